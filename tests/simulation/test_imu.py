"""Inertial units: ideal ones agree with the motion, real ones have the statistics of their data sheets."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.motions import restless_loiter
from tests.simulation.test_twins import with_values
from wildlab.flight.files import read_toml
from wildlab.geometry.frames import EARTH_RATE, Earth, normal_gravity
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.onboard_sensors import (
    TriadDataSheet,
    as_mounted,
    ideal_imu,
    imu_table,
    misaligned_triad,
    mounted_imu,
    payload_boresight,
    read_imu,
    read_triad,
)
from wildlab.simulation.parameters import PARTS, Group, TwinParameters, load_twin
from wildlab.simulation.trajectory import Motion, angular_rates, attitude_along, specific_forces, turned
from wildlab.simulation.twins import simulate

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


def data_sheet(name: str) -> Group:
    model = get_args(TwinParameters.model_fields["imu"].annotation)[0]
    return model.model_validate(read_toml(PARTS / f"imu-{name}.toml", "an IMU")["imu"])


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


def test_misaligned_axes_stay_within_the_stated_angles(rng):
    axis, package = np.radians([0.05, 0.25])
    between, turned = [], []
    for _ in range(1000):
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


def test_range_and_resolution_bound_the_reading():
    true = np.array([[0.2512, -3.0, 0.0], [1e9, -1e9, 0.2549]])
    sheet = IDEAL._replace(limit=2.0, resolution=0.01)
    reading = read_triad(true, 250.0, sheet, np.random.default_rng(0))
    assert reading == pytest.approx(np.array([[0.25, -2.0, 0.0], [2.0, -2.0, 0.25]]))


FORCE, RATE = [f"f_{axis}_m_s2" for axis in "xyz"], [f"w_{axis}_rad_s" for axis in "xyz"]
#: Figures of a data sheet that make an inertial unit err.
ERRORS = [
    f"{triad}_{figure}"
    for triad in ("accelerometer", "gyro")
    for figure in ("random_walk", "bias_stability", "turn_on_bias", "resolution")
] + ["axis_misalignment", "package_misalignment"]


@pytest.fixture(scope="module")
def exact() -> TwinParameters:
    """Twenty seconds of a flight whose inertial unit does not err."""
    errors = {f"imu__{name}": 0.0 for name in ERRORS}
    return with_values(load_twin("static-antenna"), flight__duration=20.0, **errors)


def test_a_unit_without_errors_feels_the_payload_move_on_the_turning_earth(exact):
    """Against the motion, the Earth's rate and gravity by their own formulas (WGS84)."""
    seed = 4
    airframe, boresight = twin_trajectory(exact, np.random.default_rng(0)), payload_boresight(exact, seed)

    def payload(times):
        return turned(airframe(times), boresight)

    table = imu_table(exact, payload, seed)
    motion = payload(table["time_s"].to_numpy())
    R = motion.R_nb
    latitude, height = np.radians(exact.place.latitude.number), exact.place.height.number
    assert 60 < np.degrees(latitude) < 65
    spin = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    rate = np.einsum("nij,nj->ni", R, table[RATE].to_numpy())
    against_n = np.einsum("nij,nj->ni", R, angular_rates(attitude_along(payload), motion.times))
    assert np.abs(rate - against_n - spin).max() < 1e-7
    force = np.einsum("nij,nj->ni", R, table[FORCE].to_numpy())
    pull = motion.acceleration + 2 * np.cross(spin, motion.velocity) - force
    assert pull[:, 2] == pytest.approx(normal_gravity(latitude, height - motion.position[:, 2]), abs=2e-6)
    # The plumb line leans towards where n's origin is below: by the distance over the Earth's radius.
    assert pull[:, :2] == pytest.approx(-9.82 / 6371e3 * motion.position[:, :2], abs=1e-6)
    # On the airframe itself, which the payload turns against, it would feel something else.
    assert np.abs(against_n - np.einsum(
        "nij,nj->ni", airframe(motion.times).R_nb, angular_rates(attitude_along(airframe), motion.times)
    )).max() > 1e-4  # fmt: skip


def test_a_flight_has_the_readings_of_the_unit_on_the_payload(exact):
    """Its attitude at the end is the one at the start carried on by its gyros, less the Earth's turning."""
    short = with_values(exact, camera__images=100, camera__recording_start=1.0, target__observations=0)
    flight = simulate(short, 4)
    imu = flight.table("imu")
    w, t = imu[RATE].to_numpy(), imu["time_s"].to_numpy()
    steps = Rotation.from_rotvec((w[1:] + w[:-1]) / 2 * np.diff(t)[:, None])
    truth = flight.nav["truth-payload"]
    q = truth[["q_w", "q_x", "q_y", "q_z"]].to_numpy()
    first, last = Rotation.from_quat(q[[0, -1]], scalar_first=True)
    turn = Rotation.identity()
    for step in steps:
        turn = turn * step
    latitude = np.radians(exact.place.latitude.number)
    spin = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    carried = Rotation.from_rotvec(-spin * (t[-1] - t[0])) * first * turn
    assert truth["time_s"].iloc[[0, -1]].to_numpy() == pytest.approx([t[0], t[-1]])
    assert (carried.inv() * last).magnitude() < 2e-5
    assert np.linalg.norm(spin * 20) > 1e-3, "the Earth's turning shows"


def test_the_unit_feels_and_errs_in_its_own_axes_and_is_then_calibrated(exact):
    """Steps of a coarse resolution lie along the axes of the unit, as it is mounted, and not along b."""
    airframe = twin_trajectory(exact, np.random.default_rng(0))
    coarse = with_values(exact, imu__accelerometer_resolution=50.0, imu__gyro_resolution=0.5)
    fine, rough = imu_table(exact, airframe, 4), imu_table(coarse, airframe, 4)
    R_bi, unit = mounted_imu(exact), coarse.imu
    assert R_bi is not None and unit is not None
    expected = Rotation.from_euler("ZYX", [0.25, -5.7, 1.1], degrees=True).as_matrix()
    assert R_bi == pytest.approx(expected, abs=1e-12)
    own = as_mounted(rough, R_bi)
    sizes = unit.accelerometer_resolution.si, unit.gyro_resolution.si
    for columns, step in zip((FORCE, RATE), sizes, strict=True):
        steps = own[columns].to_numpy() / step
        assert steps == pytest.approx(np.round(steps), abs=1e-8)
        calibrated = rough[columns].to_numpy()
        assert calibrated == pytest.approx(fine[columns].to_numpy(), abs=step)
        assert np.abs(calibrated / step - np.round(calibrated / step)).max() > 0.1
        # What the unit gives is the vector of b in its own axes.
        assert as_mounted(fine, R_bi)[columns].to_numpy() == pytest.approx(
            fine[columns].to_numpy() @ expected
        )
    pd.testing.assert_series_equal(own["time_s"], rough["time_s"])
