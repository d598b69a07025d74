"""Tracks after a scan are those of Kalman's and Schmidt's filters; shared errors are sums over all ways."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, norm

from tests.tracking.many.test_run import EYE, POINTS, lines, look, looks
from tests.tracking.poses import GENERATORS
from wildlab.tracking.association import association_probabilities
from wildlab.tracking.kalman import update_schmidt
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.multitarget import follow_many, learnt_from_others, moved_together
from wildlab.tracking.multitarget_tracks import Compared, compare, compare_bearings, update
from wildlab.tracking.sensors import left_out
from wildlab.tracking.target_model import Scan

H = np.eye(2, 4)


def spread(rng: np.random.Generator, *shape: int) -> np.ndarray:
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ np.swapaxes(A, -1, -2) + np.eye(shape[-1])


@given(st.integers(0, 10_000))
def test_a_bearing_is_the_extended_kalman_filter(seed):
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


@given(GENERATORS)
def test_the_mixture_has_the_moments_of_its_parts(rng):
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
def test_likelihoods_are_densities_of_the_gate(rng):
    x, P = rng.normal(size=(2, 1, 4)), spread(rng, 2, 1, 4)
    z, R = 3 * rng.normal(size=(4, 2)), spread(rng, 4, 2)
    gate = 1.2
    found = compare(x, P, np.zeros((2, 1, 2)), np.zeros((2, 1, 2, 2)), z, R, gate)
    for i, j in np.ndindex(2, 4):
        S = P[i, 0, :2, :2] + R[j]
        d = z[j] - x[i, 0, :2]
        inside = d @ np.linalg.solve(S, d) < gate**2
        assert np.isclose(found.likelihood[i, 0, j], inside * multivariate_normal(cov=S).pdf(d))


SURE = EYE._replace(detection=1 - 1e-12, clutter=1e-30)
OPEN = POINTS._replace(gate=1e3, lifetime_s=1e12, hidden_s=1e-9, lost_m=1e6, fastest_m_s=1e6)


def moved(
    truth: np.ndarray, lasting_s: float, size: float, own: float, rng: np.random.Generator, told: bool = True
) -> list[Scan]:
    """Scans of (N, T, 2) places, in their order; an error north and one east, first order, move all.

    Parameters
    ----------
    told
        Whether the scans say that it is shared, or have it in the noise of each.
    """
    error = rng.normal(size=2)
    left = np.exp(-1 / lasting_s) if lasting_s else 0.0
    scans = []
    for t, places in enumerate(truth):
        if t:
            error = left * error + np.sqrt(1 - left**2) * rng.normal(size=2)
        z = places + size * error + own * rng.normal(size=places.shape)
        R = np.tile((own**2 + (0 if told else size**2)) * np.eye(2), (len(z), 1, 1))
        shared = np.tile(size * np.eye(2), (len(z), 1, 1)) if told else None
        scans.append(look(t, *z, R=R, shared=shared))
    return scans


@given(GENERATORS, st.integers(0, 4))
@settings(max_examples=30)
def test_one_target_is_the_schmidt_filter(rng, k):
    """Without errors the Kalman filter; also where how errors move a measurement changes, and they fade."""
    lasting = rng.choice([0.0, 3.0, np.inf], k)
    scans = [
        one._replace(shared=rng.normal(size=(1, 2, k)))
        for one in looks(lines(np.array([[5.0, 8.0]]), np.array([[1.0, -2.0]]), 8), rng)
    ]
    J, H = scans[0].shared[0], np.eye(2, 4)
    x, P = np.array([*scans[0].z[0], 0.0, 0.0]), np.diag([0.0, 0.0, 9.0, 9.0])
    P[:2, :2] = scans[0].R[0] + J @ J.T
    C = np.vstack([-J, np.zeros((2, k))])
    for scan, (tracks, _) in zip(scans, follow_many(scans, [SURE], OPEN, lasting), strict=True):
        if scan.time:
            F, Q = white_acceleration(1.0, OPEN.density)
            x, P = F @ x, F @ P @ F.T + Q
            C = F @ C @ np.diag([0.0 if one == 0 else np.exp(-1.0 / one) for one in lasting])
            after = update_schmidt(
                x, P, C, np.eye(k), scan.z[0] - x[:2], H, scan.shared[0], scan.R[0]
            )  # fmt: skip
            x, P, C = after.x, after.P, after.C
        assert np.allclose(tracks.x[0, 0], x) and np.allclose(tracks.P[0, 0], P)
        assert tracks.number == 1 and np.allclose(tracks.C[0, 0], C)


def _drawn(rng: np.random.Generator, T: int, k: int, size: float, uneven: float = 0.1) -> Compared:
    """T targets some metres apart, each detected, moved together; known to a metre."""
    x = np.zeros((T, 1, 4))
    x[:, 0, :2] = rng.uniform(-6, 6, (T, 2))
    J = np.tile(size * np.eye(2, k), (T, 1, 1)) + uneven * rng.normal(size=(T, 2, k))
    z = x[:, 0, :2] + J @ rng.normal(size=k) + rng.normal(size=(T, 2)) * np.sqrt(0.5)
    P = np.tile(np.diag([0.25, 0.25, 1.0, 1.0]), (T, 1, 1, 1))
    R = np.tile(0.25 * np.eye(2), (T, 1, 1))
    return compare(x, P, np.zeros((T, 1, 2)), np.zeros((T, 1, 2, 2)), z, R, 1e3, np.zeros((T, 1, 4, k)), J)


def _enumerated(compared: Compared, seen: float, clutter: float) -> np.ndarray:
    """(T, 1 + M) by all ways, each with the errors integrated out."""
    nu, S, _, _, G = (part[:, 0] for part in compared)
    T, M = nu.shape[:2]
    alone = S - G @ np.swapaxes(G, -1, -2)
    total = np.zeros((T, 1 + M))
    for way in product(range(-1, M), repeat=T):
        taken = [m for m in way if m >= 0]
        if len(set(taken)) < len(taken):
            continue
        who = [t for t in range(T) if way[t] >= 0]
        weight = (1 - seen) ** (T - len(who)) * (seen / clutter) ** len(who)
        if who:
            g = np.concatenate([G[t, way[t]] for t in who])
            spread = g @ g.T
            for place, t in enumerate(who):
                spread[2 * place : 2 * place + 2, 2 * place : 2 * place + 2] += alone[t, way[t]]
            weight *= multivariate_normal.pdf(np.concatenate([nu[t, way[t]] for t in who]), cov=spread)
        for t in range(T):
            total[t, 1 + way[t]] += weight
    return np.asarray(total / total.sum(axis=1, keepdims=True))


def _both(compared: Compared, seen: float, clutter: float) -> tuple[np.ndarray, np.ndarray]:
    """(T, 1 + M) with each target by itself, and together."""
    T, M = compared.likelihood.shape[0], compared.likelihood.shape[2]

    def probable(likely: np.ndarray) -> np.ndarray:
        return association_probabilities(seen * likely[:, 0] / clutter, np.full(T, 1 - seen))

    alone = probable(compared.likelihood)
    near = np.tile(np.arange(M), (T, 1))
    return alone, moved_together(compared, near, np.ones((T, 1)), alone, 1e3, probable)[1]


@pytest.mark.slow
def test_together_is_near_the_sum_over_all_ways():
    """Each target by itself is far off, where all are moved by more than they are apart."""
    rng = np.random.default_rng(1)
    off = []
    for _ in range(60):
        compared = _drawn(rng, int(rng.integers(2, 5)), 3, 3.0)
        right = _enumerated(compared, 0.9, 1e-4)
        off.append([np.abs(one - right).max(axis=1).mean() for one in _both(compared, 0.9, 1e-4)])
    alone, together = np.mean(off, axis=0)
    assert alone > 0.15 and together < alone / 3


def test_what_others_tell_is_the_least_squares_of_them(rng):
    """Sure associations: the errors' posterior is that of all other targets' innovations at once."""
    compared = _drawn(rng, 4, 3, 2.0)
    mean, covariance = learnt_from_others(compared, np.eye(4)[:, None])
    nu, S, _, _, G = (part[:, 0] for part in compared)
    for t in range(4):
        others = [u for u in range(4) if u != t]
        g = np.concatenate([G[u, u] for u in others])
        alone = np.zeros((6, 6))
        for place, u in enumerate(others):
            alone[2 * place : 2 * place + 2, 2 * place : 2 * place + 2] = S[u, u] - G[u, u] @ G[u, u].T
        gain = g.T @ np.linalg.inv(g @ g.T + alone)
        assert np.allclose(mean[t], gain @ np.concatenate([nu[u, u] for u in others]))
        assert np.allclose(covariance[t], np.eye(3) - gain @ g)


def test_what_nobody_is_sure_of_tells_little():
    """Two measurements that may be a target's: their middle, as unsure as they lie apart, and probable."""
    nu = np.array([[4.0, 0.0], [0.0, 2.0]])
    S, G = np.tile(5.0 * np.eye(2), (2, 1, 1)), np.tile(2.0 * np.eye(2), (2, 1, 1))
    one = Compared(*(np.stack([part, part])[:, None] for part in (nu, S)), np.ones((2, 1, 2)), np.zeros(0),
                   np.stack([G, G])[:, None])  # fmt: skip
    share, probable = np.array([0.25, 0.75]), 0.6
    mean, covariance = learnt_from_others(one, np.tile(probable * share, (2, 1, 1)))
    middle = share @ nu
    off = nu - middle
    spread = np.eye(2) + np.einsum("m,mi,mj->ij", share, off, off)
    information = probable * 2.0 * np.linalg.inv(spread) * 2.0
    right = np.linalg.inv(np.eye(2) + information)
    assert np.allclose(covariance, right)
    assert np.allclose(mean, right @ (probable * 2.0 * np.linalg.solve(spread, middle)))


