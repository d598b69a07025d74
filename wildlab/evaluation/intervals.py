"""Intervals of a mean, a share, a median and of one more run: from independent runs, or blocks in time order.

The error of a pose wanders over tens of seconds, so that neighbouring images say less than their number. A
block is a stretch of neighbouring images; blocks are taken for independent of each other, images are not.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import independent_count, normal_quantile, student_quantile


class Interval(NamedTuple):
    """An estimate, and the two-sided interval about it."""

    estimate: float
    low: float
    high: float


def mean_interval(values: ArrayLike) -> Interval:
    """Mean of what independent runs gave, with Student's 95 % interval.

    Neighbouring moments of one run are not independent: give one value for each run.

    Parameters
    ----------
    values
        (N,), one for each run, in any unit; NaN are left out.

    Returns
    -------
    Interval
        In the unit of the values; its ends are NaN where fewer than two are known, all is where none is.

    Examples
    --------
    >>> [round(x, 2) for x in mean_interval([1.0, 2.0, 3.0])]
    [2.0, -0.48, 4.48]
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if len(known) < 2:
        return Interval(float(known[0]) if len(known) else np.nan, np.nan, np.nan)
    mean = float(known.mean())
    half = float(student_quantile(0.975, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known)))
    return Interval(mean, mean - half, mean + half)


def mean_share_interval(shares: ArrayLike) -> Interval:
    """As `mean_interval`, of shares: it ends at none and at all.

    Parameters
    ----------
    shares
        (N,) from 0 to 1, one for each run; NaN are left out.

    Returns
    -------
    Interval
        With NaN as `mean_interval` has it.

    Examples
    --------
    >>> [round(x, 2) for x in mean_share_interval([0.9, 1.0, 1.0])]
    [0.97, 0.82, 1.0]
    """
    found = mean_interval(shares)
    return Interval(found.estimate, max(found.low, 0.0), min(found.high, 1.0))


def share_interval(count: float, runs: float, probability: float = 0.95) -> Interval:
    """Share of independent runs of which something is true, with Wilson's score interval.

    It holds the share of all such runs with about that probability, also for few runs and for shares near
    zero and one.

    Parameters
    ----------
    count
        Of how many runs it is true.
    runs
        How many there are.
    probability
        Between 0 and 1.

    Returns
    -------
    Interval
        From 0 to 1; NaN where there is no run.

    Raises
    ------
    WildlabError
        Where ``count`` is not among the runs, or ``probability`` not between 0 and 1.

    Examples
    --------
    >>> [round(x, 2) for x in share_interval(8, 10)]
    [0.8, 0.49, 0.94]
    """
    if 0 < runs < 1 or not 0 <= count <= runs or not 0 < probability < 1:
        raise WildlabError(
            f"no interval for {count} of {runs} runs with probability {probability}",
            "give no more than all of them, and a probability between 0 and 1",
        )
    if runs == 0:
        return Interval(np.nan, np.nan, np.nan)
    share, z2 = count / runs, float(normal_quantile((1 + probability) / 2)) ** 2
    centre = (share + z2 / (2 * runs)) / (1 + z2 / runs)
    half = np.sqrt(z2 * (share * (1 - share) / runs + z2 / (4 * runs**2))) / (1 + z2 / runs)
    return Interval(share, max(0.0, float(centre - half)), min(1.0, float(centre + half)))


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


Labels = NDArray[np.intp]

#: Fewest and most blocks, images in a block where there are enough, and how long one is at least, s.
FEWEST, MOST, IMAGES, LONG_S = 6, 20, 3, 60.0
#: With what probability an interval holds, unless another is asked for.
PROBABILITY = 0.9


