"""One target without clutter is the Kalman filter; a mixture has the moments of its parts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, norm

from tests.tracking.poses import GENERATORS
from wildlab.tracking.bending import left_out
from wildlab.tracking.many.update import compare, compare_bearings, update
from wildlab.tracking.schmidt import update_schmidt

H = np.eye(2, 4)


def spread(rng: np.random.Generator, *shape: int) -> np.ndarray:
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ np.swapaxes(A, -1, -2) + np.eye(shape[-1])


@given(st.integers(0, 10_000))
def test_a_bearing_is_the_extended_kalman_filter(seed: int) -> None:
    """Its Jacobian by central differences of the direction from the platform, noise and errors included."""
    rng = np.random.default_rng(seed)
    x, C, noise = 20 * rng.normal(size=4), rng.normal(size=(4, 2)), spread(rng, 2)
    P = spread(rng, 4) + C @ C.T
    platform, R = x[:2] + rng.uniform(5, 150) * np.array([np.cos(seed), np.sin(seed)]), 0.02**2

    def direction(state: np.ndarray) -> float:
        to = state[:2] - platform
        return float(np.arctan2(to[1], to[0]))

    turn = np.exp([1j * (direction(x + h) - direction(x - h)) for h in 1e-4 * np.eye(4)])
    J = np.angle(turn)[None] / 2e-4
    z = direction(x) + rng.normal(0, 0.02) + 2 * np.pi * rng.integers(-1, 2)
    given_ = x[None, None], P[None, None], noise[None, None], platform
    compared = compare_bearings(*given_, [[z]], [[[R]]], 1e9, C[None, None])
    gap = np.angle(np.exp(1j * (z - direction(x))))

    # What first order leaves out is noise too: from second derivatives by differences.
    def slope(place: np.ndarray) -> np.ndarray:
        to = place - platform
        return np.array([-to[1], to[0]]) / (to @ to)

    D = np.array([(slope(x[:2] + h) - slope(x[:2] - h)) / 2e-2 for h in 1e-2 * np.eye(2)])
    bent = float(left_out(P[:2, :2] + noise, D[None])[0, 0])
    if bent > R:
        assert compared.likelihood[0, 0, 0] == 0
        return
    own = R + J[:, :2] @ noise @ J[:, :2].T + bent
    found = update(*given_[:2], [[1.0]], [[0.0, 1.0]], compared, C[None, None])
    right = update_schmidt(x, P, C, np.eye(2), np.array([gap]), J, np.zeros((1, 2)), own)
    assert np.allclose(found.x[0, 0], right.x, atol=1e-5) and np.allclose(found.P[0, 0], right.P, atol=1e-5)
    assert np.allclose(found.C[0, 0], right.C, atol=1e-5)
    density = norm(0, np.sqrt(right.S[0, 0])).pdf(gap)
    assert compared.likelihood[0, 0, 0] == pytest.approx(density, rel=1e-5)
    assert compare_bearings(*given_, [[z + 1.0]], [[[R]]], 1e-3).likelihood[0, 0, 0] == 0


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


@given(GENERATORS)
def test_the_mixture_has_the_moments_of_its_parts(rng: np.random.Generator) -> None:
    """Each way alone by a Schmidt filter, weighed by Bayes' rule, summed: moments and kinds."""
    K, M, n = 2, 3, 2
    x, C = rng.normal(size=(K, 4)), rng.normal(size=(K, 4, n))
    z, R, J = rng.normal(size=(M, 2)), spread(rng, M, 2), rng.normal(size=(M, 2, n))
    P = spread(rng, K, 4) + C @ np.swapaxes(C, -1, -2)
    offset, noise = rng.normal(size=(K, 2)), spread(rng, K, 2)
    kinds, own = rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(1 + M))
    compared = compare(x[None], P[None], offset[None], noise[None], z, R, 1e9, C[None], J)
    found = update(x[None], P[None], kinds[None], own[None], compared, C[None])
    weight, mean, second, cross = np.zeros(K), np.zeros((K, 4)), np.zeros((K, 4, 4)), np.zeros((K, 4, n))
    for k in range(K):
        ways = [(own[0] * kinds[k], x[k], P[k], C[k])]
        for j in range(M):
            left = z[j] - offset[k] - x[k, :2]
            one = update_schmidt(x[k], P[k], C[k], np.eye(n), left, H, J[j], R[j] + noise[k])
            likely = compared.likelihood[0, :, j]
            ways.append((own[1 + j] * kinds[k] * likely[k] / (kinds @ likely), one.x, one.P, one.C))
            assert np.allclose(compared.S[0, k, j], one.S)
        for w, m, V, D in ways:
            weight[k] += w
            mean[k] += w * m
            second[k] += w * (V + np.outer(m, m))
            cross[k] += w * D
    mean, second = mean / weight[:, None], second / weight[:, None, None]
    assert np.allclose(found.kinds[0], weight / weight.sum())
    assert np.allclose(found.x[0], mean) and np.allclose(found.C[0], cross / weight[:, None, None])
    assert np.allclose(found.P[0], second - mean[..., :, None] * mean[..., None, :], atol=1e-9)


@given(GENERATORS)
def test_likelihoods_are_densities_of_the_gate(rng: np.random.Generator) -> None:
    x, P = rng.normal(size=(2, 1, 4)), spread(rng, 2, 1, 4)
    z, R = 3 * rng.normal(size=(4, 2)), spread(rng, 4, 2)
    gate = 1.2
    found = compare(x, P, np.zeros((2, 1, 2)), np.zeros((2, 1, 2, 2)), z, R, gate)
    for i, j in np.ndindex(2, 4):
        S = P[i, 0, :2, :2] + R[j]
        d = z[j] - x[i, 0, :2]
        inside = d @ np.linalg.solve(S, d) < gate**2
        assert np.isclose(found.likelihood[i, 0, j], inside * multivariate_normal(cov=S).pdf(d))
