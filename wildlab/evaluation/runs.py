"""What a number of independent runs says: intervals for a mean and for a share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import normal_quantile, student_quantile


class Interval(NamedTuple):
    """An estimate, and the two-sided interval about it."""

    estimate: float
    low: float
    high: float


def mean_interval(values: ArrayLike, probability: float = 0.95) -> Interval:
    """Mean of what independent runs gave, with Student's interval.

    Neighbouring moments of one run are not independent: give one value for each run.

    Parameters
    ----------
    values
        (N,), one for each run, in any unit; NaN are left out.
    probability
        With which the interval holds the mean over all such runs.

    Returns
    -------
    Interval
        In the unit of the values; its ends are NaN where fewer than two are known, all is where none is.

    Raises
    ------
    WildlabError
        If ``probability`` is not between 0 and 1.

    Examples
    --------
    >>> [round(x, 2) for x in mean_interval([1.0, 2.0, 3.0])]
    [2.0, -0.48, 4.48]
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if not 0 < probability < 1:
        raise WildlabError(f"no interval with probability {probability}", "give one between 0 and 1")
    if len(known) < 2:
        return Interval(float(known[0]) if len(known) else np.nan, np.nan, np.nan)
    mean = float(known.mean())
    half = float(
        student_quantile((1 + probability) / 2, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known))
    )
    return Interval(mean, mean - half, mean + half)


def mean_share_interval(shares: ArrayLike) -> Interval:
    """As `mean_interval` with 95 %, of shares: it ends at none and at all.

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
