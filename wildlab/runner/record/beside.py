"""What the other reports on a flight found, where they are of the same flight and not of a former one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.paths import REPORTS
from wildlab.reporting.metrics import read_metrics
from wildlab.runner.record.digests import read_status
from wildlab.runner.record.provenance import provenance_of_flight, read_provenance


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
