"""Measurements whose noise is correlated in time: differenced, H (7.5)-(7.12), or thinned out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import nearest_detection
from wildlab.tracking.kalman import correct, predict, update
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import (
    Start,
    State,
    Track,
    check_start,
    checked,
    predict_by_motion,
    record,
    step_through,
)


class Differenced(NamedTuple):
    """The model of H (7.7)-(7.12) over one interval between two measurements.

    ``y = z_2 - F_c z_1 = H x_1 + noise R`` and ``x_2 = F x_1 + T y + noise Q``, noises uncorrelated.
    """

    H: Array  # (m, n) the print's H*
    R: Array  # (m, m)
    F: Array  # (n, n) the print's F*
    Q: Array  # (n, n) the print's Q*
    T: Array  # (n, m)


def difference_model(F: Array, Q: Array, H: Array, F_c: Array, R_w: Array) -> Differenced:
    """H (7.7)-(7.12) for a motion (F, Q) from one measurement to the next."""
    H_star = H @ F - F_c @ H
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
    F_c: ArrayLike | None = None,
    longest_gap: float = 1.0,
    gate_probability: float = 1.0,
    output_times: ArrayLike | None = None,
) -> Track:
    """Filter on differences of successive georeferenced positions, H 7.2.2.

    The difference to the next measurement updates the estimate at the earlier of the two, over the time
    between them, and only then is the estimate taken to the later one. A measurement that follows the last
    used one by more than ``longest_gap`` is used directly, with ``R_w`` as white noise. One left out by the
    gate, or NaN, is passed over: the next is held against the last used one.

    The innovation, ``S`` and NIS of a row are those of its difference (or of its position, after a gap).

    Parameters
    ----------
    times
        (N,) s, in order.
    positions
        (N, 2) north, east in n, m; rows of NaN are frames without a detection.
    R_w
        (2, 2) or (N, 2, 2), m^2: of the noise that drives the correlated one, H (7.5).
    motion
        From `wildlab.tracking.motion`, of n states.
    start
        ``x`` (n,) and ``P`` (n, n). Its row is the first measurement of a difference.
    F_c
        (2, 2), the correlated noise's transition from one measurement to the next; identity in H, and where
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
        As `wildlab.tracking.run.run_filter`; and for several detections in a frame.
    """
    given = checked(times, positions, R_w, gate_probability, output_times)
    check_start(start)
    if given.z.shape[1] != 1:
        raise WildlabError(
            "several detections in a frame", "choose one before differencing", field="positions"
        )
    m, n = given.z.shape[2], len(start.x)
    H, F_c = np.eye(m, n), np.eye(m) if F_c is None else np.asarray(F_c, float)
    last = start.row if start.row >= 0 and np.isfinite(given.z[start.row]).all() else -1

    def step(row: int, state: State, track: Track) -> State:
        nonlocal last
        then, x, P = state
        dt = given.times[row] - then
        R = given.R[row, 0]
        direct = last < 0 or given.times[row] - given.times[last] > longest_gap
        F, Q = motion(dt)
        if direct:
            prior, spread = predict(x, P, F, Q)
            best = nearest_detection(
                given.z[row], H @ prior, H @ spread @ H.T, given.R[row], (False,) * m, row
            )
        else:
            model = difference_model(F, Q, H, F_c, R)
            y = given.z[row] - F_c @ given.z[last, 0]
            best = nearest_detection(
                y, model.H @ x, model.H @ P @ model.H.T, model.R[None], (False,) * m, row
            )
        if best is None:
            return state
        record(track, row, best.innovation, best.S, best.nis, 0, best.nis <= given.threshold)
        if not track.used[row]:
            return state
        last = row
        if direct:
            done = update(prior, spread, given.z[row, 0], H, R)
            return given.times[row], done.x, done.P
        done = correct(x, P, best.innovation, model.H, model.R)
        x_new, P_new = predict(done.x, done.P, model.F, model.Q)
        return given.times[row], x_new + model.T @ y[0], P_new

    return step_through(given, start, predict_by_motion(motion), step)


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
