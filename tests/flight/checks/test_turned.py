"""A heading that is off by some degrees is said as such, and other mistakes are still found beside it."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.checks.flights import WITHOUT_CAMERA, boats
from tests.flight.checks.watching import add_sensor, level_poses, watch
from tests.flight.conftest import table
from wildlab.flight.checks.check import check_flight, find
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sensors import SourceLooks, best_turn
from wildlab.flight.manifest import make_manifest, replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion, wrap


def said(flight: Flight) -> list[Finding]:
    """What is explained by a mistake; that an angle is beyond what is possible is said beside it."""
    return [one for one in check_flight(flight) if one.causes and one.causes != ("beyond bounds",)]


@pytest.mark.parametrize("off_deg", [-10.0, 3.0, 15.0])
def test_a_heading_that_is_off_is_a_warning_with_the_angle_and_nothing_else(make_flight, off_deg):
    (found,) = said(boats(make_flight, off_deg))
    assert found.level == "warning" and found.causes == ("heading off",)
    turns = [float(one) for one in re.findall(r"by ([+-][\d.]+) deg", found.fix)]
    assert turns == pytest.approx([-off_deg], abs=0.3)


def test_a_heading_that_is_right_is_no_finding(make_flight):
    assert said(boats(make_flight)) == []


@pytest.mark.parametrize("late_s", [-12.0, 30.0])
def test_a_clock_that_is_off_is_told_from_a_heading(make_flight, late_s):
    (found,) = said(boats(make_flight, late_s=late_s))
    assert found.level == "problem" and all(cause.startswith("clock of the truth") for cause in found.causes)
    assert f"truth_offset_s = {late_s:g}" in found.fix


def test_the_clock_of_one_of_two_sensors_is_named_with_what_to_state(make_flight):
    """The other one sees all where it is: it is neither the truth nor a heading."""
    flight = boats(make_flight)
    add_sensor(flight, "eye", flight.table("detections"), 0.5)
    assert said(flight) == []
    stated = replace_in_manifest(flight.manifest, {"sensors": {"radar": {"clock_offset_s": 20.0}}})
    (found,) = said(replace(flight, manifest=stated))
    written = float(found.fix.split("clock_offset_s = ")[1].split("`")[0])
    assert abs(written) <= 1.5 and found.causes[0].startswith("radar: clock")


def test_only_the_sensor_that_is_turned_is_named(make_flight):
    flight = boats(make_flight)
    add_sensor(flight, "horizon", boats(make_flight, 5.0).table("detections"))
    (found,) = said(flight)
    assert found.causes == ("heading off",) and "[sensors.horizon." in found.fix


def test_one_look_full_of_clutter_is_no_mistake_and_hides_none(make_flight):
    flight = boats(make_flight)
    detections = flight.table("detections")
    azimuth = np.random.default_rng(3).uniform(-np.pi, np.pi, 4000)
    clutter = detections.iloc[[15] * 4000].assign(azimuth_rad=azimuth, range_m=300.0)
    clutter["detection_id"] = [f"x{k}" for k in range(4000)]
    detections = pd.concat([detections, clutter], ignore_index=True)
    flight.tables["detections"] = detections
    assert said(flight) == []
    detections["azimuth_rad"] += np.radians(4.0)
    (found,) = said(flight)
    assert found.causes == ("heading off",)


@pytest.mark.parametrize(
    ("reads", "factor", "cause"),
    [
        (lambda bearing, yaw: bearing - yaw, 1.0, "counts from the bow"),
        (lambda bearing, yaw: 2 * yaw - bearing, 1.0, "to the left"),
        (lambda bearing, yaw: bearing - np.pi / 2, 1.0, "from east"),
        (lambda bearing, yaw: bearing, 0.3048, "in m,"),
        (lambda bearing, yaw: bearing, 1 / 0.3048, "in ft,"),
        (lambda bearing, yaw: bearing, 1.0, None),
    ],
)
def test_what_bearings_count_from_and_ranges_are_in_is_named(make_flight, reads, factor, cause):
    """A boat turns by 150 deg and sees a buoy and clutter."""
    rng, t = np.random.default_rng(4), np.arange(0.0, 100.0)
    yaw = np.radians(20 + 1.5 * t)
    to_buoy = np.arctan2(300.0, 100.0 - 2.0 * t) + rng.normal(0, np.radians(0.3), 100)
    distance = np.hypot(300.0, 100.0 - 2.0 * t) + rng.normal(0, 2.0, 100)
    seen = ((to_buoy, distance), (rng.uniform(-np.pi, np.pi, 100), np.full(100, 300.0)))
    rows = [{"azimuth_rad": reads(bearing, yaw), "range_m": factor * r} for bearing, r in seen]
    flight = watch(make_flight, level_poses(t, 2.0 * t, yaw=yaw), t, *rows)
    flight.tables["truth"] = table("target_id,time_s,north_m,east_m,down_m\nbuoy,nan,100.0,300.0,0.0\n")
    found = {one for each in check_flight(flight) if each.field == "azimuth_rad" for one in each.causes}
    assert len(found) == (cause is not None) and all(cause in one for one in found)


@given(by=st.floats(-20.0, 20.0))
@settings(max_examples=20, deadline=None)
def test_places_and_bearings_are_turned_alike(by):
    """Turning places about the own one turns the bearings to them, and keeps the distance."""
    rng = np.random.default_rng(5)
    own, places = rng.normal(0, 50, (9, 3)), rng.normal(0, 200, (9, 3))
    nothing = np.zeros((1, 9, 3))
    scan = SourceLooks(
        "a", places, None, own, nothing, np.zeros(9), np.arange(9), lambda t, u: (own, nothing, np.zeros(9))
    )
    bearings = replace(scan, places=None, azimuth=scan.seen_at)
    np.testing.assert_allclose(wrap(scan.turned(by).seen_at - bearings.turned(by).seen_at), 0, atol=1e-9)
    new = scan.turned(by).places
    assert new is not None
    np.testing.assert_allclose(np.linalg.norm(new - own, axis=1), np.linalg.norm(places - own, axis=1))


def test_positions_are_turned_about_the_own_place():
    """A lidar that is 6 deg off, from places that move."""
    rng = np.random.default_rng(6)
    own = np.column_stack([np.linspace(0, 200, 80), np.zeros((80, 2))])
    targets = np.tile([[[150.0, 120.0, 0.0]], [[30.0, -160.0, 0.0]]], (1, 80, 1))
    zeros = np.zeros(80)
    places = targets[rng.integers(0, 2, 80), np.arange(80)] + rng.normal(0, 0.5, (80, 3))
    scan = SourceLooks(
        "lidar", places, None, own, targets, zeros, np.arange(80), lambda t, u: (own, targets, zeros)
    )
    found = best_turn((scan.turned(6.0),), [])
    assert found is not None and abs(found + 6.0) < 0.3
    assert best_turn((scan,), []) is None
    # Another explanation that brings all of it to targets, where the turn leaves a fifth, is the better one.
    other = np.where(np.arange(80)[:, None] % 5 == 0, places + 50.0, places)
    assert best_turn((replace(scan, places=other).turned(6.0),), []) is not None
    assert best_turn((replace(scan, places=other).turned(6.0),), [(scan,)]) is None


def test_what_a_sensor_places_goes_with_its_platform_where_its_clock_is_moved():
    """Places are about where the sensor was: later stamps put both elsewhere, and targets and bow too."""
    places, own = np.array([[30.0, 5.0, 0.0]] * 4), np.zeros((4, 3))
    targets = np.zeros((2, 4, 3))

    def stamped(by: float, _: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return own + np.array([2.0 * by, 0, 0]), targets + np.array([0, by, 0]), np.full(4, 0.1 * by)

    scan = SourceLooks("a", places, None, *stamped(0.0, 0.0), np.arange(4), stamped)
    later = scan.with_stamps(3.0)
    assert later.places is not None
    assert np.allclose(later.places - later.own, places) and np.allclose(later.own[:, 0], 6.0)
    assert np.allclose(later.targets[..., 1], 3.0) and np.allclose(later.heading, 0.3)


@pytest.mark.parametrize("speed", [5.0, 8.0, 12.0])
@pytest.mark.parametrize("heel", [0.03, 0.05])
def test_a_vessel_that_heels_outward_is_not_accused(speed, heel):
    """By 0.03 to 0.05 rad for each m/s^2, where an aircraft banks inward by 0.1."""
    t, rng = np.arange(0.0, 400.0, 0.2), np.random.default_rng(0)
    rate = 0.08 * np.sin(2 * np.pi * t / 60) + 0.05 * np.sin(2 * np.pi * t / 23)
    yaw = np.cumsum(rate) * 0.2
    places = np.cumsum(speed * np.stack([np.cos(yaw), np.sin(yaw), 0 * t], axis=1), axis=0) * 0.2
    roll = -heel * speed * rate + rng.normal(0, 0.005, len(t))
    R = euler_to_matrix(roll, rng.normal(0, 0.01, len(t)), yaw)
    nav = pd.DataFrame(places + rng.normal(0, 0.05, places.shape), columns=["north_m", "east_m", "down_m"])
    nav[["q_w", "q_x", "q_y", "q_z"]] = matrix_to_quaternion(R)
    flight = Flight(make_manifest(WITHOUT_CAMERA), {"autopilot": nav.assign(time_s=t)}, {})
    assert not [one for one in find(flight, plain=False) if one.level != "note"]
