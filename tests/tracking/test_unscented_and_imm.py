"""Unscented filter and interacting models: exact where they must be, useful where they should be."""

from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm

from tests.tracking.poses import overflight, turned
from wildlab.errors import WildlabError
from wildlab.geometry.frames import wrap
from wildlab.tracking import measurement as m
from wildlab.tracking.imm import run_imm
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.unscented import run_unscented

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


@pytest.mark.parametrize("gate", [1.0, 0.99])
def test_on_a_linear_model_all_are_the_kalman_filter(gate):
    times, z = positions_seen()
    asked = np.sort(np.concatenate([times, times + 0.01]))
    arguments = dict(gate_probability=gate, output_times=asked)
    plain = run_filter(times, z, R2, m.positions(), CV, START, **arguments)
    the_same(run_unscented(times, z, R2, m.positions(), CV, START, **arguments), plain)
    twice = run_imm(times, z, R2, m.positions(), [CV, CV], [5.0, 2.0], START, **arguments)
    the_same(twice.track, plain)
    assert np.allclose(twice.probabilities.sum(axis=1), 1)


def test_the_unscented_filter_sees_the_bend():
    """Range and bearing of a far target across a wide arc: its mean range is larger, and so is S."""
    rng = np.random.default_rng(0)
    P = np.diag([1.0, 40.0**2, 1, 1])  # across the line of sight
    sensor = m.ranges_bearings(np.zeros(2), 0.0)
    start = Start(0.0, np.array([100.0, 0, 0, 0]), P)
    R = np.diag([1.0, 0.01]) ** 2
    track = run_unscented([0.0], [[100.0, 0.0]], R, sensor, CV, start)
    x = rng.multivariate_normal(start.x, P, 400_000)
    z = m.predict_range_bearing(x[:, :2], np.zeros(2), 0.0).z
    assert abs(track.innovation[0, 0] - (100 - z[:, 0].mean())) < 0.6  # about seven metres too short
    extended = run_filter([0.0], [[100.0, 0.0]], R, sensor, CV, start)
    sampled = np.cov(z.T) + R
    assert abs(np.sqrt(track.S[0, 0, 0]) - np.sqrt(sampled[0, 0])) < 0.3 * np.sqrt(sampled[0, 0])
    assert extended.S[0, 0, 0] < 0.1 * sampled[0, 0]


def test_bearings_are_averaged_across_the_wrap():
    rng = np.random.default_rng(1)
    times = 0.5 * np.arange(80)
    own = np.column_stack([200 * np.cos(0.1 * times), 200 * np.sin(0.1 * times)])
    z = m.predict_range_bearing(np.zeros(2), own, 0.0).z[:, 1:] + rng.normal(0, 0.02, (80, 1))
    sensor, R = m.bearings(own, 0.0), 4e-4 * np.eye(1)
    start = Start(0.0, np.array([10.0, 10, 0, 0]), np.diag([400.0, 400, 1, 1]))
    for track in (
        run_unscented(times, wrap(z), R, sensor, CALM, start),
        run_imm(times, wrap(z), R, sensor, [CALM, CV], [10, 10], start).track,
    ):
        assert track.used.all()
        assert np.abs(track.innovation).max() < 0.5
        assert np.hypot(*track.x[-1, :2]) < 10


def test_behind_the_camera_there_is_no_update():
    times, uv, poses, _ = overflight(20)
    sensor = m.pixels(turned(poses, 7), 0.0)
    for track in (
        run_unscented(times, uv, PIXELS, sensor, CV, START),
        run_imm(times, uv, PIXELS, sensor, [CALM, WILD], [10, 10], START).track,
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
        yield x, sum(mu[i] * (Ps[i] + np.outer(xs[i] - x, xs[i] - x)) for i in range(2)), mu


def test_the_models_interact_as_they_should():
    times, z = positions_seen()
    z[12] -= 100
    result = run_imm(times, z, R2, m.positions(), [CALM, WILD], [8.0, 3.0], START)
    for row, (x, P, mu) in enumerate(by_hand(times, z, [CALM, WILD], [8.0, 3.0], START)):
        if row == 7:
            continue  # what is asked for at a time has all measurements of that time
        assert np.allclose(result.track.x[row], x, rtol=1e-8, atol=1e-8)
        assert np.allclose(result.track.P[row], P, rtol=1e-8, atol=1e-8)
        assert np.allclose(result.probabilities[row], mu, rtol=1e-8)


def test_bad_input_is_named():
    times, z = positions_seen()
    with pytest.raises(WildlabError, match="at least two models"):
        run_imm(times, z, R2, m.positions(), [CV], [1.0], START)
    with pytest.raises(WildlabError, match="at least two models"):
        run_imm(times, z, R2, m.positions(), [CV, CALM], [1.0, 0.0], START)
    both = np.stack([z, z], axis=1)
    with pytest.raises(WildlabError, match="several detections"):
        run_imm(times, both, R2, m.positions(), [CV, CALM], [1.0, 1.0], START)
    with pytest.raises(WildlabError, match="several detections"):
        run_unscented(times, both, R2, m.positions(), CV, START)
    with pytest.raises(WildlabError, match="row 3 at"):
        run_unscented(np.where(np.arange(50) == 3, 0.0, times), z, R2, m.positions(), CV, START)
