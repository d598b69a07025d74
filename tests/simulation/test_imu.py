"""Inertial units: ideal ones agree with the motion, real ones have the statistics of their data sheets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.motions import restless_loiter
from wildlab.flight.files import read_toml
from wildlab.geometry.gravity import Earth
from wildlab.simulation import kernels
from wildlab.simulation.imu import (
    TriadDataSheet,
    ideal_imu,
    misaligned_triad,
    read_imu,
    read_triad,
)
from wildlab.simulation.parameters import PARTS
from wildlab.simulation.sensor_parameters import Imu
from wildlab.simulation.trajectory import Motion, angular_rates, attitude_along, specific_forces

#: A triad that does not err; each test switches one error on.
IDEAL = TriadDataSheet(
    random_walk=0.0,
    bias_stability=0.0,
    bias_time=100.0,
    turn_on_bias=0.0,
    axis_misalignment=0.0,
    package_misalignment=0.0,
    limit=np.inf,
    resolution=0.0,
)


def data_sheet(name: str) -> Imu:
    return Imu.model_validate(read_toml(PARTS / f"imu-{name}.toml", "an IMU")["imu"])


def allan_deviation(rate: np.ndarray, hertz: float, averaged: int) -> float:
    """Overlapping Allan deviation of a signal (N,) for averages over that many samples."""
    angle = np.concatenate([[0.0], np.cumsum(rate)]) / hertz
    second = angle[2 * averaged :] - 2 * angle[averaged:-averaged] + angle[: -2 * averaged]
    return float(np.sqrt(np.mean(second**2) / 2) / (averaged / hertz))


def test_ideal_readings_are_those_of_the_motion_whatever_the_chunk():
    trajectory = restless_loiter()
    count = 40_000  # three chunks
    force, rate = ideal_imu(trajectory, 250.0, count)
    t = np.arange(count) / 250
    for some in (slice(0, 50), slice(16_380, 16_390), slice(32_760, 32_780), slice(-50, None)):
        assert np.abs(force[some] - specific_forces(trajectory(t[some]))).max() < 1e-9
        # Two differences of different steps: each errs by some 1e-7 of a tenth of a radian per second.
        assert np.abs(rate[some] - angular_rates(attitude_along(trajectory), t[some])).max() < 1e-7


def test_a_body_that_nothing_pulls_feels_what_gravity_has_of_the_turning_earth():
    """Free in inertial space, seen from an n that turns: no rate, and of the force only the centrifugal part.

    An accelerometer in free fall feels nothing. What a plumb line calls gravity holds the centrifugal
    acceleration of n already; where n turns and nothing pulls, that part stays over, and the Coriolis part
    must cancel with the acceleration that n sees.
    """
    spin = np.array([0.02, -0.03, 0.05])  # rad/s, so much that every term shows
    start, drift = np.array([300.0, -200.0, -350.0]), np.array([15.0, 8.0, -4.0])
    body = Rotation.from_rotvec([0.3, -0.8, 1.1])

    def trajectory(times):
        to_n = Rotation.from_rotvec(np.outer(times, -spin))
        p = to_n.apply(start + np.outer(times, drift))
        v = to_n.apply(np.tile(drift, (len(times), 1))) - np.cross(spin, p)
        a = -2 * np.cross(spin, v) - np.cross(spin, np.cross(spin, p))
        return Motion(times, p, v, a, (to_n * body).as_matrix())

    force, rate = ideal_imu(trajectory, 250.0, 2000, Earth(0.0, 0.0, 0.0, tuple(spin)))
    motion = trajectory(np.arange(2000) / 250)
    centrifugal = -np.cross(spin, np.cross(spin, motion.position))
    assert np.linalg.norm(2 * np.cross(spin, motion.velocity), axis=1).min() > 1  # m/s^2
    assert np.abs(rate).max() < 1e-9
    assert np.abs(force - np.einsum("nji,nj->ni", motion.R_nb, centrifugal)).max() < 1e-9


@pytest.mark.parametrize("name", ["adis16490", "stim300"])
def test_standing_still_the_walks_are_those_of_the_data_sheet(name):
    """Allan deviation at 1 s, where white noise is all there is: N / sqrt(T) (IEEE 952)."""
    imu, seconds, hertz = data_sheet(name), 1000, 250
    force = np.tile([0.0, 0.0, -9.81], (seconds * hertz, 1))
    f, w = read_imu(force, np.zeros_like(force), imu, lambda n: np.random.default_rng([4, len(n)]))
    per_root_hour = 60.0  # 1/sqrt(s) -> 1/sqrt(h)
    for axis in range(3):
        walk = np.degrees(allan_deviation(w[:, axis], hertz, hertz)) * per_root_hour
        # 1000 independent seconds fix a deviation to 1/sqrt(2 * 1000) = 2.2 %, overlap to a little better.
        assert walk == pytest.approx(imu.gyro_random_walk.number, rel=0.08)
        walk = allan_deviation(f[:, axis], hertz, hertz) * per_root_hour
        assert walk == pytest.approx(imu.accelerometer_random_walk.number, rel=0.08)


@pytest.mark.parametrize("name", ["adis16490", "stim300"])
def test_the_bias_in_the_run_has_the_allan_deviation_of_its_process(name):
    """Of a Gauss-Markov process it is known in closed form (IEEE 952), and largest at 1.89 times tau."""
    imu = data_sheet(name)
    sd, tau = imu.gyro_bias_stability.si, imu.gyro_bias_time.si
    count, hertz = 400_000, 1.0  # 1333 correlation times
    quiet = IDEAL._replace(bias_stability=sd, bias_time=tau)
    bias = read_triad(np.zeros((count, 3)), hertz, quiet, np.random.default_rng(8))
    averaged = round(1.89 * tau)
    x = averaged / hertz / tau
    expected = sd * np.sqrt(2 / x * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x)))
    assert expected == pytest.approx(0.617 * sd, rel=0.01)
    for axis in range(3):
        # About 700 independent averages of that length: 1/sqrt(2 * 350) = 4 %.
        assert allan_deviation(bias[:, axis], hertz, averaged) == pytest.approx(expected, rel=0.15)


def test_the_turn_on_bias_is_drawn_once_per_flight():
    still = np.zeros((10, 3))
    runs = np.array(
        [
            read_triad(still, 250.0, IDEAL._replace(turn_on_bias=0.3), np.random.default_rng(seed))
            for seed in range(2000)
        ]
    )
    assert np.ptp(runs, axis=1).max() == 0
    assert runs[:, 0].std(axis=0) == pytest.approx([0.3] * 3, rel=5 / np.sqrt(2 * 2000))
    assert runs[:, 0].mean(axis=0) == pytest.approx([0] * 3, abs=5 * 0.3 / np.sqrt(2000))
    # Each axis has a bias of its own.
    assert np.corrcoef(runs[:, 0].T)[np.triu_indices(3, 1)] == pytest.approx([0] * 3, abs=5 / np.sqrt(2000))


def test_misaligned_axes_stay_within_the_stated_angles():
    rng = np.random.default_rng(3)
    axis, package = np.radians([0.05, 0.25])
    between, turned = [], []
    for _ in range(3000):
        lean = misaligned_triad(axis, 0.0, rng)
        assert np.linalg.norm(lean, axis=1) == pytest.approx(1.0, abs=1e-12)
        between.append(lean[~np.eye(3, dtype=bool)])
        whole = misaligned_triad(0.0, package, rng)
        assert np.allclose(whole @ whole.T, np.eye(3), atol=1e-12)
        turned.append(Rotation.from_matrix(whole.T).as_rotvec())
    for angles, limit in ((np.array(between), axis), (np.array(turned), package)):
        assert 0.99 * limit < np.abs(angles).max() < 1.0001 * limit
        # Even draws have the SD limit / sqrt(3).
        assert angles.std() == pytest.approx(limit / np.sqrt(3), rel=0.03)


def test_each_axis_reads_along_its_own_direction():
    """Of a unit whose x axis leans towards y alone, only x reads a vector along y."""
    axes = np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    reading = np.zeros((1, 3))
    no_limits = np.array([np.inf, 0.0])
    kernels.read_triad(
        np.array([[0.0, 2.0, 0.0]]), axes, np.zeros(3), np.zeros((1, 3)), reading, 0.0, no_limits
    )
    assert reading[0] == pytest.approx([0.2, 2.0, 0.0])


def test_range_and_resolution_bound_the_reading():
    true = np.array([[0.2512, -3.0, 0.0], [1e9, -1e9, 0.2549]])
    sheet = IDEAL._replace(limit=2.0, resolution=0.01)
    reading = read_triad(true, 250.0, sheet, np.random.default_rng(0))
    assert reading == pytest.approx(np.array([[0.25, -2.0, 0.0], [2.0, -2.0, 0.25]]))


def test_gyros_and_accelerometers_err_apart():
    asked = []

    def stream(name):
        asked.append(name)
        return np.random.default_rng(len(asked))

    read_imu(np.zeros((5, 3)), np.zeros((5, 3)), data_sheet("adis16490"), stream)
    assert sorted(asked) == ["accelerometers", "gyros"]


@pytest.mark.parametrize(("what", "rigid"), [("package_misalignment", True), ("axis_misalignment", False)])
def test_a_misaligned_unit_reads_another_direction(what, rigid):
    """Gravity seen by a turned package keeps its length; axes that lean read a share of their neighbours."""
    g, limit, rng = 9.81, np.radians(0.25), np.random.default_rng(0)
    sheet, plumb = IDEAL._replace(**{what: limit}), np.array([[0.0, 0.0, g]])
    reading = np.array([read_triad(plumb, 250.0, sheet, rng)[0] for _ in range(300)])
    assert (np.ptp(np.linalg.norm(reading, axis=1)) < 1e-12) == rigid
    # x and y each read g times an angle between the limits; along its own direction an axis loses less.
    assert 0.9 * g * limit < np.abs(reading[:, :2]).max() < 1.001 * g * limit
    assert np.ptp(reading[:, 2]) < g * limit**2
