"""Which measurement goes to which track: firm data association over a matrix of distances, H 3.3.1.

A matrix has a row for each measurement and a column for each track, H (3.10); NaN and infinity stand for
pairs that are out of the question.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from wildlab.errors import WildlabError

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Assignment(NamedTuple):
    """Who goes with whom.

    Attributes
    ----------
    track
        (N,) the track of each measurement, -1 where it has none.
    measurement
        (M,) the measurement of each track, -1 where it has none.
    """

    track: Index
    measurement: Index


def global_nearest(distances: ArrayLike, gate: float) -> Assignment:
    """Global nearest neighbour: no measurement goes to two tracks, no track takes two, H 3.3.1.

    The sum of the distances is the least, where each pair that is not made costs as much as the gate. H asks
    for a pair for each row and column that has an entry within the gate, which may not be possible: two
    measurements may lie in the gate of one track alone. Without a gate, as many pairs are made as possible,
    with the least sum among those.

    Parameters
    ----------
    distances
        (N, M), by (3.9), with or without features; they may be negative.
    gate
        The largest distance of a pair; infinite for none.

    Returns
    -------
    Assignment

    Raises
    ------
    WildlabError
        If the distances are no matrix or one is minus infinity, or the gate is NaN or minus infinity.

    Examples
    --------
    The nearest of the first track is nearer still to the second:

    >>> global_nearest([[2.0, 1.0], [5.0, 9.0]], gate=9.21)
    Assignment(track=array([1, 0]), measurement=array([1, 0]))
    """
    d = _matrix(distances, gate)
    possible = np.isfinite(d) & (d <= gate)
    track, measurement = np.full(d.shape[0], -1), np.full(d.shape[1], -1)
    if not possible.any():
        return Assignment(track, measurement)
    # A pair that is out of the question costs what the two cost alone.
    alone = gate
    if not np.isfinite(gate):
        largest, least = d[possible].max(), d[possible].min()
        alone = largest + (largest - least + 1) * min(d.shape)
    rows, columns = linear_sum_assignment(np.where(possible, d, alone))
    made = possible[rows, columns]
    track[rows[made]], measurement[columns[made]] = columns[made], rows[made]
    return Assignment(track, measurement)


def nearest(distances: ArrayLike, gate: float) -> Index:
    """Plain nearest neighbour: each track takes its nearest measurement, whoever else takes it, H 6.4.3.

    Transposed, each measurement takes its nearest track, and a track may take several (F 4.3).

    Parameters
    ----------
    distances
        (N, M).
    gate
        The largest distance of a pair; infinite for none.

    Returns
    -------
    (M,)
        The measurement of each track, the first of those equally near; -1 where none is within the gate.

    Raises
    ------
    WildlabError
        As `global_nearest`.

    Examples
    --------
    >>> nearest([[2.0, 1.0], [5.0, 9.0]], gate=9.21).tolist()
    [0, 0]
    """
    d = _matrix(distances, gate)
    possible = np.isfinite(d) & (d <= gate)
    if not d.size:
        return np.full(d.shape[1], -1)
    best = np.where(possible, d, np.inf).argmin(axis=0)
    return np.where(possible.any(axis=0), best, -1)


def _matrix(distances: ArrayLike, gate: float) -> Array:
    d = np.asarray(distances, float)
    if d.ndim != 2:
        raise WildlabError(
            f"distances of shape {d.shape} are no matrix",
            "give (N, M): a row for each measurement and a column for each track",
            field="distances",
        )
    if (d == -np.inf).any() or np.isnan(gate) or gate == -np.inf:
        raise WildlabError(
            "a distance or the gate has no size",
            "give numbers; infinity for a pair that is out of the question, or for no gate",
            field="gate" if np.isnan(gate) or gate == -np.inf else "distances",
        )
    return d
