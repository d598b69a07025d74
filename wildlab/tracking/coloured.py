"""Measurements whose noise is correlated in time: differenced, H (7.5)-(7.12), or thinned out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import nearest_detection
from wildlab.tracking.consider_parameters import Considers, Errors, errors_of
from wildlab.tracking.inputs import check_rows, check_start, checked
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.measurement import positions as positions_sensor
from wildlab.tracking.motion import Motion
from wildlab.tracking.records import Start, State, Track, predict_by_motion, record, step_through
from wildlab.tracking.sensors import Sensor, check_states, difference, on_state


class Differenced(NamedTuple):
    """The model of H (7.7)-(7.12) over one interval between two measurements.

    ``y = z_2 - F_c z_1 = H x_1 + noise R`` and ``x_2 = F x_1 + T y + noise Q``, noises uncorrelated.
    """

    H: Array  # (m, n) the print's H*
    R: Array  # (m, m)
    F: Array  # (n, n) the print's F*
    Q: Array  # (n, n) the print's Q*
    T: Array  # (n, m)


def difference_model(
    F: Array, Q: Array, H: Array, F_c: Array, R_w: Array, H_before: Array | None = None
) -> Differenced:
    """H (7.7)-(7.12) for a motion (F, Q) from one measurement to the next.

    ``H_before`` is the derivative of the first of the two; None: the same as that of the second.
    """
    H_star = H @ F - F_c @ (H if H_before is None else H_before)
    R = H @ Q @ H.T + R_w
    T = np.asarray(np.linalg.solve(R, H @ Q).T, float)
    # Q - Q H' R^-1 H Q, in the form that cannot turn negative.
    kept = np.eye(len(F)) - T @ H
    return Differenced(H_star, R, F - T @ H_star, kept @ Q @ kept.T + T @ R_w @ T.T, T)


def run_coloured(
    times: ArrayLike,
    positions: ArrayLike,
    R_w: ArrayLike,
    motion: Motion,
    start: Start,
    *,
    sensor: Sensor | None = None,
    pose: Considers | None = None,
    F_c: ArrayLike | None = None,
    longest_gap: float = 1.0,
    gate_probability: float = 1.0,
    output_times: ArrayLike | None = None,
) -> Track:
    """Filter on differences of successive measurements, georeferenced positions above all, H 7.2.2.

    The difference to the next measurement updates the estimate at the earlier of the two, over the time
    between them, and only then is the estimate taken to the later one. A measurement that follows the last
    used one by more than ``longest_gap`` is used directly, with ``R_w`` as white noise. One left out by the
    gate, or NaN, is passed over: the next is held against the last used one.

    The innovation, ``S`` and NIS of a row are those of its difference (or of the measurement, after a gap).
    Sensors whose prediction is not linear in the state are linearised at either end of the interval.

    Parameters
    ----------
    times
        (N,) s, in order.
    positions
        (N, 2) north, east in n, m, or (N, m) in the sensor's units; rows of NaN are frames without a
        detection.
    R_w
        (m, m) or (N, m, m), in the units squared: of the noise that drives the correlated one, H (7.5).
    motion
        From `wildlab.tracking.motion`, of n states.
    start
        ``x`` (n,) and ``P`` (n, n). Its row is the first measurement of a difference.
    sensor
        From `wildlab.tracking.measurement`, the same in all rows; None: `positions`.
    pose
        Errors to consider, as in `run_filter`. What is left of them in a difference widens its noise, and
        that is all of them after a gap: as H (7.40)-(7.41) they are not followed from row to row. None:
        poses are taken as true.
    F_c
        (m, m), the correlated noise's transition from one measurement to the next; identity in H, and where
        it is left out.
    longest_gap
        s, H 7.2.2.
    gate_probability
        Probability that the target's own difference is let in, H (3.9), in (0, 1]; 1 is no gate.
    output_times
        (M,) s, in order; the measurements' own when not given.

    Returns
    -------
    Track

    Raises
    ------
    WildlabError
        As `wildlab.tracking.run.run_filter`; and for several detections in a frame, or rows of different
        sensors, between which there is no difference.
    """
    sensor = positions_sensor() if sensor is None else sensor
    if sensor.sizes is not None:
        raise WildlabError(
            "measurements of several sensors", "difference those of one sensor at a time", field="sensor"
        )
    given = checked(times, positions, R_w, gate_probability, output_times)
    check_start(start)
    if given.z.shape[1] != 1:
        raise WildlabError(
            "several detections in a frame", "choose one before differencing", field="positions"
        )
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, len(start.x))
    errors = errors_of(pose, sensor, len(given.times))
    m, n = given.z.shape[2], len(start.x)
    F_c = np.eye(m) if F_c is None else np.asarray(F_c, float)
    last = start.row if start.row >= 0 and np.isfinite(given.z[start.row]).all() else -1

    def step(row: int, state: State, track: Track) -> State:
        nonlocal last
        then, x, P = state
        dt = given.times[row] - then
        if not np.isfinite(given.z[row]).all():
            return state
        direct = last < 0 or given.times[row] - given.times[last] > longest_gap
        F, Q = motion(dt)
        prior, spread = predict(x, P, F, Q)
        now = sensor.predict(row, prior[: sensor.states])
        H = on_state(now.H_position, n)
        gap, R = difference(given.z[row, 0], now.z, sensor.angles), given.R[row, 0]
        if direct:
            R = R if errors is None else R + errors.spread(row, now.H_pose)
            found, H_now, P_now = gap, H, spread
        else:
            before = sensor.predict(last, x[: sensor.states])
            if errors is not None:
                R = R + _left_in_difference(errors, given.times, last, row, before.H_pose, now.H_pose, F_c)
            model = difference_model(F, Q, H, F_c, R, on_state(before.H_position, n))
            found = gap - F_c @ difference(given.z[last, 0], before.z, sensor.angles)
            H_now, P_now, R = model.H, P, model.R
        if not all(np.isfinite(part).all() for part in (found, H_now, R)):
            return state
        nothing = np.zeros(m)
        best = nearest_detection(found[None], nothing, H_now @ P_now @ H_now.T, R[None], (False,) * m, row)
        if best is None:
            return state
        record(track, row, best.innovation, best.S, best.nis, 0, best.nis <= given.threshold)
        if not track.used[row]:
            return state
        last = row
        if direct:
            done = correct(prior, spread, best.innovation, H, R)
            return given.times[row], done.x, done.P
        done = correct(x, P, best.innovation, model.H, model.R)
        _, P_new = predict(done.x, done.P, model.F, model.Q)
        left = best.innovation - model.H @ (done.x - x)
        return given.times[row], F @ done.x + model.T @ left, P_new

    return step_through(given, start, predict_by_motion(motion), step)


def _left_in_difference(
    errors: Errors, times: Array, first: int, row: int, H_first: Array, H_row: Array, F_c: Array
) -> Array:
    """Covariance (m, m) of what considered errors do to ``z_2 - F_c z_1``."""
    psi = np.eye(errors.k)
    for one in range(first + 1, row + 1):
        psi = errors.transition(one, times[one] - times[one - 1]) @ psi
    P, P_row = errors.covariance[first], errors.covariance[row]
    by_row = errors.of(H_row)
    by_both = by_row @ psi - F_c @ errors.of(H_first)
    S = by_both @ P @ by_both.T + by_row @ (P_row - psi @ P @ psi.T) @ by_row.T
    return np.asarray((S + S.T) / 2)


def thin(times: ArrayLike, interval: float, usable: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Which of N measurements, in order of time, to keep so that no two are closer than ``interval``.

    The first is kept, then the first at least ``interval`` after the last kept.

    Parameters
    ----------
    times
        (N,) s, in order. Rows without a time are not kept.
    interval
        s.
    usable
        (N,) bool: rows that are not are neither kept nor counted. All are when it is left out.

    Returns
    -------
    (N,) bool: the rows to keep.
    """
    t = np.asarray(times, float)
    ready = np.isfinite(t) if usable is None else np.isfinite(t) & np.asarray(usable, bool)
    kept, last = np.zeros(len(t), bool), -np.inf
    for row in np.flatnonzero(ready):
        if t[row] - last >= interval * (1 - 1e-9):
            kept[row], last = True, t[row]
    return kept
