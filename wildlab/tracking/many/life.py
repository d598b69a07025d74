"""When a track begins, is believed, and ends: H 3.4.

H's start has four steps. A detection that belongs to no track waits for the next scan; one near enough to it
there makes a preliminary track of the two; that is confirmed by detections in m of the next n scans, and
dropped where it can no longer have so many. Only scans in which the target could have been seen count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.many.assignment import Assignment, global_nearest

Array = NDArray[np.float64]

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
