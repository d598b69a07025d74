"""Writing ``reports/index.html``, the ledger, from what runs have left behind, and ``flights.html``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.reporting.cases import load_cases
from wildlab.reporting.ledger import ledger_page
from wildlab.reporting.metrics import read_metrics
from wildlab.reporting.notebook_file import read_notebook
from wildlab.reporting.own_flights import PAGE, flights_page
from wildlab.reporting.text import escape
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.record.own_flights import own_flights
from wildlab.runner.record.provenance import git_state
from wildlab.runner.record.status import study_status

#: The folder of the comparison of flights, among the reports.
COMPARISON = "comparison"


def build_ledger(reports: Path, studies: Mapping[str, StudyEntry]) -> Path:
    """Write ``index.html`` and return its path. Works whichever of the studies have been run.

    The page of all flights that somebody evaluated, ``flights.html``, is written with it.
    """
    statuses = [study_status(study, reports) for study in studies.values()]
    git = git_state()
    code = f"commit <code>{git['commit'][:10]}</code>" if git["commit"] else escape(git["note"])
    path = reports / "index.html"
    reports.mkdir(parents=True, exist_ok=True)
    compared = f"{COMPARISON}/report.html"
    own = own_flights(reports, studies)
    write_atomic(reports / PAGE, flights_page(own, compared if (reports / compared).is_file() else ""))
    learn = [*tutorial_links(reports), *_reference_link(reports)]
    others = _other_reports(reports, studies)
    write_atomic(path, ledger_page(statuses, others, learn=learn, code=code, cases=load_cases()))
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


def tutorial_links(reports: Path = REPORTS, notebooks: Path = NOTEBOOKS) -> list[tuple[str, str]]:
    """Title and address, as seen from ``reports``, of each tutorial whose page is there."""
    pages = [(path, f"tutorials/{path.stem}.html") for path in tutorial_notebooks(notebooks)]
    return [(title_of(path), page) for path, page in pages if (reports / page).is_file()]


def _reference_link(reports: Path) -> list[tuple[str, str]]:
    page = "reference/index.html"
    return [("Reference of all functions", page)] if (reports / page).is_file() else []
