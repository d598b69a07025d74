"""One target without clutter is the Kalman filter; a mixture has the moments of its parts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.tracking.bending import left_out
from wildlab.tracking.kalman import update as kalman_update
from wildlab.tracking.many.update import compare, compare_bearings, update

H = np.eye(2, 4)


def spread(rng: np.random.Generator, *shape: int) -> np.ndarray:
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ np.swapaxes(A, -1, -2) + np.eye(shape[-1])


@given(st.integers(0, 10_000))
def test_one_measurement_that_is_its_own_is_the_kalman_filter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, P, z, R = rng.normal(size=(1, 1, 4)), spread(rng, 1, 1, 4), rng.normal(size=(1, 2)), spread(rng, 1, 2)
    offset, noise = rng.normal(size=(1, 1, 2)), spread(rng, 1, 1, 2)
    found = update(x, P, [[1.0]], [[0.0, 1.0]], compare(x, P, offset, noise, z, R, 1e9))
    right = kalman_update(x[0, 0], P[0, 0], z[0] - offset[0, 0], H, R[0] + noise[0, 0])
    assert np.allclose(found.x[0, 0], right.x) and np.allclose(found.P[0, 0], right.P)
    unseen = update(x, P, [[1.0]], [[1.0, 0.0]], compare(x, P, offset, noise, z, R, 1e9))
    assert np.allclose(unseen.x, x) and np.allclose(unseen.P, P)


@given(st.integers(0, 10_000))
def test_a_bearing_is_the_extended_kalman_filter(seed: int) -> None:
    """Its Jacobian by central differences of the direction from the platform, hull's noise included."""
    rng = np.random.default_rng(seed)
    x, P, noise = 20 * rng.normal(size=(1, 1, 4)), spread(rng, 1, 1, 4), spread(rng, 1, 1, 2)
    platform, R = x[0, 0, :2] + rng.uniform(5, 150) * np.array([np.cos(seed), np.sin(seed)]), 0.02**2

    def direction(state: np.ndarray) -> float:
        to = state[:2] - platform
        return float(np.arctan2(to[1], to[0]))

    step = 1e-4 * np.eye(4)
    turn = np.exp([1j * (direction(x[0, 0] + h) - direction(x[0, 0] - h)) for h in step])
    J = np.angle(turn)[None] / 2e-4
    z = direction(x[0, 0]) + rng.normal(0, 0.02) + 2 * np.pi * rng.integers(-1, 2)
    compared = compare_bearings(x, P, noise, platform, [[z]], [[[R]]], 1e9)
    gap = np.angle(np.exp(1j * (z - direction(x[0, 0]))))
    # What first order leaves out is noise too: from second derivatives by differences.
    h = 1e-2 * np.eye(2)
    at = x[0, 0, :2]

    def slope(place: np.ndarray) -> np.ndarray:
        to = place - platform
        return np.array([-to[1], to[0]]) / (to @ to)

    D = np.array([(slope(at + one) - slope(at - one)) / 2e-2 for one in h])
    bent = float(left_out(P[0, 0, :2, :2] + noise[0, 0], D[None])[0, 0])
    if bent > R:
        assert compared.likelihood[0, 0, 0] == 0
        return
    own = R + J[:, :2] @ noise[0, 0] @ J[:, :2].T + bent
    found = update(x, P, [[1.0]], [[0.0, 1.0]], compared)
    right = kalman_update(x[0, 0], P[0, 0], J @ x[0, 0] + gap, J, own)
    assert np.allclose(found.x[0, 0], right.x, atol=1e-5) and np.allclose(found.P[0, 0], right.P, atol=1e-5)
    S = float((J @ P[0, 0] @ J.T + own)[0, 0])
    assert compared.likelihood[0, 0, 0] == pytest.approx(
        np.exp(-(gap**2) / S / 2) / np.sqrt(2 * np.pi * S), rel=1e-5
    )
    assert compare_bearings(x, P, noise, platform, [[z + 1.0]], [[[R]]], 1e-3).likelihood[0, 0, 0] == 0


