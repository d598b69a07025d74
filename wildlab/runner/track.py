"""The report on a flight's tracks: checked, tuned elsewhere, and run as a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, cast

from rich.console import Console

from wildlab.analysis.following.follow import refuse_unusable, sensors_with_detections
from wildlab.analysis.following.tuned import Against, Tuned, refuse_same, tune_flight, tuned_text
from wildlab.errors import WildlabError
from wildlab.flight.following import Settings, read_settings
from wildlab.flight.store import Flight, load_flight
from wildlab.flight.toml import dump_toml
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.evaluate import refuse_other_flight, tell_source
from wildlab.runner.processes.job import Job
from wildlab.runner.processes.progress import shown
from wildlab.runner.processes.scheduling import Outcome, run_jobs
from wildlab.runner.run import make_job, run_all
from wildlab.runner.typed import other_reports, typed_in_report

NOTEBOOK = "tracking.ipynb"


def track_flight(
    folder: Path,
    *,
    tune: Path | None = None,
    against: str | None = None,
    filters: Sequence[str] = (),
    targets: Sequence[str] = (),
    sensors: Sequence[str] = (),
    settings: Path | None = None,
    smooth: bool = False,
    source: str | None = None,
    into: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    console: Console | None = None,
) -> Outcome:
    """Follow a flight's targets, and leave a report with tables of estimates.

    Parameters
    ----------
    tune
        Another flight folder, on which sensors are tuned.
    against
        ``"truth"`` or ``"innovations"``: how it is tuned; truth where there is any, if left out.
    filters, targets, sensors, source
        As `wildlab.analysis.following.follow.follow_targets`.
    settings
        A settings file.
    into
        The folder of the report; ``<reports>/<name of the flight>-tracking`` if left out.

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
    if against is not None and tune is None:
        raise WildlabError(
            "it says against what to tune, and not on which flight",
            "name another flight with --tune, or leave --against out",
            field="--against",
        )
    tuned: Tuned | None = None
    refuse_unusable(flight, stated, filters, targets, sensors, source)
    if tune is not None:
        other = load_flight(tune)
        refuse_same(flight, other)
        wanted = sensors_with_detections(flight, sensors)
        there = set(sensors_with_detections(other))
        if missing := [name for name in wanted if name not in there]:
            raise WildlabError(
                f"the flight {other.name!r} has no detections of the sensor {missing[0]!r}",
                "tune on a flight with the same sensors, or name with --sensor those that both have",
                file=tune,
                field="--tune",
            )
        its_source = source if source in other.nav else None
        tuned = tune_flight(other, wanted, stated, cast(Against | None, against), its_source)
    tell_source(flight, source, console)
    studies = load_studies(notebooks / "studies.toml")
    place = place_of(flight, folder, "tracking", into, reports, studies)
    job = tracking_job(
        flight,
        place.parent,
        notebooks,
        place.name,
        settings=stated,
        tuned=tuned,
        filters=filters,
        targets=targets,
        sensors=sensors,
        source=source,
        smooth=smooth,
        again=typed_in_report(
            "wildlab track",
            folder,
            tune=tune,
            against=against,
            filter=filters,
            target=targets,
            sensor=sensors,
            settings=settings,
            smooth=smooth,
            source=source,
            into=into or (other_reports(reports) and place),
        ),
    )
    return run_alone(job, studies, place.parent, console, listed=into is None)


def place_of(
    flight: Flight,
    folder: Path,
    kind: str,
    into: Path | None,
    reports: Path,
    studies: dict[str, StudyEntry],
) -> Path:
    """The folder of a report on a flight: ``into``, else ``<reports>/<name>-<kind>``; its parent is made.

    Raises
    ------
    WildlabError
        Where a study or another flight has its report there.
    """
    place = reports / f"{flight.name}-{kind}" if into is None else into
    if place.name in studies and into is None:
        raise WildlabError(
            f"the flight is named {flight.name!r} like a study, whose report it would replace",
            "rename the flight's folder, or give the report another folder with --into",
        )
    refuse_other_flight(folder, place)
    place.parent.mkdir(parents=True, exist_ok=True)
    return place


def run_alone(
    job: Job, studies: dict[str, StudyEntry], reports: Path, console: Console | None, *, listed: bool
) -> Outcome:
    """Run one report; where it is not ``listed``, its folder is one's own and gets no list of others."""
    if listed:
        return run_all([[job]], [], studies, reports, console)[0]
    with shown(console) if console is not None else nullcontext() as listen:
        return run_jobs([job], listen=listen)[0]


def tracking_job(
    flight: Flight,
    reports: Path,
    notebooks: Path,
    name: str,
    *,
    settings: Settings | None = None,
    tuned: Tuned | None = None,
    filters: Sequence[str] = (),
    targets: Sequence[str] = (),
    sensors: Sequence[str] = (),
    source: str | None = None,
    smooth: bool = False,
    timeout_s: float | None = None,
    again: str | None = None,
) -> Job:
    """The notebook on a flight's tracks; its parameters are texts, not paths, and name no folder."""
    parameters: dict[str, Any] = {
        "settings": "" if settings is None else dump_toml(settings.model_dump(exclude_none=True)),
        "tuned": "" if tuned is None else tuned_text(tuned),
        "filters": list(filters),
        "targets": list(targets),
        "sensors": list(sensors),
        "source": source or "",
        "smooth": smooth,
    }
    study = StudyEntry(name="evaluate", title=f"Tracks of {flight.name}", notebook=NOTEBOOK,
                       parameters=parameters)  # fmt: skip
    return make_job(
        study,
        flight=flight.folder,
        reports=reports,
        notebooks=notebooks,
        timeout_s=timeout_s,
        name=name,
        again=again,
    )
