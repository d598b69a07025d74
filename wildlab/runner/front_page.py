"""Writing ``reports/index.html``, the ledger, from what runs have left behind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.reporting.ledger import ledger_page
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.text import escape
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.provenance import git_state
from wildlab.runner.status import study_status


def build_ledger(reports: Path, studies: Mapping[str, StudyEntry]) -> Path:
    """Write ``index.html`` and return its path. Works whichever of the studies have been run."""
    statuses = [study_status(study, reports) for study in studies.values()]
    git = git_state()
    code = f"commit <code>{git['commit'][:10]}</code>" if git["commit"] else escape(git["note"])
    path = reports / "index.html"
    reports.mkdir(parents=True, exist_ok=True)
    write_atomic(path, ledger_page(statuses, _other_reports(reports, studies), code=code))
    return path


def _other_reports(reports: Path, studies: Mapping[str, StudyEntry]) -> list[tuple[str, str]]:
    """Reports of flights that somebody evaluated: (folder, flight)."""
    found: list[tuple[str, str]] = []
    for path in sorted(reports.glob("*/status.json")) if reports.is_dir() else []:
        folder = path.parent
        if folder.name in studies or folder.name.startswith(".") or not (folder / "report.html").is_file():
            continue
        try:
            content: dict[str, Any] = read_metrics(folder / "metrics.json")
        except WildlabError:
            continue
        found.append((folder.name, str(content["flight"]) or folder.name))
    return found
