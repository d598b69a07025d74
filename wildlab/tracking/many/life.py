"""When a track begins, is believed, ends, and is found again: H 3.4.

H's start has four steps. A detection that belongs to no track waits for the next scan; one near enough to it
there makes a preliminary track of the two; that is confirmed by detections in m of the next n scans, and
dropped where it can no longer have so many. Only scans in which the target could have been seen count. A new
track may be one that had ended: by where its target can have come to, and by what both look like.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import Assignment, global_nearest, innovation_squared

#: What `judge_start` says of a preliminary track.
CONFIRMED, UNDECIDED, DROPPED = 1, 0, -1


def pair_scans(
    waiting: ArrayLike, arrived: ArrayLike, dt: float, R: ArrayLike, max_speed: float, gate: float
) -> Assignment:
    """Which detection of a scan continues which one of the scan before: steps 1 and 2 of H 3.4.1.

    The validation region is that of the noise of both, about all places that the target may have come to:
    what lies in between counts only where it is more than the target can have moved. Where several lie in
    one region, those are paired whose distances, all counted, have the least sum.

    Parameters
    ----------
    waiting, arrived
        (M, 2) and (N, 2) positions of the scan before and of this one, m.
    dt
        Time between the two, s, not negative.
    R
        (2, 2) covariance of the noise of a position, m^2.
    max_speed
        Largest speed of a target, m/s.
    gate
        On the square of the distance in units of its spread, as of (3.9).

    Returns
    -------
    Assignment
        The waiting detections stand for its tracks.

    Raises
    ------
    WildlabError
        If time or speed are negative or not finite.

    Examples
    --------
    >>> pair_scans([[0.0, 0.0]], [[90.0, 0.0], [4.0, 3.0]], 1.0, np.eye(2), max_speed=5.0, gate=9.21)
    Assignment(track=array([-1,  0]), measurement=array([1]))
    """
    for field, value in (("dt", dt), ("max_speed", max_speed)):
        if not 0 <= value < np.inf:
            raise WildlabError(f"{field} is {value:g}", "give a number that is not negative", field=field)
    old, new = (np.asarray(points, float).reshape(-1, 2) for points in (waiting, arrived))
    gap = new[:, None] - old
    distance = innovation_squared(gap, 2 * np.asarray(R, float)) if gap.size else np.zeros(gap.shape[:2])
    length = np.linalg.norm(gap, axis=-1)
    beyond = np.maximum(length - max_speed * dt, 0.0) / np.where(length > 0, length, 1.0)
    return global_nearest(np.where(beyond**2 * distance <= gate, distance, np.inf), np.inf)


def judge_start(hits: ArrayLike, scans: ArrayLike, m: int = 3, n: int = 5) -> NDArray[np.int8]:
    """Whether preliminary tracks are confirmed: detections in m of the next n scans, step 4 of H 3.4.1.

    Parameters
    ----------
    hits
        (T,) how many scans since each became preliminary had a detection in its validation region.
    scans
        (T,) how many scans there have been since, in which it could have been seen; at most n.
    m, n
        H's common choice by default.

    Returns
    -------
    (T,)
        `CONFIRMED` from the m-th hit on, `DROPPED` as soon as m can no longer be reached, else `UNDECIDED`.

    Raises
    ------
    WildlabError
        Unless 1 <= m <= n, and 0 <= hits <= scans <= n.

    Examples
    --------
    >>> judge_start([3, 2, 1, 0], [4, 4, 4, 3]).tolist()
    [1, 0, -1, -1]
    """
    h, s = np.asarray(hits, int), np.asarray(scans, int)
    if not 1 <= m <= n:
        raise WildlabError(f"{m} of {n} scans", "give m from 1 to n", field="m")
    if h.shape != s.shape or (h < 0).any() or (h > s).any() or (s > n).any():
        raise WildlabError(
            f"{h.tolist()} detections in {s.tolist()} scans, of {n}",
            f"give two counts a track, no more detections than scans, and judge at every scan up to {n}",
            field="hits",
        )
    dropped = np.where(s - h > n - m, DROPPED, UNDECIDED)
    return np.asarray(np.where(h >= m, CONFIRMED, dropped), np.int8)


def outlived(unseen: ArrayLike, P: ArrayLike, max_unseen: float, max_sd: float) -> NDArray[np.bool_]:
    """Which tracks end: not measured for too long, or too uncertain to be found again, H 3.4.2.

    Parameters
    ----------
    unseen
        (T,) seconds since the last measurement. Seconds in which the target could have been seen end a track
        by absence; seconds of any kind by age.
    P
        (T, 2, 2) covariances of the positions, m^2.
    max_unseen
        The longest time, s; infinite for none.
    max_sd
        The largest standard deviation of the position in any direction, m; infinite for none.

    Returns
    -------
    (T,)
        True above either limit, and for a covariance that is not finite.

    Raises
    ------
    WildlabError
        If the shapes do not fit each other.

    Examples
    --------
    >>> outlived([1.0, 9.0, 1.0], np.eye(2) * np.array([1.0, 1.0, 50.0])[:, None, None], 5.0, 6.0).tolist()
    [False, True, True]
    """
    seconds, covariance = np.asarray(unseen, float), np.asarray(P, float)
    if covariance.shape != (*seconds.shape, 2, 2):
        raise WildlabError(
            f"times of shape {seconds.shape} do not go with covariances of shape {covariance.shape}",
            "give (T,) and (T, 2, 2)",
        )
    known = np.isfinite(covariance).all(axis=(1, 2))
    sd = np.full(len(seconds), np.nan)
    sd[known] = np.sqrt(np.linalg.eigvalsh(covariance[known])[:, -1])
    return np.asarray(~((seconds <= max_unseen) & (sd <= max_sd)))


def reachable(
    new: ArrayLike,
    new_P: ArrayLike,
    old: ArrayLike,
    old_P: ArrayLike,
    seconds: ArrayLike,
    max_speed: float,
    gate: float,
) -> NDArray[np.bool_]:
    """Which new tracks lie where kept ones can have come to.

    As `pair_scans`: of the way between the two what is more than the target can have moved counts, in units
    of the spread of both places together.

    Parameters
    ----------
    new, new_P
        (N, 2) and (N, 2, 2): places of the new tracks, m, and their covariances.
    old, old_P
        (M, 2) and (M, 2, 2): of the kept ones, when they were measured last.
    seconds
        (M,) since then.
    max_speed
        Largest speed of a target, m/s.
    gate
        On the squared distance, as of (3.9).

    Returns
    -------
    (N, M)

    Raises
    ------
    WildlabError
        If a time or the speed are negative or not finite.

    Examples
    --------
    >>> reachable([[60.0, 0.0]], [np.eye(2)], [[0.0, 0.0]] * 2, [np.eye(2)] * 2, [5.0, 20.0], 3.0, 9.21)
    array([[False,  True]])
    """
    since = np.asarray(seconds, float)
    if not (np.isfinite(since) & (since >= 0)).all() or not 0 <= max_speed < np.inf:
        raise WildlabError(
            f"times of {since.tolist()} s with a speed of {max_speed:g} m/s",
            "give numbers that are not negative",
            field="seconds" if 0 <= max_speed < np.inf else "max_speed",
        )
    gap, S = _apart(new, new_P, old, old_P)
    if not gap.size:
        return np.zeros(gap.shape[:2], bool)
    length = np.linalg.norm(gap, axis=-1)
    beyond = np.maximum(length - max_speed * since, 0.0) / np.where(length > 0, length, 1.0)
    return np.asarray(beyond**2 * innovation_squared(gap, S) <= gate)


def place_costs(new: ArrayLike, new_P: ArrayLike, expected: ArrayLike, expected_P: ArrayLike) -> Array:
    """Minus twice the logarithm of how likely a new track begins where it did, if it is a kept one.

    Normal about where the filter expects the kept one by now. A constant that all pairs share is left out.

    Parameters
    ----------
    new, new_P
        (N, 2) and (N, 2, 2), m and m^2.
    expected, expected_P
        (M, 2) and (M, 2, 2), predicted to now.

    Returns
    -------
    (N, M)

    Examples
    --------
    >>> place_costs([[2.0, 0.0]], [np.eye(2)], [[0.0, 0.0]], [np.eye(2)]).round(3).tolist()
    [[3.386]]
    """
    gap, S = _apart(new, new_P, expected, expected_P)
    if not gap.size:
        return np.zeros(gap.shape[:2])
    return np.asarray(innovation_squared(gap, S) + np.linalg.slogdet(S)[1])


def look_differences(new: ArrayLike, old: ArrayLike, sd: ArrayLike, weights: ArrayLike) -> Array:
    """Weighted squared differences of what tracks look like on the mean, feature by feature.

    However many detections a mean is of, it counts as one of two: those of neighbouring images show a target
    alike, and more of them tell little more. The spread of a difference is then that of one detection.

    Parameters
    ----------
    new, old
        (N, f) and (M, f) means over the detections of tracks.
    sd, weights
        (f,) spread of a detection, and weights, as of `feature_distances`.

    Returns
    -------
    (N, M, f)
        NaN where a feature is not known of both.

    Raises
    ------
    WildlabError
        If the shapes do not fit each other, a spread is not positive or a weight is negative.

    Examples
    --------
    >>> look_differences([[3.0, np.nan]], [[1.0, 1.0]], sd=[1.0, 3.0], weights=[1.0, 0.5]).tolist()
    [[[4.0, nan]]]
    """
    a, b, spread, w = (np.asarray(one, float) for one in (new, old, sd, weights))
    if not (a.ndim == b.ndim == 2 and a.shape[1:] == b.shape[1:] == spread.shape == w.shape):
        raise WildlabError(
            f"means of shapes {a.shape} and {b.shape} do not go with spreads of shape {spread.shape} and "
            f"weights of shape {w.shape}",
            "give (N, f), (M, f), (f,) and (f,)",
        )
    positive = bool((np.isfinite(spread) & (spread > 0)).all())
    if not positive or not (np.isfinite(w) & (w >= 0)).all():
        raise WildlabError(
            f"spreads of {spread.tolist()} with weights of {w.tolist()}",
            "give positive spreads and no weight below zero; a weight of zero leaves a feature out",
            field="weights" if positive else "sd",
        )
    return np.asarray(w * ((a[:, None] - b) / spread) ** 2)


def recognise(
    possible: ArrayLike,
    places: ArrayLike,
    looks: ArrayLike,
    limit: float,
    likelier: float,
) -> Assignment:
    """Which new tracks are which kept ones; none where that would be a guess.

    All are assigned at once, as many as possible with the least sum of costs (`global_nearest`). A pair of
    these is taken where, by the ratio of likelihoods, it is at least ``likelier`` times as likely as each
    other possible pair of its new or of its kept track, and the whole assignment as every other one of as
    many pairs that does without it. Two pairs are compared by the features that are known in both; in a sum
    of costs one that is not known adds nothing.

    Parameters
    ----------
    possible
        (N, M), from `reachable`.
    places
        (N, M), from `place_costs`.
    looks
        (N, M, f), from `look_differences`; f may be zero.
    limit
        The largest sum of ``looks`` of a pair: those that look less alike are not possible.
    likelier
        The ratio, above 1.

    Returns
    -------
    Assignment
        New tracks stand for its measurements and kept ones for its tracks.

    Raises
    ------
    WildlabError
        If the shapes do not fit each other, or the ratio is not above 1 and finite.

    Examples
    --------
    Two kept ones are as near as each other, and only looks tell them apart:

    >>> there, nothing = np.ones((1, 2), bool), np.zeros((1, 2, 0))
    >>> recognise(there, [[1.0, 1.5]], nothing, 10.8, likelier=19.0).track.tolist()
    [-1]
    >>> recognise(there, [[1.0, 1.5]], [[[9.0], [0.1]]], 10.8, likelier=19.0).track.tolist()
    [1]
    """
    may, where, differ = np.asarray(possible, bool), np.asarray(places, float), np.asarray(looks, float)
    if not may.ndim == 2 or where.shape != may.shape or differ.ndim != 3 or differ.shape[:2] != may.shape:
        raise WildlabError(
            f"pairs of shapes {may.shape}, {where.shape} and {differ.shape} do not go together",
            "give (N, M), (N, M) and (N, M, f)",
            field="looks",
        )
    if not 1 < likelier < np.inf:
        raise WildlabError(
            f"a ratio of {likelier:g} tells no pair from another one", "give one above 1", field="likelier"
        )
    alike = np.nansum(differ, axis=-1)
    may = may & (alike <= limit)
    costs, margin = np.where(may, where + alike, np.inf), 2 * np.log(likelier)
    best = global_nearest(costs, np.inf)
    rows = np.flatnonzero(best.track >= 0)
    least = _total(costs, best)
    track = np.full(len(best.track), -1)
    for row in rows:
        column = int(best.track[row])
        rivals = np.zeros_like(may)
        rivals[row], rivals[:, column] = may[row], may[:, column]
        rivals[row, column] = False
        further = differ - differ[row, column]
        ahead = where - where[row, column] + np.nansum(further, axis=-1)
        if (ahead[rivals] < margin).any():
            continue
        without = costs.copy()
        without[row, column] = np.inf
        other = global_nearest(without, np.inf)
        as_many = (other.track >= 0).sum() == len(rows)
        if not (as_many and _total(without, other) - least < margin):
            track[row] = column
    measurement = np.full(len(best.measurement), -1)
    measurement[track[track >= 0]] = np.flatnonzero(track >= 0)
    return Assignment(track, measurement)


def _apart(new: ArrayLike, new_P: ArrayLike, old: ArrayLike, old_P: ArrayLike) -> tuple[Array, Array]:
    """(N, M, 2) ways from old to new and (N, M, 2, 2) their covariances."""
    a, b = (np.asarray(one, float).reshape(-1, 2) for one in (new, old))
    A, B = (np.asarray(one, float).reshape(-1, 2, 2) for one in (new_P, old_P))
    return a[:, None] - b, A[:, None] + B


def _total(costs: Array, assignment: Assignment) -> float:
    rows = np.flatnonzero(assignment.track >= 0)
    return float(costs[rows, assignment.track[rows]].sum())
