"""Reports on one flight of whoever asks: a report for each thing that its data can be judged by."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from wildlab.analysis.navigate import imu_noise, reference_of
from wildlab.analysis.tracks.tracker import refuse_unusable
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import calibration_toml, read_learnt, refuse_other_camera
from wildlab.flight.checks.check import Use, find, usable_for
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.job import Job, other_reports, typed_in_report
from wildlab.runner.ledger import own_flights
from wildlab.runner.provenance import provenance_of_flight, read_provenance
from wildlab.runner.run import make_job, run_all
from wildlab.runner.scheduling import Outcome

#: Files of a flight that two flights may have in common.
_SHARED = ("flight", "truth", "terrain", "calibration")
#: What is judged beside the overview, by how long it takes on a flight of 25 minutes.
LONGEST_FIRST = ("navigation.ipynb", "tracking.ipynb", "georeferencing.ipynb", "repeat-sightings.ipynb")


def evaluate_flight(
    folder: Path,
    *,
    source: str | None = None,
    calibration: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    timeout_s: float | None = None,
    console: Console | None = None,
) -> list[Outcome]:
    """Judge a flight folder by all that it has the data for.

    An overview, with what is most worth fixing, goes to ``<reports>/<name of the flight>-overview/``,
    whatever the flight lacks; its georeferencing to ``<name>`` (without truth: how far apart sightings of
    the same things lie), its navigation (inertial unit and GNSS
    against the attitude found on board) to ``<name>-navigation``, the tracks of what was seen often enough to
    ``<name>-tracking``.

    Parameters
    ----------
    source
        Which of the flight's poses to judge; left out, the best of `Flight.estimated_sources`.
    calibration
        A ``calibration.toml`` of another flight, applied before the georeferencing is judged; left out, the
        one that the flight was imported with, if any.

    Returns
    -------
    list of Outcome
        One for each report, the overview first, also where it failed or, some of its data being there, was
        skipped.

    Raises
    ------
    WildlabError
        If the folder is not a flight, there are no such poses, its name is that of a study, the
        report of another flight of this name would be replaced, or the calibration is of another camera.
    """
    flight = load_flight(folder)
    studies = load_studies(notebooks / "studies.toml")
    uses = {use.purpose: use for use in usable_for(flight)}
    jobs: list[Job] = []
    # One choice for all reports; a flight without poses, such as a radar's, has none.
    found = flight.pose_source(source)[0] if source or flight.estimated_sources else ""
    tell_source(flight, source, console)

    def prepare(end: str, notebook: str, parameters: dict[str, Any], **options: Any) -> None:
        name = f"{flight.name}{end}"
        refuse_study_name(flight, name, studies)
        refuse_other_flight(folder, reports / name)
        study = StudyEntry(name="evaluate", title=f"Flight {name}", notebook=notebook, parameters=parameters)
        again = typed_in_report("wildlab evaluate", folder, **options, out=other_reports(reports))
        places: dict[str, Any] = {"reports": reports, "notebooks": notebooks, "timeout_s": timeout_s}
        jobs.append(make_job(study, flight=folder, name=name, again=again, **places))

    places = uses["georeferencing accuracy"]
    if places.usable:
        parameters = {"source": found}
        applied = calibration or flight.calibration
        if applied is not None:
            learnt = read_learnt(applied)
            refuse_other_camera(flight.manifest, learnt)
            # Its text, not its path: the report can be made again without the file, and names no folder.
            parameters["calibration"] = calibration_toml(learnt)
        prepare("", "georeferencing.ipynb", parameters, source=found, calibration=calibration)
    elif calibration is not None:
        raise WildlabError(
            f"a calibration is named, and the georeferencing cannot be judged: {places.why}",
            "see what is amiss: wildlab check; or leave --calibration out",
            file=folder,
            field="--calibration",
        )
    elif lacks_only_truth(flight):
        prepare("", "repeat-sightings.ipynb", {"source": found}, source=found)
    skipped: list[Outcome] = []
    unjudged = lacking_for_navigation(flight, uses["navigation"])
    if not unjudged:
        prepare("-navigation", "navigation.ipynb", {})
    elif flight.imu is not None and flight.manifest.twin is None:
        skipped.append(Outcome(f"{flight.name}-navigation", "skipped", 0.0, unjudged))
    untracked = lacking_for_tracking(flight, uses["tracking"], source)
    if not untracked:
        prepare("-tracking", "tracking.ipynb", {"source": found}, source=source)
    # The last to be run, since it lists what the others measured, and the first to be read.
    beside = [job.name for job in jobs]
    reasons = [] if beside[:1] == [flight.name] else [f"georeferencing ({places.why})"]
    reasons += [f"navigation ({unjudged})"] if unjudged else []
    reasons += [f"tracking ({untracked})"] if untracked else []
    about: dict[str, Any] = {"beside": beside, "lacking": reasons, "source": found}
    prepare("-overview", "overview.ipynb", about, source=source)
    passes = [longest_first(jobs[:-1]), jobs[-1:]]
    outcomes = run_all(passes, skipped, studies, reports, console, parallel=cores())
    order = [jobs[-1].name, *beside]
    return sorted(outcomes, key=lambda one: order.index(one.name) if one.name in order else len(order))


def refuse_study_name(flight: Flight, name: str, studies: Collection[str]) -> None:
    """Refuse a report that would take the place of a study's.

    Raises
    ------
    WildlabError
        Where ``name``, of the report's folder, is that of a study.
    """
    if name in studies:
        raise WildlabError(
            f"the flight is named {flight.name!r} like a study, whose report it would replace",
            "rename the flight's folder, or name another folder for the report (--out)",
        )


def tell_source(flight: Flight, source: str | None, console: Console | None) -> None:
    """Name the poses that are taken where there are several and nobody chose."""
    known = flight.estimated_sources
    if console is not None and source is None and len(known) > 1:
        others = ", ".join(known[1:])
        console.print(f"Poses: {known[0]} (--source takes another: {others}).", markup=False, highlight=False)


def longest_first(jobs: Sequence[Job]) -> list[Job]:
    """The jobs in the order that leaves the last one waiting least, where there are fewer cores than jobs."""
    return sorted(jobs, key=lambda job: LONGEST_FIRST.index(Path(job.notebook).name))


def cores() -> int:
    """How many cores there are for this process."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def refuse_other_flight(folder: Path, report: Path) -> None:
    """Two flights of one name are told apart by their content.

    The same flight, perhaps imported again, is one whose raw files are all among the other's, or that has
    one of the aircraft's tables in common with it. Marks, trackers and terrain are shared by flights.

    Parameters
    ----------
    folder
        Of the flight.
    report
        The folder that its report would go to.

    Raises
    ------
    WildlabError
        Where the report of another flight is there.
    """
    there = read_provenance(report).get("flight") or {}
    mine = provenance_of_flight(folder)
    if _contents(there) and not _same(there, mine):
        raise WildlabError(
            f"there is a report of another flight named {mine['name']!r}: they share none of the aircraft's "
            "tables, and have other raw files",
            "rename this flight's folder, give the report another folder with --out, or move the old report "
            "away",
            file=report,
        )


