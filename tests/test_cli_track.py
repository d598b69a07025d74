"""`wildlab track`, as it is typed: its report, its tables, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.analysis.robots import robot_flight
from tests.commands import refuse, succeed
from wildlab.flight.store import save_flight


def kept(folder: Path, **changes: object) -> Path:
    place = folder / str(changes.get("name", "robot"))
    save_flight(robot_flight(**changes), place)  # type: ignore[arg-type]
    return place


def numbers(report: Path) -> dict[tuple[str, str], float]:
    found = json.loads((report / "metrics.json").read_text())["metrics"]
    return {(one["name"], one["subject"]): one["value"] for one in found}


@pytest.mark.slow
def test_a_heading_that_is_off_is_seen_through_by_the_command_line_alone(tmp_path):
    flight = kept(tmp_path, seed=1, heading_off_deg=2.0, heading_sd_deg=2.0)
    succeed("track", flight, "--out", tmp_path / "out", "--smooth")
    found = numbers(tmp_path / "out")
    assert found["nees", "radar/boat/ekf"] > 20 > 5 > found["nees", "radar/boat/schmidt"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert str(tmp_path) not in page
    table = pd.read_parquet(tmp_path / "out" / "estimates.parquet")
    assert set(table["filter"]) == {"ekf", "ekf-smoothed", "schmidt", "schmidt-smoothed", "coloured"}
    assert len(pd.read_csv(tmp_path / "out" / "estimates.csv")) == len(table)
    # A folder of one's own gets this report and no list of others.
    assert not (tmp_path / "index.html").exists()


@pytest.mark.slow
def test_tuned_on_one_flight_and_judged_on_another(tmp_path):
    one = kept(tmp_path, seed=1, name="monday", truth=False)
    other = kept(tmp_path, seed=2, name="tuesday", truth=False)
    succeed("track", other, "--tune", one, "--out", tmp_path / "out")
    assert ("nis", "radar/boat/ekf") in numbers(tmp_path / "out")
    assert not any(name == "nees" for name, _ in numbers(tmp_path / "out"))


def test_what_is_refused(tmp_path):
    flight = kept(tmp_path)
    assert "target 'ship'" in refuse("track", flight, "--target", "ship")
    assert "which flight" in refuse("track", flight, "--against", "truth")
    other = kept(tmp_path, seed=3, name="blind", truth=False)
    assert "no truth" in refuse("track", flight, "--tune", other, "--against", "truth")
    copy = kept(tmp_path, name="copy")
    assert "tuned where" in refuse("track", flight, "--tune", copy)
    lidar = kept(tmp_path, name="lidar", sensor="lidar")
    assert "sensor 'radar'" in refuse("track", flight, "--tune", lidar)
    settings = tmp_path / "settings.toml"
    settings.write_text("[targets]\nsped = 3\n")
    assert "sped" in refuse("track", flight, "--settings", settings)
    assert "flight.toml" in refuse("track", tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("the first")
    assert "--overwrite" in refuse("track", flight, "--out", tmp_path / "out")
    assert (tmp_path / "out" / "report.html").read_text() == "the first"


@pytest.mark.slow
def test_all_targets_at_once_without_a_name(tmp_path):
    flight = kept(tmp_path, kind="position", clutter=2, labelled=False)
    succeed("track", flight, "--many", "--out", tmp_path / "out")
    assert numbers(tmp_path / "out")["tracked", "target-1"] > 0.9
    assert (pd.read_parquet(tmp_path / "out" / "estimates.parquet")["track"] >= 0).all()


@pytest.mark.parametrize("option", [("--filter", "ekf"), ("--target", "boat"), ("--smooth",)])
def test_options_that_do_not_go_with_many(tmp_path, option):
    flight = kept(tmp_path, kind="position")
    (tmp_path / "other").mkdir()
    given = [tmp_path / one if one == "other" else one for one in option]
    assert f"{option[0]} and --many" in refuse("track", flight, "--many", *given)
