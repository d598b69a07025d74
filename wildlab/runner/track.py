"""The reports on a flight's tracks, by sensor and target or of all targets at once: checked, tuned elsewhere,
and run as notebooks.

Parameters of the notebooks are texts, not paths, and name no folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, cast

from rich.console import Console

from wildlab.analysis.tracks.many import refuse_unfit as refuse_unfit_settings
from wildlab.analysis.tracks.noise_model import Against, settings_of
from wildlab.analysis.tracks.scans import sensors_of
from wildlab.analysis.tracks.tracker import refuse_unusable, sensors_with_detections
from wildlab.analysis.tracks.tuning import refuse_same, tune_flight, tuned_text
from wildlab.errors import WildlabError
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import Settings, read_settings
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.evaluate import refuse_other_flight, refuse_study_name, tell_source
from wildlab.runner.job import Job, other_reports, typed_in_report
from wildlab.runner.progress import shown
from wildlab.runner.run import make_job, run_all
from wildlab.runner.scheduling import Outcome, run_jobs

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
    tune: Path | None = None,
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
        Another flight folder, on which sensors are tuned.
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
    if against is not None and tune is None:
        raise WildlabError(
            "it is not said on which flight to tune",
            "add --tune, or leave --against out",
            field="--against",
        )
    refuse_unusable(flight, stated, filters, targets, sensors, source)
    tuned = ""
    if tune is not None:
        other = load_flight(tune)
        refuse_same(flight, other)
        wanted = sensors_with_detections(flight, sensors)
        there = set(sensors_with_detections(other))
        if missing := [name for name in wanted if name not in there]:
            raise WildlabError(
                f"the flight {other.name!r} has no detections of the sensor {missing[0]!r}",
                "name the sensors of both with --sensor",
                file=tune,
                field="--tune",
            )
        its_source = source if source in other.nav else None
        tuned = tuned_text(tune_flight(other, wanted, stated, cast(Against | None, against), its_source))
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


def track_many(
    folder: Path,
    *,
    sensors: Sequence[str] = (),
    settings: Path | None = None,
    source: str | None = None,
    console: Console | None = None,
    **places: Any,
) -> Outcome:
    """Follow all targets of a flight at once, and leave a report with a table of tracks.

    Parameters
    ----------
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
    parameters = {"settings": _text_of(stated), "sensors": list(sensors), "source": source or ""}
    title = f"All targets of {flight.name}"
    study = StudyEntry(name="evaluate", title=title, notebook=MANY_NOTEBOOK, parameters=parameters)
    options = {"many": True, "sensor": sensors, "settings": settings, "source": source}
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
    return run_alone(job, studies, place.parent, console, listed=into is None)


def run_alone(
    job: Job, studies: dict[str, StudyEntry], reports: Path, console: Console | None, *, listed: bool
) -> Outcome:
    """Run one report; where it is not ``listed``, its folder is one's own and gets no list of others."""
    if listed:
        return run_all([[job]], [], studies, reports, console)[0]
    with shown(console) if console is not None else nullcontext() as listen:
        return run_jobs([job], listen=listen)[0]