def left_from_before(folder: Path, reports: Path) -> list[Path]:
    """Reports on a flight that its newest evaluation did not make again.

    Parameters
    ----------
    folder
        Of the flight.
    reports
        The folder of all reports.

    Returns
    -------
    list of Path
    """
    name = load_flight(folder).name
    return [
        reports / one.folder for own in own_flights(reports, ()) if own.name == name for one in own.earlier
    ]


def _contents(flight: Mapping[str, Any]) -> set[str]:
    return {*flight.get("files", {}).values(), *flight.get("sources", ())}


def _same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    raw, theirs = set(one.get("sources", ())), set(other.get("sources", ()))
    if raw and theirs and (raw <= theirs or theirs <= raw):
        return True
    carried = [
        {digest for name, digest in flight.get("files", {}).items() if Path(name).stem not in _SHARED}
        for flight in (one, other)
    ]
    return bool(carried[0] & carried[1])


def lacking_for_tracking(flight: Flight, use: Use, source: str | None = None) -> str:
    """Why no target of a flight can be followed, or nothing; ``use`` is what the checks say of it."""
    if not use.usable:
        return use.why
    try:
        refuse_unusable(flight, None, (), (), (), source)
    except WildlabError as error:
        return str(error).rstrip(".")
    return ""


def lacks_only_truth(flight: Flight) -> bool:
    """Whether truth is all that the georeferencing lacks, and things are seen that have names."""
    detections, frames, truth = flight.detections, flight.frames, flight.truth
    if detections is None or frames is None or not len(frames) or not flight.estimated_sources:
        return False
    pixels = detections[detections["kind"] == "pixel"]
    named = "target_id" in pixels and bool(pixels["target_id"].fillna("").ne("").any())
    whole = not any(one.level == "problem" for one in find(flight, meaning=False))
    return named and whole and (truth is None or not len(truth))


def lacking_for_navigation(flight: Flight, use: Use) -> str:
    """Why the navigation of a flight cannot be judged, or nothing; ``use`` is what the checks say of it."""
    if flight.manifest.twin is not None:
        return "on simulated flights it has studies of its own"
    if not use.usable:
        return use.why
    try:
        reference_of(flight)
        imu_noise(flight)
    except WildlabError as error:
        return str(error).rstrip(".")
    return ""
