"""Other filters of one target, differenced, unscented, of several models, smoothed: exact where they must."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag, expm

from tests.tracking.full_filter import beside, full_filter
from tests.tracking.level_sensors import bearings, consider, measured_from, ranges_bearings
from tests.tracking.poses import overflight, turned
from wildlab.errors import WildlabError
from wildlab.geometry.frames import wrap
from wildlab.tracking import sensors as m
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.kalman import Considered, errors_of
from wildlab.tracking.motion import constant_velocity, rest, singer, white_acceleration
from wildlab.tracking.run import (
    Start,
    lasting_errors,
    run_filter,
    smooth,
    smooth_moments,
    start_from_first,
)
from wildlab.tracking.sensors import predict_range_bearing

ROUGH = partial(constant_velocity, sd_acceleration=0.3)
SINGER = partial(singer, alpha=0.1, variance=0.2)
R_W = np.array([[0.5, 0.1], [0.1, 0.8]])
SLOW = np.array([[0.9, 0.05], [-0.02, 0.8]])


def data(n=40, longest=0.9, seed=0):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.02, longest, n)), np.cumsum(rng.normal(0, 1.5, (n, 2)), axis=0)


def augmented(times, z, motion, prior, F_c):
    """Target and noise in one state, measured without any noise; ``prior`` is for the first row."""
    n = len(prior.x)
    H = np.hstack([np.eye(2, n), np.eye(2)])
    start = Start(times[0], np.append(prior.x, [0.0, 0.0]), beside(prior.P, R_W))

    def move(row, dt):
        still = np.eye(n + 2), np.zeros((n + 2, n + 2))
        return tuple(map(beside, motion(dt), (F_c, R_W))) if row else still

    return full_filter(times, np.zeros((2, 2)), lambda row, x: (z[row] - H @ x, H), move, start)


@pytest.mark.parametrize("F_c", [np.eye(2), SLOW], ids=["constant", "fading"])
@pytest.mark.parametrize(("motion", "n"), [(ROUGH, 4), (SINGER, 6)], ids=["constant velocity", "singer"])
def test_differencing_is_the_augmented_filter(motion, n, F_c):
    """Exactly: once the target is known, the noise is the rest of the measurement.

    Both use the first measurement with noise R_w; the differences begin at the second.
    """
    times, z = data()
    prior = Start(times[0], np.ones(n), np.diag([30.0, 20, 9, 4, 0.3, 0.2])[:n, :n])
    track = run_coloured(times, z, R_W, motion, prior, F_c=F_c)
    assert track.used.all()
    for row, (x, P, _) in enumerate(augmented(times, z, motion, prior, F_c)):
        assert np.allclose(track.x[row], x[:n], rtol=1e-8, atol=1e-8)
        assert np.allclose(track.P[row], P[:n, :n], rtol=1e-8, atol=1e-8)


def test_after_a_gap_the_position_itself_is_used():
    times, z = data(20)
    times[10:] += 5.0
    start = start_from_first(times, z, 1.0, 3.0)
    track = run_coloured(times, z, R_W, ROUGH, start)
    before = run_coloured(times[:10], z[:10], R_W, ROUGH, start)
    direct = run_filter(
        times[10:11], z[10:11], R_W, m.positions(), ROUGH, Start(times[9], before.x[-1], before.P[-1])
    )
    assert np.allclose(track.x[10], direct.x[0])
    assert np.allclose(track.P[10], direct.P[0])
    assert np.allclose(track.S[10], direct.S[0])
    patient = run_coloured(times, z, R_W, ROUGH, start, longest_gap=10.0)
    assert not np.allclose(patient.x[10], direct.x[0])


def test_a_measurement_that_is_not_used_is_no_reference():
    times, z = data(20, longest=0.3)
    start = start_from_first(times, z, 1.0, 3.0)
    gone = z.copy()
    gone[8] = np.nan
    left_out = run_coloured(np.delete(times, 8), np.delete(z, 8, 0), R_W, ROUGH, start, output_times=times)
    missing = run_coloured(times, gone, R_W, ROUGH, start)
    assert np.isnan(missing.nis[8]) and missing.used.sum() == 19
    assert np.allclose(missing.x, left_out.x)
    assert np.allclose(missing.P, left_out.P)


@given(
    steps=st.lists(st.floats(0, 3), min_size=1, max_size=60),
    interval=st.floats(0.01, 5),
    seed=st.integers(0, 99),
)
def test_thinning_keeps_as_many_as_it_may(steps, interval, seed):
    times = np.cumsum(steps)
    usable = np.random.default_rng(seed).random(len(times)) < 0.8
    kept = thin(times, interval, usable)
    assert not kept[~usable].any()
    assert (np.diff(times[kept]) >= interval * (1 - 1e-8)).all()
    for row in np.flatnonzero(usable & ~kept):  # none left out without one kept shortly before
        before = times[:row][kept[:row]]
        assert len(before)
        assert times[row] - before[-1] < interval
    assert np.array_equal(thin(times, interval), thin(times, interval, np.ones(len(times), bool)))


CV = partial(constant_velocity, sd_acceleration=0.2)
CALM = partial(constant_velocity, sd_acceleration=0.02)
WILD = partial(constant_velocity, sd_acceleration=2.0)
START = Start(0.0, np.zeros(4), np.diag([25.0, 25, 9, 9]))
PIXELS = 4.0 * np.eye(2)
R2 = 9.0 * np.eye(2)


def positions_seen(n=50, seed=0):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0, 1.5, n))
    times[8] = times[7]
    z = np.cumsum(rng.normal(0, 2, (n, 2)), axis=0)
    z[[4, 20]] = np.nan
    z[12] += 100
    return times, z


def the_same(ours, theirs, rtol=1e-9):
    for name in ("x", "P", "innovation", "S", "nis"):
        assert np.allclose(
            getattr(ours, name), getattr(theirs, name), rtol=rtol, atol=1e-8, equal_nan=True
        ), name
    assert np.array_equal(ours.used, theirs.used)
    assert np.array_equal(ours.chosen, theirs.chosen)


def test_on_a_linear_model_all_are_the_kalman_filter():
    times, z = positions_seen()
    asked = np.sort(np.concatenate([times, times + 0.01]))
    plain, more = (run_filter(times, z, R2, m.positions(), CV, START, output_times=t) for t in (None, asked))
    the_same(run_unscented(times, z, R2, m.positions(), CV, START, output_times=asked), more)
    the_same(run_imm(times, z, R2, m.positions(), [CV, CV], [5.0, 2.0], START), plain)


def test_the_unscented_filter_sees_the_bend(rng):
    """Range and bearing of a far target across a wide arc: its mean range is larger, and so is S."""
    P = np.diag([1.0, 40.0**2, 1, 1])  # across the line of sight
    sensor = ranges_bearings(np.zeros(2), 0.0)
    start = Start(0.0, np.array([100.0, 0, 0, 0]), P)
    R = np.diag([1.0, 0.01]) ** 2
    track = run_unscented([0.0], [[100.0, 0.0]], R, sensor, CV, start)
    x = rng.multivariate_normal(start.x, P, 400_000)
    z = predict_range_bearing(x[:, :2], np.zeros(2), 0.0).z
    assert abs(track.innovation[0, 0] - (100 - z[:, 0].mean())) < 0.6  # about seven metres too short
    extended = run_filter([0.0], [[100.0, 0.0]], R, sensor, CV, start)
    sampled = np.cov(z.T) + R
    assert abs(np.sqrt(track.S[0, 0, 0]) - np.sqrt(sampled[0, 0])) < 0.3 * np.sqrt(sampled[0, 0])
    assert extended.S[0, 0, 0] < 0.1 * sampled[0, 0]


def test_bearings_are_averaged_across_the_wrap(rng):
    times = 0.5 * np.arange(80)
    own = np.column_stack([200 * np.cos(0.1 * times), 200 * np.sin(0.1 * times)])
    z = predict_range_bearing(np.zeros(2), own, 0.0).z[:, 1:] + rng.normal(0, 0.02, (80, 1))
    sensor, R = bearings(own, 0.0), 4e-4 * np.eye(1)
    start = Start(0.0, np.array([10.0, 10, 0, 0]), np.diag([400.0, 400, 1, 1]))
    for track in (
        run_unscented(times, wrap(z), R, sensor, CALM, start),
        run_imm(times, wrap(z), R, sensor, [CALM, CV], [10, 10], start),
    ):
        assert track.used.all()
        assert np.abs(track.innovation).max() < 0.5
        assert np.hypot(*track.x[-1, :2]) < 10


def test_behind_the_camera_there_is_no_update():
    times, uv, poses, _ = overflight(20)
    sensor = m.pixels(turned(poses, 7), 0.0)
    for track in (
        run_unscented(times, uv, PIXELS, sensor, CV, START),
        run_imm(times, uv, PIXELS, sensor, [CALM, WILD], [10, 10], START),
    ):
        assert np.flatnonzero(~track.used).tolist() == [7]
        assert np.isnan(track.nis[7])
        assert np.isfinite(track.x).all()


def by_hand(times, z, motions, mean_stay, start):
    """Blom and Bar-Shalom's cycle, without filterpy; two models."""
    a, b = 1 / np.asarray(mean_stay)
    mu, H = np.array([0.5, 0.5]), np.eye(2, 4)
    xs, Ps, then = [start.x] * 2, [start.P] * 2, start.time
    for t, one in zip(times, z, strict=True):
        dt = t - then
        M = expm(dt * np.array([[-a, a], [b, -b]]))
        c = mu @ M
        mixed = []
        for j in range(2):
            w = M[:, j] * mu / c[j]
            x = w[0] * xs[0] + w[1] * xs[1]
            mixed.append((x, sum(w[i] * (Ps[i] + np.outer(xs[i] - x, xs[i] - x)) for i in range(2))))
        xs, Ps, likelihood = [], [], np.ones(2)
        for j in range(2):
            F, Q = motions[j](dt)
            x, P = F @ mixed[j][0], F @ mixed[j][1] @ F.T + Q
            if np.isfinite(one).all():
                S, v = H @ P @ H.T + R2, one - H @ x
                K = P @ H.T @ np.linalg.inv(S)
                x, P = x + K @ v, P - K @ S @ K.T
                likelihood[j] = np.exp(-v @ np.linalg.inv(S) @ v / 2) / np.sqrt(np.linalg.det(2 * np.pi * S))
            xs.append(x)
            Ps.append(P)
        mu = c * likelihood / (c * likelihood).sum()
        then = t
        x = mu @ np.array(xs)
        yield x, sum(mu[i] * (Ps[i] + np.outer(xs[i] - x, xs[i] - x)) for i in range(2))


