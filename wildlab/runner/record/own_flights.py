"""Flights that somebody evaluated here: which reports there are of each, and what their numbers are."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from wildlab.pipeline.overviews.worth_fixing import numbers_of
from wildlab.reporting.own_flights import OwnFlight, OwnReport
from wildlab.runner.record.beside import finished_metrics, state_of
from wildlab.runner.record.provenance import read_provenance

#: What the end of a report's name says it is about; without one of them it is the georeferencing.
ABOUT = {
    "-overview": "overview",
    "-navigation": "navigation",
    "-tracking": "tracking",
    "": "georeferencing",
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
    kinds: dict[str, str] = {}
    for status in sorted(reports.glob("*/status.json")) if reports.is_dir() else []:
        folder = status.parent
        if folder.name in studies or folder.name.startswith(".") or not (folder / "report.html").is_file():
            continue
        provenance = read_provenance(folder)
        flight = provenance.get("flight")
        if not isinstance(flight, dict) or not isinstance(flight.get("name"), str):
            continue
        if any(folder.name == f"{study}-{flight['name']}" for study in studies):
            continue  # a study on another flight than its own
        found.setdefault(flight["name"], []).append(_report(folder, flight["name"], provenance))
        kinds[flight["name"]] = str(flight.get("kind", ""))
    order = list(ABOUT.values())
    flights = []
    for name, ones in sorted(found.items()):
        ones.sort(key=lambda one: (order.index(one.about) if one.about in order else len(order), one.folder))
        flights.append(OwnFlight(name, kinds[name], tuple(ones)))
    return flights


def _report(folder: Path, flight: str, provenance: dict[str, Any]) -> OwnReport:
    status = state_of(folder)
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
