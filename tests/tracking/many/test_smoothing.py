"""Back over many tracks: the answer of all equations at once, each by itself, and closer to the truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.many.test_together import OPEN, SURE, moved
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many.beliefs import POINT, Scan, SensorBeliefs, TargetBeliefs
from wildlab.tracking.many.run import Shown, run_many
from wildlab.tracking.many.smoothing import smooth_considering, smooth_many
from wildlab.tracking.maritime import white_acceleration

H = np.eye(2, 4)


def shown(time: float, names: list[int], x: np.ndarray, P: np.ndarray) -> Shown:
    count = len(names)
    return Shown(
        time, 0, np.array(names, np.int64), np.asarray(x, float).reshape(count, 4),
        np.asarray(P, float).reshape(count, 4, 4), np.ones(count), np.ones((count, 1)),
        np.zeros((count, 4, 0)),
    )  # fmt: skip


def filtered(z: np.ndarray, times: np.ndarray, density: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    x, P = np.zeros(4), np.diag([25.0, 25.0, 4.0, 4.0])
    means, covariances = [], []
    for k, one in enumerate(z):
        if k:
            x, P = predict(x, P, *white_acceleration(float(times[k] - times[k - 1]), density))
        after = update(x, P, one, H, np.eye(2))
        x, P = after.x, after.P
        means.append(x)
        covariances.append(P)
    return means, covariances


@given(st.integers(0, 10_000), st.floats(0.05, 2.0))
@settings(max_examples=30, deadline=None)
def test_it_is_the_solution_of_all_equations_at_once(seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.2, 3.0, 6))
    z = rng.normal(0, 5, (6, 2))
    means, covariances = filtered(z, times, density)
    after = smooth_many(
        [shown(t, [7], x, P) for t, x, P in zip(times, means, covariances, strict=True)], density
    )
    # Information of the start, of every measurement and of every step between, of all states together.
    Y, y = np.zeros((24, 24)), np.zeros(24)
    Y[:4, :4] += np.linalg.inv(np.diag([25.0, 25.0, 4.0, 4.0]))
    for k in range(6):
        rows = slice(4 * k, 4 * k + 4)
        Y[rows, rows] += H.T @ H
        y[rows] += H.T @ z[k]
        if k:
            F, Q = white_acceleration(float(times[k] - times[k - 1]), density)
            pair = slice(4 * k - 4, 4 * k + 4)
            G = np.hstack([-F, np.eye(4)])
            Y[pair, pair] += G.T @ np.linalg.inv(Q) @ G
    whole = np.linalg.inv(Y)
    expected = (whole @ y).reshape(6, 4)
    for k, (x, P) in enumerate(after):
        assert x[0] == pytest.approx(expected[k], rel=1e-5, abs=1e-5)
        assert P[0] == pytest.approx(whole[4 * k : 4 * k + 4, 4 * k : 4 * k + 4], rel=1e-4, abs=1e-5)


def test_each_track_is_smoothed_by_itself_and_on_either_side_of_an_absence() -> None:
    rng = np.random.default_rng(3)
    times = np.arange(6.0)
    a, b = (filtered(rng.normal(0, 5, (6, 2)), times, 0.5) for _ in range(2))
    alone = smooth_many([shown(t, [1], x, P) for t, x, P in zip(times, *a, strict=True)], 0.5)
    # The other one changes places with it in the rows, and is absent at the fourth look.
    looks = []
    for k, t in enumerate(times):
        order = [2, 1] if k % 2 else [1, 2]
        order = [1] if k == 3 else order
        states = {1: (a[0][k], a[1][k]), 2: (b[0][k], b[1][k])}
        looks.append(
            shown(t, order, np.array([states[n][0] for n in order]), np.array([states[n][1] for n in order]))
        )
    after = smooth_many(looks, 0.5)
    for k, one in enumerate(looks):
        place = one.identity.tolist().index(1)
        assert np.allclose(after[k][0][place], alone[k][0][0])
        assert np.allclose(after[k][1][place], alone[k][1][0])
    before = looks[2].identity.tolist().index(2)
    # Its last look before the absence and its last of all know nothing later.
    assert np.allclose(after[2][0][before], b[0][2])
    assert np.allclose(after[5][0][looks[5].identity.tolist().index(2)], b[0][5])


def test_what_was_given_is_not_changed_and_nothing_stays_nothing() -> None:
    looks = [shown(t, [1], np.array([t, 0, 1, 0]), np.eye(4)) for t in (0.0, 1.0)]
    kept = [one.x.copy() for one in looks]
    smooth_many(looks, 0.5)
    assert all(np.array_equal(one.x, x) for one, x in zip(looks, kept, strict=True))
    assert smooth_many([], 0.5) == []
    assert smooth_many([shown(0.0, [], np.zeros((0, 4)), np.zeros((0, 4, 4)))], 0.5)[0][0].shape == (0, 4)


def test_smoothed_tracks_of_many_are_closer_to_the_truth() -> None:
    eye = SensorBeliefs("eye", 0.9, 1e-4, 0.0, 1e6, 3.0, (0.0,), (0.0,), (0.0,))
    targets = TargetBeliefs(
        (POINT,), density=0.1, start_speed_m_s=3.0, lifetime_s=500.0, birth=0.1, visible_s=100.0,
        hidden_s=5.0, gate=4.5, confirmed=0.9, hits=3, shown=0.5, forgotten=0.01, lost_m=50.0,
        fastest_m_s=30.0, moves_m=0.0, over_s=15.0, apart_m=1.0,
    )  # fmt: skip
    rng = np.random.default_rng(5)
    starts, velocities = np.array([[-60.0, -40.0], [40.0, 60.0]]), np.array([[2.0, 0.5], [-1.0, 0.0]])
    truth = starts + velocities * np.arange(60)[:, None, None]
    looks = [
        Scan(float(t), 0, np.zeros(2), now + rng.normal(0, 2, now.shape), np.tile(4 * np.eye(2), (2, 1, 1)))
        for t, now in enumerate(truth)
    ]
    found = run_many(looks, [eye], targets)
    off: dict[str, list[float]] = {"filter": [], "smoothed": []}
    for k, (one, (x, _)) in enumerate(zip(found, smooth_many(found, 0.1), strict=True)):
        for place in range(len(one.identity)):
            for name, at in (("filter", one.x[place, :2]), ("smoothed", x[place, :2])):
                off[name].append(float(np.linalg.norm(truth[k] - at, axis=1).min()))
    assert np.mean(off["smoothed"]) < 0.75 * np.mean(off["filter"])


def test_what_fades_is_less_common_with_what_was_before() -> None:
    """Three looks, an error that fades by a fifth, gains as one likes: all from sources of size one.

    The second look moves the other way than the first by just so much that the estimate then has nothing in
    common with the error: so what is approximated where errors fade is exact here.
    """
    left, shares = 0.8, np.array([1.0, -0.8, 1.5])
    F, Q = white_acceleration(1.0, 0.3)
    gains = np.vstack([np.eye(2) / 2, np.zeros((2, 2))]), np.vstack([np.eye(2) / 2, 0.3 * np.eye(2)])
    # One row for each of o, its two changes, v, and of noise n and process noise w at each look.
    o, *changes, v, n, n1, n2, w1, w2 = np.split(np.eye(19), [1, 2, 3, 5, 7, 9, 11, 15])
    root, J = np.linalg.cholesky(Q), np.array([[2.0], [1.0]])
    truth, shared = [np.zeros((4, 19))], [o]
    e = [np.vstack([-(n + shares[0] * J @ o), v])]
    for k, (gain, noise, w) in enumerate(zip(gains, (n1, n2), (w1, w2), strict=True)):
        truth.append(F @ truth[-1] + root @ w)
        shared.append(left * shared[-1] + np.sqrt(1 - left**2) * changes[k])
        ahead = F @ e[-1] + root @ w
        e.append(ahead - gain @ (H @ ahead + noise + shares[k + 1] * J @ shared[-1]))
    assert np.allclose(e[1] @ shared[1].T, 0) and not np.allclose(e[0] @ o.T, 0)
    P = np.array([one @ one.T for one in e])
    C = np.array([one @ other.T for one, other in zip(e, shared, strict=True)])
    lasting, x = [-1 / np.log(left)], np.array(truth) - np.array(e)
    after = [smooth_considering([0.0, 1.0, 2.0], x[..., k], P, C, 0.3, lasting) for k in range(19)]
    off = np.array(truth) - np.stack([mean for mean, _ in after], axis=-1)
    assert np.allclose(after[0][1], off @ np.swapaxes(off, 1, 2))


@pytest.mark.parametrize("lasting", [0.0, 5.0, 40.0, np.inf])
def test_errors_are_as_large_as_smoothed_tracks_say(lasting: float) -> None:
    """Errors that measurements share are in the covariance, and what is learnt later lowers it."""
    density, nees, lower = 0.3, [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        state, way = np.array([0.0, 0.0, *rng.normal(0, OPEN.start_speed_m_s, 2)]), []
        F, Q = white_acceleration(1.0, density)
        for _ in range(20):
            way.append(state[:2])
            state = F @ state + rng.multivariate_normal(np.zeros(4), Q)
        scans = moved(np.array(way)[:, None], lasting, 2.0, 0.5, rng)
        found = run_many(scans, [SURE], OPEN._replace(density=density, hits=1, confirmed=0.0), [lasting] * 2)
        after = smooth_many(found, density, [lasting] * 2)
        for k in range(2, 20, 6):
            e, P = way[k] - after[k][0][0, :2], after[k][1][0, :2, :2]
            nees.append(e @ np.linalg.solve(P, e) / 2)
            # What lasts for ever, 2 m in each axis, no smoothing lowers.
            ever = 2 * 2.0**2 if lasting == np.inf else 0.0
            lower.append((np.trace(P) - ever) / (np.trace(found[k].P[0, :2, :2]) - ever))
    assert 0.8 < np.mean(nees) < 1.2
    assert np.mean(lower) < 0.97 and max(lower) < 1.001
