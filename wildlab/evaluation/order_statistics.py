"""Intervals from ordered values of flights: of their median, and of one more flight; for any distribution."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Of both intervals: of the centre of our flights, and of one more flight.
LEVEL = 0.9


def median_interval(values: ArrayLike) -> tuple[float, float]:
    """The 90 % confidence interval of a median by order statistics.

    Parameters
    ----------
    values
        (N,), one of each flight; NaN is left out.

    Returns
    -------
    (low, high)
        NaN of fewer than five.

    Examples
    --------
    >>> median_interval(range(1, 21))
    (6.0, 15.0)
    """
    known = finite_sorted(values)
    return _between(known, _median_rank(len(known)))


def prediction_interval(values: ArrayLike) -> tuple[float, float]:
    """The 90 % prediction interval of one more flight by order statistics, exact for any distribution.

    Parameters
    ----------
    values
        (N,), one of each flight; NaN is left out.

    Returns
    -------
    (low, high)
        NaN of fewer than 19 flights, of which even the lowest and the highest hold less.

    Examples
    --------
    >>> prediction_interval(range(1, 101))
    (5.0, 96.0)
    """
    known = finite_sorted(values)
    return _between(known, prediction_rank(len(known)))


def prediction_rank(flights: int) -> int:
    """From which lowest and highest flight the prediction interval goes; 0 where there are too few."""
    return int((flights + 1) * (1 - LEVEL) / 2 + 1e-9)


def false_outside(flights: int) -> float:
    """The probability that one more flight like ours lies outside of our prediction interval.

    Examples
    --------
    >>> round(false_outside(200), 4)
    0.0995
    """
    return 2 * prediction_rank(flights) / (flights + 1)


@lru_cache(maxsize=256)
def _median_rank(flights: int) -> int:
    """The number below the median is binomial: the largest rank that each side passes with at most 5 %."""
    from scipy.special import bdtr

    below = bdtr(np.arange(flights), flights, 0.5)
    return int(np.searchsorted(below, (1 - LEVEL) / 2 + 1e-9, "right"))


def finite_sorted(values: ArrayLike) -> Array:
    """The finite ones of (N,) values, in order."""
    array = np.asarray(values, float)
    return np.sort(array[np.isfinite(array)])


def _between(ordered: Array, rank: int) -> tuple[float, float]:
    """The values of that rank from below and from above, NaN for rank 0."""
    if rank < 1:
        return math.nan, math.nan
    return float(ordered[rank - 1]), float(ordered[-rank])
