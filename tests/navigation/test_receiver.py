"""Receiver noise found from innovations: its process, its likelihood, and flights of known noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from tests.navigation.flights import NOISE, begin, fly, spoil
from tests.navigation.test_mekf import EARTH
from wildlab.evaluation.consistency import autocorrelation
from wildlab.geometry.frames import matrix_to_rotation_vector, quaternion_to_matrix
from wildlab.navigation import kernels
from wildlab.navigation.aiding import GaussMarkov, gather, positions, set_out, velocities
from wildlab.navigation.mekf import run_mekf
from wildlab.navigation.receiver import ReceiverNoise, Scale, choose, gaussian_log_likelihood, maximise, tell
from wildlab.simulation.error_models import gauss_markov

#: What the filter is told at first, level and vertical: of positions, m, and velocities, m/s.
STATED = np.array([2.0, 3.0]), np.array([0.3, 0.5])


def generator(process: np.ndarray) -> np.ndarray:
    """d/dt of the states, (m, m), from what a process says of them."""
    A = np.diag(-1 / process[:, 1])
    for i in np.flatnonzero(process[:, 2] > 0):
        A[i, i + int(process[i, 2])] = 1.0
    return A


@pytest.mark.parametrize("rate_time", [0.0, 0.7, 15.0, 40.0])
def test_a_gauss_markov_error_keeps_its_covariance(rate_time):
    """What decays is what its noise puts back: ``A C + C A' + Q = 0``."""
    error = GaussMarkov(np.array([0.5, 1.0, 2.0]), 15.0, rate_time)
    process, C = error.process(), error.covariance()
    A, Q = generator(process), np.diag(process[:, 0] ** 2)
    assert np.allclose(A @ C + C @ A.T + Q, 0, atol=1e-12)
    assert np.allclose(np.diagonal(C)[:3], error.sd**2)
    assert error.order == (1 if rate_time == 0 else 2)


@pytest.mark.parametrize("dt", [1e-3, 0.02, 1.0, 30.0])
@pytest.mark.parametrize("rate_time", [0.0, 0.7, 15.0])
def test_a_step_of_the_compiled_filter_is_the_matrix_exponential(dt, rate_time):
    """For a state and covariance that are far from stationary, correlated with a pose that stands still."""
    error = GaussMarkov(np.array([0.5, 1.0, 2.0]), 15.0, rate_time)
    extra = error.process()
    m = len(extra)
    rng = np.random.default_rng(3)
    root = rng.normal(size=(15 + m, 15 + m))
    P, x = root @ root.T, rng.normal(size=16 + m)
    Phi = expm(generator(extra) * dt)
    whole = np.eye(15 + m)
    whole[15:, 15:] = Phi
    expected = whole @ P @ whole.T
    expected[15:, 15:] += error.covariance() - Phi @ error.covariance() @ Phi.T
    shifted = Phi @ x[16:]
    M = P[:, :15].copy()
    kernels.carry_extra(x, P, M, dt, extra)
    P[:15, :15] = expected[:15, :15]  # what the other functions of the filter carry
    assert np.allclose(x[16:], shifted, atol=1e-12)
    assert np.allclose(P, expected, rtol=1e-9, atol=1e-10)


def test_errors_of_second_order_have_room_for_their_rates():
    """And the source behind one begins behind its rates."""
    flight = fly(5.0, 0.02)
    t = np.array([1.0, 2.0])
    smooth = positions(t, np.zeros((2, 3)), 1.0, gauss_markov_sd=1.0, gauss_markov_time=9.0)
    smooth = smooth._replace(gauss_markov=smooth.gauss_markov._replace(rate_time=2.0))
    plain = velocities(t, np.zeros((2, 3)), 1.0)
    moving = plain._replace(gauss_markov=GaussMarkov(np.array([0.1, 0.2, 0.3]), 4.0))
    line, _ = set_out(flight.imu, 0.0, [smooth, moving, plain], t, 1.0)
    measured, source, _ = gather([smooth, moving, plain], line, 15)
    assert {int(s): set(measured.gauss_markov[source == s]) for s in (0, 1, 2)} == {0: {15}, 1: {21}, 2: {-1}}


