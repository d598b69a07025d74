"""A whole flight through a filter: arrays of measurements in, estimates at the requested times out.

The same few arguments for every filter: times, measurements, their covariances, a `Sensor` that knows the
poses, a motion model, a `Start`, the errors to consider. Nothing is kept between calls. The filter steps to
every row, also to rows without a usable measurement; see `wildlab.tracking.motion` for where that matters.

Back over a track: estimates that know later measurements too, for flights that are over.

Each estimate is corrected by what the smoother changed at the next row, as by Rauch, Tung and Striebel,

``x^s_k = x_k + G (x^s_k+1 - x_k+1|k)``,

but with the ``G`` that is best for the joint covariance of target and considered errors, which are not
estimated and last. With ``e`` for truth minus estimate and ``o`` for the errors,
``e^s_k+1 = A e_k+1|k + B o_k+1 + n``, where ``n`` has the covariance ``N`` and is independent of what was
before: so the correction ``d = (I - A) e - B o - n`` has a known covariance with ``e_k``, ``G`` is that
over the covariance of ``d``, and ``A``, ``B`` and ``N`` follow one row back. The smoothed covariance is
never above the filter's, and without considered errors it is Rauch, Tung and Striebel's.

What a measurement did is known by the moments before and after it. The best gain leaves the error after a
measurement uncorrelated with the innovation, so with the error before it has its own covariance in common; no
more than there was, where mixtures grow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import check_covariance, gate_threshold
from wildlab.geometry.frames import Array
from wildlab.tracking.association import nearest_detection
from wildlab.tracking.kalman import (
    Considered,
    Errors,
    correct,
    errors_of,
    limit_cross,
    predict,
    spread_of_prediction,
    update_schmidt,
)
from wildlab.tracking.motion import Motion
from wildlab.tracking.sensors import Sensor, angles_at, on_state


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
    """

    time: float
    x: Array
    P: Array
    row: int = -1


def start_from_first(
    times: ArrayLike,
    positions: ArrayLike,
    sd_position: float,
    sd_velocity: float = 0.0,
    n: int = 4,
    **more: float,
) -> Start:
    """Start on the first georeferenced position, with zero speed (H 6.2.4, 6.3.3).

    Parameters
    ----------
    times
        (N,) s.
    positions
        (N, 2) or (N, 3): north, east in n, m, and what is not looked at; the first row with a time and
        without NaN is taken.
    sd_position, sd_velocity
        m and m/s, the same north and east.
    n
        Number of states: 2, 4 or 6.
    more
        ``sd_acceleration``, m/s^2, with six states; zero where it is left out. No other name is looked at.

    Returns
    -------
    Start
        At the time of that row, which is not used again, with a diagonal ``P`` (n, n).

    Raises
    ------
    WildlabError
        Without any position.
    """
    t, p = np.asarray(times, float), np.asarray(positions, float)[:, :2]
    there = np.flatnonzero(np.isfinite(p).all(axis=1) & np.isfinite(t))
    if not len(there):
        raise WildlabError(
            "no measurement gives a position to start from",
            "check poses and plane, or give a start",
            field="positions",
        )
    row = int(there[0])
    sd = np.repeat([sd_position, sd_velocity, more.get("sd_acceleration", 0.0)], 2)[:n]
    x = np.zeros(n)
    x[:2] = p[row]
    return Start(float(t[row]), x, np.diag(sd**2), row)


