"""The unscented Kalman filter (UKF) beside the extended filter of H, through filterpy.

Same arguments and the same `Track` as `wildlab.tracking.run.run_filter`; one detection per row. Errors of the
pose widen the noise of the measurement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import Considers, errors_of
from wildlab.tracking.inputs import check_rows, check_start, checked, single_detection
from wildlab.tracking.motion import Motion
from wildlab.tracking.records import Start, State, Track, predict_by_motion, record, step_through
from wildlab.tracking.sensors import Sensor, angles_at, check_states, difference


def run_unscented(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion,
    start: Start,
    *,
    pose: Considers | None = None,
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
    pose
        Errors to consider, as in `run_filter`; but as if they were new at every measurement, H (7.40)-(7.41):
        ``R + H^o P^o H^o'``, with the derivatives at the predicted state. None: poses are taken as true.
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
    # Imported here, for it brings scipy.stats along, which takes longer than all else that is imported.
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    given = single_detection(checked(times, measurements, R, gate_probability, output_times, sensor.sizes))
    check_start(start)
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, len(start.x))
    errors = errors_of(pose, sensor, len(given.times))
    n, m = len(start.x), given.z.shape[2]
    angles = sensor.angles
    wrapped = any(angles) if sensor.row_angles is None else bool(sensor.row_angles.any())

    def mean(points: Array, weights: Array) -> Array:
        """Angles are averaged as differences from the first, which is the middle one."""
        return np.asarray(points[0] + weights @ difference(points, points[0], angles))

    def residual(a: Array, b: Array) -> Array:
        return difference(a, b, angles)

    ukf = UnscentedKalmanFilter(
        n, m, 1.0, hx=None, fx=None, points=MerweScaledSigmaPoints(n, 1.0, 0.0, 0.0),
        z_mean_fn=mean if wrapped else None, residual_z=residual,
    )  # fmt: skip

    def step(row: int, state: State, track: Track) -> State:
        nonlocal angles
        angles = angles_at(sensor, row)
        then, ukf.x, ukf.P = state
        F, ukf.Q = motion(given.times[row] - then)
        ukf.predict(fx=lambda x, dt: F @ x)
        prior = given.times[row], ukf.x.copy(), (ukf.P + ukf.P.T) / 2
        if not np.isfinite(given.z[row, 0]).all():
            return prior
        seen = sensor.predict(row, ukf.sigmas_f[:, : sensor.states]).z
        if not np.isfinite(seen).all():
            return prior
        noise = given.R[row, 0]
        if errors is not None:
            noise = noise + errors.spread(row, sensor.predict(row, prior[1][: sensor.states]).H_pose)
            if not np.isfinite(noise).all():
                return prior
        points = iter(seen)
        ukf.update(given.z[row, 0], R=noise, hx=lambda x: next(points))
        nis = float(ukf.y @ np.linalg.solve(ukf.S, ukf.y))
        record(track, row, ukf.y, ukf.S, nis, 0, nis <= given.thresholds[row])
        return (given.times[row], ukf.x, (ukf.P + ukf.P.T) / 2) if track.used[row] else prior

    return step_through(given, start, predict_by_motion(motion), step)
