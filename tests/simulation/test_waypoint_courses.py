"""Courses between waypoints: their geometry, their speed through the wind, no contradictions."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.motions import ALTITUDE, LAPS_WIND
from wildlab.geometry.frames import matrix_to_euler
from wildlab.simulation.attitudes import fixed_wing_trajectory
from wildlab.simulation.waypoint_courses import (
    Laps,
    filleted_course,
    lap_times,
    laps_path,
    shape_corners,
)


def calm(course, **more):
    return laps_path(Laps(course, 19.5, 600.0, **more), [[0.0, 300.0]])


def test_a_course_touches_its_legs_and_turns_with_its_radius():
    course = filleted_course(shape_corners("eight", 500.0, 400.0), 80.0)
    assert course[0] == pytest.approx(course[-1])
    assert course[0] == pytest.approx([0.0, 0.0], abs=0.5)  # an eight starts in its middle
    step = np.diff(course, axis=0)
    assert np.linalg.norm(step, axis=1).max() < 0.51
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    bend = np.diff(heading) / np.linalg.norm(step[1:], axis=1)
    curved = np.abs(bend) > 1e-6
    # Where a leg meets an arc, only half of the bend has happened.
    assert np.quantile(np.abs(bend[curved]), [0.1, 0.9]) == pytest.approx(1 / 80, rel=0.01)
    # An eight turns as far to the left as to the right.
    assert heading[-1] - heading[0] == pytest.approx(0.0, abs=1e-9)
    track = filleted_course(shape_corners("racetrack", 500.0, 200.0), 80.0)
    heading = np.unwrap(np.arctan2(*np.diff(track, axis=0).T[::-1]))
    assert heading[-1] - heading[0] == pytest.approx(2 * np.pi)  # clockwise once
    assert track[0] == pytest.approx([0.0, 0.0], abs=0.5)


def test_turns_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        filleted_course(shape_corners("eight", 300.0, 100.0), 80.0)
    with pytest.raises(ValueError, match="exceed the wind"):
        lap_times(filleted_course(shape_corners("eight", 500.0, 400.0), 80.0), 19.5, (15.0, 15.0))


def test_a_lap_in_still_air_takes_its_length_over_the_airspeed():
    course = filleted_course(shape_corners("eight", 500.0, 400.0), 80.0)
    length = np.linalg.norm(np.diff(course, axis=0), axis=1).sum()
    assert lap_times(course, 20.0, (0, 0))[-1] == pytest.approx(length / 20)
    path = calm(course)
    p0, p1 = path(np.array([50.0]))[0], path(np.array([50.0 + length / 19.5]))[0]
    # Smoothing samples the laps at its own times, which cut corners a little differently on each.
    assert p1 == pytest.approx(p0, abs=0.05)


def test_legs_are_straight_at_the_airspeed_and_turns_are_coordinated():
    course = filleted_course(shape_corners("eight", 1500.0, 400.0), 80.0)
    path = calm(course, wind=LAPS_WIND[:2])
    trajectory = fixed_wing_trajectory(path, wind=LAPS_WIND)
    t = np.arange(0, 600, 0.1)
    p, v, a = path(t)
    airspeed = np.linalg.norm(v - LAPS_WIND, axis=1)
    level = np.linalg.norm(a, axis=1) < 1e-9
    assert 0.4 < level.mean() < 0.9
    assert airspeed[level] == pytest.approx(19.5, abs=1e-9)
    assert 0.9 * 19.5 < airspeed.min() <= airspeed.max() < 1.02 * 19.5
    roll = matrix_to_euler(trajectory(t).R_nb)[:, 0]
    assert roll[level] == pytest.approx(0.0, abs=1e-9)
    ground_speed = np.linalg.norm(v, axis=1)
    steepest = np.arctan(ground_speed**2 / (9.81 * 80))
    assert np.radians(45) > np.abs(roll).max() > np.radians(20)
    assert (np.abs(roll) < steepest.max() + 0.05).all()
    # On the ground the track is that of the drawn course, within what smoothing cuts off.
    nearest = np.array([np.min(np.linalg.norm(course - q[:2], axis=1)) for q in p[::7]])
    assert nearest.max() < 4.0
    assert p[:, 2] == pytest.approx(-300.0)


def test_a_drifting_course_is_the_same_course_in_its_own_frame():
    course = filleted_course(shape_corners("eight", 500.0, 400.0), 80.0)
    drift = np.array([3.0, -4.0])
    t = np.arange(0, 300, 0.5)
    moving, v, _ = calm(course, drift=drift, wind=(1.0, 2.0))(t)
    resting, u, _ = calm(course, wind=np.array([1.0, 2.0]) - drift)(t)
    assert moving[:, :2] - np.outer(t, drift) == pytest.approx(resting[:, :2], abs=1e-8)
    assert v[:, :2] - drift == pytest.approx(u[:, :2], abs=1e-9)


def test_altitude_follows_its_profile():
    course = filleted_course(shape_corners("eight", 500.0, 400.0), 80.0)
    path = laps_path(Laps(course, 19.5, 300.0), ALTITUDE)
    p, v, _ = path(np.array([0.0, 50.0, 130.0, 200.0, 290.0]))
    assert -p[:, 2] == pytest.approx([200, 200, 250, 300, 300], abs=1e-6)
    assert v[2, 2] == pytest.approx(-100 / 60)
