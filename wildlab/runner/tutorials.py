"""The tutorials of ``notebooks/tutorials``, each run in a process of its own and left as one offline page.

``python -m wildlab.runner.tutorials`` runs them and writes ``reports/tutorials/<name>.html``. A tutorial that
fails leaves ``reports/tutorial-<name>/``, as a study would, and no page; the others go on.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from rich.console import Console

from wildlab.errors import WildlabError
from wildlab.paths import NOTEBOOKS, REPORTS
from wildlab.reporting.notebook_pages import read_notebook
from wildlab.runner.catalogue import load_studies
from wildlab.runner.job import Job
from wildlab.runner.ledger import build_ledger, title_of, tutorial_notebooks
from wildlab.runner.progress import shown
from wildlab.runner.scheduling import Outcome, run_jobs


def run_tutorials(
    reports: Path = REPORTS,
    notebooks: Path = NOTEBOOKS,
    *,
    parallel: int = 1,
    console: Console | None = None,
) -> list[Outcome]:
    """Run the tutorials, and write their pages.

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
        ``folder`` of one that failed has a page that says why.

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
    with shown(console) if console is not None else nullcontext() as listen:
        outcomes = run_jobs([_job(path, reports) for path in found], parallel=parallel, listen=listen)
    for path, outcome in zip(found, outcomes, strict=True):
        page = reports / "tutorials" / f"{path.stem}.html"
        # What another code made goes, where this one failed.
        page.unlink(missing_ok=True)
        if outcome.state == "done" and outcome.folder is not None:
            (outcome.folder / "report.html").replace(page)
            shutil.rmtree(outcome.folder)
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
    for page in sorted((given.out / "tutorials").glob("*.html")):
        print(page)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
