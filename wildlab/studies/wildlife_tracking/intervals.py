"""Means over worlds and their intervals: of what cannot be negative, of shares, of differences."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval
from wildlab.reporting.text import NOTHING, number

#: From how many worlds on a mean of what cannot be negative has an interval: of two its ends lie a factor of
#: up to a hundred thousand apart.
FEWEST = 3


def positive_interval(values: ArrayLike) -> Interval | None:
    r"""Mean over worlds of what cannot be negative, with an interval of 95 % that is not negative either.

    Student's interval with its half width :math:`h` is taken on the logarithm of the mean :math:`m`, whose
    standard deviation is that of the mean over the mean (delta method): from :math:`m\,e^{-h/m}` to
    :math:`m\,e^{h/m}`. Values may be zero. Where they hardly spread it is Student's interval. Of
    few worlds with skewed values no such interval holds the mean as often as it says: of 5 log-normal ones
    nine times in ten, and of a count that is 0.2 in the mean two times in three; of 40 worlds it does.

    Parameters
    ----------
    values
        (N,), one of each world, none below zero, in any unit; NaN are left out.

    Returns
    -------
    Interval or None
        In the unit of the values; None where fewer than `FEWEST` are known.

    Examples
    --------
    >>> [round(x, 2) for x in positive_interval([1.0, 2.0, 3.0])]
    [2.0, 0.58, 6.93]
    >>> positive_interval([1.0, 2.0]) is None
    True
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if len(known) < FEWEST:
        return None
    mean, _, high = mean_interval(known)
    if mean == 0:
        return Interval(mean, mean, mean)
    factor = float(np.exp((high - mean) / mean))
    return Interval(mean, mean / factor, mean * factor)


def positive_words(values: pd.Series, digits: int = 1, unit: str = "") -> str:
    """Such a mean and its interval in words.

    Of too few worlds for an interval it says of how many; where all are the same, so.

    Examples
    --------
    >>> positive_words(pd.Series([1.0, 2.0, 3.0]), unit="m")
    '2.0 m (0.6 to 6.9)'
    >>> positive_words(pd.Series([1.0, 2.0, np.nan]))
    '1.5 (2 of 3 worlds)'
    >>> positive_words(pd.Series([0.0, 0.0, 0.0]))
    '0.0 in each of 3 worlds'
    """
    known = values[np.isfinite(values)].to_numpy(float)
    if not len(known):
        return NOTHING
    middle = f"{number(known.mean(), digits)} {unit}".rstrip()
    found, same = positive_interval(known), np.ptp(known) == 0
    if found is not None and not same:
        return f"{middle} ({number(found.low, digits)} to {number(found.high, digits)})"
    if len(known) < len(values) and len(known) < FEWEST:
        return f"{middle} ({len(known)} of {len(values)} worlds)"
    if len(known) < 2:
        return middle
    return f"{middle} in each of {len(known)} worlds" if same else f"{middle} ({len(known)} worlds)"


def mean_share_words(values: pd.Series) -> str:
    """A mean of shares in per cent, with an interval that ends at none and at all.

    Examples
    --------
    >>> mean_share_words(pd.Series([0.8, 0.9, 1.0]))
    '90 % (65 to 100)'
    >>> mean_share_words(pd.Series([1.0, 1.0]))
    '100 % in each of 2 worlds'
    """
    known = values[np.isfinite(values)].to_numpy(float)
    if not len(known):
        return NOTHING
    middle = f"{100 * known.mean():.0f} %"
    if len(known) < 2:
        return middle
    if np.ptp(known) == 0:
        return f"{middle} in each of {len(known)} worlds"
    found = mean_share_interval(known)
    return f"{middle} ({100 * found.low:.0f} to {100 * found.high:.0f})"


def difference(spread: pd.DataFrame, name: str, first: str, second: str) -> Interval | None:
    """Mean over worlds of the first less the second, with its interval; None of fewer than two known."""
    both = (spread[first, name] - spread[second, name]).to_numpy(float)
    both = both[np.isfinite(both)]
    return mean_interval(both) if len(both) > 1 else None


def changed_words(spread: pd.DataFrame, name: str, first: str, second: str) -> str:
    """By how much a number of metres differs, and whether that is more than chance.

    Examples
    --------
    >>> table = pd.DataFrame({("a", "sd"): [9.0, 9.5, 8.7], ("b", "sd"): [10.0, 10.4, 9.8]})
    >>> changed_words(table, "sd", "a", "b")
    'lower by 1.00 m (0.75 to 1.25)'
    """
    found = difference(spread, name, first, second)
    if found is None:
        known = (spread[first, name] - spread[second, name]).dropna()
        if not len(known):
            return "not known in any world"
        value = float(known.iloc[0])
        if number(value, 2) == "0.00":
            return "the same in the one world"
        return f"{'lower' if value < 0 else 'higher'} by {abs(value):.2f} m in the one world"
    if number(found.low, 2) == number(found.high, 2) == "0.00":
        return "the same to a centimetre"
    if found.low > 0 or found.high < 0:
        low, high = sorted((abs(found.low), abs(found.high)))
        way = "lower" if found.high < 0 else "higher"
        return f"{way} by {abs(found.estimate):.2f} m ({low:.2f} to {high:.2f})"
    return (
        f"changed by {number(found.estimate, 2)} m, which chance may have done too "
        f"({number(found.low, 2)} to {number(found.high, 2)})"
    )
