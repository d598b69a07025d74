"""Tracking among the reports of a flight, where it has what that takes."""

from __future__ import annotations

from tests.analysis.robots import robot_flight
from wildlab.flight.checks.check import Use, usable_for
from wildlab.flight.store import Flight
from wildlab.runner.evaluate import lacking_for_tracking


def use_of(flight: Flight) -> Use:
    return next(use for use in usable_for(flight) if use.purpose == "tracking")


def test_what_a_flight_lacks_for_tracking_is_said():
    flight = robot_flight()
    assert lacking_for_tracking(flight, use_of(flight)) == ""
    short = robot_flight(seconds=6.0)
    assert "10 images or scans" in lacking_for_tracking(short, use_of(short))
    nowhere = Flight(flight.manifest, {}, flight.tables)
    assert lacking_for_tracking(nowhere, use_of(nowhere))
    blind = Flight(flight.manifest, flight.nav, {"frames": flight.tables["frames"]})
    assert "detections" in lacking_for_tracking(blind, use_of(blind))
