"""Whether a new track is a target whose track had ended: H 3.4.2.

H proposes to store the last state of a track that ends together with visual properties, and to go on with it
in place of a new one; how it is compared is left open. Here a new track may be one that was kept where its
place could have been reached since, and where both look alike. How likely each such pair is follows from
where the filter expects the kept track by now, and from the looks. An identity is taken only where no other
pair is nearly as likely: a new identity says less than is known, a wrong one says what is not so.

How likely it is that a new track is a target never seen before is not asked: of that speak the limits on
place and looks alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.many.assignment import Assignment, global_nearest

Array = NDArray[np.float64]


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
