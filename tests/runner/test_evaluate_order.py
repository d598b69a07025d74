"""The reports of a flight: which are made at once, in which order, and in which order they are told."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from tests.analysis.robots import robot_flight
from tests.notebooks import OPEN, notebook, write
from wildlab.flight.store import save_flight
from wildlab.runner import evaluate
from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.job import AFTER_OTHERS, Job
from wildlab.runner.progress import shown
from wildlab.runner.run import make_job
from wildlab.runner.scheduling import Outcome, run_jobs


def test_long_ones_begin_first_and_the_overview_waits_for_all(tmp_path, monkeypatch):
    save_flight(robot_flight(1, heading_sd_deg=1.0), tmp_path / "flight")
    ran: list[Job] = []

    def run_all(jobs: Sequence[Job], skipped: list[Outcome], *_: Any, parallel: int) -> list[Outcome]:
        ran.extend(jobs)
        assert parallel == 2
        return [Outcome(job.name, "done", 1.0) for job in jobs] + skipped

    monkeypatch.setattr(evaluate, "run_all", run_all)
    monkeypatch.setattr(evaluate, "cores", lambda: 2)
    monkeypatch.setattr(evaluate, "lacking_for_navigation", lambda *_: "")
    told = [one.name for one in evaluate.evaluate_flight(tmp_path / "flight", reports=tmp_path / "reports")]
    assert [Path(job.notebook).stem for job in ran] == ["navigation", "tracking", "overview"]
    assert [set(job.after) for job in ran] == [set(), set(), {job.name for job in ran[:2]}]
    assert told[0] == "flight-overview" and told[-1] == "flight-tracking"


@pytest.mark.slow
@pytest.mark.parametrize("parallel", [1, 2])
def test_a_cell_that_reads_other_reports_begins_when_they_are_there(tmp_path, parallel):
    reports = tmp_path / "reports"
    status = reports / "first" / "status.json"
    first = notebook(OPEN, 'import time\ntime.sleep(2)\nreport.head("a")\nreport.save()')
    seen = f"from pathlib import Path\nassert Path({str(status)!r}).is_file()\nreport.save()"
    early = f"from pathlib import Path\nassert Path({str(status)!r}).is_file() == ({parallel} == 1)"
    second = notebook(OPEN, f'report.head("b")\n{early}', seen)
    second.cells[-1].metadata["tags"] = [AFTER_OTHERS]
    jobs = []
    for name, cells in (("first", first), ("second", second)):
        write(tmp_path, f"{name}.ipynb", cells)
        study = StudyEntry(name=name, title=name, notebook=f"{name}.ipynb")
        jobs.append(make_job(study, reports=reports, notebooks=tmp_path, name=name))
    jobs[1] = replace(jobs[1], after=("first",))
    assert [(one.state, one.reason) for one in run_jobs(jobs, parallel=parallel)] == [("done", "")] * 2


def test_who_waits_hears_what_is_under_way_and_how_long_it_took(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("wildlab.runner.progress.time.monotonic", lambda: now[0])
    console = Console(file=io.StringIO(), width=200)
    with shown(console) as tell:
        tell("f", "start", 31.4)
        tell("f", "cell", (2, 6))
        for now[0] in (9.0, 11.0, 12.0):
            tell("", "tick", None)
    assert console.file.getvalue().splitlines() == [
        "start f (31 s the last time)",
        "still f cell 3 of 6, 11 s (31 s the last time)",
    ]