def start_from_position(
    time: float, position: ArrayLike, covariance: ArrayLike, sd_velocity: float, row: int = -1
) -> Start:
    """Start at rest on a position that is known with a covariance.

    Parameters
    ----------
    time
        s.
    position, covariance
        (2,) north and east, m in n, and (2, 2), m^2.
    sd_velocity
        m/s, the same north and east.
    row
        The measurement that the position was made from; -1: none.

    Returns
    -------
    Start
        Of the state ``[pN, pE, vN, vE]``; position and velocity uncorrelated.
    """
    x, P = np.zeros(4), np.zeros((4, 4))
    x[:2], P[:2, :2], P[2:, 2:] = position, covariance, sd_velocity**2 * np.eye(2)
    return Start(float(time), x, P, row)


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
        (N,) bool: the Schmidt filter's cross-covariance had to be shortened here (`kalman.limit_cross`).
    C, x_after, P_after
        (N, n, k) after each row, with the k errors that `run_filter` considered; and x (N, n) and P (N, n, n)
        there: rows of one instant differ, where ``x`` and ``P`` have what all of them tell.
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
    C: Array = np.empty((0, 0, 0))
    x_after: Array = np.empty((0, 0))
    P_after: Array = np.empty((0, 0, 0))


class FilterInputs(NamedTuple):
    """Checked measurements: K detections in each of N rows."""

    times: Array  # (N,)
    z: Array  # (N, K, m)
    R: Array  # (N, K, m, m)
    output_times: Array  # (M,)
    thresholds: Array  # (N,) largest NIS that is let in
    sizes: NDArray[np.int64] | None = None  # (N,) elements that a row measures; None: all m


#: State of a filter: when, estimate, covariance.
State = tuple[float, Array, Array]


def record(track: Track, row: int, innovation: Array, S: Array, nis: float, chosen: int, used: bool) -> None:
    """Enter a row's innovation with its covariance and NIS, and whether the measurement was used."""
    track.innovation[row], track.S[row], track.nis[row] = innovation, S, nis
    track.chosen[row], track.used[row] = chosen, used


def step_through(
    given: FilterInputs,
    start: Start,
    motion: Motion,
    step: Callable[[int, State, Track], State | None],
) -> Track:
    """Apply a filter's ``step`` to the rows in order, and predict to the requested times in between.

    ``step`` gives the state after a row, and may leave it at an earlier time. None ends the track: it has
    no estimates from that row on.
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
            then, x, P = state
            track.x[out], track.P[out] = predict(x, P, *motion(float(given.output_times[out]) - then))
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
    if given.sizes is not None:  # what a row does not measure was given and not seen
        absent = np.arange(m) >= given.sizes[:, None]
        track.innovation[absent] = np.nan
        track.S[absent[:, :, None] | absent[:, None, :]] = np.nan
    return track


def checked(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    gate_probability: float,
    output_times: ArrayLike | None,
    sizes: NDArray[np.int64] | None = None,
) -> FilterInputs:
    """FilterInputs of a run with all their axes, or a `WildlabError` that names the row.

    ``sizes`` (N,) says how many elements a row measures; None: all. The others are taken for zeros that were
    measured with a noise of one: a prediction of zero that nothing changes makes them weigh nothing.
    """
    t, z = np.asarray(times, float), np.asarray(measurements, float)
    if z.ndim == 2:
        z = z[:, None, :]
    if t.ndim != 1 or z.ndim != 3 or len(z) != len(t):
        raise WildlabError(
            f"{t.shape} times and {np.shape(measurements)} measurements",
            "give one row of measurements for each time",
            field="measurements",
        )
    _check_order(t, "times")
    out = t if output_times is None else np.asarray(output_times, float)
    _check_order(out, "output_times")
    N, K, m = z.shape
    R = np.asarray(R, float)
    R = R[:, None] if R.ndim == 3 else R
    if R.shape not in ((m, m), (N, 1, m, m), (N, K, m, m)):
        raise WildlabError(
            f"R has the shape {R.shape} for {N} rows of {K} measurements with {m} elements",
            "give (m, m), (N, m, m) or (N, K, m, m)",
            field="R",
        )
    if sizes is not None:
        z, R = _filled(z, R, np.asarray(sizes))
    known = np.isfinite(R).all(axis=(-1, -2))
    flat = R[known]
    lowest = np.linalg.eigvalsh(flat)
    bad = (lowest[:, 0] <= 1e-14 * np.abs(lowest[:, -1])) | (
        np.abs(flat - np.swapaxes(flat, -1, -2)).max(axis=(-1, -2)) > 1e-9 * np.abs(lowest[:, -1])
    )
    if bad.any():
        marked = np.zeros(known.shape, bool)
        marked[known] = bad
        row = int(np.flatnonzero(np.broadcast_to(marked, (N, K)).any(axis=1))[0])
        raise WildlabError(
            f"R of row {row} is not symmetric or not positive definite",
            "give every element a noise",
            field="R",
        )
    # A measurement of which a part is missing is none, and neither is one without a covariance.
    usable = np.where((known & np.isfinite(z).all(axis=-1))[..., None], z, np.nan)
    thresholds = np.full(N, gate_threshold(gate_probability, m))
    if sizes is not None:
        for size in np.unique(sizes):
            thresholds[sizes == size] = gate_threshold(gate_probability, int(size))
    return FilterInputs(t, usable, np.broadcast_to(R, (N, K, m, m)), out, thresholds, sizes)


def _filled(z: Array, R: Array, sizes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Zeros measured with a noise of one in the place of elements that rows do not have."""
    N, _, m = z.shape
    if sizes.shape != (N,):
        raise WildlabError(
            f"{len(sizes)} rows for {N} rows of measurements", "give one for each measurement", field="sensor"
        )
    absent = np.arange(m) >= sizes[:, None]
    z, R = z.copy(), np.array(np.broadcast_to(R, (N, R.shape[1] if R.ndim == 4 else 1, m, m)))
    z[np.broadcast_to(absent[:, None], z.shape)] = 0.0
    R[np.broadcast_to((absent[:, :, None] | absent[:, None, :])[:, None], R.shape)] = 0.0
    rows, element = np.nonzero(absent)
    R[rows, :, element, element] = 1.0
    return z, R