def time_blocks(order: ArrayLike, seconds: bool) -> Labels:
    """Number of the block (N,) that each point belongs to, in time order.

    Where there are times and the flight lasts for six blocks of a minute: by the clock. Otherwise by the
    number of images: three to a block, as far as that leaves six blocks. No more than `MOST` blocks, which
    are longer where that takes it.

    Parameters
    ----------
    order
        (N,) when the image of each point was taken: seconds, or its place in the order. NaN stands first.
    seconds
        Whether these are seconds.

    Returns
    -------
    (N,) integers from 0

    Examples
    --------
    >>> time_blocks([5, 5, 6, 7, 8, 9, 10], seconds=False).tolist()
    [0, 0, 1, 2, 3, 4, 5]
    """
    when = np.nan_to_num(np.asarray(order, float), nan=-np.inf)
    images, place = np.unique(when, return_inverse=True)
    known = images[np.isfinite(images)]
    if seconds and len(known) and (known[-1] - known[0]) >= FEWEST * LONG_S:
        length = max(LONG_S, (known[-1] - known[0]) / MOST)
        number = np.floor((np.maximum(when, known[0]) - known[0]) / length)
        return np.asarray(np.unique(number, return_inverse=True)[1])
    count = min(MOST, max(FEWEST, len(images) // IMAGES), len(images))
    return np.asarray(place * count // len(images))


def block_mean(values: ArrayLike, blocks: ArrayLike, probability: float = PROBABILITY) -> Interval:
    """Mean of values that go together within blocks, with Student's interval by the independent blocks.

    Parameters
    ----------
    values
        (N,) in any unit; NaN are left out.
    blocks
        (N,) which block each belongs to.
    probability
        With which the interval holds the mean that more such blocks would have.

    Returns
    -------
    Interval
        Low and high are NaN where fewer than two blocks are left, all is NaN where no value is.

    Examples
    --------
    >>> block_mean([1.0, 1.0, 3.0, 3.0], [0, 0, 1, 1]).estimate
    2.0
    """
    x = np.asarray(values, float)
    keep = np.isfinite(x)
    x, group = x[keep], np.unique(np.asarray(blocks)[keep], return_inverse=True)[1]
    if not len(x):
        return Interval(np.nan, np.nan, np.nan)
    mean = float(x.mean())
    if group.max() < 1:
        return Interval(mean, np.nan, np.nan)
    # As of a ratio of sums over so many independent blocks.
    worth, (apart, count) = independent_blocks(x, group), _apart(x, group)
    error = np.sqrt(count / (count - 1) * (apart @ apart) * count / worth) / len(x)
    half = float(student_quantile((1 + probability) / 2, worth - 1) * error)
    return Interval(mean, mean - half, mean + half)


def independent_blocks(values: ArrayLike, blocks: ArrayLike, surely: float = 0.0) -> float:
    """How many independent blocks the mean of values is worth, three at least.

    Errors that wander make neighbouring blocks alike. Their correlation is that of a process of the first
    order, its estimate freed of its bias (Kendall 1954): so many seconds of a short flight are one sample.

    Parameters
    ----------
    values
        (N,) without NaN.
    blocks
        (N,) which block each belongs to, in time order; two at least.
    surely
        Of its correlation, by so many standard errors more than estimated: 1.64 gives a number that is
        exceeded with 95 %.

    Returns
    -------
    float

    Examples
    --------
    >>> wave = np.sin(np.arange(20) / 4)
    >>> round(independent_blocks(wave, np.arange(20)), 1)
    3.0
    """
    return independent_count(_apart(values, blocks)[0], surely)


def widening(values: ArrayLike, blocks: ArrayLike) -> float:
    """By which factor a 90 % interval is wider that takes all blocks for independent and many.

    Parameters
    ----------
    values
        (N,) without NaN.
    blocks
        (N,) which block each belongs to, in time order; two at least.

    Returns
    -------
    float
    """
    worth, count = independent_blocks(values, blocks), _apart(values, blocks)[1]
    tail = (1 + PROBABILITY) / 2
    return float(np.sqrt(count / worth) * student_quantile(tail, worth - 1) / normal_quantile(tail))


def _apart(values: ArrayLike, blocks: ArrayLike) -> tuple[Array, int]:
    """Sums over blocks of what lies above the mean, and how many blocks there are."""
    x, group = np.asarray(values, float), np.unique(np.asarray(blocks), return_inverse=True)[1]
    sums = np.bincount(group, weights=x - x.mean()).astype(float)
    return sums, len(sums)
