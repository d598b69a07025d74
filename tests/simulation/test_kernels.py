"""The compiled functions against the same in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.simulation import plain_kernels as plain
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion
from wildlab.geometry.gravity import Earth
from wildlab.simulation import kernels
from wildlab.simulation.courses import _polynomials, _smoothed, _times_of_angles
from wildlab.simulation.trajectory import Disturbance

COUNT = 300
SEEDS = st.integers(0, 2**32 - 1)


def rows(rng: np.random.Generator, count: int = COUNT) -> np.ndarray:
    return rng.normal(size=(count, 3))


def attitudes(rng: np.random.Generator, count: int = COUNT) -> np.ndarray:
    return Rotation.random(count, rng=rng).as_matrix()


def same(found: np.ndarray, expected: np.ndarray, within: float = 1e-12) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=within)


def signal(seed: int) -> Disturbance:
    rng = np.random.default_rng(seed)
    return Disturbance(rng.normal(size=16), rng.uniform(0.01, 4.0, 16), rng.uniform(0, 2 * np.pi, 16))


@settings(deadline=None)
@given(seed=SEEDS, start=st.floats(0, 5000), step=st.floats(1e-4, 1.0), count=st.integers(0, 400))
def test_in_equal_steps_a_sum_of_sines_is_the_plain_sum(seed, start, step, count):
    some, times = signal(seed), start + step * np.arange(count)
    expected = plain.sum_of_sines(times, some.amplitudes, some.frequencies, some.phases)
    together = some.with_derivatives(times)
    for derivative in range(3):
        # A rounding of the times, 5e-13 s, is multiplied by up to 4 rad/s with every derivative.
        within = 1e-9 * 4**derivative
        same(together[derivative], expected[derivative], within)
        same(some(times, derivative), expected[derivative], within)


@settings(deadline=None)
@given(seed=SEEDS, count=st.integers(0, 200))
def test_at_any_times_a_sum_of_sines_is_the_plain_sum(seed, count):
    some = signal(seed)
    times = np.random.default_rng(seed).uniform(-100, 3000, count)
    expected = plain.sum_of_sines(times, some.amplitudes, some.frequencies, some.phases)
    same(some.with_derivatives(times), expected, 1e-10)
    same(some(times), expected[0], 1e-10)


@pytest.mark.parametrize("off", [1e-9, 1e-3])
def test_times_a_little_off_equal_steps_are_noticed(off):
    some, rng = signal(1), np.random.default_rng(1)
    times = np.concatenate([np.arange(100) * 0.1, 9.9 + np.arange(1, 200) * 0.004, [11.0, 400.0]])
    for uneven in (times, 0.004 * np.arange(COUNT) + off * rng.random(COUNT)):
        expected = plain.sum_of_sines(uneven, some.amplitudes, some.frequencies, some.phases)
        same(some.with_derivatives(uneven), expected, 1e-10)


def test_the_polynomials_of_a_spline_are_the_spline_and_nan_outside(rng):
    interval = 0.95
    spline = _smoothed(interval * (np.arange(120) - 24.0), 100 * rng.normal(size=(120, 3)), interval)
    start, coefficients = _polynomials(spline)
    end = start + interval * len(coefficients)
    times = np.concatenate([np.linspace(start, end, 2000, endpoint=False), [start - 0.1, end + 0.1, np.nan]])
    found = [np.empty((2003, 3)) for _ in range(3)]
    kernels.piecewise_polynomial(times, start, interval, coefficients, *found)
    for derivative, part in enumerate(found):
        assert np.isfinite(part[:2000]).all() and np.isnan(part[2000:]).all()
        same(part[:2000], spline.derivative(derivative)(times[:2000]), 1e-9)


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("wind", [(0.0, 0.0), (4.0, -3.0), (9.0, 12.0), (11.0, 15.0)])
def test_angles_on_a_circle_solve_the_same_equation(sense, wind, rng):
    circle = (160.0, 19.5, *wind, sense, 0.4)
    series = _times_of_angles(circle)
    for times in (np.arange(-4, 400) / 250, np.arange(COUNT) / 7.5, 1000 * rng.random(COUNT)):
        found = np.empty(len(times))
        kernels.angles_on_circle(times, circle, *series, found)
        same(found, plain.angles_on_circle(times, circle, *series), 1e-11)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_motion_on_a_circle_is_that_of_its_angle(sense, rng):
    circle = (160.0, 19.5, 4.0, -3.0, sense, 0.4)
    angles, off = rng.uniform(-10, 10, COUNT), rng.normal(size=(3, COUNT))
    found = [np.zeros((COUNT, 3)) for _ in range(3)]
    kernels.circle_motion(angles, circle, off, *found)
    for part, expected in zip(found, plain.circle_motion(angles, circle, off), strict=True):
        same(part[:, :2], expected)


def test_coordinated_attitudes_are_the_plain_ones(rng):
    velocity, acceleration, wind = 20 + rows(rng), rows(rng), np.array([4.0, -3.0, 0.5])
    found = np.empty((COUNT, 3, 3))
    kernels.coordinated_attitude(velocity, acceleration, wind, 0.1, 9.8, found)
    same(found, plain.coordinated_attitude(velocity, acceleration, wind, 0.1, 9.8))


def test_turned_attitudes_are_the_plain_ones(rng):
    R, angles, found = attitudes(rng), rng.uniform(-1.5, 1.5, (3, COUNT)), np.empty((COUNT, 3, 3))
    kernels.turn(R, *angles, found)
    same(found, R @ euler_to_matrix(*angles))


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.7])
def test_rates_are_the_plain_ones(size, rng):
    """Attitudes that turn by up to ``size`` rad from one to the next."""
    R = [attitudes(rng)]
    for _ in range(3):
        R.append(R[-1] @ Rotation.from_rotvec(size * rng.uniform(-1, 1, (COUNT, 3))).as_matrix())
    found = np.empty((COUNT, 3))
    kernels.body_rates(*R, 0.5, found)
    same(found, plain.body_rates(*R, 0.5))


def test_what_is_felt_on_earth_is_the_plain_sum(rng):
    R, p, v, a, rate = attitudes(rng), 1000 * rows(rng), 20 * rows(rng), rows(rng), rows(rng)
    # Larger than those of the Earth, so that every term shows.
    earth = Earth(9.8, 1e-3, 1e-3, (0.1, -0.2, 0.3))
    force, found = np.empty((COUNT, 3)), rate.copy()
    kernels.felt_on_earth(R, p, v, a, earth.as_array(), force, found)
    expected = plain.felt_on_earth(R, p, v, a, earth, rate)
    same(force, expected[0], 1e-11)
    same(found, expected[1])


def test_quaternions_are_those_of_geometry(rng):
    axes = Rotation.from_rotvec(np.pi * np.eye(3)[[0, 1, 2, 0]] * [[1.0], [1.0], [1.0], [0.999]])
    nearly = Rotation.from_rotvec(rng.choice([-3.1, 3.1, 1e-9], (COUNT, 3)))
    R = np.concatenate([attitudes(rng), axes.as_matrix(), nearly.as_matrix(), [np.eye(3)]])
    found = np.empty((len(R), 4))
    kernels.quaternions(R, found)
    assert (found[:, 0] >= 0).all()
    # Of a half turn q and -q are the same, and rounding says which.
    expected = matrix_to_quaternion(R)
    sign = np.where(found[:, :1] < 1e-12, np.sign(np.sum(found * expected, axis=1, keepdims=True)), 1.0)
    same(sign * found, expected)


def test_gauss_markov_errors_are_those_of_a_linear_filter(rng):
    draws, sd, kept = rows(rng), np.array([1.0, 2.0, 0.0]), np.array([0.9, 0.0, 0.5])
    found = draws.copy()
    kernels.gauss_markov(found, sd, kept)
    same(found, plain.gauss_markov(draws, sd, kept))
    assert np.array_equal(found[0], draws[0] * sd)


@pytest.mark.parametrize("limits", [(np.inf, 0.0), (2.5, 0.0), (np.inf, 0.01), (2.5, 0.01)])
def test_readings_of_a_triad_are_the_plain_ones(limits, rng):
    true, axes, turn_on = rows(rng), np.eye(3) + 0.1 * rng.normal(size=(3, 3)), rng.normal(size=3)
    drift, noise = 0.1 * rows(rng), rows(rng)
    found = noise.copy()
    kernels.read_triad(true, axes, turn_on, drift, found, 0.7, np.array(limits))
    same(found, plain.read_triad(true, axes, turn_on, drift, noise, 0.7, np.array(limits)))
    assert np.abs(found).max() <= limits[0]
