"""The reports of a flight: which are made at once, in which order, and in which order they are told."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.analysis.robots import robot_flight
from wildlab.flight.store import save_flight
from wildlab.runner import evaluate
from wildlab.runner.job import Job
from wildlab.runner.scheduling import Outcome


def test_long_ones_begin_first_and_the_overview_waits_for_all(tmp_path, monkeypatch):
    save_flight(robot_flight(1, heading_sd_deg=1.0), tmp_path / "flight")
    ran: list[tuple[list[str], int]] = []

    def run_all(
        passes: Sequence[Sequence[Job]], skipped: list[Outcome], *_: Any, parallel: int
    ) -> list[Outcome]:
        ran.extend(([Path(job.notebook).stem for job in jobs], parallel) for jobs in passes)
        return [Outcome(job.name, "done", 1.0) for jobs in passes for job in jobs] + skipped

    monkeypatch.setattr(evaluate, "run_all", run_all)
    monkeypatch.setattr(evaluate, "cores", lambda: 2)
    monkeypatch.setattr(evaluate, "lacking_for_navigation", lambda *_: "")
    told = [one.name for one in evaluate.evaluate_flight(tmp_path / "flight", reports=tmp_path / "reports")]
    assert ran[0][0][0] == "navigation" and set(ran[0][0][1:]) >= {"tracking"}
    assert ran[1:] == [(["overview"], 2)] and ran[0][1] == 2
    assert told[0] == "flight-overview" and told[-1] == "flight-tracking"
