"""Reports on flights of whoever asks: one for each thing that a flight can be judged by, the tracks of its
targets, and several flights on one page.

Parameters of the notebooks are texts, not paths, and name no folder.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from rich.console import Console

from wildlab.analysis.navigate import imu_noise, reference_of
from wildlab.analysis.tracks.many import refuse_unfit as refuse_unfit_settings
from wildlab.analysis.tracks.noise_model import Against, settings_of
from wildlab.analysis.tracks.scans import sensors_of
from wildlab.analysis.tracks.tracker import refuse_unusable, sensors_with_detections
from wildlab.analysis.tracks.tuning import refuse_same, tune_flights, tuned_text
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv
from wildlab.flight.calibration_files import calibration_toml, read_learnt, refuse_other_camera
from wildlab.flight.checks.check import Use, problems_of, sense_sentences, sentences_of, usable_for
from wildlab.flight.files import dump_toml, flight_name
from wildlab.flight.manifest import FILE_NAME, Settings, read_manifest, read_settings
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.reporting.front_page import OwnFlight
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.job import Job, other_reports, typed_in_report
from wildlab.runner.ledger import COMPARISON, build_ledger, finished_metrics, own_flights
from wildlab.runner.provenance import provenance_of_flight, read_provenance
from wildlab.runner.run import make_job, run_all
from wildlab.runner.scheduling import Outcome
from wildlab.runner.status import read_status

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
    ledger: bool = True,
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
    ledger
        Whether the pages on all reports are written too.

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
    problems = problems_of(flight)
    uses = {use.purpose: use for use in usable_for(flight, problems)}
    # Looked for once: every report says it.
    amiss = sense_sentences(flight)
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
        parameters: dict[str, Any] = {"source": found, "amiss": amiss}
        applied = calibration or flight.calibration
        if applied is not None:
            learnt = read_learnt(applied)
            refuse_other_camera(flight.manifest, learnt)
            # Its text, not its path: the report can be made again without the file, and names no folder.
            parameters |= {"calibration": calibration_toml(learnt), "amiss": None}
        prepare("", "georeferencing.ipynb", parameters, source=found, calibration=calibration)
    elif calibration is not None:
        raise WildlabError(
            f"a calibration is named, and the georeferencing cannot be judged: {places.why}",
            "see what is amiss: wildlab check; or leave --calibration out",
            file=folder,
            field="--calibration",
        )
    elif not problems and lacks_only_truth(flight):
        prepare("", "repeat-sightings.ipynb", {"source": found, "amiss": amiss}, source=found)
    skipped: list[Outcome] = []
    unjudged = lacking_for_navigation(flight, uses["navigation"])
    if not unjudged:
        prepare("-navigation", "navigation.ipynb", {})
    elif flight.imu is not None and flight.manifest.twin is None:
        skipped.append(Outcome(f"{flight.name}-navigation", "skipped", 0.0, unjudged))
    untracked = lacking_for_tracking(flight, uses["tracking"], source)
    if not untracked:
        prepare("-tracking", "tracking.ipynb", {"source": found, "amiss": amiss}, source=source)
    # The last to be begun, since it lists what the others measured, and the first to be read.
    beside = [job.name for job in jobs]
    reasons = [] if beside[:1] == [flight.name] else [f"georeferencing ({places.why})"]
    reasons += [f"navigation ({unjudged})"] if unjudged else []
    reasons += [f"tracking ({untracked})"] if untracked else []
    about: dict[str, Any] = {"beside": beside, "lacking": reasons, "source": found}
    about["amiss"] = [*sentences_of(problems), *amiss]
    prepare("-overview", "overview.ipynb", about, source=source)
    overview = replace(jobs.pop(), after=tuple(beside))
    pages = studies if ledger else None
    # The last one waits least like this, where there are fewer cores than jobs.
    jobs.sort(key=lambda job: LONGEST_FIRST.index(Path(job.notebook).name))
    outcomes = run_all([*jobs, overview], skipped, pages, reports, console, parallel=cores())
    order = [overview.name, *beside]
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
    if (there.get("files") or there.get("sources")) and not _same(there, mine):
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
    return named and (truth is None or not len(truth))


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


#: The notebook on all targets at once.
MANY_NOTEBOOK = "tracking-many.ipynb"


def refuse_unfit(options: Mapping[str, object]) -> None:
    """Refuse options that have no meaning where all targets are followed at once.

    Raises
    ------
    WildlabError
        For the first that was given.
    """
    for name, value in options.items():
        if value:
            raise WildlabError(
                f"{name} and --many do not go together",
                f"leave {name} out, or --many: with it all targets are followed by one filter, as told by "
                "--settings",
                field=name,
            )


def track_flight(
    folder: Path,
    *,
    tune: Sequence[Path] = (),
    against: str | None = None,
    filters: Sequence[str] = (),
    targets: Sequence[str] = (),
    sensors: Sequence[str] = (),
    settings: Path | None = None,
    smooth: bool = False,
    source: str | None = None,
    **places: Any,
) -> Outcome:
    """Follow a flight's targets, and leave a report with tables of estimates.

    Parameters
    ----------
    tune
        Other flights' folders, on which sensors are tuned.
    against
        ``"truth"`` or ``"innovations"``: how it is tuned; truth where there is any, if left out.
    filters, targets, sensors, source
        As `wildlab.analysis.tracks.tracker.track`.
    settings
        A settings file.
    **places
        As of `_run_report`.

    Returns
    -------
    Outcome

    Raises
    ------
    WildlabError
        Where the flight cannot be followed as it is asked for, before anything runs.
    """
    flight = load_flight(folder)
    stated = None if settings is None else read_settings(settings)
    refuse_unusable(flight, stated, filters, targets, sensors, source)
    tuned = _tuned_text(flight, tune, against, stated, sensors, source)
    parameters: dict[str, Any] = {
        "settings": _text_of(stated),
        "tuned": tuned,
        "filters": list(filters),
        "targets": list(targets),
        "sensors": list(sensors),
        "source": source or "",
        "smooth": smooth,
    }
    title = f"Tracks of {flight.name}"
    study = StudyEntry(name="evaluate", title=title, notebook="tracking.ipynb", parameters=parameters)
    options: dict[str, Any] = {
        "tune": tune,
        "against": against,
        "filter": filters,
        "target": targets,
        "sensor": sensors,
        "settings": settings,
        "smooth": smooth,
        "source": source,
    }
    return _run_report(flight, study, "tracking", options, **places)


def _tuned_text(
    flight: Flight,
    tune: Sequence[Path],
    against: str | None,
    stated: Settings | None,
    sensors: Sequence[str],
    source: str | None,
) -> str:
    """What other flights teach, as a notebook takes it; empty where there are none."""
    if against is not None and not tune:
        raise WildlabError(
            "it is not said on which flight to tune",
            "add --tune, or leave --against out",
            field="--against",
        )
    if not tune:
        return ""
    wanted, others = sensors_with_detections(flight, sensors), [load_flight(one) for one in tune]
    for other in others:
        refuse_same(flight, other)
        there = set(sensors_with_detections(other))
        if missing := [name for name in wanted if name not in there]:
            raise WildlabError(
                f"the flight {other.name!r} has no detections of the sensor {missing[0]!r}",
                "name the sensors that all have with --sensor",
                file=other.folder,
                field="--tune",
            )
    return tuned_text(tune_flights(others, wanted, stated, cast(Against | None, against), source))


def track_many(
    folder: Path,
    *,
    tune: Sequence[Path] = (),
    against: str | None = None,
    sensors: Sequence[str] = (),
    settings: Path | None = None,
    source: str | None = None,
    console: Console | None = None,
    **places: Any,
) -> Outcome:
    """Follow all targets of a flight at once, and leave a report with a table of tracks.

    Parameters
    ----------
    tune, against
        As of `track_flight`.
    sensors, source
        As `wildlab.analysis.tracks.tracker.track`.
    settings
        A settings file.
    console, **places
        As of `_run_report`.

    Raises
    ------
    WildlabError
        Where the flight cannot be followed as it is asked for, before anything runs.
    """
    flight = load_flight(folder)
    stated = None if settings is None else read_settings(settings)
    refuse_unusable(flight, stated, (), (), sensors, source)
    told = settings_of(flight, stated)
    refuse_unfit_settings(told)
    unknown = ", ".join(map(repr, sorted(set(told.sensors) - set(sensors_of(flight)))))
    if unknown and console is not None:
        text = f"note: the settings speak of {unknown}, which this flight does not have."
        console.print(text, markup=False, highlight=False)
    parameters = {
        "settings": _text_of(stated),
        "tuned": _tuned_text(flight, tune, against, stated, sensors, source),
        "sensors": list(sensors),
        "source": source or "",
    }
    title = f"All targets of {flight.name}"
    study = StudyEntry(name="evaluate", title=title, notebook=MANY_NOTEBOOK, parameters=parameters)
    options = {
        "many": True,
        "tune": tune,
        "against": against,
        "sensor": sensors,
        "settings": settings,
        "source": source,
    }
    return _run_report(flight, study, "many", options, console=console, **places)


def _text_of(settings: Settings | None) -> str:
    return "" if settings is None else dump_toml(settings.model_dump(exclude_none=True))


def _run_report(
    flight: Flight,
    study: StudyEntry,
    kind: str,
    options: dict[str, Any],
    *,
    into: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    console: Console | None = None,
) -> Outcome:
    """Run a notebook on a flight.

    Parameters
    ----------
    options
        Of the command, by name: they are written into the report, to be typed again.
    into
        The folder of the report, which then is in no list of others; left out, it is ``<kind>`` after the
        flight's name, in ``reports``.
    console
        Where progress is shown.

    Raises
    ------
    WildlabError
        Where a study or another flight has its report there.
    """
    source = options["source"]
    tell_source(flight, source, console)
    studies = load_studies(notebooks / "studies.toml")
    place = into or reports / f"{flight.name}-{kind}"
    if into is None:
        refuse_study_name(flight, place.name, studies)
    folder = cast(Path, flight.folder)
    refuse_other_flight(folder, place)
    place.parent.mkdir(parents=True, exist_ok=True)
    out = into or (other_reports(reports) and place)
    again = typed_in_report("wildlab track", folder, **options, out=out, overwrite=out is not None)
    job = make_job(
        study, flight=folder, reports=place.parent, notebooks=notebooks, name=place.name, again=again
    )
    # One's own folder gets no list of others.
    return run_all([job], [], None if into else studies, place.parent, console)[0]


def compare_flights(
    folders: Sequence[Path],
    *,
    into: Path | None = None,
    reports: Path = REPORTS,
    console: Console | None = None,
) -> Path:
    """Write one page, and one table with a row for each flight.

    Parameters
    ----------
    folders
        Two or more, of flights or of reports on them. A flight whose overview is not that of its files as
        they are is evaluated first.
    into
        The folder to write to; left out, ``<reports>/comparison``.
    reports
        Where reports are, and go.
    console
        Where progress is shown.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    WildlabError
        Where there are fewer than two flights, one is named twice, a folder is neither a flight nor a report,
        or a flight cannot be evaluated.
    """
    if len(folders) < 2:
        raise WildlabError("there is nothing to compare: one flight was named", "name two flights or more")
    studies = load_studies()
    for folder in folders:
        if not (folder / FILE_NAME).is_file() and not (folder / "status.json").is_file():
            raise WildlabError(
                "this is neither a flight nor a report on one",
                "name folders with a flight.toml, or of reports",
                file=folder,
            )
    chosen: list[OwnFlight] = []
    for folder in folders:
        if (folder / FILE_NAME).is_file():
            name, where = flight_name(folder, read_manifest(folder / FILE_NAME).name), reports
            if not _is_current(folder, reports / f"{name}-overview"):
                evaluate_flight(folder, reports=reports, console=console)
        else:
            status = read_status(folder)
            if status.get("state") == "damaged":
                raise WildlabError(str(status["reason"]), "make the report again", file=folder)
            where = folder.resolve().parent
            flight = read_provenance(folder).get("flight")
            name = str(flight.get("name")) if isinstance(flight, dict) else ""
        found = next((one for one in own_flights(where, studies) if one.name == name), None)
        if found is None:
            raise WildlabError(
                "there is no report of a flight in this folder", "evaluate it: wildlab evaluate", file=folder
            )
        if found.name in [one.name for one in chosen]:
            raise WildlabError(
                f"the flight {found.name!r} is named twice", "name each flight once", file=folder
            )
        chosen.append(found)
        damaged = [one.folder for one in found.reports if one.state == "damaged"]
        if damaged and console is not None:
            what = f"left out, not as written: {', '.join(damaged)} (see: wildlab verify)"
            console.print(what, markup=False, highlight=False, soft_wrap=True)
    target = reports / COMPARISON if into is None else into
    target.mkdir(parents=True, exist_ok=True)
    from wildlab.reporting.comparison import comparison_page, flights_table  # draws, which takes a while

    page = comparison_page(chosen)
    write_csv(target / "flights.csv", flights_table(chosen))
    write_atomic(target / "report.html", page)
    build_ledger(reports, studies)
    return target / "report.html"


def _is_current(folder: Path, overview: Path) -> bool:
    """Whether an overview is done, and of the flight's files as they are."""
    theirs = read_provenance(overview).get("flight")
    if finished_metrics(overview) is None or not isinstance(theirs, dict):
        return False
    return bool(theirs.get("files") == provenance_of_flight(folder)["files"])
