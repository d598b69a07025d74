"""Bring clocks together: poses, gimbal angles and truth at the times of the frames.

A clock's offset is what to add to its stamps to get flight time (`[clocks]` of the manifest).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.flight.schema import COVARIANCE_COLUMNS, POSITION, QUATERNION
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Indices, between_attitudes, quaternion_to_matrix, wrap

#: Stretches without a sample up to this long are bridged by interpolation, unless the caller says otherwise;
#: longer ones where the log's own rate explains them, up to so many of its usual steps: none is missing.
MAX_GAP_S = 1.0
USUAL_STEPS = 1.5

#: (row, column) of each of COVARIANCE_COLUMNS.
_UPPER = np.triu_indices(6)


def frame_times(flight: Flight) -> Array:
    """Flight time of each frame in seconds, the camera's clock offset applied. (N,)

    Parameters
    ----------
    flight
        With frames.

    Returns
    -------
    (N,) s

    Raises
    ------
    WildlabError
        Where the flight has no frames.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1)
    >>> len(frame_times(flight)) == len(flight.frames)
    True
    """
    stamps = flight.table("frames")["time_s"].to_numpy(float)
    return stamps + flight.manifest.clocks.camera_offset_s


def gnss_times(flight: Flight) -> Array:
    """Flight time each satellite position is of, in seconds: its stamp, the offset of its clock applied, and
    the latency of the receiver taken off. (N,)

    Parameters
    ----------
    flight
        With the table ``gnss``.

    Returns
    -------
    (N,) s

    Raises
    ------
    WildlabError
        Where the flight has no satellite positions.
    """
    manifest = flight.manifest
    stamps = flight.table("gnss")["time_s"].to_numpy(float)
    return stamps + manifest.clocks.gnss_offset_s - manifest.gnss.latency_s


def poses_at(
    nav: pd.DataFrame,
    times: ArrayLike | None = None,
    frame_ids: Sequence[str] | pd.Series | None = None,
    max_gap_s: float | None = None,
) -> tuple[Array, Array, Array | None]:
    """Poses of the platform at given times, or of given frames.

    Where `nav` has a column `frame_id` and `frame_ids` are given, each frame has the pose that belongs to it,
    and `times` are not looked at. Otherwise: positions linear in time, attitudes along the shortest turn
    (slerp), covariances linear.

    Parameters
    ----------
    nav
        One nav table.
    times
        (N,) flight times in seconds.
    frame_ids
        (N,) names of frames.
    max_gap_s
        No pose where the two nearest stamps in the log are further apart than this (but at a stamp itself);
        if not given, what the log's own rate explains (`longest_gap`).

    Returns
    -------
    p_nb
        (N, 3) metres; NaN outside of the log, in a gap, beside a NaN, or for a frame without a pose.
    R_nb
        (N, 3, 3), likewise.
    covariance
        (N, 6, 6) in the order of `schema.COVARIANCE_COLUMNS`, or None where the log has none.

    Raises
    ------
    WildlabError
        Where the log's stamps do not increase, or neither times nor frame names fit the log.
    """
    position = nav[POSITION].to_numpy(float)
    attitude = nav[QUATERNION].to_numpy(float)
    covariance = covariances(nav)
    if len(nav) == 0:
        raise WildlabError("the table is empty", "give it rows", file="nav")
    if frame_ids is not None and "frame_id" in nav:
        first = ~nav["frame_id"].duplicated()
        rows = pd.Index(nav.loc[first, "frame_id"]).get_indexer(pd.Index(frame_ids))
        missing = rows < 0
        rows = np.flatnonzero(first)[rows]
        p = np.where(missing[:, None], np.nan, position[rows])
        R = quaternion_to_matrix(np.where(missing[:, None], np.nan, attitude[rows]))
        P = None if covariance is None else np.where(missing[:, None, None], np.nan, covariance[rows])
        return p, R, P
    if times is None:
        raise WildlabError(
            "these poses have no frames, and no times are given",
            "give times",
            field="nav",
        )
    stamps = nav["time_s"].to_numpy(float)
    rows = _rows_about(stamps, times, _longest(stamps, "nav", max_gap_s))
    P = None if covariance is None else _between(covariance.reshape(-1, 36), *rows).reshape(-1, 6, 6)
    return _between(position, *rows), between_attitudes(attitude, *rows), P


def pose_finder(
    nav: pd.DataFrame, frame_ids: Sequence[str] | pd.Series | None = None
) -> Callable[[ArrayLike], tuple[Array, Array]]:
    """`poses_at` of one table for whoever asks over and over: what does not hang on the times is done once.

    Parameters
    ----------
    nav, frame_ids
        As for `poses_at`.

    Returns
    -------
    From times (N,) to positions (N, 3) and rotations (N, 3, 3), as of `poses_at`.

    Raises
    ------
    WildlabError
        As `poses_at`.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1)
    >>> nav, times = flight.nav["autopilot"], frame_times(flight)
    >>> bool((pose_finder(nav)(times)[0] == poses_at(nav, times)[0]).all())
    True
    """
    if len(nav) == 0 or (frame_ids is not None and "frame_id" in nav):
        p, R, _ = poses_at(nav, None, frame_ids)
        return lambda _: (p, R)
    stamps = nav["time_s"].to_numpy(float)
    position = nav[POSITION].to_numpy(float)
    attitude = np.ascontiguousarray(nav[QUATERNION].to_numpy(float))
    longest = _longest(stamps, "nav")

    def find(times: ArrayLike) -> tuple[Array, Array]:
        rows = _rows_about(stamps, times, longest)
        return _between(position, *rows), between_attitudes(attitude, *rows)

    return find


def frame_poses(
    flight: Flight, source: str | None = None, max_gap_s: float | None = None
) -> tuple[Array, Array, Array | None]:
    """Poses of the platform for every frame of a flight, row by row: see `poses_at`.

    Parameters
    ----------
    flight
        With frames and poses.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    max_gap_s
        As in `poses_at`.

    Returns
    -------
    As from `poses_at`: positions (N, 3), rotations (N, 3, 3), covariances (N, 6, 6) or None.

    Raises
    ------
    WildlabError
        Where the flight has no frames or no such nav source.
    """
    _, nav = flight.pose_source(source)
    return poses_at(nav, frame_times(flight), flight.table("frames")["frame_id"], max_gap_s)


def covariances(nav: pd.DataFrame) -> Array | None:
    """Pose covariances of a nav table, (N, 6, 6) in m and rad, or None where it has none.

    Parameters
    ----------
    nav
        A nav table.

    Returns
    -------
    (N, 6, 6) or None

    Examples
    --------
    >>> P = np.tile(np.eye(6), (2, 1, 1))
    >>> bool((covariances(covariance_columns(P)) == P).all())
    True
    """
    if not set(COVARIANCE_COLUMNS) <= set(nav.columns):
        return None
    P = np.empty((len(nav), 6, 6))
    upper = nav[list(COVARIANCE_COLUMNS)].to_numpy(float)
    P[:, _UPPER[0], _UPPER[1]] = upper
    P[:, _UPPER[1], _UPPER[0]] = upper
    return P


def covariance_columns(covariance: ArrayLike) -> pd.DataFrame:
    """The 21 columns `cov_ij` of covariances (N, 6, 6): the inverse of `covariances`.

    Parameters
    ----------
    covariance
        (N, 6, 6): position (m, in n) before attitude (rad, in b).

    Returns
    -------
    DataFrame
        N rows.

    Examples
    --------
    >>> list(covariance_columns(np.eye(6)[None]))[:2]
    ['cov_00', 'cov_01']
    """
    P = np.asarray(covariance, float)
    return pd.DataFrame(P[:, _UPPER[0], _UPPER[1]], columns=list(COVARIANCE_COLUMNS))


def gimbal_angles(
    flight: Flight, times: ArrayLike | None = None, rows: Indices | None = None
) -> tuple[Array, Array]:
    """Pan and tilt of the gimbal for every frame, or for others and as it was at other times, radians.

    From the columns of the frames where they have them, else from the gimbal table (linear in time), else the
    fixed angles of the manifest. They take the place of the manifest's, they are not added to them.

    Parameters
    ----------
    flight
        With frames.
    times, rows
        (N,) flight times, s, of frames in these rows of their table.

    Returns
    -------
    (pan, tilt), (N,) each, rad

    Raises
    ------
    WildlabError
        Where the flight has no frames, or the stamps of the gimbal do not increase.
    """
    frames, mount = flight.table("frames"), flight.manifest.geometry_mount()
    if "pan_rad" in frames:
        pan, tilt = frames[["pan_rad", "tilt_rad"]].to_numpy(float)[slice(None) if rows is None else rows].T
        return pan, tilt
    at = frame_times(flight) if times is None else np.asarray(times, float)
    if flight.gimbal is None:
        return np.full(len(at), mount.pan), np.full(len(at), mount.tilt)
    return gimbal_at(flight.gimbal, at)


def gimbal_at(gimbal: pd.DataFrame, times: ArrayLike) -> tuple[Array, Array]:
    """Pan and tilt at flight times (N,) by the gimbal's table, radians, (N,) each; NaN where it has none."""
    stamps, angles = gimbal["time_s"].to_numpy(float), gimbal[["pan_rad", "tilt_rad"]].to_numpy(float)
    before, after, share = _rows_about(stamps, times, _longest(stamps, "gimbal"))
    pan, tilt = (angles[before] + share[:, None] * wrap(angles[after] - angles[before])).T
    return pan, tilt


