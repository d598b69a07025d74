"""Tracking filters against other people's software: filterpy and, where it is installed, Stone Soup."""

from datetime import UTC, datetime, timedelta
from functools import partial

import numpy as np
import pytest
from filterpy.kalman import EKF, KalmanFilter, UnscentedKalmanFilter
from filterpy.kalman import MerweScaledSigmaPoints as SigmaPoints

from tests.tracking.poses import overflight
from wildlab.tracking import sensors as m
from wildlab.tracking.batch import run_batch
from wildlab.tracking.filters import run_unscented
from wildlab.tracking.motion import constant_velocity, singer
from wildlab.tracking.run import Start, run_filter, smooth

CV = partial(constant_velocity, sd_acceleration=0.2)


def covariance(rng, k):
    A = rng.normal(size=(k, k + 1))
    return A @ A.T + 0.1 * np.eye(k)


@pytest.mark.parametrize("seed", range(6))
def test_whole_runs_agree_with_filterpy_over_random_models(seed):
    """Random transitions and noises, uneven times, every row its own R."""
    rng = np.random.default_rng(seed)
    n = int(rng.choice([2, 4, 6]))
    drift, noise = 0.3 * rng.normal(size=(n, n)), covariance(rng, n)
    times = np.cumsum(rng.uniform(0, 1.0, 40))
    z, R = rng.normal(0, 3, (40, 2)), np.array([covariance(rng, 2) for _ in range(40)])

    def motion(dt):
        return np.eye(n) + dt * drift, dt * noise

    start = Start(0.0, rng.normal(size=n), covariance(rng, n))
    track = run_filter(times, z, R, m.positions(), motion, start)
    oracle = KalmanFilter(dim_x=n, dim_z=2)
    oracle.x, oracle.P, oracle.H = start.x.copy(), start.P.copy(), np.eye(2, n)
    then = 0.0
    for row, t in enumerate(times):
        F, Q = motion(t - then)
        oracle.predict(F=F, Q=Q)
        oracle.update(z[row], R=R[row])
        then = t
        size = np.abs(oracle.P).max()
        assert np.allclose(track.x[row], oracle.x, rtol=1e-10, atol=1e-10)
        assert np.allclose(track.P[row], oracle.P, rtol=1e-10, atol=1e-10 * size)
        assert np.allclose(track.S[row], oracle.S, rtol=1e-10)
        assert np.allclose(track.innovation[row], oracle.y, rtol=1e-10, atol=1e-10)


def test_pixels_agree_with_filterpys_extended_filter():
    times, uv, poses, _ = overflight()
    sensor, R = m.pixels(poses, 0.0), 4.0 * np.eye(2)
    motion = partial(singer, alpha=0.1, variance=0.04)
    start = Start(0.0, np.zeros(6), np.diag([25.0, 25, 9, 9, 0.04, 0.04]))
    track = run_filter(times, uv, R, sensor, motion, start)
    oracle = EKF.ExtendedKalmanFilter(dim_x=6, dim_z=2)
    oracle.x, oracle.P, oracle.R = start.x.copy(), start.P.copy(), R
    then = 0.0
    for row, t in enumerate(times):
        oracle.F, oracle.Q = motion(t - then)
        oracle.predict()
        oracle.update(
            uv[row],
            lambda x, row=row: m.on_state(sensor.predict(row, x[:2]).H_position, 6),
            lambda x, row=row: sensor.predict(row, x[:2]).z,
        )
        then = t
        assert np.allclose(track.x[row], oracle.x, rtol=1e-9, atol=1e-9)
        assert np.allclose(track.P[row], oracle.P, rtol=1e-9, atol=1e-9)


