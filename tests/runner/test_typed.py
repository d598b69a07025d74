"""What somebody types to run something again: it has every word of the first time, and a shell takes it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tests.analysis.robots import robot_flight
from wildlab.flight.store import save_flight
from wildlab.paths import REPORTS
from wildlab.runner import evaluate
from wildlab.runner.job import Job, other_reports, typed, typed_in_report
from wildlab.runner.scheduling import Outcome


@given(st.lists(st.text(min_size=1).filter(lambda one: "\0" not in one)))
def test_a_shell_reads_what_was_meant(words):
    assert shlex.split(typed("wildlab track", *words, target=words)) == [
        "wildlab", "track", *words, *(one for word in words for one in ("--target", word)),
    ]  # fmt: skip


def test_paths_are_from_here_and_what_was_left_out_is_left_out(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    here = typed(
        "x", Path("my flights/one"), settings=tmp_path / "s.toml", source=None, smooth=False, filter=()
    )
    assert here == "x 'my flights/one' --settings s.toml"
    assert typed("x", tmp_path.parent) == f"x {shlex.quote(str(tmp_path.parent))}"
    told = typed_in_report("x", tmp_path / "a b", settings=tmp_path / "s.toml", against=[tmp_path / "c"])
    assert told == "x 'a b' --settings s.toml --against c"
    assert other_reports(REPORTS) is None and other_reports(tmp_path) == tmp_path


def test_a_report_that_failed_is_asked_for_again_as_it_was(tmp_path, monkeypatch):
    """The flight's folder from here, and every option."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "flights" / "my boat"
    save_flight(robot_flight(), folder)
    (tmp_path / "s.toml").write_text("[targets]\nstart_speed_m_s = 4.0\n", encoding="utf-8")
    jobs: list[Job] = []

    def keep_all(some: list[Job], *_: Any, **__: Any) -> list[Outcome]:
        jobs.extend(some)
        return [Outcome(one.name, "done", 0.0) for one in some]

    monkeypatch.setattr(evaluate, "run_all", keep_all)
    told: dict[str, Any] = {"settings": Path("s.toml"), "sensors": ("radar",), "into": tmp_path / "out"}
    evaluate.track_flight(folder, filters=("ekf", "ukf"), smooth=True, **told)
    evaluate.track_many(folder, **told)
    evaluate.evaluate_flight(folder, reports=tmp_path / "reports")
    start = "wildlab track 'flights/my boat'"
    assert jobs[0].again == (
        f"{start} --filter ekf --filter ukf --sensor radar --settings s.toml --smooth --out out --overwrite"
    )
    assert jobs[1].again == f"{start} --many --sensor radar --settings s.toml --out out --overwrite"
    assert {job.again for job in jobs[2:]} == {"wildlab evaluate 'flights/my boat' --out reports"}