def normal_numbers(seed: int, n: int = 4000) -> np.ndarray:
    return np.random.default_rng(seed).normal(1.5, 0.7, n)[:, None]


def test_scoring_finds_the_mean_and_variance_of_normal_numbers():
    """Whose likelihood has its largest value where mean and variance are those of the sample."""
    z = normal_numbers(1)

    def run(p):
        return z - p[0], np.full((len(z), 1, 1), np.exp(2 * p[1]))

    found = maximise(run, [0.0, 0.0, 7.0], [0, 1], [-9, -9, -9], [9, 9, 9], enough=1e-6, iterations=40)
    assert np.allclose(found.parameters, [z.mean(), np.log(z.std()), 7.0], atol=1e-4)
    # By theory: sigma / sqrt(n), and 1 / sqrt(2 n) of the logarithm of sigma.
    assert np.allclose(found.sd[:2], [z.std() / np.sqrt(len(z)), 1 / np.sqrt(2 * len(z))], rtol=0.01)
    assert np.isnan(found.sd[2])
    assert found.log_likelihood == pytest.approx(gaussian_log_likelihood(*run(found.parameters)))


def test_scoring_stays_within_its_bounds_and_moves_the_others():
    z = normal_numbers(2)

    def run(p):
        return z - p[0], np.full((len(z), 1, 1), np.exp(2 * p[1]))

    found = maximise(run, [0.5, 0.0], [0, 1], [0.0, -9], [1.0, 9], enough=1e-6, iterations=40)
    off = np.sqrt(np.mean((z - 1.0) ** 2))
    assert np.allclose(found.parameters, [1.0, np.log(off)], atol=1e-4)
    assert np.isnan(found.sd[0])


def test_a_filter_that_is_lost_where_it_begins_stays_there_without_deviations():
    def run(p):
        return np.full((5, 1), np.nan), np.ones((5, 1, 1))

    found = maximise(run, [0.5, 1.0], [0, 1], [0.0, 0.0], [2.0, 2.0])
    assert found.parameters.tolist() == [0.5, 1.0] and np.isnan(found.sd).all()
    assert found.log_likelihood == -np.inf


def flown(seed: int, sd: float, time: float, rate_time: float = 0.0):
    """A filter on a flight whose fixes have 0.4 and 0.6 m of white noise beside, and how far off it is."""
    flight, rng = fly(330.0, 0.02), np.random.default_rng(seed)
    imu, biases = spoil(flight, rng)
    start = begin(flight, biases, rng)
    rows = np.arange(25, len(flight.motion.times), 25)
    t, spread = flight.motion.times[rows], np.array([1.0, 1.0, 1.5])
    slow = np.zeros((len(t), 3))
    if sd:
        fine = gauss_markov(len(flight.motion.times), 0.02, sd * spread, time, rng)
        if rate_time:
            fine = smoothed(rng, sd * spread, time, rate_time, len(fine))
        slow = fine[rows]
    p = flight.motion.position[rows] + slow + 0.4 * spread * rng.standard_normal((len(t), 3))
    v = flight.motion.velocity[rows] + 0.1 * spread * rng.standard_normal((len(t), 3))
    level = [0, 0, 1]
    given = [positions(t, p, STATED[0][level]), velocities(t, v, STATED[1][level])]
    wanted = flight.motion.times[3000::25]

    def navigate(noise: ReceiverNoise):
        told = [tell(given[0], noise.position), tell(given[1], noise.velocity)]
        return run_mekf(imu, start, NOISE, EARTH, told, wanted, gate_probability=1.0)

    def off(found) -> float:
        R = flight.motion.R_nb[3000::25]
        turn = np.swapaxes(quaternion_to_matrix(found.quaternion), 1, 2) @ R
        return float(np.degrees(np.sqrt((matrix_to_rotation_vector(turn) ** 2).sum(axis=1).mean())))

    return navigate, off