def single_detection(given: FilterInputs) -> FilterInputs:
    """The same inputs, for a filter that takes no more than one detection a row."""
    if given.z.shape[1] != 1:
        raise WildlabError(
            "several detections in a frame", "choose one first, or use run_filter", field="measurements"
        )
    return given


def check_sensor(sensor: Sensor, start: Start, rows: int) -> None:
    """Refuse a start that is none, and a sensor that does not go with it or with so many rows."""
    check_start(start)
    check_rows(sensor.rows, rows, "sensor")
    if sensor.states > len(start.x):
        raise WildlabError(
            f"a sensor of {sensor.states} states for a motion model of {len(start.x)}",
            "use a model with velocity, as constant_velocity",
            field="sensor",
        )


def check_start(start: Start) -> None:
    """Refuse a start that is not finite, whose shapes do not fit, or whose ``P`` is no covariance."""
    x, P = np.asarray(start.x, float), np.asarray(start.P, float)
    if x.ndim != 1 or P.shape != (len(x), len(x)):
        raise WildlabError(f"x of the shape {x.shape}, P {P.shape}", "give (n,) and (n, n)", field="start")
    if not np.isfinite(start.time):
        raise WildlabError(f"a time of {start.time}", "give seconds", field="start.time")
    lost = np.flatnonzero(~np.isfinite(x))
    if len(lost):
        raise WildlabError(
            f"row {lost[0]} is {x[lost[0]]}", "give every state a value to start from", field="start.x"
        )
    check_covariance(P, "start.P")


def check_rows(rows: int | None, wanted: int, what: str) -> None:
    """Refuse ``rows`` of something that goes with ``wanted`` measurements; None is one value for all."""
    if rows is not None and rows != wanted:
        raise WildlabError(
            f"{rows} rows for {wanted} rows of measurements", "give one for each measurement", field=what
        )


def _check_order(times: Array, field: str) -> None:
    lost = np.flatnonzero(~np.isfinite(times))
    if len(lost):
        raise WildlabError(f"row {lost[0]} has no time ({times[lost[0]]})", "leave the row out", field=field)
    back = np.flatnonzero(np.diff(times) < 0)
    if len(back):
        row = int(back[0]) + 1
        raise WildlabError(
            f"row {row} at {times[row]} s comes after row {row - 1} at {times[row - 1]} s",
            "sort the rows by time",
            field=field,
        )


