"""The smoother: exact in linear cases, its covariance that of its errors and never above the filter's."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from tests.tracking.poses import overflight
from wildlab.errors import WildlabError
from wildlab.tracking import measurement as m
from wildlab.tracking.considered import consider
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.motion import constant_velocity, rest
from wildlab.tracking.platforms import measured_from
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.schmidt import PoseUncertainty
from wildlab.tracking.smoothing import run_smoothed, smooth

CV = partial(constant_velocity, sd_acceleration=0.2)
WA = partial(white_acceleration, density=0.3)
START = Start(0.0, np.zeros(4), np.diag([25.0, 25.0, 9.0, 9.0]))
SEEDS = st.integers(0, 2**31)


def linear_run(seed, n=25):
    """Positions with uneven times, gaps, one instant twice."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0, 2, n))
    times[7] = times[6]
    z = rng.normal(0, 5, (n, 2))
    z[rng.random(n) < 0.2] = np.nan
    return times, z, np.array([np.diag(rng.uniform(0.5, 4, 2)) for _ in range(n)])


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
        run_smoothed(times, z, R, m.positions(), motion, START),
        # With nothing that could be wrong the joint smoother is the same.
        run_smoothed(times, z, R, measured_from([0, 0]), motion, START, pose=consider({"heading": 0.0})),
    ):
        np.testing.assert_allclose(found.x, x, atol=1e-6)
        np.testing.assert_allclose(found.P, P, atol=1e-6)


@settings(max_examples=30)
@given(SEEDS)
def test_covariances_are_never_above_the_filters(seed):
    times, z, R = linear_run(seed)
    for pose in (None, consider({"platform_north": 3.0, "heading": 0.02}, correlation_time={"heading": 4.0})):
        sensor = measured_from([-100.0, 30.0])
        filtered = run_filter(times, z, R, sensor, WA, START, pose=pose)
        smoothed = run_smoothed(times, z, R, sensor, WA, START, pose=pose)
        sd = np.sqrt(np.diagonal(filtered.P, axis1=1, axis2=2))
        gained = (filtered.P - smoothed.P) / (sd[:, :, None] * sd[:, None, :])
        assert np.linalg.eigvalsh(gained)[:, 0].min() > -1e-8
        assert np.linalg.eigvalsh(smoothed.P)[:, 0].min() > 0
        np.testing.assert_allclose(smoothed.x[-1], filtered.x[-1])
        np.testing.assert_array_equal(smoothed.nis, filtered.nis)


@pytest.mark.parametrize("time", [0.0, 5.0, np.inf])
def test_its_covariance_is_its_errors_with_considered_ones(time):
    """The smoother is linear in what is random: its true covariance, one source of randomness at a time."""
    N, bias = 12, 2.0
    times = np.arange(1.0, N + 1)
    pose = consider({"platform_north": bias, "platform_east": bias}, correlation_time=time)
    sensor, R = measured_from([0.0, 0.0]), np.eye(2)
    start = Start(0.0, np.zeros(4), np.diag([9.0, 9.0, 1.0, 1.0]))
    F, Q = WA(1.0)
    left = float(np.exp(-1 / time)) if time else 0.0
    # A column for each source: of the state 4 and of the bias 2, then in each row motion 4, noise 2, bias 2.
    unit = np.eye(6 + 8 * N)
    x, o, rest = np.sqrt(start.P) @ unit[:4], bias * unit[4:6], unit[6:].reshape(N, 8, -1)
    truth, z = [], []
    for k in range(N):
        x = F @ x + np.linalg.cholesky(Q) @ rest[k, :4]
        o = left * o + bias * np.sqrt(1 - left**2) * rest[k, 6:] if k else o
        truth.append(x)
        z.append(x[:2] - o + rest[k, 4:6])
    found = [run_smoothed(times, one, R, sensor, WA, start, pose=pose) for one in np.moveaxis(z, -1, 0)]
    e = np.array(truth) - np.stack([one.x for one in found], axis=-1)
    np.testing.assert_allclose(found[0].P, e @ np.swapaxes(e, 1, 2), atol=1e-8)


def test_between_rows_before_and_behind():
    times, z, R = linear_run(3)
    asked = np.sort(np.concatenate([[times[0] - 5, times[-1] + 3], times, times[:-1] + 0.4 * np.diff(times)]))
    for pose in (None, consider({"heading": 0.0})):
        sensor = measured_from([0.0, 0.0])
        given = (R, sensor, WA, START)
        rows = np.sort(np.concatenate([times, asked]))
        filled = np.full((len(rows), 2), np.nan)
        noise = np.tile(np.eye(2), (len(rows), 1, 1))
        place = np.searchsorted(rows, times)
        for i, k in enumerate(place):
            k = k + (1 if i and place[i - 1] == place[i] else 0)
            filled[k], noise[k] = z[i], R[i]
        found = run_smoothed(times, z, *given, pose=pose, output_times=asked)
        # A model that is continuous in time does not mind rows in between at which nothing is seen.
        every = run_smoothed(rows, filled, noise, *given[1:], pose=pose, output_times=asked)
        np.testing.assert_allclose(found.x, every.x, atol=1e-6)
        np.testing.assert_allclose(found.P, every.P, atol=1e-6)
        before = asked < 0
        assert np.isnan(found.x[before]).all()


def test_a_start_without_variance_and_one_row():
    start = Start(0.0, np.zeros(2), np.zeros((2, 2)))
    track = run_filter([1.0, 2.0], np.ones((2, 2)), np.eye(2), m.positions(), rest, start)
    np.testing.assert_array_equal(smooth(track, rest).x, 0.0)
    alone = Start(0.0, np.zeros(2), np.eye(2))
    found = run_smoothed(
        [1.0], np.ones((1, 2)), np.eye(2), m.positions(), rest, alone, output_times=[0.0, 1.0]
    )
    np.testing.assert_allclose(found.x, 0.5)
    begun = Start(0.0, np.zeros(2), np.eye(2), row=0)
    found = run_smoothed([0.0], np.ones((1, 2)), np.eye(2), m.positions(), rest, begun)
    np.testing.assert_allclose(found.x, 0.0)


def test_rows_whose_pose_is_not_known():
    times, uv, poses, truth = overflight(40)
    P = np.tile(np.diag([1.0, 1, 1, 1e-4, 1e-4, 1e-4]), (40, 1, 1))
    P[[0, 1, 20, 21]] = np.nan
    pose = PoseUncertainty(P, 30.0)
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
