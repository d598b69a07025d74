"""Which rows of a log stand in the order of their stamps, and which lie where nothing can have been."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import median_filter

#: A log does not run for longer than this, s: stamps further from the middle one are wrong.
LONGEST_S = 7 * 86400.0
#: Nothing that carries a log moves faster, and no stretch of time is taken to be shorter than this.
FASTEST_M_S, SHORTEST_S = 700.0, 1.0
_DEGREE_M = 111_000.0


def in_order(
    stamps: ArrayLike, wanted: ArrayLike | None = None, longest_s: float = LONGEST_S
) -> NDArray[np.bool_]:
    """The most rows whose stamps strictly increase; the others repeat one, go back or leap ahead.

    Parameters
    ----------
    stamps
        (N,) s, in the order of the file; NaN is left out.
    wanted
        (N,) bool: rows that count; the others are left out, and do not make others be left out.
    longest_s
        Stamps further than this from the middle one are left out.

    Returns
    -------
    (N,) bool

    Examples
    --------
    >>> in_order([1.0, 2.0, 2.0, 9000.0, 3.0, 4.0, 0.5, 5.0]).tolist()
    [True, True, False, False, True, True, False, True]
    """
    at = np.asarray(stamps, float)
    usable = np.isfinite(at) if wanted is None else np.isfinite(at) & np.asarray(wanted, bool)
    kept = np.zeros(len(at), bool)
    rows = np.flatnonzero(usable)
    if not len(rows):
        return kept
    rows = rows[np.abs(at[rows] - np.median(at[rows])) <= longest_s]
    few = _without_few(at[rows])
    if few is not None:
        kept[rows[few]] = True
        return kept
    # The longest increasing run of rows: for each length, the row with the smallest stamp that ends one. Of
    # repeated stamps the first is kept.
    smallest: list[float] = []
    ending: list[int] = []
    before: list[int] = []
    values = at[rows].tolist()
    for i, value in enumerate(values):
        length = bisect_left(smallest, value)
        before.append(ending[length - 1] if length else -1)
        if length == len(smallest):
            smallest.append(value)
            ending.append(i)
        elif value < smallest[length]:
            smallest[length], ending[length] = value, i
    i = ending[-1]
    while i >= 0:
        kept[rows[i]] = True
        i = before[i]
    return kept


def _without_few(at: NDArray[np.float64]) -> NDArray[np.bool_] | None:
    """(N,) what is left where one row is taken out at each step back; None where that does not mend all.

    One has to go at each, so that no more can be left.
    """
    kept = np.ones(len(at), bool)
    back = np.flatnonzero(np.diff(at) <= 0)
    if not len(back):
        return kept
    before = np.where(back > 0, at[back - 1], -np.inf)
    ahead = (before < at[back + 1]) & (at[back] != at[back + 1])
    gone = np.where(ahead, back, back + 1)
    kept[gone] = False
    mended = (np.diff(at[kept]) > 0).all() and (np.diff(back) > 1).all()
    return kept if mended else None


def leaps(
    stamps: ArrayLike, latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike
) -> NDArray[np.bool_]:
    """Rows that lie further from the middle of their neighbours than 700 m/s over these would carry them.

    Parameters
    ----------
    stamps
        (N,) s, increasing.
    latitude, longitude, height
        (N,) deg and m; a height that is NaN is not looked at.

    Returns
    -------
    (N,) bool; none where there are fewer than five rows.
    """
    at, lat = np.asarray(stamps, float), np.asarray(latitude, float)
    lon, up = np.asarray(longitude, float), np.nan_to_num(np.asarray(height, float))
    if len(at) < 5:
        return np.zeros(len(at), bool)
    east = lon - median_filter(lon, 5, mode="nearest")
    east = ((east + 180) % 360 - 180) * np.cos(np.radians(lat))
    north = lat - median_filter(lat, 5, mode="nearest")
    rise = up - median_filter(up, 5, mode="nearest")
    away = np.sqrt(np.square(_DEGREE_M * north) + np.square(_DEGREE_M * east) + np.square(rise))
    rows = np.arange(len(at))
    took = at[np.minimum(rows + 2, len(at) - 1)] - at[np.maximum(rows - 2, 0)]
    return np.asarray(away > FASTEST_M_S * np.maximum(took, SHORTEST_S))