def test_targets_that_are_moved_together_are_told_apart():
    """Two metres apart and moved by three for long: who knows that they are moved together keeps them."""
    starts = 2.0 * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    truth = lines(starts, np.array([[0.3, 0.2]] * 3), 40)
    targets = POINTS._replace(density=0.02, start_speed_m_s=1.0)
    kept = dict.fromkeys((True, False), 0)
    for seed in range(4):
        for told in kept:
            scans = moved(truth, 100.0, 3.0, 0.3, np.random.default_rng(seed), told)
            names = []
            for k, (tracks, _) in enumerate(follow_many(scans, [EYE], targets, [100.0] * 2 if told else [])):
                sure = tracks.only(np.flatnonzero(tracks.confirmed))
                if k in (10, 39) and sure.number >= 3:
                    near = np.linalg.norm(sure.x[:, :1, :2] - scans[k].z[None], axis=2).argmin(axis=0)
                    names.append(tuple(sure.identity[near].tolist()))
            kept[told] += len(names) == 2 and names[0] == names[1] and len(set(names[0])) == 3
    assert kept[True] >= 3 > 1 >= kept[False]


def test_a_track_is_not_lost_for_what_all_are_wrong_by():
    """A hundred metres that all share, where 50 m is what a place may be unknown by: new ones count."""
    truth = lines(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), 15)
    for lasting, kept in ((np.inf, True), (0.0, False)):
        scans = moved(truth, lasting, 100.0, 0.5, np.random.default_rng(1))
        first, *_, last = [tracks for tracks, _ in follow_many(scans, [EYE], POINTS, [lasting] * 2)]
        assert first.identity.tolist() == [0]
        assert (last.identity.tolist() == [0]) == kept