def smoothed(rng, sd, time, rate_time, n):
    """A process of second order by its exact steps."""
    one = GaussMarkov(np.array([1.0, 1.0, 1.0]), time, rate_time)
    C = one.covariance()[::3, ::3]
    Phi = expm(np.array([[-1 / time, 1.0], [0.0, -1 / rate_time]]) * 0.02)
    root = np.linalg.cholesky(C - Phi @ C @ Phi.T + 1e-15 * np.eye(2))
    x = np.empty((n, 2, 3))
    x[0] = np.linalg.cholesky(C) @ rng.standard_normal((2, 3))
    draws = rng.standard_normal((n, 2, 3))
    for k in range(1, n):
        x[k] = Phi @ x[k - 1] + root @ draws[k]
    return x[:, 0] * sd


def chosen_of(navigate):
    def run(noise):
        found = navigate(noise).innovations
        return found.innovation, found.S

    candidates = choose(run, Scale(*STATED, 0.5, 329.0))
    best = max(candidates, key=lambda one: one.score)
    return best


def whiteness(found) -> dict[int, tuple[float, float]]:
    """NIS over its ideal, and the largest correlation at lag 1, by source."""
    result = {}
    for source in (0, 1):
        mine = found.innovations.source == source
        z = found.innovations.innovation[mine] / np.sqrt(
            np.diagonal(found.innovations.S[mine], axis1=1, axis2=2)
        )
        lags = [float(autocorrelation(column, 1)[1]) for column in z.T]
        result[source] = float(found.innovations.nis[mine].mean()) / 3, max(lags, key=abs)
    return result


@pytest.mark.slow
@pytest.mark.parametrize(("rate_time", "order"), [(0.0, 1), (4.0, 2)])
def test_coloured_noise_of_a_receiver_is_found(rate_time, order):
    navigate, off = flown(5, 1.0, 20.0, rate_time)
    best = chosen_of(navigate)
    found = best.noise.position
    assert (found.order, best.noise.velocity.order) == (order, 0)
    truth = np.log([0.4 / 2, 0.6 / 3, 1.0, 1.5, 20.0, rate_time or 1.0])
    apart = np.log(np.maximum(found, 1e-9)) - truth
    free = np.isfinite(best.sd[:6])
    assert free.sum() >= (4 if order == 1 else 5)
    assert (np.abs(apart[free]) < 3 * best.sd[:6][free] + 0.05).all()
    assert best.noise.velocity.white_level == pytest.approx(0.1 / 0.3, rel=0.15)
    assert best.noise.velocity.white_vertical == pytest.approx(0.15 / 0.5, rel=0.15)
    before, after = navigate(ReceiverNoise()), navigate(best.noise)
    for ratio, lag1 in whiteness(after).values():
        assert 0.85 < ratio < 1.15
        assert abs(lag1) < 0.15
    assert not 0.7 < whiteness(before)[0][0] < 1.4 or abs(whiteness(before)[0][1]) > 0.3
    assert off(after) < 1.02 * off(before)


@pytest.mark.slow
def test_where_noise_is_white_no_colour_is_invented():
    navigate, off = flown(6, 0.0, 20.0)
    best = chosen_of(navigate)
    assert (best.noise.position.order, best.noise.velocity.order) == (0, 0)
    assert best.noise.position.white_level == pytest.approx(0.4 / 2, rel=0.15)
    assert best.noise.position.white_vertical == pytest.approx(0.6 / 3, rel=0.15)
    for ratio, lag1 in whiteness(navigate(best.noise)).values():
        assert 0.85 < ratio < 1.15
        assert abs(lag1) < 0.15
    assert off(navigate(best.noise)) < 1.02 * off(navigate(ReceiverNoise()))