def test_the_unscented_wrapper_adds_nothing():
    times, uv, poses, _ = overflight()
    sensor, R = m.pixels(poses, 0.0), 4.0 * np.eye(2)
    start = Start(0.0, np.zeros(4), np.diag([25.0, 25, 9, 9]))
    track = run_unscented(times, uv, R, sensor, CV, start)
    then = 0.0
    oracle = UnscentedKalmanFilter(
        4, 2, 1.0, hx=lambda x, row: sensor.predict(row, x[:2]).z, fx=lambda x, dt: CV(dt)[0] @ x,
        points=SigmaPoints(4, 1.0, 0.0, 0.0),
    )  # fmt: skip
    oracle.x, oracle.P = start.x.copy(), start.P.copy()
    for row, t in enumerate(times):
        oracle.Q = CV(t - then)[1]
        oracle.predict(dt=t - then)
        oracle.update(uv[row], R=R, row=row)
        then = t
        assert np.allclose(track.x[row], oracle.x, rtol=1e-9, atol=1e-9)
        assert np.allclose(track.P[row], oracle.P, rtol=1e-9, atol=1e-9)


def test_a_run_agrees_with_stone_soup():
    """Its constant velocity model has continuous white acceleration, so its noise is handed to our filter."""
    pytest.importorskip("stonesoup")
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    rng = np.random.default_rng(0)
    times = np.cumsum(rng.integers(1, 2000, 30)) / 1000
    z = np.cumsum(rng.normal(0, 2, (30, 2)), axis=0)
    model = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.3)] * 2)
    order = [0, 2, 1, 3]  # theirs is north, its speed, east, its speed

    def motion(dt):
        F = np.asarray(model.matrix(time_interval=timedelta(seconds=dt)), float)
        Q = np.asarray(model.covar(time_interval=timedelta(seconds=dt)), float)
        return F[np.ix_(order, order)], Q[np.ix_(order, order)]

    start = Start(0.0, np.array([1.0, 2, 0.5, -0.5]), np.diag([30.0, 20, 4, 4]))
    track = run_filter(times, z, 9 * np.eye(2), m.positions(), motion, start)
    (batch,) = run_batch(times, z[None], 9 * np.eye(2), motion, start)
    predictor = KalmanPredictor(model)
    updater = KalmanUpdater(LinearGaussian(4, (0, 2), 9 * np.eye(2)))
    epoch = datetime(2020, 1, 1, tzinfo=UTC)
    state = GaussianState(start.x[order], start.P[np.ix_(order, order)], timestamp=epoch)
    for row, t in enumerate(times):
        seen = Detection(z[row][:, None], timestamp=epoch + timedelta(seconds=float(t)))
        state = updater.update(SingleHypothesis(predictor.predict(state, timestamp=seen.timestamp), seen))
        theirs = np.asarray(state.state_vector, float).ravel()[order]
        assert np.allclose(track.x[row], theirs, rtol=1e-8, atol=1e-8)
        assert np.allclose(batch.x[row], theirs, rtol=1e-8, atol=1e-8)
        assert np.allclose(track.P[row], np.asarray(state.covar, float)[np.ix_(order, order)], rtol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_smoothed_runs_agree_with_filterpy(seed):
    """Uneven times, gaps, every row its own R."""
    rng = np.random.default_rng(seed)
    motion = partial(singer, alpha=0.3, variance=0.5)
    times = np.cumsum(rng.uniform(0.1, 1.0, 40))
    z, R = rng.normal(0, 3, (40, 2)), np.array([covariance(rng, 2) for _ in range(40)])
    z[rng.random(40) < 0.2] = np.nan
    start = Start(0.0, rng.normal(size=6), covariance(rng, 6))
    ours = smooth(run_filter(times, z, R, m.positions(), motion, start), motion)
    oracle = KalmanFilter(dim_x=6, dim_z=2)
    oracle.x, oracle.P, oracle.H = start.x.copy(), start.P.copy(), np.eye(2, 6)
    steps = [motion(dt) for dt in np.diff(times, prepend=0.0)]
    xs, Ps = [], []
    for row, (F, Q) in enumerate(steps):
        oracle.predict(F=F, Q=Q)
        oracle.update(z[row] if np.isfinite(z[row]).all() else None, R=R[row])
        xs.append(oracle.x.copy())
        Ps.append(oracle.P.copy())
    x, P, *_ = oracle.rts_smoother(
        np.array(xs), np.array(Ps), Fs=[F for F, _ in steps], Qs=[Q for _, Q in steps]
    )
    assert np.allclose(ours.x, x, rtol=1e-8, atol=1e-8)
    assert np.allclose(ours.P, P, rtol=1e-8, atol=1e-8)
