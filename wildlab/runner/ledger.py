"""What runs have left: where each study stands, the flights evaluated here, and the pages of it all."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from wildlab.analysis.verdict import numbers_of
from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.store import Flight
from wildlab.paths import NOTEBOOKS, REPORTS, ROOT
from wildlab.reporting.front_page import (
    FLIGHTS,
    LEDGER,
    MOST_FLIGHTS,
    PARTNERS,
    OwnFlight,
    OwnReport,
    case_cards,
    flight_card,
    flights_page,
    front_page,
    ledger_page,
    partners_page,
    read_glimpse,
)
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.notebook_pages import read_notebook
from wildlab.reporting.published import load_cases
from wildlab.reporting.text import escape
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.provenance import git_state, provenance_of_flight, read_provenance, tables_of
from wildlab.runner.status import read_status, study_status


def finished_metrics(folder: Path) -> dict[str, Any] | None:
    """``metrics.json`` of a report that is done; None where it failed, is not there, is not as it was
    written, or cannot be read."""
    if read_status(folder).get("state") != "done":
        return None
    try:
        return read_metrics(folder / "metrics.json")
    except WildlabError:
        return None


def measured_beside(flight: Flight, names: Sequence[str], out: str) -> dict[str, dict[str, Any]]:
    """Numbers of the other reports on a flight as it is now.

    Parameters
    ----------
    flight
        With its folder.
    names
        Of the reports' folders.
    out
        The folder that the asking report is written to, beside theirs; "" for ``reports``.

    Returns
    -------
    dict
        ``metrics.json`` by name, of those that are done and whose flight has the same files.
    """
    if flight.folder is None:
        return {}
    reports = Path(out).parent if out else REPORTS
    files = provenance_of_flight(flight.folder)["files"] if names else {}
    found = {}
    for name in names:
        theirs = read_provenance(reports / name).get("flight")
        metrics = finished_metrics(reports / name)
        if metrics is not None and isinstance(theirs, dict) and theirs.get("files") == files:
            found[name] = metrics
    return found


#: What the end of a report's name says it is about; without one of them it is the georeferencing.
ABOUT = {
    "-overview": "overview",
    "-navigation": "navigation",
    "-tracking": "tracking",
    "": "georeferencing",
    "-many": "many targets",
}


def own_flights(reports: Path, studies: Collection[str]) -> list[OwnFlight]:
    """Every flight of which there is a report that is none of a study, by name.

    Parameters
    ----------
    reports
        The folder of all reports.
    studies
        Names of the studies, whose reports are left out.

    Returns
    -------
    list of OwnFlight
        A report that failed is among them; a folder that nothing can be read of is not.
    """
    found: dict[str, list[OwnReport]] = {}
    made_from: dict[str, dict[str, Any]] = {}
    kinds: dict[str, str] = {}
    for status in sorted(reports.glob("*/status.json")) if reports.is_dir() else []:
        folder = status.parent
        if folder.name in studies or folder.name.startswith(".") or not (folder / "report.html").is_file():
            continue
        provenance = read_provenance(folder)
        if not provenance and read_status(folder).get("state") == "damaged":
            end = next(end for end in ABOUT if folder.name.endswith(end))
            provenance = {"flight": {"name": folder.name.removesuffix(end)}}
        flight = provenance.get("flight")
        if not isinstance(flight, dict) or not isinstance(flight.get("name"), str):
            continue
        if any(folder.name == f"{study}-{flight['name']}" for study in studies):
            continue  # a study on another flight than its own
        found.setdefault(flight["name"], []).append(_report(folder, flight["name"], provenance))
        made_from[folder.name] = provenance
        kinds[flight["name"]] = str(flight.get("kind", ""))
    order = list(ABOUT.values())
    flights = []
    for name, ones in sorted(found.items()):
        ones.sort(key=lambda one: (order.index(one.about) if one.about in order else len(order), one.folder))
        old = _earlier(ones, made_from)
        current = tuple(one for one in ones if one.folder not in old)
        flights.append(OwnFlight(name, kinds[name], current, tuple(one for one in ones if one.folder in old)))
    return flights


def _earlier(ones: Sequence[OwnReport], made_from: Mapping[str, Mapping[str, Any]]) -> set[str]:
    """Folders of reports that are not of the newest evaluation.

    They are older than another report that is made from other tables, or older than the overview, which lists
    what was evaluated with it and does not list them.
    """
    newest = max(ones, key=lambda one: one.finished)
    tables = tables_of(made_from[newest.folder].get("flight"))
    old = {
        one.folder
        for one in ones
        if one.finished < newest.finished
        and tables_of(made_from[one.folder].get("flight")) not in ({}, tables)
        and tables
    }
    overview = next((one for one in ones if one.about == "overview" and one.folder not in old), None)
    parameters = made_from[overview.folder].get("parameters") if overview is not None else None
    beside = parameters.get("beside") if isinstance(parameters, dict) else None
    if overview is None or not isinstance(beside, list):
        return old
    known = {"georeferencing", "navigation", "tracking"}
    return old | {
        one.folder
        for one in ones
        if one.about in known and one.folder not in beside and one.finished < overview.finished
    }


def _report(folder: Path, flight: str, provenance: dict[str, Any]) -> OwnReport:
    status = read_status(folder)
    ends = {f"{flight}{end}": about for end, about in ABOUT.items()}
    metrics = finished_metrics(folder)
    parameters = provenance.get("parameters")
    lacking = parameters.get("lacking", []) if isinstance(parameters, dict) else []
    return OwnReport(
        folder=folder.name,
        about=ends.get(folder.name, folder.name),
        state=str(status.get("state", "broken off")),
        finished=str(status.get("finished", "")),
        numbers=numbers_of([metrics]) if metrics is not None else {},
        lacking=tuple(str(one) for one in lacking) if isinstance(lacking, list) else (),
    )


#: The folder of the comparison of flights, among the reports.
COMPARISON = "comparison"


def build_ledger(reports: Path, studies: Mapping[str, StudyEntry]) -> Path:
    """Write ``index.html`` and return its path. Works whichever of the studies have been run.

    The pages that it leads to are written with it: the ledger, the flights that
    somebody evaluated, and how to share.
    """
    statuses = [study_status(study, reports) for study in studies.values()]
    git = git_state()
    code = f"commit <code>{git['commit'][:10]}</code>" if git["commit"] else escape(git["note"])
    reports.mkdir(parents=True, exist_ok=True)
    compared = f"{COMPARISON}/report.html"
    own = own_flights(reports, studies)
    write_atomic(reports / FLIGHTS, flights_page(own, compared if (reports / compared).is_file() else ""))
    cases = load_cases()
    write_atomic(reports / LEDGER, ledger_page(statuses, code=code, cases=cases))
    newest = sorted(own, key=lambda flight: flight.finished, reverse=True)
    shared = [flight.reports[0].folder for flight in newest if flight.reports[0].state == "done"]
    write_atomic(reports / PARTNERS, partners_page(shared))
    path = reports / "index.html"
    whole = front_page(
        statuses,
        study_cards=case_cards(
            (
                (one, read_glimpse(reports / one.study.name / "report.html"))
                for one in statuses
                if one.state != "not run"
            ),
            cases,
        ),
        flight_cards=[
            flight_card(flight, read_glimpse(reports / flight.reports[0].folder / "report.html"))
            for flight in newest[:MOST_FLIGHTS]
        ],
        flights=len(own),
        cases=len(cases),
        learn=_learn(reports),
        checkout=ROOT is not None,
        code=code,
    )
    write_atomic(path, whole)
    return path


def _learn(reports: Path) -> list[tuple[str, str]]:
    """Titles of tutorials and reference, with an address where the page is there."""
    pages = {title_of(path): f"tutorials/{path.stem}.html" for path in tutorial_notebooks()}
    pages["Reference of all functions"] = "reference/index.html"
    found = [(title, page if (reports / page).is_file() else "") for title, page in pages.items()]
    # A wheel cannot write the reference.
    return found if ROOT or found[-1][1] else found[:-1]


def tutorial_notebooks(notebooks: Path = NOTEBOOKS) -> list[Path]:
    """The tutorials, in the order in which they are to be read."""
    return sorted((notebooks / "tutorials").glob("*.ipynb"))


def title_of(notebook: Path) -> str:
    """The main heading of a tutorial; the name of its file where it has none."""
    for cell in read_notebook(notebook).cells:
        first = cell.source.partition("\n")[0]
        if cell.cell_type == "markdown" and first.startswith("# "):
            return str(first[2:].strip())
    return notebook.stem