def truth_at(truth: pd.DataFrame, times: ArrayLike, offset_s: float = 0.0) -> tuple[list[str], Array]:
    """Where every target truly was at given times.

    Parameters
    ----------
    truth
        The table; rows with a NaN time are points that never move.
    times
        (T,) flight times in seconds.
    offset_s
        What to add to the stamps of the truth (`clocks.truth_offset_s`).

    Returns
    -------
    Names of the M targets in order of appearance, and positions (M, T, 3) in n, NaN where not known.

    Raises
    ------
    WildlabError
        Where a target's stamps do not increase.
    """
    at = np.atleast_1d(np.asarray(times, float))
    # By arrays: this is asked for thousands of times, and pandas' groups cost more than all else of it.
    codes, names = pd.factorize(truth["target_id"].to_numpy(object))
    position = truth[POSITION].to_numpy(float)
    stamps = truth["time_s"].to_numpy(float) + offset_s
    where = np.empty((len(names), len(at), 3))
    for k, name in enumerate(names):
        mine = codes == k
        if np.isnan(stamps[mine]).all():
            where[k] = position[mine][0]
        else:
            where[k] = between(stamps[mine], position[mine], at, f"truth of {name!r}")
    return [str(name) for name in names], where


def truth_deviations(flight: Flight, names: ArrayLike) -> Array:
    """Standard deviations (N,), m, of each axis of the true places of targets (N,), by name.

    The median of what the truth states of a target; zero where it states nothing.
    """
    truth = flight.table("truth")
    if "sd_horizontal_m" not in truth:
        return np.zeros(np.shape(names))
    stated = truth.groupby("target_id")["sd_horizontal_m"].median()
    return stated.reindex(np.asarray(names, str)).fillna(0.0).to_numpy(float)


