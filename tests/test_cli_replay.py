"""`wildlab replay`, as it is typed: of a flight, of a report, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.commands import refuse, succeed
from wildlab.analysis.tracks.tracker import COLUMNS
from wildlab.flight.store import save_flight
from wildlab.runner.provenance import provenance_of_flight
from wildlab.simulation.twins import simulate_twin

POSES = ("--source", "autopilot")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("here") / "flights" / "ship"
    save_flight(simulate_twin("large-ship", 1), folder)
    return folder


def report_of(flight: Path, place: Path) -> Path:
    place.mkdir(parents=True)
    (place / "provenance.json").write_text(json.dumps({"flight": provenance_of_flight(flight)}))
    rows = {name: [0.5, 1.5, 2.5] for name in COLUMNS}
    rows |= {"target": ["ship"] * 3, "sensor": ["camera"] * 3, "filter": ["schmidt"] * 3}
    pd.DataFrame(rows | {"p_01": [0.0] * 3}).to_parquet(place / "estimates.parquet")
    return place


def test_a_flight_is_written(flight, tmp_path):
    out = succeed("replay", flight, "--out", tmp_path / "out", *POSES)
    assert out.split() == [str(tmp_path / "out" / name) for name in ("replay.html", "replay.rrd")]
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["replay.html", "replay.rrd"]
    assert not list(flight.glob("replay.*"))


def test_a_report_finds_its_flight_and_shows_its_tracks(flight, tmp_path):
    report = report_of(flight, flight.parents[1] / "reports" / "ship-tracking")
    succeed("replay", report)
    assert "track by considered errors (Schmidt)" in (report / "replay.html").read_text()
    # The flight is another one now: its report is not taken for it.
    other = report_of(flight, flight.parents[1] / "reports" / "other")
    content = json.loads((other / "provenance.json").read_text())
    content["flight"]["files"] = {"flight.toml": "0" * 64}
    (other / "provenance.json").write_text(json.dumps(content))
    assert "changed" in refuse("replay", other)


def test_what_is_refused(flight, tmp_path):
    assert "no such folder" in refuse("replay", tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    assert "neither a flight" in refuse("replay", tmp_path / "empty")
    assert "no part" in refuse("replay", flight, "--out", flight, *POSES)
    assert "nav source 'x'" in refuse("replay", flight, "--source", "x", "--out", tmp_path / "a")
    assert not (tmp_path / "a").exists()
