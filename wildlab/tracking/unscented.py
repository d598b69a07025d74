"""The unscented Kalman filter (UKF) beside the extended filter of H, through filterpy.

Same arguments and the same `Track` as `wildlab.tracking.run.run_filter`; one detection per row, and poses are
taken as true.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking.measurement import Sensor, check_states, difference
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import (
    Start,
    State,
    Track,
    check_rows,
    check_start,
    checked,
    predict_by_motion,
    record,
    single_detection,
    step_through,
)


def run_unscented(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion,
    start: Start,
    *,
    gate_probability: float = 1.0,
    output_times: ArrayLike | None = None,
) -> Track:
    """Unscented Kalman filter, on one detection per row.

    Sigma points at ``sqrt(n)`` standard deviations, all of one weight and none in the middle (alpha 1, beta
    0, kappa 0: the cubature rule). No weight is negative, so no covariance can be; a larger beta is for
    points close to the middle, and would count the bend twice here. A row is left out when any point is
    behind the camera.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (N, m) in the sensor's units; rows of NaN are frames without a detection.
    R
        (m, m) or (N, m, m), in the sensor's units squared.
    sensor
        From `wildlab.tracking.measurement`, with a pose for each row.
    motion
        From `wildlab.tracking.motion`, of n states.
    start
        ``x`` (n,) and ``P`` (n, n), which must be positive definite: sigma points need its root.
    gate_probability
        Probability that the target's own measurement is let in, H (3.9), in (0, 1]; 1 is no gate.
    output_times
        (M,) s, in order; the measurements' own when not given.

    Returns
    -------
    Track

    Raises
    ------
    WildlabError
        Naming field and row: shapes that do not fit each other, times missing or out of order, several
        detections in a frame, an ``R`` that is not positive definite, a start that is not finite or whose
        ``P`` is no covariance, poses of another length than the measurements, a ``gate_probability`` outside
        (0, 1].
    numpy.linalg.LinAlgError
        For a covariance that is not positive definite: a start without variance in some direction.
    """
    given = single_detection(checked(times, measurements, R, gate_probability, output_times))
    check_start(start)
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, len(start.x))
    n, m = len(start.x), given.z.shape[2]
    angles = np.array(sensor.angles)

    def mean(points: Array, weights: Array) -> Array:
        """Angles are averaged as differences from the first, which is the middle one."""
        return np.asarray(points[0] + weights @ difference(points, points[0], sensor.angles))

    def residual(a: Array, b: Array) -> Array:
        return difference(a, b, sensor.angles)

    ukf = UnscentedKalmanFilter(
        n, m, 1.0, hx=None, fx=None, points=MerweScaledSigmaPoints(n, 1.0, 0.0, 0.0),
        z_mean_fn=mean if angles.any() else None, residual_z=residual,
    )  # fmt: skip

    def step(row: int, state: State, track: Track) -> State:
        then, ukf.x, ukf.P = state
        F, ukf.Q = motion(given.times[row] - then)
        ukf.predict(fx=lambda x, dt: F @ x)
        prior = given.times[row], ukf.x.copy(), (ukf.P + ukf.P.T) / 2
        if not np.isfinite(given.z[row, 0]).all():
            return prior
        seen = np.array([sensor.predict(row, point[: sensor.states]).z for point in ukf.sigmas_f])
        if not np.isfinite(seen).all():
            return prior
        points = iter(seen)
        ukf.update(given.z[row, 0], R=given.R[row, 0], hx=lambda x: next(points))
        nis = float(ukf.y @ np.linalg.solve(ukf.S, ukf.y))
        record(track, row, ukf.y, ukf.S, nis, 0, nis <= given.threshold)
        return (given.times[row], ukf.x, (ukf.P + ukf.P.T) / 2) if track.used[row] else prior

    return step_through(given, start, predict_by_motion(motion), step)