def test_a_bearing_from_near_makes_no_track_too_sure() -> None:
    """Places known to 5 m, bearings to 3 deg; to first order alone NEES / 2 would be 33 at 8 m."""
    rng, distance = np.random.default_rng(5), 8.0
    values = []
    P = np.diag([25.0, 25.0, 1.0, 1.0])[None, None]
    for _ in range(1000):
        true = np.array([distance, 0.0, 0.0, 0.0])
        x = (true + rng.normal(size=4) * np.sqrt(np.diag(P[0, 0])))[None, None]
        z = rng.normal(0, np.radians(3.0))
        compared = compare_bearings(
            x, P, np.zeros((1, 1, 2, 2)), np.zeros(2), [[z]], [[[np.radians(3.0) ** 2]]], 1e9
        )
        taken = float(compared.likelihood[0, 0, 0] > 0)
        after = update(x, P, [[1.0]], [[1 - taken, taken]], compared)
        off = true[:2] - after.x[0, 0, :2]
        values.append(off @ np.linalg.solve(after.P[0, 0, :2, :2], off) / 2)
    assert np.mean(values) < 1.2


def test_what_is_at_the_platform_is_in_no_direction() -> None:
    x, P = np.zeros((1, 1, 4)), np.eye(4)[None, None]
    compared = compare_bearings(x, P, np.zeros((1, 1, 2, 2)), np.array([0.3, 0.0]), [[1.0]], [[[0.1]]], 9.0)
    assert compared.likelihood[0, 0, 0] == 0 and np.isfinite(compared.S).all()


@given(st.integers(0, 10_000))
def test_the_mixture_has_the_moments_of_its_parts(seed: int) -> None:
    """Each way alone by a Kalman filter, weighed by Bayes' rule, summed: mean, covariance and kinds."""
    rng = np.random.default_rng(seed)
    K, M = 2, 3
    x, P, z, R = rng.normal(size=(1, K, 4)), spread(rng, 1, K, 4), rng.normal(size=(M, 2)), spread(rng, M, 2)
    offset, noise = rng.normal(size=(1, K, 2)), spread(rng, 1, K, 2)
    kinds, own = rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(1 + M))
    compared = compare(x, P, offset, noise, z, R, 1e9)
    found = update(x, P, kinds[None], own[None], compared)
    weight, mean, second = np.zeros(K), np.zeros((K, 4)), np.zeros((K, 4, 4))
    for k in range(K):
        for j in range(-1, M):
            if j < 0:
                w, m, V = kinds[k] * own[0], x[0, k], P[0, k]
            else:
                likely = compared.likelihood[0, :, j]
                w = own[1 + j] * kinds[k] * likely[k] / (kinds @ likely)
                one = kalman_update(x[0, k], P[0, k], z[j] - offset[0, k], H, R[j] + noise[0, k])
                m, V = one.x, one.P
            weight[k] += w
            mean[k] += w * m
            second[k] += w * (V + np.outer(m, m))
    mean, second = mean / weight[:, None], second / weight[:, None, None]
    assert np.allclose(found.kinds[0], weight / weight.sum())
    assert np.allclose(found.x[0], mean)
    assert np.allclose(found.P[0], second - mean[..., :, None] * mean[..., None, :], atol=1e-9)


@given(st.integers(0, 10_000))
def test_likelihoods_are_densities_of_the_gate(seed: int) -> None:
    from scipy.stats import multivariate_normal

    rng = np.random.default_rng(seed)
    x, P, z, R = (
        rng.normal(size=(2, 1, 4)),
        spread(rng, 2, 1, 4),
        3 * rng.normal(size=(4, 2)),
        spread(rng, 4, 2),
    )
    zero = np.zeros((2, 1, 2)), np.zeros((2, 1, 2, 2))
    gate = 1.2
    found = compare(x, P, *zero, z, R, gate)
    for i in range(2):
        for j in range(4):
            S = P[i, 0, :2, :2] + R[j]
            d = z[j] - x[i, 0, :2]
            inside = d @ np.linalg.solve(S, d) < gate**2
            assert np.isclose(found.likelihood[i, 0, j], inside * multivariate_normal(cov=S).pdf(d))
