"""A motion must not contradict itself: stated derivatives against differences and dead reckoning."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.motions import WIND, flown, restless_laps, restless_loiter
from wildlab.geometry.frames import matrix_to_euler
from wildlab.simulation.attitudes import coordinated_attitude, fixed_wing_trajectory
from wildlab.simulation.disturbances import band_limited_disturbance
from wildlab.simulation.loiter import loiter_path
from wildlab.simulation.trajectory import Motion, angular_rates, attitude_along, specific_forces


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


def test_a_disturbance_has_its_spread_its_band_and_its_derivatives():
    rng = np.random.default_rng(3)
    t = np.arange(0, 200_000, 0.7)
    for _ in range(5):
        w = band_limited_disturbance(2.5, 4.0, 40.0, rng)
        # Over 5000 of the longest periods a mean square of sines is theirs to a few parts in a thousand.
        assert np.sqrt(np.mean(w(t) ** 2)) == pytest.approx(2.5, rel=0.01)
        periods = 2 * np.pi / w.frequencies
        assert periods.min() >= 4.0
        assert periods.max() <= 40.0
        s, h = t[:1000], 1e-4
        assert np.abs((w(s + h) - w(s - h)) / (2 * h) - w(s, 1)).max() < 1e-6
        assert np.abs((w(s + h, 1) - w(s - h, 1)) / (2 * h) - w(s, 2)).max() < 1e-6


def test_a_circle_that_cannot_be_flown_is_refused():
    with pytest.raises(ValueError, match="exceed the wind"):
        loiter_path((0.0, 0.0), 100.0, 300.0, 10.0, wind=(8.0, 8.0))
    with pytest.raises(ValueError, match="radius"):
        loiter_path((0.0, 0.0), 0.0, 300.0, 10.0)
