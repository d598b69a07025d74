"""What scoring against the nearest mark hides, and which clicks it may have given to the wrong one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: A click is ambiguous where the nearest mark is not this many times as likely as the second nearest.
ODDS = 19.0


def ambiguous(nearest: ArrayLike, second: ArrayLike, sd: float) -> NDArray[np.bool_]:
    """Whether a click may as well be of the second nearest mark.

    Parameters
    ----------
    nearest, second
        (N,) m, distances to the two marks that lie nearest; infinite where there is no second.
    sd
        Standard deviation of an error along either axis, m.

    Returns
    -------
    (N,) bool; False where the nearest is NaN

    Examples
    --------
    >>> ambiguous([1.0, 1.0], [1.5, 20.0], 2.0).tolist()
    [True, False]
    """
    d1, d2 = np.asarray(nearest, float), np.asarray(second, float)
    with np.errstate(invalid="ignore"):
        return np.asarray(d2**2 - d1**2 < 2 * sd**2 * np.log(ODDS))


def largest_visible(marks: ArrayLike) -> float:
    """The error beyond which the nearest mark is usually another one: half the median spacing of the marks.

    Parameters
    ----------
    marks
        (M, 2) m.

    Returns
    -------
    float
        Infinite for one mark.

    Examples
    --------
    >>> largest_visible([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    5.0
    """
    xy = np.unique(np.asarray(marks, float), axis=0)
    if len(xy) < 2:
        return float("inf")
    apart = np.linalg.norm(xy[:, None] - xy, axis=2)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)) / 2)
