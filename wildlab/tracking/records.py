"""What goes into a run of a filter and what comes out, and how it goes from row to row."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.frames import Array
from wildlab.tracking.kalman import predict
from wildlab.tracking.motion import Motion


class Start(NamedTuple):
    """What is known before the filter runs.

    Attributes
    ----------
    time
        s; earlier measurements are not used.
    x, P
        (n,) and (n, n), in the order of the motion model.
    row
        The measurement that ``x`` was made from, which is not used again, nor any before it. -1: none.
    C
        (n, k) cross-covariance of the state's error (truth minus estimate) with the errors that the filter
        considers, in their order; None: zero. A start made from a measurement has one.
    """

    time: float
    x: Array
    P: Array
    row: int = -1
    C: Array | None = None


class Track(NamedTuple):
    """What a filter made of N measurements, asked at M times.

    Attributes
    ----------
    times, x, P
        (M,), (M, n), (M, n, n): estimates with all measurements up to and including that time; NaN before
        the start.
    innovation, S, nis
        (N, m), (N, m, m), (N,): of each row's measurement, whether it passed the gate or not; NaN where
        there was nothing to compare (no detection, target not in front of the camera, before the start).
    used
        (N,) bool: the measurement changed the estimate, or started it. An unused row with a NIS was
        left out by the gate, one without had nothing usable.
    chosen
        (N,) index of the detection that was nearest, -1 where there was none to choose from.
    limited
        (N,) bool: the Schmidt filter's cross-covariance had to be shortened here (`schmidt.limit_cross`).
    """

    times: Array
    x: Array
    P: Array
    innovation: Array
    S: Array
    nis: Array
    used: NDArray[np.bool_]
    chosen: NDArray[np.int64]
    limited: NDArray[np.bool_]


class FilterInputs(NamedTuple):
    """Checked measurements: K detections in each of N rows."""

    times: Array  # (N,)
    z: Array  # (N, K, m)
    R: Array  # (N, K, m, m)
    output_times: Array  # (M,)
    threshold: float  # largest NIS that is let in
    thresholds: Array  # (N,) likewise, row by row
    sizes: NDArray[np.int64] | None = None  # (N,) elements that a row measures; None: all m


#: State of a filter: when, estimate, covariance.
State = tuple[float, Array, Array]
#: State and a later time -> estimate and covariance then.
PredictTo = Callable[[State, float], tuple[Array, Array]]


def record(track: Track, row: int, innovation: Array, S: Array, nis: float, chosen: int, used: bool) -> None:
    """Enter a row's innovation with its covariance and NIS, and whether the measurement was used."""
    track.innovation[row], track.S[row], track.nis[row] = innovation, S, nis
    track.chosen[row], track.used[row] = chosen, used


def predict_by_motion(motion: Motion) -> PredictTo:
    """Prediction with a motion model."""
    return lambda state, time: predict(state[1], state[2], *motion(time - state[0]))


def step_through(
    given: FilterInputs,
    start: Start,
    predict_to: PredictTo,
    step: Callable[[int, State, Track], State | None],
) -> Track:
    """Apply a filter's ``step`` to the rows in order, and predict to the requested times in between.

    ``predict_to`` gives estimate and covariance at a later time; ``step`` gives the state after a row, and
    may leave it at an earlier time. None ends the track: it has no estimates from that row on.
    """
    N, _, m = given.z.shape
    M, n = len(given.output_times), len(start.x)
    track = Track(
        given.output_times,
        np.full((M, n), np.nan),
        np.full((M, n, n), np.nan),
        np.full((N, m), np.nan),
        np.full((N, m, m), np.nan),
        np.full(N, np.nan),
        np.zeros(N, bool),
        np.full(N, -1),
        np.zeros(N, bool),
    )
    state: State = (float(start.time), np.asarray(start.x, float), np.asarray(start.P, float))
    if start.row >= 0:
        track.used[start.row] = True
        track.chosen[start.row] = 0
    first = max(int(np.searchsorted(given.times, start.time, "left")), start.row + 1)
    out = int(np.searchsorted(given.output_times, start.time, "left"))

    def write_until(time: float, out: int) -> int:
        while out < M and given.output_times[out] < time:
            track.x[out], track.P[out] = predict_to(state, float(given.output_times[out]))
            out += 1
        return out

    for row in range(first, N):
        out = write_until(given.times[row], out)
        after = step(row, state, track)
        if after is None:
            break
        state = after
    else:
        write_until(np.inf, out)
    if given.sizes is not None:  # what a row does not measure was told and not seen
        absent = np.arange(m) >= given.sizes[:, None]
        track.innovation[absent] = np.nan
        track.S[absent[:, :, None] | absent[:, None, :]] = np.nan
    return track
