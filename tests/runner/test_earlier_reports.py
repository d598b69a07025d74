"""Reports that an evaluation did not make again are not listed as if it had."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from wildlab.runner.ledger import own_flights


def report(folder: Path, hour: int, table: str, beside: list[str] | None = None) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "report.html").write_text("x", encoding="utf-8")
    finished = f"2026-03-14T{hour:02d}:00:00+00:00"
    (folder / "status.json").write_text(json.dumps({"state": "done", "finished": finished}), encoding="utf-8")
    files = {"flight.toml": f"t{hour}", "nav/logged.parquet": table}
    content = {
        "flight": {"name": "f", "kind": "logged", "files": files, "sources": []},
        "parameters": {} if beside is None else {"beside": beside},
    }
    (folder / "provenance.json").write_text(json.dumps(content), encoding="utf-8")


@pytest.mark.parametrize("table", ["a", "b"])
def test_what_was_not_made_again_is_of_an_earlier_evaluation(tmp_path, table):
    for end in ("", "-navigation", "-tracking"):
        report(tmp_path / f"f{end}", 9, "a")
    report(tmp_path / "f-overview", 10, "a", ["f", "f-navigation", "f-tracking"])
    (whole,) = own_flights(tmp_path, ())
    assert len(whole.reports) == 4 and not whole.earlier
    # Again, of the same tables or of others: without navigation and tracking.
    report(tmp_path / "f", 11, table)
    report(tmp_path / "f-overview", 12, table, ["f"])
    (found,) = own_flights(tmp_path, ())
    assert [one.folder for one in found.reports] == ["f-overview", "f"]
    assert [one.folder for one in found.earlier] == ["f-navigation", "f-tracking"]


def test_tracks_that_were_made_after_the_overview_are_current(tmp_path):
    report(tmp_path / "f-overview", 10, "a", [])
    report(tmp_path / "f-tracking", 11, "a")
    (found,) = own_flights(tmp_path, ())
    assert [one.about for one in found.reports] == ["overview", "tracking"] and not found.earlier
    # Of other tables, the overview is the one that is of before.
    report(tmp_path / "f-tracking", 12, "b")
    (found,) = own_flights(tmp_path, ())
    assert [one.about for one in found.earlier] == ["overview"]
