"""Back over many tracks: the answer of all equations at once, each by itself, errors as predicted."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.many.test_run import look
from tests.tracking.many.test_update import OPEN, SURE
from tests.tracking.poses import GENERATORS
from wildlab.evaluation.consistency import chi_square_interval, nees
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.multitarget import Shown, run_many, smooth_many
from wildlab.tracking.run import Start, Track, lasting_errors, run_filter, smooth, smooth_moments
from wildlab.tracking.sensors import positions
from wildlab.tracking.target_model import Hull, own_columns, own_lasting

H = np.eye(2, 4)


def shown(time: float, names: list[int], x: np.ndarray, P: np.ndarray) -> Shown:
    count = len(names)
    return Shown(
        time, 0, np.array(names, np.int64), np.asarray(x, float).reshape(count, 4),
        np.asarray(P, float).reshape(count, 4, 4), np.ones(count), np.ones((count, 1)),
        np.zeros((count, 4, 0)),
    )  # fmt: skip


def filtered(seed: int, density: float) -> Track:
    """One target by the filter of one target, at uneven times."""
    rng = np.random.default_rng(seed)
    times, z = np.cumsum(rng.uniform(0.2, 3.0, 6)), rng.normal(0, 5, (6, 2))
    start = Start(times[0], np.zeros(4), np.diag([25.0, 25.0, 4.0, 4.0]))
    return run_filter(times, z, np.eye(2), positions(), partial(white_acceleration, density=density), start)


@given(st.integers(0, 10_000), st.floats(0.05, 2.0))
@settings(max_examples=30, deadline=None)
def test_each_track_is_smoothed_by_itself_and_on_either_side_of_an_absence(seed, density):
    one = filtered(seed, density)
    other = one.x[::-1], one.P[::-1]
    alone = smooth(one, partial(white_acceleration, density=density))
    # The other one changes places with it in the rows, and is absent at the fourth look.
    looks, orders = [], ([1, 2], [2, 1], [1, 2], [1], [1, 2], [2, 1])
    for k, order in enumerate(orders):
        x, P = (
            np.array([(mine[k], its[k])[n - 1] for n in order])
            for mine, its in zip(one[1:3], other, strict=True)
        )
        looks.append(shown(one.times[k], order, x, P))
    after = smooth_many(looks, density)
    for k, order in enumerate(orders):
        x, P = (part[order.index(1)] for part in after[k])
        assert x == pytest.approx(alone.x[k], rel=1e-5, abs=1e-5)
        assert pytest.approx(alone.P[k], rel=1e-4, abs=1e-5) == P
    # Its last look before the absence and its last of all know nothing later.
    for k in (2, 5):
        assert np.allclose(after[k][0][orders[k].index(2)], other[0][k])


def test_a_target_at_rest_is_where_all_measurements_say():
    z = np.random.default_rng(0).normal(0, 5, (6, 2))
    start = Start(0.0, np.zeros(4), np.diag([25.0, 25.0, 0.0, 0.0]))
    still = partial(white_acceleration, density=0.0)
    one = run_filter(np.arange(1.0, 7.0), z, np.eye(2), positions(), still, start)
    after = smooth_many([shown(one.times[k], [1], one.x[k], one.P[k]) for k in range(6)], 0.0)
    for x, P in after:
        np.testing.assert_allclose(x[0], one.x[-1], atol=1e-12)
        np.testing.assert_allclose(P[0], one.P[-1], atol=1e-12)


@given(GENERATORS)
@settings(max_examples=8, deadline=None)
def test_covariances_are_those_of_the_errors_of_smoothed_tracks(rng):
    """Errors that fade, each at its own rate: everything is a sum of sources of variance one, and exact."""
    looks, k = 6, 2
    lasting = rng.choice([0.0, 1.0, 5.0, 40.0, np.inf], k)
    times = np.cumsum(rng.uniform(0.2, 3.0, looks))
    # A row of sources for each element: of the state 4, then at each look errors k, noise 2 and motion 4.
    unit = np.eye(4 + looks * (k + 6))
    start, rest = unit[:4], unit[4:].reshape(looks, k + 6, -1)
    truth, e, o = np.zeros((4, unit.shape[1])), 5 * start, rest[0, :k]
    truths, filtered, P, C = [], [], [], []
    for row in range(looks):
        if row:
            dt = float(times[row] - times[row - 1])
            F, Q = white_acceleration(dt, 0.3)
            w = np.linalg.cholesky(Q) @ rest[row, k + 2 :]
            truth, e = F @ truth + w, F @ e + w
            left = np.array([np.exp(-dt / one) if one else 0.0 for one in lasting])[:, None]
            o = left * o + np.sqrt(1 - left**2) * rest[row, :k]
        # An innovation is H e + J o + n, and the gain is the best one for the state alone.
        nu = H @ e + rng.normal(size=(2, k)) @ o + rng.uniform(0.3, 2.0) * rest[row, k : k + 2]
        e = e - e @ nu.T @ np.linalg.inv(nu @ nu.T) @ nu
        truths.append(truth)
        filtered.append(truth - e)
        P.append(e @ e.T)
        C.append(e @ o.T)
    x = np.array(filtered)
    errors, motion = lasting_errors(lasting.tolist(), looks), partial(white_acceleration, density=0.3)
    after = [
        smooth_moments(times, x[..., source], np.array(P), np.array(C), motion, errors)
        for source in range(unit.shape[1])
    ]
    off = np.array(truths) - np.stack([mean for mean, _ in after], axis=-1)
    assert np.allclose(after[0][1], off @ np.swapaxes(off, 1, 2))


@pytest.mark.slow
def test_errors_are_as_large_as_tracks_of_two_sensors_say():
    """Which part of a hull is seen lasts, another one of each sensor: before and after smoothing."""
    boat, share, lasting, own, rough = Hull("boat", 6.0, 2.0), 0.8, (20.0, 60.0), (0.7, 1.5), (2.0, 1.0)
    eyes = [
        SURE._replace(rough_m=(size,), correlation=share, lasting_s=one)
        for size, one in zip(rough, lasting, strict=True)
    ]
    targets = OPEN._replace(hulls=(boat,), density=0.3, hits=1, confirmed=0.0)
    # A hundred boats, far apart.
    rng, count = np.random.default_rng(4), 100
    state = np.zeros((count, 4))
    state[:, 0], state[:, 2:] = 5e3 * np.arange(count), rng.normal(0, 3.0, (count, 2))
    lasts, way, scans = rng.normal(size=(2, count, 2)), [], []
    for t in range(28):
        which = t % 2
        left = np.exp(-0.5 / np.array(lasting))[:, None, None]
        lasts = left * lasts + np.sqrt(1 - left**2) * rng.normal(size=lasts.shape)
        error = np.sqrt(share) * lasts[which] + np.sqrt(1 - share) * rng.normal(size=(count, 2))
        z, R = state[:, :2] + np.hypot(own[which], rough[which]) * error, own[which] ** 2 * np.eye(2)
        scans.append(look(t / 2, *z, sensor=which, R=np.tile(R, (count, 1, 1))))
        way.append(state[:, :2])
        F, Q = white_acceleration(0.5, targets.density)
        state = state @ F.T + rng.multivariate_normal(np.zeros(4), Q, count)
    found = run_many(scans, eyes, targets)
    white = run_many(scans, [one._replace(correlation=0.0) for one in eyes], targets)
    given = {
        "filter": [(one.x, one.P) for one in found],
        "smoothed": smooth_many(found, targets.density, own_lasting(eyes)),
        "white": smooth_many(white, targets.density),
    }
    low, high = chi_square_interval(2, runs=count)
    means: dict[str, list[float]] = {name: [] for name in given}
    for name, states in given.items():
        for k in range(3, 28, 12):
            assert found[k].identity.tolist() == list(range(count))
            e, P = way[k] - states[k][0][:, :2], states[k][1][:, :2, :2]
            means[name].append(float(nees(e, P).mean()))
        # Errors of one boat are correlated: the band is of as many values as there are boats.
    assert all(low < np.mean(means[name]) < high for name in ("filter", "smoothed")), means
    assert np.mean(means["white"]) > 2 * high


def test_each_sensor_has_two_errors_of_its_own_behind_all_shared_ones():
    alone, own = SURE, SURE._replace(correlation=0.5, lasting_s=7.0)
    eyes = [own, alone, own]
    assert own_lasting(eyes) == (7.0,) * 4
    assert [own_columns(eyes, k, 9) for k in range(3)] == [slice(5, 7), slice(7, 7), slice(7, 9)]