#: Row, the row of the detection that was used last, the estimate then, covariance now -> whether the track
#: ends here, before anything of this row is used.
Ends = Callable[[int, int, Array, Array], bool]


def run_filter(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion,
    start: Start,
    *,
    pose: Considered | None = None,
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
        Errors to consider: the Schmidt filter, H (7.32)-(7.38). Those of the poses (`Considered`), or
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
    >>> from wildlab.tracking.motion import rest
    >>> from wildlab.tracking.run import Start, run_filter
    >>> from wildlab.tracking.sensors import positions
    >>> z = [[10.0, 0.0], [10.5, 0.5], [9.5, -0.5]]
    >>> start = Start(time=0.0, x=np.array([0.0, 0.0]), P=100.0 * np.eye(2))
    >>> track = run_filter([0.0, 1.0, 2.0], z, np.eye(2), positions(), rest, start)
    >>> track.x[-1].round(2).tolist(), np.sqrt(track.P[-1, 0, 0]).round(2).item()
    ([9.97, 0.0], 0.58)
    """
    given = checked(times, measurements, R, gate_probability, output_times, sensor.sizes)
    check_sensor(sensor, start, len(given.times))
    errors = errors_of(pose, sensor, len(given.times))
    n, x_last = len(start.x), np.asarray(start.x, float)
    C = np.zeros((n, 0 if errors is None else len(errors.times)))
    crosses = np.zeros((len(given.times), *C.shape))
    # The row that a start was made from, or the first that is not before it.
    last = (
        start.row
        if start.row >= 0
        else min(int(np.searchsorted(given.times, start.time)), len(given.times) - 1)
    )

    def step(row: int, state: State, track: Track) -> State | None:
        nonlocal C, last, x_last
        then, x, P = state
        now, dt = float(given.times[row]), given.times[row] - then
        F, Q = motion(dt)
        x, P = predict(x, P, F, Q)
        if ends is not None and ends(row, last, x_last, P):
            return None
        if errors is not None:
            C = crosses[row] = errors.carry(C, F, row, dt)
        if not np.isfinite(given.z[row]).all(axis=-1).any():
            return now, x, P
        expected = sensor.predict(row, x[: sensor.states])
        H = on_state(expected.H_position, n)
        if not (np.isfinite(expected.z).all() and np.isfinite(H).all()):
            return now, x, P
        if errors is None:
            spread = H @ P @ H.T
        else:
            P_pose, H_errors = errors.covariance[row], expected.H_pose[..., errors.columns]
            if not (np.isfinite(P_pose).all() and np.isfinite(H_errors).all()):
                return now, x, P
            C, track.limited[row] = limit_cross(C.copy(), P.copy(), P_pose.copy())
            spread = spread_of_prediction(P, C, P_pose, H, H_errors)
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
            done = correct(x, P, best.innovation, H, noise)
        else:
            done = update_schmidt(x, P, C, P_pose, best.innovation, H, H_errors, noise)
            C = crosses[row] = done.C
        last, x_last = row, done.x
        return now, done.x, done.P

    moments = np.full((len(given.times), n), np.nan), np.full((len(given.times), n, n), np.nan)
    if start.row >= 0:
        moments[0][start.row], moments[1][start.row] = start.x, start.P

    def kept_step(row: int, state: State, track: Track) -> State | None:
        done = step(row, state, track)
        if done is not None:
            moments[0][row], moments[1][row] = done[1:]
        return done

    return step_through(given, start, motion, kept_step)._replace(
        C=crosses, x_after=moments[0], P_after=moments[1]
    )


#: Variances below this share of those that there were count as zero: rounding.
NEGLIGIBLE = 1e-10


def smooth(track: Track, motion: Motion, errors: Errors | None = None) -> Track:
    """Go back over the track of a filter: `run_filter` or `run_unscented`.

    Parameters
    ----------
    track
        Its estimates at the times of all measurements, as they are where no ``output_times`` were asked for.
    motion
        The one that the filter had.
    errors
        Those that it considered (`wildlab.tracking.kalman.errors_of`); left out: none.

    Returns
    -------
    Track
        The same with smoothed ``x`` and ``P``; NaN before the start.

    Raises
    ------
    WildlabError
        For a track whose times are not those of its measurements.

    Examples
    --------
    A target at rest: all that is known at the end was true at the beginning.

    >>> import numpy as np
    >>> from wildlab.tracking.motion import rest
    >>> from wildlab.tracking.run import Start, run_filter
    >>> from wildlab.tracking.sensors import positions
    >>> start = Start(time=0.0, x=np.zeros(2), P=100.0 * np.eye(2))
    >>> track = run_filter([0.0, 1.0], [[1.0, 0.0], [3.0, 0.0]], np.eye(2), positions(), rest, start)
    >>> smooth(track, rest).x[:, 0].round(2).tolist()
    [1.99, 1.99]
    """
    if len(track.times) != len(track.nis):
        raise WildlabError(
            f"estimates at {len(track.times)} times of {len(track.nis)} measurements",
            "give it at the measurements' times", field="track",
        )  # fmt: skip
    x, P = track.x.copy(), track.P.copy()
    x_rows, P_rows = (x, P) if errors is None else (track.x_after, track.P_after)
    rows = np.flatnonzero(np.isfinite(x_rows).all(axis=1))
    times = track.times[rows]
    last = np.searchsorted(times, times, side="right") - 1  # of its instant
    C, of_rows = np.zeros((len(rows), x.shape[1], 0)), lasting_errors((), len(rows))
    if errors is not None:
        C, known = track.C[rows], known_before(errors.covariance)
        of_rows = errors._replace(covariance=known[rows], phi=errors.phi[rows])
    smoothed = smooth_moments(times, x_rows[rows], P_rows[rows], C, motion, of_rows)
    x[rows], P[rows] = (part[last] for part in smoothed)
    return track._replace(x=x, P=P)


def lasting_errors(correlation_times: Sequence[float], rows: int) -> Errors:
    """Errors (k,) of variance one, for as long as they last, at so many rows."""
    k = len(correlation_times)
    unit = np.broadcast_to(np.eye(k), (rows, k, k))
    return Errors(unit, unit, np.asarray(correlation_times, float), [])


def smooth_moments(
    times: Array, x: Array, P: Array, C: Array, motion: Motion, errors: Errors
) -> tuple[Array, Array]:
    """Back over the moments of one track.

    Parameters
    ----------
    times
        (N,) s, in order.
    x, P, C
        (N, n), (N, n, n) and (N, n, k) after each row's measurement.
    motion
        The one that the filter had.
    errors
        The k errors at each row.

    Returns
    -------
    x, P
        With all measurements.
    """
    after, spread = x.copy(), P.copy()
    later = begin_back(x[-1], P[-1], C.shape[-1])
    for row in range(len(times) - 2, -1, -1):
        dt = float(times[row + 1] - times[row])
        ahead = P[row + 1], C[row + 1], errors.covariance[row + 1]
        here = P[row], C[row], errors.covariance[row]
        later = step_back(later, x[row], here, ahead, *motion(dt), errors.transition(row + 1, dt))
        after[row], spread[row] = later.x, later.P
    return after, spread


class Later(NamedTuple):
    """Smoothed ``x`` (..., n) and ``P`` (..., n, n) at a row, and ``A``, ``B`` and ``N`` of its error."""

    x: Array
    P: Array
    A: Array
    B: Array
    N: Array


def begin_back(x: Array, P: Array, errors: int) -> Later:
    """The last row, which knows nothing later."""
    none = np.zeros(P.shape)
    return Later(x.copy(), P.copy(), none + np.eye(x.shape[-1]), np.zeros((*x.shape, errors)), none)


#: ``P`` (..., n, n), ``C`` (..., n, k) and the covariance of the errors (k, k) after a row's measurement.
Moments = tuple[Array, Array, Array]


def step_back(later: Later, x: Array, here: Moments, ahead: Moments, F: Array, Q: Array, psi: Array) -> Later:
    """One row back, see the module; any number of tracks at once."""
    (P, C, known), (P_next, C_next, known_next) = here, ahead
    n, (_, _, A, B, N) = x.shape[-1], later
    eye = np.eye(n)
    before = _joint(F @ P @ F.T + Q, F @ C @ psi.T, known_next)
    sd = np.sqrt(np.maximum(np.diagonal(before, axis1=-2, axis2=-1), 0))
    # What is left after the measurement of the errors before it.
    root, inverse = _root(before[..., :n, :n], sd[..., :n])
    size, axes = np.linalg.eigh(inverse @ P_next @ _t(inverse))
    axes = root @ axes
    cross = np.concatenate([axes * np.minimum(size, 1)[..., None, :] @ _t(axes), C_next], axis=-1)
    kept = _over(cross, before, sd)
    values, axes = np.linalg.eigh(P_next - kept @ _t(cross))
    axes = A @ axes
    N = N + axes * np.maximum(values, 0)[..., None, :] @ _t(axes)
    A, B = A @ kept[..., :n], A @ kept[..., n:] + B
    D = np.concatenate([eye - A, -B], axis=-1)
    to = np.concatenate([P @ F.T, C @ psi.T], axis=-1)
    G = _over(to @ _t(D), D @ before @ _t(D) + N, sd[..., :n])
    grown = known_next - psi @ known @ psi.T
    by_noise, by_errors = G @ (A - eye), G @ B
    N = by_noise @ Q @ _t(by_noise) + by_errors @ grown @ _t(by_errors) + G @ N @ _t(G)
    A, B = eye + by_noise @ F, by_errors @ psi
    both = np.concatenate([A, B], axis=-1)
    spread = both @ _joint(P, C, known) @ _t(both) + N
    back = (G @ (later.x - x @ F.T)[..., None])[..., 0]
    return Later(x + back, (spread + _t(spread)) / 2, A, B, N)


def _t(matrix: Array) -> Array:
    return np.swapaxes(matrix, -1, -2)


def _joint(P: Array, C: Array, P_errors: Array) -> Array:
    P_errors = np.broadcast_to(P_errors, (*P.shape[:-2], *P_errors.shape))
    upper, lower = np.concatenate([P, C], axis=-1), np.concatenate([_t(C), P_errors], axis=-1)
    return np.concatenate([upper, lower], axis=-2)


def _axes(covariance: Array, sd: Array) -> tuple[Array, Array, Array]:
    """``1 / sd``, and the variances and axes (..., n, n) of what is scaled by it, negligible ones zero."""
    unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, axes = np.linalg.eigh((covariance + _t(covariance)) / 2 * unit[..., None] * unit[..., None, :])
    return unit, np.where(values > NEGLIGIBLE, values, 0.0), axes


def _root(covariance: Array, sd: Array) -> tuple[Array, Array]:
    """``A`` with ``A A'`` the covariance, and its inverse where there is variance."""
    unit, values, axes = _axes(covariance, sd)
    lengths = np.sqrt(values)[..., None, :]
    inverse = np.divide(1, lengths, out=np.zeros_like(lengths), where=lengths > 0)
    return sd[..., None] * axes * lengths, _t(unit[..., None] * axes * inverse)


def _over(cross: Array, covariance: Array, sd: Array) -> Array:
    """``cross covariance^-1``; directions whose variances are nothing beside ``sd`` squared are left out."""
    unit, values, axes = _axes(covariance, sd)
    inverse = np.divide(1, values, out=np.zeros_like(values), where=values > 0)[..., None, :]
    return np.asarray(((cross * unit[..., None, :]) @ axes * inverse) @ _t(axes) * unit[..., None, :])


def known_before(covariance: Array) -> Array:
    """(N, k, k) with the one before where there is none, and the first that is known before that."""
    known = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    if not known.any():
        return np.zeros_like(covariance)
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    return covariance[np.where(last < 0, int(np.argmax(known)), last)]
