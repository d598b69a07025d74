"""What a run leaves in a folder of reports, without the run; and a page that shows all that a flight has."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from wildlab.files import write_json
from wildlab.flight.manifest import manifest_toml
from wildlab.flight.store import load_flight
from wildlab.reporting.metrics import document
from wildlab.reporting.text import escape, page
from wildlab.runner.provenance import provenance_of_flight

_CODED = re.compile(r"sha256|fingerprint|epoch")


def leave_report(
    folder: Path,
    flight: Path | str,
    body: str = "",
    *,
    metrics: Sequence[dict[str, Any]] = (),
    parameters: Mapping[str, Any] | None = None,
    notebook: str = "Report",
    state: str = "done",
    files: Mapping[str, str] | None = None,
) -> Path:
    """A report on the flight in a folder, or of a name and digests of its files, headed by its notebook."""
    folder.mkdir(parents=True)
    (folder / "report.html").write_text(page(title="x", body=f"<h1>{notebook}</h1>{body}"), encoding="utf-8")
    about = {"name": flight, "kind": "logged", "files": files or {}}
    if isinstance(flight, Path):
        about = provenance_of_flight(flight)
    content = {"flight": about, "parameters": parameters or {}, "notebook": {"file": notebook}}
    write_json(folder / "provenance.json", content)
    status = {"state": state, "seconds": 3.0, "finished": "2026-11-22T10:15:00+00:00", "reason": "it rained"}
    write_json(folder / "status.json", status)
    if state == "done":
        about = {"study": folder.name, "flight": "x", "kind": "logged", "seed": 1, "seeds": None}
        write_json(folder / "metrics.json", document(**about, metrics=list(metrics), claims=[]))
    return folder


def everything(flight: Path, *more: str) -> str:
    """All that a flight says, and more texts, as a careless report might print it."""
    loaded = load_flight(flight)
    # First and last rows: of every group, and few enough to be read quickly.
    shown = "".join(
        f"<h2>{escape(name)}</h2>{pd.concat([table.head(3), table.tail(3)]).to_html(border=0)}"
        for name, table in {**loaded.nav, **loaded.tables}.items()
    )
    # Hashes and stamps are of no form that a report has.
    stated = "\n".join(line for line in manifest_toml(loaded.manifest).splitlines() if not _CODED.match(line))
    shown = shown.replace(' style="text-align: right;"', "")
    return f"<pre>{escape(' '.join((stated, *more)))}</pre>{shown}"
