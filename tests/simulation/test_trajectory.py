"""A motion must not contradict itself: derivatives, circles in wind, courses between waypoints."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.motions import LAPS_WIND, WIND, flown, restless_laps, restless_loiter
from wildlab.geometry.frames import matrix_to_euler
from wildlab.simulation.courses import (
    Laps,
    filleted_course,
    lap_times,
    laps_path,
    loiter_path,
    shape_corners,
)
from wildlab.simulation.trajectory import (
    Motion,
    angular_rates,
    attitude_along,
    band_limited_disturbance,
    coordinated_attitude,
    fixed_wing_trajectory,
    specific_forces,
)


@pytest.mark.parametrize(("turn", "sense"), [("clockwise", 1), ("counter-clockwise", -1)])
def test_still_air_circle_is_a_coordinated_turn(turn, sense):
    speed, radius, gravity = 20.0, 150.0, 9.82
    path = loiter_path((0.0, 0.0), radius, 300.0, speed, turn=turn)
    t = np.linspace(0, 100, 500)
    p, v, _ = path(t)
    roll, pitch, yaw = matrix_to_euler(fixed_wing_trajectory(path, gravity=gravity)(t).R_nb).T
    assert np.tan(roll) == pytest.approx(sense * speed**2 / (gravity * radius), abs=1e-12)
    assert pitch == pytest.approx(0.0, abs=1e-12)
    course = np.arctan2(v[:, 1], v[:, 0])
    assert np.sin(yaw - course) == pytest.approx(0.0, abs=1e-12)
    assert np.hypot(p[:, 0], p[:, 1]) == pytest.approx(radius, abs=1e-9)
    # Clockwise seen from above is from north to east.
    bearing = np.unwrap(np.arctan2(p[:, 1], p[:, 0]))
    assert np.diff(bearing) == pytest.approx(sense * speed / radius * np.diff(t), abs=1e-12)


def test_in_wind_the_airspeed_is_steady_and_the_ground_track_a_circle():
    path = loiter_path((10.0, 20.0), 160.0, 350.0, 19.5, wind=WIND[:2])
    p, v, a = path(np.linspace(0, 1500, 4000))
    assert np.hypot(p[:, 0] - 10, p[:, 1] - 20) == pytest.approx(160.0, abs=1e-9)
    assert np.linalg.norm(v - WIND, axis=1) == pytest.approx(19.5, abs=1e-10)
    ground_speed = np.linalg.norm(v, axis=1)
    assert ground_speed.min() == pytest.approx(14.5, abs=1e-3)
    assert ground_speed.max() == pytest.approx(24.5, abs=1e-3)
    # A steady airspeed leaves no acceleration along the way through the air.
    assert np.einsum("ij,ij->i", v - WIND, a) == pytest.approx(0.0, abs=1e-9)


def test_coordinated_flight_has_no_sideslip_and_no_lateral_force():
    trajectory = restless_loiter()
    t = np.linspace(0, 200, 1000)
    restless = trajectory(t)
    v, a = restless.velocity, restless.acceleration
    R = coordinated_attitude(v, a, wind=WIND, trim_pitch=0.05)
    through_air = np.einsum("nij,ni->nj", R, v - WIND)
    assert through_air[:, 1] == pytest.approx(0.0, abs=1e-10)
    assert np.arctan2(through_air[:, 2], through_air[:, 0]) == pytest.approx(0.05, abs=1e-10)
    motion = Motion(t, restless.position, v, a, R)
    assert specific_forces(motion)[:, 1] == pytest.approx(0.0, abs=1e-10)
    assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("motion", "last", "within"),
    [
        # Truncation is h^2/6 times the third (fourth) derivative: of a loiter below 2 m/s^3 (m/s^4), of turns
        # between waypoints below 10. Rounding of 500 m over 2 h is some 1e-10.
        (partial(restless_loiter, "clockwise"), 1400, 4e-7),
        (partial(restless_loiter, "counter-clockwise"), 1400, 4e-7),
        (partial(restless_laps, "eight"), 400, 2e-6),
        (partial(restless_laps, "racetrack"), 400, 2e-6),
        (partial(flown, "uav-search-low"), 1700, 2e-6),
        (partial(flown, "gondola"), 1700, 2e-6),
    ],
)
def test_velocity_and_acceleration_are_the_derivatives_of_position(motion, last, within):
    trajectory = motion()
    t, h = np.linspace(0, last, 5000), 1e-3
    before, at, after = trajectory(t - h), trajectory(t), trajectory(t + h)
    assert np.abs((after.position - before.position) / (2 * h) - at.velocity).max() < within
    assert np.abs((after.velocity - before.velocity) / (2 * h) - at.acceleration).max() < within


@pytest.mark.parametrize(
    ("motion", "within"),
    [
        # A turn from t to t+h has the mean rate at t+h/2, but for h^2/24 times the rate's second derivative
        # (of a loiter below 3 rad/s^3) and products of it.
        (restless_loiter, 1e-6),
        *((partial(flown, name), 5e-6) for name in ("uav-search", "uav-search-low", "gondola")),
    ],
)
def test_angular_rate_is_the_derivative_of_attitude(motion, within):
    attitude = attitude_along(motion())
    t, h = np.linspace(5, 1400, 5000), 1e-3
    rate = Rotation.from_matrix(np.swapaxes(attitude(t), -1, -2) @ attitude(t + h)).as_rotvec() / h
    assert np.abs(rate - angular_rates(attitude, t + h / 2)).max() < within
    assert np.abs(rate - angular_rates(attitude, t)).max() > within  # the bound could fail
    assert np.degrees(np.abs(rate)).max() < 120  # turning round where a course reverses


def test_a_disturbance_has_its_spread_its_band_and_its_derivatives(rng):
    t = np.arange(0, 200_000, 0.7)
    for _ in range(5):
        w = band_limited_disturbance(2.5, 4.0, 40.0, rng)
        # Over 5000 of the longest periods a mean square of sines is theirs to a few parts in a thousand.
        assert np.sqrt(np.mean(w(t) ** 2)) == pytest.approx(2.5, rel=0.01)
        periods = 2 * np.pi / w.frequencies
        assert periods.min() >= 4.0
        assert periods.max() <= 40.0
        s, h = t[:1000], 1e-4
        _, first, second = w.with_derivatives(s)
        by_difference = (w.with_derivatives(s + h) - w.with_derivatives(s - h)) / (2 * h)
        assert np.abs(by_difference[0] - first).max() < 1e-6
        assert np.abs(by_difference[1] - second).max() < 1e-6


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