def test_the_models_interact_as_they_should():
    times, z = positions_seen()
    z[12] -= 100
    result = run_imm(times, z, R2, m.positions(), [CALM, WILD], [8.0, 3.0], START)
    for row, (x, P) in enumerate(by_hand(times, z, [CALM, WILD], [8.0, 3.0], START)):
        if row == 7:
            continue  # what is asked for at a time has all measurements of that time
        assert np.allclose(result.x[row], x, rtol=1e-8, atol=1e-8)
        assert np.allclose(result.P[row], P, rtol=1e-8, atol=1e-8)


WA = partial(white_acceleration, density=0.3)


def linear_run(seed, n=25):
    """Positions with uneven times, gaps, one instant twice."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0, 2, n))
    times[7] = times[6]
    z = rng.normal(0, 5, (n, 2))
    z[rng.random(n) < 0.2] = np.nan
    return times, z, np.array([np.diag(rng.uniform(0.5, 4, 2)) for _ in range(n)])


def run_smoothed(times, z, R, sensor, motion, start, pose=None):
    track = run_filter(times, z, R, sensor, motion, start, pose=pose)
    return smooth(track, motion, errors_of(pose, sensor, len(track.nis)))


def everything_at_once(times, z, R, motion, start):
    """Means and covariances of all states given all measurements, as one Gaussian: no recursion at all."""
    n, N = len(start.x), len(times)
    sources = np.eye(n * (N + 1)).reshape(N + 1, n, -1)
    A, mean, then, rows = np.linalg.cholesky(start.P) @ sources[0], start.x, start.time, []
    for t, source in zip(times, sources[1:], strict=True):
        F, Q = motion(t - then)
        values, axes = np.linalg.eigh(Q)
        A, mean, then = F @ A + axes @ (np.sqrt(np.maximum(values, 0.0))[:, None] * source), F @ mean, t
        rows.append((A, mean))
    A, mean = (np.concatenate(part) for part in zip(*rows, strict=True))
    seen = np.isfinite(z).all(axis=1)
    H = np.kron(np.eye(N)[seen], np.eye(2, n))
    S = H @ A @ A.T @ H.T + block_diag(*R[seen])
    gain = A @ A.T @ H.T @ np.linalg.inv(S)
    P = (A @ A.T - gain @ H @ A @ A.T).reshape(N, n, N, n)
    x = mean + gain @ (z[seen].ravel() - H @ mean)
    return x.reshape(N, n), P[np.arange(N), :, np.arange(N)]


@pytest.mark.parametrize(("motion", "seed"), [(CV, 0), (WA, 1)])
def test_it_is_the_mean_given_all_measurements(motion, seed):
    times, z, R = linear_run(seed)
    x, P = everything_at_once(times, z, R, motion, START)
    track = run_filter(times, z, R, m.positions(), motion, START)
    for found in (
        smooth(track, motion),
        # With nothing that could be wrong the joint smoother is the same.
        run_smoothed(times, z, R, measured_from([0, 0]), motion, START, pose=consider({"heading": 0.0})),
    ):
        np.testing.assert_allclose(found.x, x, atol=1e-6)
        np.testing.assert_allclose(found.P, P, atol=1e-6)


@pytest.mark.parametrize("together", [1, 3])
@pytest.mark.parametrize("time", [0.0, 5.0, np.inf])
def test_its_covariance_is_its_errors_with_considered_ones(time, together):
    """The smoother is linear in what is random: its true covariance, one source of randomness at a time; of
    one row at an instant or several, better and worse."""
    N, bias = 12, 2.0
    times = np.arange(N) // together + 1.0
    pose = consider(
        {"platform_north": bias, "platform_east": bias}, {"platform_north": time, "platform_east": time}
    )
    sd = np.array([1.0, 0.2, 3.0])[np.arange(N) % together]
    sensor, R = measured_from([0.0, 0.0]), sd[:, None, None] ** 2 * np.eye(2)
    start = Start(0.0, np.zeros(4), np.diag([9.0, 9.0, 1.0, 1.0]))
    # A column for each source: of the state 4 and of the bias 2, then in each row motion 4, noise 2, bias 2.
    unit = np.eye(6 + 8 * N)
    x, o, rest = np.sqrt(start.P) @ unit[:4], bias * unit[4:6], unit[6:].reshape(N, 8, -1)
    truth, z = [], []
    for k in range(N):
        dt = times[k] - (times[k - 1] if k else 0.0)
        F, Q = WA(dt)
        left = float(np.exp(-dt / time)) if time else 0.0
        x = F @ x + (np.linalg.cholesky(Q) @ rest[k, :4] if dt else 0.0)
        o = left * o + bias * np.sqrt(1 - left**2) * rest[k, 6:] if k else o
        truth.append(x)
        z.append(x[:2] - o + sd[k] * rest[k, 4:6])
    found = [run_smoothed(times, one, R, sensor, WA, start, pose=pose) for one in np.moveaxis(z, -1, 0)]
    e = np.array(truth) - np.stack([one.x for one in found], axis=-1)
    np.testing.assert_allclose(found[0].P, e @ np.swapaxes(e, 1, 2), atol=1e-8)


def test_a_start_without_variance_and_one_row():
    start = Start(0.0, np.zeros(2), np.zeros((2, 2)))
    track = run_filter([1.0, 2.0], np.ones((2, 2)), np.eye(2), m.positions(), rest, start)
    np.testing.assert_array_equal(smooth(track, rest).x, 0.0)
    alone = Start(0.0, np.zeros(2), np.eye(2))
    found = run_smoothed([1.0], np.ones((1, 2)), np.eye(2), m.positions(), rest, alone)
    np.testing.assert_allclose(found.x, 0.5)
    begun = Start(0.0, np.zeros(2), np.eye(2), row=0)
    found = run_smoothed([0.0], np.ones((1, 2)), np.eye(2), m.positions(), rest, begun)
    np.testing.assert_allclose(found.x, 0.0)


def test_a_moment_after_which_less_is_known_says_nothing_of_earlier_ones():
    """As where a track is begun again: its covariance exceeds the prediction, and carries nothing back."""
    x, P = np.array([[0.0, 0, 1, 0], [9.0, 9, 5, 5]]), np.stack([np.eye(4), np.eye(4)])
    F, Q = CV(1.0)
    P[1] = 2 * (F @ P[0] @ F.T + Q)
    found = smooth_moments(np.arange(2.0), x, P, np.zeros((2, 4, 0)), CV, lasting_errors((), 2))
    np.testing.assert_allclose(found[0], x, atol=1e-9)
    np.testing.assert_allclose(found[1], P, atol=1e-9)


def test_rows_whose_pose_is_not_known():
    times, uv, poses, truth = overflight(40)
    P = np.tile(np.diag([1.0, 1, 1, 1e-4, 1e-4, 1e-4]), (40, 1, 1))
    P[[0, 1, 20, 21]] = np.nan
    pose = Considered(m.POSE, P, 30.0)
    filtered = run_filter(times, uv, 4 * np.eye(2), m.pixels(poses, 0.0), CV, START, pose=pose)
    smoothed = run_smoothed(times, uv, 4 * np.eye(2), m.pixels(poses, 0.0), CV, START, pose=pose)
    assert not filtered.used[[0, 1, 20, 21]].any() and filtered.used.sum() == 36
    off = [np.sqrt(np.mean((track.x - truth)[:, :2] ** 2)) for track in (filtered, smoothed)]
    assert np.isfinite(smoothed.P).all() and off[1] < off[0]


def test_a_track_at_other_times_is_refused():
    times, z, R = linear_run(0)
    track = run_filter(times, z, R, m.positions(), CV, START, output_times=times[::2])
    with pytest.raises(WildlabError, match="13 times"):
        smooth(track, CV)
