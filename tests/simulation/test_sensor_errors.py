"""Errors of clocks, receivers and of a camera that sways have the statistics they are documented with."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.simulation.motions import restless_loiter
from tests.simulation.test_twins import with_values
from wildlab.geometry.frames import matrix_to_rotation_vector
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.error_models import (
    computer_stamps,
    gauss_markov,
    stream,
    with_attitude_error,
)
from wildlab.simulation.onboard_sensors import antenna_motion, position_fixes
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.trajectory import (
    angular_rates,
    attitude_along,
    camera_motion,
    camera_sway,
    recent_change,
)
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate


def test_gauss_markov_has_its_variance_and_autocorrelation_from_the_first_sample_on():
    runs, step, tau, sd = 40_000, 0.1, 3.0, 2.0
    x = gauss_markov(61, step, np.full(runs, sd), tau, np.random.default_rng(11))
    # 40 000 independent runs: a variance is known to sqrt(2/N) = 0.7 %, a product to about the same.
    tolerance = 5 * np.sqrt(2.0 / runs) * sd**2
    for sample in (0, 1, 30, 60):
        assert np.mean(x[sample] ** 2) == pytest.approx(sd**2, abs=tolerance)
        assert np.mean(x[sample]) == pytest.approx(0.0, abs=5 * sd / np.sqrt(runs))
    for first, lag in ((0, 1), (0, 10), (0, 30), (20, 30), (0, 60)):
        expected = sd**2 * np.exp(-lag * step / tau)
        assert np.mean(x[first] * x[first + lag]) == pytest.approx(expected, abs=tolerance)


def test_a_new_sensor_changes_nobody_elses_noise():
    a, again, other, next_seed = (
        stream(seed, name).standard_normal(50)
        for seed, name in ((1, "gyro"), (1, "gyro"), (1, "clock"), (2, "gyro"))
    )
    assert np.array_equal(a, again)
    assert not np.isin(a, other).any()
    assert not np.isin(a, next_seed).any()


def test_reported_attitude_and_error_give_back_the_truth(rng):
    true = Rotation.random(20, rng=rng).as_matrix()
    error = 0.05 * rng.standard_normal((20, 3))
    reported = with_attitude_error(true, error)
    assert np.allclose(reported @ Rotation.from_rotvec(error).as_matrix(), true, atol=1e-14)
    assert not np.allclose(reported, true, atol=1e-3)


def test_stamps_of_an_idle_computer_are_the_clocks():
    t = 100 + np.arange(100) / 7.5
    stamps = computer_stamps(t, -0.3, 1e-4, 0.0, np.random.default_rng(0))
    assert stamps == pytest.approx(t - 0.3 + 1e-4 * (t - 100), abs=1e-12)


def test_stamps_never_overtake_and_are_late_by_the_mean_latency():
    rare = np.arange(20_000) * 10.0  # so far apart that none waits for another
    late = computer_stamps(rare, 0.0, 0.0, 0.05, np.random.default_rng(1)) - rare
    assert late.min() >= 0
    assert late.mean() == pytest.approx(0.05, abs=5 * 0.05 / np.sqrt(20_000))
    assert late.std() == pytest.approx(0.05, rel=0.06)
    dense = np.arange(20_000) / 100
    assert np.diff(computer_stamps(dense, 0.0, 0.0, 0.05, np.random.default_rng(1))).min() >= 1e-3 - 1e-9
    assert len(computer_stamps([], 0.0, 0.0, 0.05, np.random.default_rng(1))) == 0


ARM = np.array([0.5, -0.2, -0.1])


def test_an_antennas_velocity_is_the_derivative_of_its_position():
    trajectory = restless_loiter()
    t, h = np.linspace(5, 500, 400), 1e-3

    def position(times):
        return antenna_motion(trajectory(times), angular_rates(attitude_along(trajectory), times), ARM)[0]

    motion = trajectory(t)
    p, v = antenna_motion(motion, angular_rates(attitude_along(trajectory), t), ARM)
    assert np.linalg.norm(p - motion.position, axis=1) == pytest.approx(np.linalg.norm(ARM), abs=1e-12)
    assert np.abs(v - motion.velocity).max() > 0.05  # the arm matters
    # Truncation: h^2/6 times the third derivative, 2 m/s^3 of the path and the arm times 3 rad/s^3.
    assert np.abs((position(t + h) - position(t - h)) / (2 * h) - v).max() < 2e-6


def test_fixes_scatter_about_the_truth_as_stated(rng):
    runs, count = 300, 200
    true = np.tile([10.0, 20.0, -300.0], (count, 1))
    sizes = {
        "horizontal_correlated_sd": 2.0, "vertical_correlated_sd": 3.0, "correlation_time": 25.0,
        "horizontal_noise": 0.5, "vertical_noise": 1.0, "rate": 2.0, "resolution": 0.0,
    }  # fmt: skip
    receiver = with_values(load_twin("static-antenna"), **{f"gnss__{k}": v for k, v in sizes.items()}).gnss
    off = np.array([position_fixes(true, receiver, rng) for _ in range(runs)]) - true
    variance = np.array([2.0**2 + 0.5**2] * 2 + [3.0**2 + 1.0**2])
    # 100 s hold two independent errors of the correlated kind (100 / 2 tau).
    assert (off**2).mean(axis=(0, 1)) == pytest.approx(variance, rel=5 * np.sqrt(2 / (2 * runs)))
    lag = 10  # 5 s
    together = (off[:, :-lag] * off[:, lag:]).mean(axis=(0, 1))
    expected = np.array([4.0, 4.0, 9.0]) * np.exp(-5 / 25)
    assert together == pytest.approx(expected, rel=5 * np.sqrt(2 / (2 * runs)))
    step = np.diff(off, axis=1).var(axis=(0, 1))
    jump = 2 * np.array([0.25, 0.25, 1.0]) + 2 * np.array([4.0, 4.0, 9.0]) * (1 - np.exp(-0.5 / 25))
    assert step == pytest.approx(jump, rel=0.03)


STEP, MEMORY = 0.01, 10.0


def test_the_change_is_the_weighted_standard_deviation():
    x = np.random.default_rng(1).normal(2.0, 1.0, 400).cumsum()
    weight = np.exp(-STEP / MEMORY) ** np.arange(399, -1, -1) * (1 - np.exp(-STEP / MEMORY))
    weight[0] += 1 - weight.sum()  # before, it stood where it begins
    expected = np.sqrt(weight @ x**2 - (weight @ x) ** 2)
    assert recent_change(x, STEP, MEMORY)[-1] == pytest.approx(expected, rel=1e-9)


def test_each_axis_errs_by_its_share_of_the_change():
    """Over 40 flights, each with hundreds of independent errors: the sines have periods of 1 to 15 s."""
    twin = load_twin("slow-vessel-eight")
    share = twin.camera_sway.share.number
    trajectory = twin_trajectory(twin, stream(3, "trajectory"))
    times = np.arange(120.0, 880.0, 0.5)
    grid = np.arange(0.0, 880.0, 0.1)
    R = trajectory(grid).R_nb
    bank = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    size = np.interp(times, grid, recent_change(bank, 0.1, twin.camera_sway.memory.number))
    angles = np.array([camera_sway(twin, trajectory, seed)(times) for seed in range(40)])
    in_units = angles / (share * size[:, None])
    assert np.sqrt((in_units**2).mean(axis=(0, 1))) == pytest.approx([1.0] * 3, rel=0.03)
    # Axes do not know of each other.
    together = np.corrcoef(in_units.reshape(-1, 3).T)
    assert np.abs(together - np.eye(3)).max() < 0.05


def test_the_camera_is_turned_by_those_angles_and_stays_in_its_place():
    twin = load_twin("slow-vessel-eight")
    trajectory = twin_trajectory(twin, stream(3, "trajectory"))
    times = np.arange(120.0, 300.0, 0.5)
    airframe, camera = trajectory(times), camera_motion(twin, trajectory, times, 3)
    turn = matrix_to_rotation_vector(np.swapaxes(airframe.R_nb, 1, 2) @ camera.R_nb)
    assert turn == pytest.approx(camera_sway(twin, trajectory, 3)(times), abs=2e-3)  # small angles
    assert (airframe.position == camera.position).all()
    assert np.abs(turn).max() > np.radians(1.0)


def test_no_navigation_system_feels_the_camera_sway():
    twin = load_twin("slow-vessel-eight")
    calm, restless = (
        simulate(with_values(twin, camera_sway__share=share), 5, without=OPTIONAL_TABLES)
        for share in (0.0, 0.2)
    )
    for name, table in calm.nav.items():
        pd.testing.assert_frame_equal(table, restless.nav[name], check_exact=True)
    pd.testing.assert_frame_equal(calm.truth, restless.truth, check_exact=True)
    assert calm.manifest == restless.manifest
    both = calm.detections.merge(restless.detections, on="frame_id")
    moved = np.hypot(both["u_px_x"] - both["u_px_y"], both["v_px_x"] - both["v_px_y"])
    assert moved.median() > 5.0
