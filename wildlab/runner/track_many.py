"""The report on all targets of a flight at once: checked, and run as a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from wildlab.analysis.following.follow import refuse_unusable
from wildlab.analysis.following.noise_model import of_flight
from wildlab.analysis.many.target_model import refuse_unfit as refuse_unfit_settings
from wildlab.analysis.scans import sensors_of
from wildlab.errors import WildlabError
from wildlab.flight.following import read_settings
from wildlab.flight.store import load_flight
from wildlab.flight.toml import dump_toml
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.evaluate import tell_source
from wildlab.runner.processes.scheduling import Outcome
from wildlab.runner.run import make_job
from wildlab.runner.track import place_of, run_alone
from wildlab.runner.typed import other_reports, typed_in_report

NOTEBOOK = "tracking-many.ipynb"


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


def track_many(
    folder: Path,
    *,
    sensors: Sequence[str] = (),
    settings: Path | None = None,
    source: str | None = None,
    into: Path | None = None,
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    console: Console | None = None,
) -> Outcome:
    """Follow all targets of a flight at once, and leave a report with a table of tracks.

    Parameters
    ----------
    sensors, source
        As `wildlab.analysis.many.follow.track_targets`.
    settings
        A settings file.
    into
        The folder of the report; ``<reports>/<name of the flight>-many`` if left out.

    Raises
    ------
    WildlabError
        Where the flight cannot be followed as it is asked for, before anything runs.
    """
    flight = load_flight(folder)
    stated = None if settings is None else read_settings(settings)
    refuse_unusable(flight, stated, (), (), sensors, source)
    told = of_flight(flight, stated)
    refuse_unfit_settings(told)
    unknown = sorted(set(told.sensors) - set(sensors_of(flight)))
    if unknown and console is not None:
        text = (
            f"note: the settings speak of {', '.join(map(repr, unknown))}, which this flight does not have."
        )
        console.print(text, markup=False, highlight=False)
    tell_source(flight, source, console)
    studies = load_studies(notebooks / "studies.toml")
    place = place_of(flight, folder, "many", into, reports, studies)
    parameters: dict[str, Any] = {
        "settings": "" if stated is None else dump_toml(stated.model_dump(exclude_none=True)),
        "sensors": list(sensors),
        "source": source or "",
    }
    study = StudyEntry(
        name="evaluate", title=f"All targets of {flight.name}", notebook=NOTEBOOK, parameters=parameters
    )
    job = make_job(
        study,
        flight=flight.folder,
        reports=place.parent,
        notebooks=notebooks,
        timeout_s=None,
        name=place.name,
        again=typed_in_report(
            "wildlab track",
            folder,
            many=True,
            sensor=sensors,
            settings=settings,
            source=source,
            into=into or (other_reports(reports) and place),
        ),
    )
    return run_alone(job, studies, place.parent, console, listed=into is None)
