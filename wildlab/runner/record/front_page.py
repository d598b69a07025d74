"""Writing ``reports/index.html``, the front page, and the pages beside it from what runs have left behind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from wildlab.files import write_atomic
from wildlab.paths import NOTEBOOKS, REPORTS, ROOT
from wildlab.reporting.front_page import (
    LEDGER,
    MOST_FLIGHTS,
    PARTNERS,
    Learn,
    case_cards,
    flight_card,
    front_page,
    ledger_page,
    partners_page,
    read_glimpse,
)
from wildlab.reporting.notebook_pages import read_notebook
from wildlab.reporting.own_flights import PAGE, flights_page
from wildlab.reporting.status import load_cases
from wildlab.reporting.text import escape
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.record.own_flights import own_flights
from wildlab.runner.record.provenance import git_state
from wildlab.runner.record.status import study_status

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
    write_atomic(reports / PAGE, flights_page(own, compared if (reports / compared).is_file() else ""))
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


def _learn(reports: Path) -> list[Learn]:
    """Tutorials and reference, with an address where the page is there."""
    there = dict(tutorial_links(reports))
    titles = [title_of(notebook) for notebook in tutorial_notebooks()]
    reference = "reference/index.html"
    found = [Learn(title, there.get(title, "")) for title in titles]
    if ROOT or (reports / reference).is_file():
        found.append(
            Learn("Reference of all functions", reference if (reports / reference).is_file() else "")
        )
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
