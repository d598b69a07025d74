"""The tutorials of ``notebooks/tutorials``, each run in a process of its own and left as one offline page.

``python -m wildlab.runner.tutorials`` runs those whose page is not there yet, or was made from another
notebook, other code or other packages, and writes ``reports/tutorials/<name>.html``. What a page was made
from stands in a comment at its end. A tutorial that fails leaves ``reports/tutorial-<name>/``, as a study
would, and no page; the others go on.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from rich.console import Console

from wildlab.errors import WildlabError
from wildlab.files import digest, write_atomic
from wildlab.paths import DATA, NOTEBOOKS, PACKAGE, REPORTS
from wildlab.reporting.notebook_pages import read_notebook
from wildlab.runner.catalogue import load_studies
from wildlab.runner.job import Job
from wildlab.runner.ledger import build_ledger, title_of, tutorial_links, tutorial_notebooks
from wildlab.runner.progress import shown
from wildlab.runner.scheduling import Outcome, run_jobs
from wildlab.runner.seeds import code_key

#: What a tutorial shows comes out of these besides the rooms below them (`wildlab.runner.seeds`).
_SHOWING = (
    "api/*.py",
    "reporting/**/*.py",
    "summary_table.py",
    "runner/tutorials.py",
    "runner/notebook_process.py",
)
_PACKAGES = ("matplotlib", "nbconvert", "latex2mathml")


def run_tutorials(
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    *,
    parallel: int = 1,
    console: Console | None = None,
) -> list[Outcome]:
    """Run the tutorials whose pages are not there or out of date, and write their pages.

    Parameters
    ----------
    reports
        Where the folder ``tutorials`` is, or will be.
    notebooks
        Where the tutorials are, in ``tutorials``.
    parallel
        How many at once.
    console
        Where progress is shown; nowhere if not given.

    Returns
    -------
    list of Outcome
        Of those that were run; ``folder`` of one that failed has a page that says why.

    Raises
    ------
    WildlabError
        Where there is no tutorial.
    """
    found = tutorial_notebooks(notebooks)
    if not found:
        raise WildlabError("there are no tutorials", "restore notebooks/tutorials", file=notebooks)
    reports = reports.resolve()
    (reports / "tutorials").mkdir(parents=True, exist_ok=True)
    marks = {path: _mark(path) for path in found}
    jobs = {path: _job(path, reports) for path in found if not _kept(path, reports, marks[path])}
    # A terminal shows a bar; elsewhere each has a line of its own.
    if console is not None:
        with shown(console) as listen:
            outcomes = run_jobs(list(jobs.values()), parallel=parallel, listen=listen)
    else:
        outcomes = run_jobs(list(jobs.values()), parallel=parallel)
    for path, outcome in zip(jobs, outcomes, strict=True):
        _put(outcome, _page(path, reports), marks[path])
    return outcomes


def _job(path: Path, reports: Path) -> Job:
    name = f"tutorial-{path.stem}"
    return Job(
        name=name,
        title=title_of(path),
        notebook=str(path.resolve()),
        work=str(reports / f".{name}.{os.getpid()}.part"),
        reports=str(reports),
        again="python -m wildlab.runner.tutorials",
        timeout_s=600.0,
        cells=len(read_notebook(path).cells),
        tutorial=True,
    )


def _put(outcome: Outcome, page: Path, mark: str) -> None:
    """Move a finished page to where it is read from. What another code made goes, where this one failed."""
    if outcome.state != "done" or outcome.folder is None:
        page.unlink(missing_ok=True)
        return
    whole = (outcome.folder / "report.html").read_text(encoding="utf-8")
    write_atomic(page, whole + mark)
    shutil.rmtree(outcome.folder)


def _page(path: Path, reports: Path) -> Path:
    return reports / "tutorials" / f"{path.stem}.html"


def _kept(path: Path, reports: Path, mark: str) -> bool:
    page = _page(path, reports)
    return page.is_file() and page.read_text(encoding="utf-8").endswith(mark)


def _mark(notebook: Path) -> str:
    """What a page is made from, as the comment that ends it."""
    shows = sorted({path for pattern in _SHOWING for path in PACKAGE.glob(pattern)})
    files = [(path.name, path) for path in (*shows, *sorted((DATA / "pages").glob("*")), notebook)]
    return f"<!-- made from {digest([code_key(), *map(version, _PACKAGES)], files)} -->\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command: 0 where every page is there, 1 where a tutorial failed, 2 where there is none to run."""
    parser = argparse.ArgumentParser(
        prog="python -m wildlab.runner.tutorials", description="Run the tutorials, and write their pages."
    )
    parser.add_argument("--jobs", type=int, default=1, help="how many at once (default: 1)")
    parser.add_argument("--out", type=Path, default=REPORTS, help="where the reports are (default: reports)")
    given = parser.parse_args(arguments)
    console = Console(stderr=True)
    try:
        outcomes = run_tutorials(given.out, parallel=given.jobs, console=console)
    except WildlabError as error:
        console.print(str(error), markup=False, highlight=False)
        return 2
    build_ledger(given.out, load_studies())
    failed = [outcome for outcome in outcomes if outcome.state != "done"]
    for outcome in failed:
        print(f"failed: {outcome.folder}/report.html")
    for _, page in tutorial_links(given.out):
        print(given.out / page)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
