"""Motion models: steps that add up, closed forms, and the print's limits."""

from functools import partial

import numpy as np
import pytest
from filterpy.common import van_loan_discretization
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec

from wildlab.errors import WildlabError
from wildlab.tracking import motion

STEPS = st.just(0.0) | st.floats(1e-6, 200)
CONTINUOUS = {
    "rest": motion.rest,
    "random walk": partial(motion.random_walk, density=0.7),
    "white acceleration": partial(motion.white_acceleration, density=0.7),
    "at rest": partial(motion.white_acceleration, density=0.0),
    "singer, slow": partial(motion.singer, alpha=0.02, variance=0.3),
    "singer, fast": partial(motion.singer, alpha=4.0, variance=0.3),
    "singer, no fading": partial(motion.singer, alpha=0.0, variance=0.3),
}
HELD = {
    "constant velocity": partial(motion.constant_velocity, sd_acceleration=0.4),
}
ALL = CONTINUOUS | HELD


@pytest.mark.parametrize("name", ALL)
@given(a=STEPS, b=STEPS)
def test_transitions_compose(name, a, b):
    whole, first, second = (ALL[name](t)[0] for t in (a + b, a, b))
    assert np.allclose(second @ first, whole, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", CONTINUOUS)
@given(a=STEPS, b=STEPS)
def test_noise_of_continuous_models_adds_up(name, a, b):
    (_, whole), (_, first), (F, second) = (CONTINUOUS[name](t) for t in (a + b, a, b))
    assert np.allclose(F @ first @ F.T + second, whole, rtol=1e-8, atol=1e-8 * np.abs(whole).max() + 1e-300)


@pytest.mark.parametrize("name", ALL)
@given(dt=STEPS)
def test_noise_is_a_covariance_and_nothing_happens_in_no_time(name, dt):
    F, Q = ALL[name](dt)
    assert np.array_equal(Q, Q.T)
    sd = np.sqrt(np.diag(Q))
    sd[sd == 0] = 1.0
    assert np.linalg.eigvalsh(Q / np.outer(sd, sd))[0] > -1e-10
    F, Q = ALL[name](0.0)
    assert np.array_equal(F, np.eye(len(F)))
    assert not Q.any()


@pytest.mark.parametrize("name", ["rest", "singer, slow", "constant velocity"])
@pytest.mark.parametrize("dt", [-0.1, np.nan, np.inf])
def test_steps_backwards_are_refused(name, dt):
    with pytest.raises(WildlabError, match="time step"):
        ALL[name](dt)


def test_constant_velocity_is_the_print():
    T, sd = 0.3, 0.05
    F, Q = motion.constant_velocity(T, sd)
    G = np.array([[T**2 / 2, 0], [0, T**2 / 2], [T, 0], [0, T]])
    assert np.allclose(F, [[1, 0, T, 0], [0, 1, 0, T], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert np.allclose(Q, sd**2 * G @ G.T)


def test_white_acceleration_agrees_with_van_loan():
    axis = van_loan_discretization(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [0.3]]), 1.7)
    for ours, one in zip(motion.white_acceleration(1.7, 0.3), axis, strict=True):
        np.testing.assert_allclose(ours, np.kron(one, np.eye(2)), atol=1e-12)


@given(alpha=st.floats(1e-3, 3), dt=st.floats(1e-3, 5))
def test_singer_agrees_with_van_loan_and_with_the_integral(alpha, dt):
    F, Q = motion.singer(dt, alpha, 0.3)
    A = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -alpha]])
    F1, Q1 = van_loan_discretization(A, np.array([[0], [0], [np.sqrt(2 * alpha * 0.3)]]), dt)
    assert np.isclose(F[4, 4], np.exp(-alpha * dt), rtol=1e-12, atol=0)
    if alpha * dt < 2:  # the oracle takes the exponential of -A, and its digits go for long steps
        assert np.allclose(F[::2, ::2], F1, rtol=1e-10, atol=1e-12)
        units = np.array([dt**2, dt, 1])
        one = np.outer(units, units)
        assert np.allclose(Q[::2, ::2] / one, Q1 / one, rtol=1e-6, atol=1e-9)

    def kernel(s):
        g = motion.singer(s, alpha, 0.3)[0][::2, 4]
        return 0.6 * alpha * np.outer(g, g)

    Q2, _ = quad_vec(kernel, 0, dt, epsrel=1e-10, norm="max")
    assert np.allclose(Q[::2, ::2], Q2, rtol=1e-7, atol=0)
    assert not Q[::2, 1::2].any()


@given(exponent=st.floats(-8, -2), dt=st.floats(1e-3, 100))
def test_the_printed_noise_is_the_limit_of_short_steps(exponent, dt):
    alpha = 10**exponent / dt
    _, exact = motion.singer(dt, alpha, 0.3)
    size = np.array([[20, 8, 6], [8, 3, 2], [6, 2, 1]])
    axis = dt ** np.array([[5, 4, 3], [4, 3, 2], [3, 2, 1]]) / size
    printed = 2 * alpha * 0.3 * np.kron(axis, np.eye(2))
    rows, columns = np.nonzero(printed)
    ratio = exact[rows, columns] / printed[rows, columns]
    assert np.allclose(ratio, 1, atol=2 * alpha * dt + 1e-12)


@given(dt=st.floats(0, 50), longest=st.floats(0.05, 60))
def test_in_steps_is_the_loop(dt, longest):
    model = HELD["constant velocity"]
    F, Q = motion.in_steps(dt, model, longest)
    n = next(n for n in range(1, 10_000) if dt / n <= longest * (1 + 1e-9))
    F1, Q1 = model(dt / n)
    F2, Q2 = np.eye(4), np.zeros((4, 4))
    for _ in range(n):
        F2, Q2 = F1 @ F2, F1 @ Q2 @ F1.T + Q1
    assert np.allclose(F, F2)
    assert np.allclose(Q, Q2, rtol=1e-9, atol=1e-15)
