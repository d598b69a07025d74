"""Several flights on one page: those without reports of their files as they are, are evaluated first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv
from wildlab.flight.files import flight_name
from wildlab.flight.manifest import FILE_NAME, read_manifest
from wildlab.paths import REPORTS
from wildlab.reporting.comparison import comparison_page, flights_table
from wildlab.reporting.front_page import OwnFlight
from wildlab.runner.catalogue import load_studies
from wildlab.runner.evaluate import evaluate_flight
from wildlab.runner.ledger import COMPARISON, build_ledger, finished_metrics, own_flights
from wildlab.runner.provenance import provenance_of_flight, read_provenance
from wildlab.runner.status import read_status


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
