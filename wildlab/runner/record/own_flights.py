"""Flights that somebody evaluated here: which reports there are of each, and what their numbers are."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from wildlab.analysis.verdict import numbers_of
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.paths import REPORTS
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.own_flights import OwnFlight, OwnReport
from wildlab.runner.record.digests import read_status
from wildlab.runner.record.provenance import provenance_of_flight, read_provenance, tables_of


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
        if one.finished < newest.finished and _differ(tables_of(made_from[one.folder].get("flight")), tables)
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


def _differ(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return bool(one) and bool(other) and one != other


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
