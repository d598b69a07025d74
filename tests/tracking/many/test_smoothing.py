"""Back over many tracks: the answer of all equations at once, each by itself, errors as predicted."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.many.test_run import EYE, POINTS, look
from tests.tracking.many.test_update import OPEN, SURE
from tests.tracking.poses import GENERATORS
from wildlab.evaluation.consistency import chi_square_interval, nees
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.multitarget import follow_many, smooth_many
from wildlab.tracking.run import Start, lasting_errors, run_filter, smooth, smooth_moments
from wildlab.tracking.sensors import positions
from wildlab.tracking.target_model import Hull, own_columns, own_lasting

H = np.eye(2, 4)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.05, 2.0]))
@settings(max_examples=20, deadline=None)
def test_each_track_is_that_of_kalman_and_rauch_from_its_first_measurement_on(seed, density):
    """Three targets far apart, at uneven times; the last begins later than the others."""
    rng = np.random.default_rng(seed)
    targets, looks, late = OPEN._replace(density=density, hits=4), 7, 2
    times, z = np.cumsum(rng.uniform(0.2, 3.0, looks)), rng.normal(0, 1, (looks, 3, 2))
    z[..., 0] += 1e5 * np.arange(3)
    scans = [look(t, *(at if k >= late else at[:2])) for k, (t, at) in enumerate(zip(times, z, strict=True))]
    filtered, smoothed = smooth_many(scans, [SURE], targets)
    motion = partial(white_acceleration, density=density)
    for name in range(3):
        first = late if name == 2 else 0
        P = np.diag([1.0, 1.0, 9.0, 9.0])
        start = Start(times[first], np.array([*z[first, name], 0.0, 0.0]), P, row=0)
        own = times[first:], z[first:, name]
        one = run_filter(*own, np.eye(2), positions(), motion, start)
        right = smooth(one, motion)
        for k in range(looks):
            for found, track in ((filtered, one), (smoothed, right)):
                here = np.flatnonzero(found[k].identity == name)
                # Believed by the filter from the fourth sighting on, and in the end from the first.
                assert len(here) == (k >= (first if found is smoothed else first + 3))
                for row in here:
                    assert found[k].x[row] == pytest.approx(track.x[k - first], rel=1e-6, abs=1e-6)
                    assert found[k].P[row] == pytest.approx(track.P[k - first], rel=1e-4, abs=1e-6)


def test_each_kind_of_hull_is_smoothed_by_itself(rng):
    """Two kinds that differ in how rough they are: two smoothed Kalman filters, their mean as probable as
    they are, their spread as frequent as they are: what scatters little may lie aside by much."""
    rough, looks = (0.0, 3.0), 8
    eye = SURE._replace(rough_m=rough, along_m=(0.0, 0.0), near_side_m=(0.0, 0.0))
    targets = OPEN._replace(hulls=(Hull("a", 0.0, 0.0, 3.0), Hull("b", 1.0, 1.0, 1.0)), confirmed=0.0, hits=1)
    z = rng.normal(0, 2, (looks, 2))
    scans = [look(float(t), z[t]) for t in range(looks)]
    smoothed = smooth_many(scans, [eye], targets)[1]
    shares = [tracks.kinds[0] for tracks, _ in follow_many(scans, [eye], targets)]
    motion, each = partial(white_acceleration, density=targets.density), []
    for one in rough:
        R = (1 + one**2) * np.eye(2)
        P = np.diag([R[0, 0], R[0, 0], 9.0, 9.0])
        start = Start(0.0, np.array([*z[0], 0.0, 0.0]), P, row=0)
        each.append(smooth(run_filter(np.arange(float(looks)), z, R, positions(), motion, start), motion))
    for k, share in enumerate(shares):
        x, P = np.array([one.x[k] for one in each]), np.array([one.P[k] for one in each])
        mean = share @ x
        off = x - mean
        assert smoothed[k].x[0] == pytest.approx(mean, rel=1e-6, abs=1e-6)
        P += off[:, :, None] * off[:, None]
        assert smoothed[k].P[0] == pytest.approx(0.75 * P[0] + 0.25 * P[1], rel=1e-4, abs=1e-6)


def test_what_ends_ended_when_it_was_seen_last_and_what_comes_back_was_there():
    """Ten scans with, ten without; and the same with ten more behind them."""
    seen = [look(float(t), [0.0, 0.0]) for t in range(10)]
    none = [look(float(t)) for t in range(10, 20)]
    again = [look(float(t), [0.0, 0.0]) for t in range(20, 30)]
    eye, targets = EYE._replace(patience_s=5.5), POINTS._replace(lifetime_s=20.0, hidden_s=20.0)
    online, gone = smooth_many([*seen, *none], [eye], targets)
    back = smooth_many([*seen, *none, *again], [eye], targets)[1]
    counts = [[len(one.identity) for one in some] for some in (online, gone, back)]
    assert counts[0][:2] == [0, 0] and 10 <= sum(counts[1]) < sum(counts[0][2:]) + 2
    assert counts[2] == [1] * 30 and (np.array([one.existence[0] for one in back[:21]]) > 0.99).all()


def test_nobody_grows_old_unwatched_before_or_after():
    """Seen three times, out of view for long, then missed twice: it is there, or ended at either look."""
    eye = EYE._replace(detection=0.6, patience_s=1e6)
    targets = POINTS._replace(lifetime_s=8.0, visible_s=1e12, hidden_s=1e-3, shown=0.0, hits=1, confirmed=0.0)
    away = [look(float(t))._replace(sees=lambda places: np.zeros(len(places), bool)) for t in range(3, 40)]
    scans = [*(look(float(t), [0.0, 0.0]) for t in range(3)), *away, look(40.0), look(41.0)]
    before = [tracks.existence[0] for tracks, _ in follow_many(scans, [eye], targets)]
    r, lasts, missed = before[2], np.exp(-1 / 8.0), 0.4
    there = r * (1 - lasts + lasts * missed * (1 - lasts + lasts * missed))
    back = [one.existence[0] for one in smooth_many(scans, [eye], targets)[1]]
    assert back[2:40] == pytest.approx([there / (there + 1 - r)] * 38, rel=1e-6)
    assert before[3:40] == pytest.approx([r] * 37)


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
    # Two hundred boats, far apart.
    rng, count = np.random.default_rng(4), 200
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
    white = [one._replace(correlation=0.0) for one in eyes]
    filtered, smoothed = smooth_many(scans, eyes, targets)
    given = {"filter": filtered, "smoothed": smoothed, "white": smooth_many(scans, white, targets)[1]}
    low, high = chi_square_interval(2, runs=count)
    means: dict[str, list[float]] = {name: [] for name in given}
    for name, states in given.items():
        for k in range(3, 28, 12):
            assert states[k].identity.tolist() == list(range(count))
            e, P = way[k] - states[k].x[:, :2], states[k].P[:, :2, :2]
            means[name].append(float(nees(e, P).mean()))
        # Errors of one boat are correlated: the band is of as many values as there are boats.
    assert all(low < np.mean(means[name]) < high for name in ("filter", "smoothed")), means
    assert np.mean(means["white"]) > 2 * high


def test_each_sensor_has_two_errors_of_its_own_behind_all_shared_ones():
    alone, own = SURE, SURE._replace(correlation=0.5, lasting_s=7.0)
    eyes = [own, alone, own]
    assert own_lasting(eyes) == (7.0,) * 4
    assert [own_columns(eyes, k, 9) for k in range(3)] == [slice(5, 7), slice(7, 7), slice(7, 9)]
