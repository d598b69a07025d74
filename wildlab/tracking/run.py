"""A whole flight through a filter: arrays of measurements in, estimates at the requested times out.

The same few arguments for every filter: times, measurements, their covariances, a `Sensor` that knows the
poses, a motion model, a `Start`, the errors to consider. Nothing is kept between calls. The filter steps to
every row, also to rows without a usable measurement; see `wildlab.tracking.motion` for where that matters.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking import schmidt
from wildlab.tracking.association import nearest_detection
from wildlab.tracking.consider_parameters import Considers, Errors, errors_of
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.motion import Motion
from wildlab.tracking.records import Start as Start
from wildlab.tracking.records import (
    State,
    check_rows,
    check_start,
    checked,
    predict_by_motion,
    record,
    step_through,
)
from wildlab.tracking.records import Track as Track
from wildlab.tracking.sensors import Sensor, angles_at, check_states, on_state

#: Row, the row of the detection that was used last, the estimate then, covariance now -> whether the track
#: ends here, before anything of this row is used.
Ends = Callable[[int, int, Array, Array], bool]


class Step(NamedTuple):
    """What a filter did at one row; ``gain`` and what belongs to it are None where nothing was used."""

    row: int
    time: float
    F: Array  # (n, n) from the row before, or from the start
    Q: Array
    x_prior: Array  # (n,)
    P_prior: Array
    C_prior: Array  # (n, k)
    x: Array
    P: Array
    C: Array
    gain: Array | None = None  # (n, m)
    H: Array | None = None  # (m, n)
    H_errors: Array | None = None  # (m, k)
    R: Array | None = None  # (m, m)


def run_filter(
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
    ends: Ends | None = None,
) -> Track:
    """Kalman filter on positions; extended filter on pixels, bearings, ranges; Schmidt filter with ``pose``.

    H (3.5), (3.7), 6.2, 6.3, 7.4.2.

    Parameters
    ----------
    times
        (N,) s, in order. Equal times are two measurements at once, and both are used.
    measurements
        (N, m) in the sensor's units; or (N, K, m) with up to K detections in a frame, NaN where there are
        fewer: the nearest by NIS is used. Rows of NaN are frames without a detection.
    R
        (m, m), (N, m, m) or (N, K, m, m), in the sensor's units squared. A measurement whose ``R`` has NaN is
        not used.
    sensor
        From `wildlab.tracking.sensors`, with a pose for each row.
    motion
        From `wildlab.tracking.motion`.
    start
        See `Start`, `start_from_first`.
    pose
        Errors to consider: the Schmidt filter, H (7.32)-(7.38). Those of the poses (`PoseUncertainty`), or
        any (`consider`). None: poses are taken as true.
    gate_probability
        Probability that the target's own measurement is let in, H (3.9); what falls outside the validation
        region is not used. In (0, 1]; 1 is no gate.
    output_times
        (M,) s, in order; the measurements' own when not given.
    ends
        When the track ends: asked at every row behind the start, see `Ends`. From there on there are no
        estimates. None: never.

    Returns
    -------
    Track
        Estimates at ``output_times``, and innovation, ``S`` and NIS of every row.

    Raises
    ------
    WildlabError
        Naming field and row: shapes that do not fit each other, times missing or out of order, an ``R`` or
        an ``S`` that is not positive definite, a start that is not finite or whose ``P`` is no covariance,
        poses of another length than the measurements, a sensor that sees more states than there are, an
        error that it has no derivative for, a ``gate_probability`` outside (0, 1].

    Examples
    --------
    A target at rest at 10 m north, seen three times with a standard deviation of 1 m:

    >>> import numpy as np
    >>> from wildlab.tracking import Start, positions, rest, run_filter
    >>> z = [[10.0, 0.0], [10.5, 0.5], [9.5, -0.5]]
    >>> start = Start(time=0.0, x=np.array([0.0, 0.0]), P=100.0 * np.eye(2))
    >>> track = run_filter([0.0, 1.0, 2.0], z, np.eye(2), positions(), rest, start)
    >>> track.x[-1].round(2).tolist(), np.sqrt(track.P[-1, 0, 0]).round(2).item()
    ([9.97, 0.0], 0.58)
    """
    return filter_in_steps(
        times, measurements, R, sensor, motion, start, pose=pose, gate_probability=gate_probability,
        output_times=output_times, ends=ends,
    )[0]  # fmt: skip


def filter_in_steps(
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
    ends: Ends | None = None,
) -> tuple[Track, list[Step], Errors | None]:
    """`run_filter`, with what it did at every row, and the considered errors as it worked with them."""
    given = checked(times, measurements, R, gate_probability, output_times, sensor.sizes)
    check_start(start)
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, len(start.x))
    errors = errors_of(pose, sensor, len(given.times))
    n, steps = len(start.x), list[Step]()
    C = np.zeros((n, 0 if errors is None else errors.k))

    last, x_last = _first_row(start, given.times), np.asarray(start.x, float)

    def step(row: int, state: State, track: Track) -> State | None:
        nonlocal C, last, x_last
        then, x, P = state
        now, dt = float(given.times[row]), given.times[row] - then
        F, Q = motion(dt)
        x, P = predict(x, P, F, Q)
        if ends is not None and ends(row, last, x_last, P):
            return None
        C = C if errors is None else errors.carry(C, F, row, dt)
        done = Step(row, now, F, Q, x, P, C, x, P, C)
        steps.append(done)
        if not np.isfinite(given.z[row]).all(axis=-1).any():
            return now, x, P
        expected = sensor.predict(row, x[: sensor.states])
        H = on_state(expected.H_position, n)
        if not (np.isfinite(expected.z).all() and np.isfinite(H).all()):
            return now, x, P
        H_errors = np.zeros((len(H), 0))
        if errors is None:
            spread = H @ P @ H.T
        else:
            P_pose, H_errors = errors.covariance[row], errors.of(expected.H_pose)
            if not (np.isfinite(P_pose).all() and np.isfinite(H_errors).all()):
                return now, x, P
            C, track.limited[row] = schmidt.limit_cross(C, P, P_pose)
            steps[-1] = done = done._replace(C_prior=C, C=C)
            spread = schmidt.spread_of_prediction(P, C, P_pose, H, H_errors)
        with np.errstate(invalid="ignore"):
            angles = angles_at(sensor, row)
            best = nearest_detection(given.z[row], expected.z, spread, given.R[row], angles, row)
        if best is None:
            return now, x, P
        let_in = best.nis <= given.thresholds[row]
        record(track, row, best.innovation, best.S, best.nis, best.detection, let_in)
        if not let_in:
            return now, x, P
        noise = given.R[row, best.detection]
        if errors is None:
            update = correct(x, P, best.innovation, H, noise)
            x, P, gain = update.x, update.P, update.gain
        else:
            considered = schmidt.update_schmidt(x, P, C, P_pose, best.innovation, H, H_errors, noise)
            x, P, C, gain = considered.x, considered.P, considered.C, considered.gain
        last, x_last = row, x
        steps[-1] = done._replace(x=x, P=P, C=C, gain=gain, H=H, H_errors=H_errors, R=noise)
        return now, x, P

    return step_through(given, start, predict_by_motion(motion), step), steps, errors


def _first_row(start: Start, times: Array) -> int:
    """The row that a start was made from, or the first that is not before it."""
    return start.row if start.row >= 0 else min(int(np.searchsorted(times, start.time)), len(times) - 1)
