"""Dead reckoning against motion known in closed form, and against the physics of the Earth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import (
    EARTH_RATE,
    flat_earth,
    local_earth,
    matrix_to_quaternion,
    normal_gravity,
    quaternion_to_matrix,
)
from wildlab.navigation.strapdown import ImuSamples, integrate_strapdown
from wildlab.simulation.courses import loiter_path
from wildlab.simulation.trajectory import (
    angular_rates,
    attitude_along,
    fixed_wing_trajectory,
    specific_forces,
)


def flown(times):
    """A loiter in wind, and what ideal sensors measure on it."""
    path = loiter_path((50.0, -20.0), 120.0, 200.0, 18.0, wind=(4.0, -2.0))
    trajectory = fixed_wing_trajectory(path, wind=(4.0, -2.0, 0.0), trim_pitch=0.05)
    motion = trajectory(times)
    return motion, ImuSamples(
        times, specific_forces(motion), angular_rates(attitude_along(trajectory), times)
    )


def reckon(motion, imu, **options):
    start = motion.position[0], motion.velocity[0], matrix_to_quaternion(motion.R_nb[0])
    return integrate_strapdown(imu, *start, flat_earth(), **options)


def angle_between(q, R):
    return Rotation.from_matrix(np.swapaxes(R, -1, -2) @ quaternion_to_matrix(q)).magnitude()


def test_ideal_sensors_give_the_motion_back():
    times = np.arange(0, 120, 0.004)
    motion, imu = flown(times)
    found = reckon(motion, imu)
    assert np.linalg.norm(found.position - motion.position, axis=1).max() < 1e-3
    assert np.linalg.norm(found.velocity - motion.velocity, axis=1).max() < 1e-4
    assert angle_between(found.quaternion, motion.R_nb).max() < 1e-6
    assert found.gaps == []


def test_the_error_falls_with_the_square_of_the_step():
    errors = []
    for step in (0.04, 0.02, 0.01):
        motion, imu = flown(np.arange(0, 20, step))
        errors.append(np.abs(reckon(motion, imu).position[-1] - motion.position[-1]).max())
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


def test_a_gap_is_said_and_not_integrated():
    times = np.concatenate([np.arange(0, 10, 0.01), np.arange(12, 20, 0.01)])
    motion, imu = flown(times)
    found = reckon(motion, imu, max_gap=0.5)
    assert [(gap.start, gap.end) for gap in found.gaps] == [(pytest.approx(9.99), 12.0)]
    assert np.isfinite(found.position[times < 11]).all()
    assert np.isnan(found.position[times > 11]).all()
    assert np.isfinite(reckon(motion, imu, max_gap=3.0).position).all()


def test_at_rest_on_the_turning_earth():
    """What stands on the ground measures the Earth's rate and its gravity, and goes nowhere."""
    earth = local_earth(np.radians(63.6), 40.0)
    q = matrix_to_quaternion(Rotation.from_euler("ZYX", [1.0, 0.1, -0.2]).as_matrix())
    R = quaternion_to_matrix(q)
    times = np.arange(0, 600, 0.02)
    still = np.ones((len(times), 1))
    imu = ImuSamples(times, still * (R.T @ [0, 0, -earth.gravity]), still * (R.T @ np.array(earth.rate)))
    found = integrate_strapdown(imu, np.zeros(3), np.zeros(3), q, earth)
    assert np.abs(found.position).max() < 2e-3
    assert angle_between(found.quaternion[-1:], R[None]).max() < 1e-9
    # Without the Earth's rate the same measurements turn the airframe by 15 deg an hour.
    turned = integrate_strapdown(imu, np.zeros(3), np.zeros(3), q, flat_earth(earth.gravity))
    assert angle_between(turned.quaternion[-1:], R[None])[0] == pytest.approx(
        EARTH_RATE * times[-1], rel=1e-6
    )


def test_a_falling_body_is_pushed_east():
    """Coriolis: after t seconds of free fall, by (1/3) rate g t^3 cos(latitude)."""
    latitude = np.radians(45.0)
    earth = local_earth(latitude)
    times = np.linspace(0, 10, 5001)
    turning = np.ones((len(times), 1)) * np.array(earth.rate)
    found = integrate_strapdown(
        ImuSamples(times, np.zeros((len(times), 3)), turning), np.zeros(3), np.zeros(3), [1, 0, 0, 0], earth
    )
    east = EARTH_RATE * earth.gravity * times[-1] ** 3 * np.cos(latitude) / 3
    assert found.position[-1, 1] == pytest.approx(east, rel=1e-3)
    assert found.position[-1, 2] == pytest.approx(earth.gravity * 50, rel=1e-4)


def test_normal_gravity_at_known_places():
    """WGS84's own values at the equator and the pole, and the free-air gradient."""
    assert normal_gravity(0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(np.pi / 2) == pytest.approx(9.8321849379, abs=1e-9)
    assert normal_gravity(np.pi / 4) == pytest.approx(9.8061977, abs=1e-6)
    assert (normal_gravity(0.8) - normal_gravity(0.8, 1000.0)) / 1000 == pytest.approx(3.085e-6, rel=1e-3)
    assert local_earth(0.8).gradient == pytest.approx(3.085e-6, rel=2e-3)


def test_the_plumb_line_leans_with_the_distance():
    """A kilometre north, the direction of gravity differs by a kilometre over the Earth's radius."""
    earth = local_earth(0.9)
    times = np.linspace(0, 1, 101)
    nothing = np.zeros((101, 3))
    turning = nothing + np.array(earth.rate)
    found = integrate_strapdown(
        ImuSamples(times, nothing, turning), [1000.0, 0, 0], np.zeros(3), [1, 0, 0, 0], earth
    )
    # The Coriolis force on the fall itself has no northward part to first order.
    assert found.velocity[-1, 0] == pytest.approx(-earth.gravity * 1000 / 6371e3, rel=0.02)


def test_rows_with_nan_are_missing_samples():
    times = np.arange(0, 4, 0.01)
    motion, imu = flown(times)
    imu.angular_rate[100:250, 1] = np.nan
    assert len(reckon(motion, imu, max_gap=0.5).gaps) == 1
