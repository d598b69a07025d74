"""The nonlinear observer against its plain version, and against flights that are known."""

import numpy as np
import pytest

from tests.navigation import reference_observer
from tests.navigation.flights import LEVERS, NOISE, attitude, begin, fixes, fly, moved, spoil
from wildlab.geometry.frames import (
    geodetic_to_ecef,
    local_earth,
    matrix_to_euler,
    matrix_to_rotation_vector,
    normal_gravity,
    quaternion_to_matrix,
)
from wildlab.navigation.aiding import velocities
from wildlab.navigation.mekf import run_mekf
from wildlab.navigation.observer import (
    Gains,
    baseline_reference,
    course_reference,
    earth_axes,
    field_reference,
    prepare,
    run_observer,
)
from wildlab.navigation.strapdown import ImuSamples

ORIGIN = (np.radians(63.6), np.radians(9.7), 40.0)


def on_earth(flight):
    """The flight's sensors carried round by the Earth, which the flat one of the trajectory is not."""
    earth = local_earth(ORIGIN[0], ORIGIN[2])
    motion = flight.motion
    g = np.zeros_like(motion.position)
    strength = earth.gravity + earth.gradient * motion.position[:, 2]
    g[:, 2] = strength
    g[:, :2] = -(strength * earth.curvature)[:, None] * motion.position[:, :2]
    rate = np.array(earth.rate)
    force = motion.acceleration - g + 2 * np.cross(rate, motion.velocity)
    f = np.einsum("kji,kj->ki", motion.R_nb, force)
    w = flight.imu.angular_rate + np.einsum("kji,j->ki", motion.R_nb, rate)
    return flight._replace(imu=ImuSamples(flight.imu.times, f, w))


@pytest.fixture(scope="module")
def flight():
    return on_earth(fly())


def spoilt(flight, seed):
    rng = np.random.default_rng(seed)
    imu, biases = spoil(flight, rng)
    antennas = fixes(flight, rng, every=10)
    reference = baseline_reference(antennas[0].times, antennas[0].value, antennas[1].value, *LEVERS)
    return imu, begin(flight, biases, rng), antennas, reference, biases


def attitude_errors(found, motion, rows):
    R = quaternion_to_matrix(found.quaternion)
    return matrix_to_rotation_vector(np.swapaxes(R, -1, -2) @ motion.R_nb[rows])


def test_gravity_in_ecef_is_normal_gravity():
    for latitude, height in ((0.0, 0.0), (0.7, 0.0), (1.1, 500.0), (np.pi / 2, 100.0)):
        g = reference_observer.gravity_at(geodetic_to_ecef(latitude, 0.3, height))
        assert np.linalg.norm(g) == pytest.approx(normal_gravity(latitude, height), abs=2e-4)
        _, R_en = earth_axes((latitude, 0.3, height))
        assert g @ R_en[:, 2] == pytest.approx(np.linalg.norm(g), rel=1e-9)


def test_compiled_and_plain_agree(flight, theta=1.7):
    imu, start, antennas, reference, _ = spoilt(flight, 0)
    keep = (imu.times < 30) & ~((imu.times > 15) & (imu.times < 16.2))
    imu = ImuSamples(*(part[keep] for part in imu))
    t = np.arange(0.3, 29, 0.9)
    aiding = [*antennas, reference, velocities(t, moved(t)[0], 0.3, LEVERS[1])]
    # A tight bound, so that the projection has something to do.
    gains = Gains(theta=theta, bias_bound=3e-4, k_i=0.05)
    wanted = np.array([0.0, 3.3, 9.87, 14.0, 15.5, 20.0, 28.9])
    found = run_observer(imu, start, ORIGIN, aiding, wanted, gains=gains)
    ready = prepare(imu, start, ORIGIN, aiding, gains, wanted, 0.1)
    rows = reference_observer.observer(ready)
    p_e, R_en = earth_axes(ORIGIN)
    known = np.isfinite(found.position).all(axis=1)
    assert known.tolist() == [True, True, True, True, False, True, True]
    assert len(found.gaps) == 1
    # Positions in e have seven digits before the point.
    assert np.abs(found.position - (rows[:, 7:10] - p_e) @ R_en)[known].max() < 2e-7
    assert np.abs(found.velocity - rows[:, 10:13] @ R_en)[known].max() < 1e-7
    assert np.abs(found.gyro_bias - rows[:, 4:7])[known].max() < 1e-9
    R = R_en.T @ quaternion_to_matrix(rows[:, :4])
    assert np.abs(quaternion_to_matrix(found.quaternion) - R)[known].max() < 1e-9
    assert np.linalg.norm(found.gyro_bias[known], axis=1).max() > 2.5e-4


def test_two_antennas_give_the_pose(flight):
    imu, start, antennas, reference, biases = spoilt(flight, 1)
    rows = np.arange(0, len(flight.imu.times), 10)
    found = run_observer(imu, start, ORIGIN, [*antennas, reference], flight.imu.times[rows])
    late = found.times > 60
    error = np.sqrt((attitude_errors(found, flight.motion, rows)[late] ** 2).mean(axis=0))
    assert np.degrees(error).max() < 1.0
    assert np.abs(found.position - flight.motion.position[rows])[late].max() < 0.15
    assert np.abs(found.gyro_bias[-1] - biases[-1, 3:]).max() < 1.5e-3
    mekf = run_mekf(imu, start, NOISE, local_earth(ORIGIN[0], ORIGIN[2]), antennas, found.times)
    best = np.sqrt((attitude_errors(mekf, flight.motion, rows)[late] ** 2).mean(axis=0))
    assert (best < error).all()


def test_a_wrong_heading_comes_round(flight):
    """Ideal sensors and a start that is 60 deg wrong in heading: the observer has no linearisation to
    leave."""
    _, start, antennas, reference, _ = spoilt(flight, 2)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    w, x, y, z = start.state[6:10]
    turned = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
    start.state[6:10] = turned
    rows = np.array([100, 6000, 15000])
    found = run_observer(flight.imu, start, ORIGIN, [*antennas, reference], flight.imu.times[rows])
    error = np.degrees(np.linalg.norm(attitude_errors(found, flight.motion, rows), axis=1))
    assert error[0] > 20
    assert error[1] < 1.5
    assert error[2] < 1.0


def test_one_antenna_with_a_magnetometer_or_a_course(flight):
    imu, start, antennas, _, _ = spoilt(flight, 3)
    rows = np.arange(6000, 33000, 100)
    field_n = np.array([0.15, 0.01, 0.48])
    t = np.arange(0.5, 329, 0.1)
    rng = np.random.default_rng(0)
    field_b = field_n @ attitude(t) + 0.003 * rng.standard_normal((len(t), 3))
    velocity = velocities(t, moved(t)[0], 0.1)
    yaw = matrix_to_euler(flight.motion.R_nb[rows])[:, 2]
    for second in (field_reference(t, field_b, field_n), course_reference(t, moved(t)[0])):
        found = run_observer(imu, start, ORIGIN, [antennas[0], velocity, second], flight.imu.times[rows])
        off = matrix_to_euler(quaternion_to_matrix(found.quaternion))[:, 2] - yaw
        assert np.degrees(np.sqrt((np.angle(np.exp(1j * off)) ** 2).mean())) < 3.0