def longest_gap(stamps: ArrayLike) -> float:
    """The longest stretch in seconds between stamps (N,) of a log that its own rate explains."""
    steps = np.diff(np.asarray(stamps, float))
    return max(MAX_GAP_S, USUAL_STEPS * float(np.median(steps))) if len(steps) else MAX_GAP_S


def between(stamps: ArrayLike, values: ArrayLike, times: ArrayLike, what: str) -> Array:
    """Values (N, K) of increasing stamps (N,) at other times (T,), linear in time; `what` is for messages.

    (T, K); NaN outside of the stamps, and in a gap as in `poses_at`.

    Raises
    ------
    WildlabError
        Where the stamps do not increase, or there are none.
    """
    known = np.asarray(stamps, float)
    return _between(np.asarray(values, float), *_rows_about(known, times, _longest(known, what)))


def _longest(stamps: Array, what: str, max_gap_s: float | None = None) -> float:
    """The longest gap that is bridged between stamps, which must increase; ``what`` is for messages."""
    if not (np.diff(stamps) > 0).all():
        raise WildlabError(
            "the timestamps do not increase",
            "sort the rows, and remove repeated stamps",
            file=what,
            field="time_s",
        )
    if len(stamps) == 0:
        raise WildlabError("the table is empty", "give it rows", file=what)
    return longest_gap(stamps) if max_gap_s is None else max_gap_s


def _rows_about(stamps: Array, times: ArrayLike, longest: float) -> tuple[Indices, Indices, Array]:
    """Rows before and after each time, and how far between them (0..1); NaN where there is no answer."""
    at = np.atleast_1d(np.asarray(times, float))
    after = np.clip(np.searchsorted(stamps, at, side="left"), 0, len(stamps) - 1)
    exact = stamps[after] == at
    before = np.where(exact, after, np.maximum(after - 1, 0))
    span = stamps[after] - stamps[before]
    inside = (at >= stamps[0]) & (at <= stamps[-1])
    share = np.divide(at - stamps[before], span, out=np.zeros(len(at)), where=span > 0)
    return before, after, np.where(exact | (inside & (span <= longest)), share, np.nan)


def _between(values: Array, before: Indices, after: Indices, share: Array) -> Array:
    # A time that falls on a stamp takes that row alone, whatever stands in the next.
    return values[before] + share[:, None] * (values[after] - values[before])
