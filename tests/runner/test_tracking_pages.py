"""Tracking among the reports of a flight, where it has what that takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pipeline.robots import robot_flight
from wildlab.flight.checks.check import Use, usable_for
from wildlab.flight.store import Flight, save_flight
from wildlab.runner.evaluate import evaluate_flight, lacking_for_tracking


def use_of(flight: Flight) -> Use:
    return next(use for use in usable_for(flight) if use.purpose == "tracking")


def test_what_a_flight_lacks_for_tracking_is_said() -> None:
    flight = robot_flight()
    assert lacking_for_tracking(flight, use_of(flight)) == ""
    short = robot_flight(seconds=6.0)
    assert "10 looks" in lacking_for_tracking(short, use_of(short))
    nowhere = Flight(flight.manifest, {}, flight.tables)
    assert lacking_for_tracking(nowhere, use_of(nowhere))
    blind = Flight(flight.manifest, flight.nav, {"frames": flight.tables["frames"]})
    assert "detections" in lacking_for_tracking(blind, use_of(blind))


@pytest.mark.slow
def test_evaluate_writes_the_tracks_too(tmp_path: Path) -> None:
    save_flight(robot_flight(1, heading_sd_deg=1.0), tmp_path / "flight")
    outcomes = evaluate_flight(tmp_path / "flight", reports=tmp_path / "reports")
    assert {one.name: one.state for one in outcomes}["flight-tracking"] == "done"
    folder = tmp_path / "reports" / "flight-tracking"
    assert (folder / "estimates.parquet").is_file() and (folder / "report.html").is_file()
