"""Tables of the study of tracking animals, with intervals of what cannot be negative."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval, share_interval
from wildlab.reporting.text import number, percent_between
from wildlab.studies.wildlife_tracking.rendered import Counted
from wildlab.studies.wildlife_tracking.trial import FILTERS, GONDOLA, REVISITS, ROWS, UAV

#: Numbers of `searches_table` and their units; those without one are shares.
_OF_SEARCH = {"minutes": "min", "turns": "", "visits": "", "given_up": "", "rmse": "m", "sd": "m"}
_SHARES = ("done", "animals_share")

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


def positive_cell(values: pd.Series, digits: int = 1, unit: str = "") -> str:
    """Such a mean and its interval, where it has one, as a table shows it.

    Examples
    --------
    >>> positive_cell(pd.Series([1.0, 2.0, 3.0]), unit="m"), positive_cell(pd.Series([1.0, 2.0, np.nan]))
    ('2.0 m (0.6 to 6.9)', '1.5')
    """
    middle = f"{number(values.mean(), digits)} {unit}".rstrip()
    found = positive_interval(values)
    if found is None or found.low == found.high:
        return middle
    return f"{middle} ({number(found.low, digits)} to {number(found.high, digits)})"


def count_cell(count: int, of: int) -> str:
    """A count, with the interval of its share.

    Examples
    --------
    >>> count_cell(8, 10), count_cell(0, 0)
    ('8 of 10 (49 to 94 %)', 'none of 0')
    """
    if not of:
        return "none of 0"
    found = share_interval(count, of)
    return f"{count} of {of} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def tracks_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of animals out of sight, a row for each platform and filter."""
    rows = []
    for one in (f"{platform}-{each}" for platform in (GONDOLA, UAV) for each in FILTERS):
        cells = {name: positive_cell(runs[one, name]) for name in ("rmse", "sd", "anees")}
        right = count_cell(int(runs[one, "right"].sum()), int(runs[one, "later"].sum()))
        rows.append({"filter": names[one], **cells, "right": right})
    return pd.DataFrame(rows)


def searches_table(runs: pd.DataFrame, quantities: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of searches with and without visits to known animals, a row for each number."""
    cells = {name: {one: positive_cell(runs[one, name], unit=unit) for one in (REVISITS, ROWS)}
             for name, unit in _OF_SEARCH.items()}  # fmt: skip
    cells |= {
        name: {one: percent_between(mean_share_interval(runs[one, name]), 0) for one in (REVISITS, ROWS)}
        for name in _SHARES
    }
    return pd.DataFrame([{"what": quantities[name]} | row for name, row in cells.items()])


def frames_table(counts: Mapping[str, Counted], frames: int, names: Mapping[str, str]) -> pd.DataFrame:
    """What simulated detections and rendered frames gave, a row for each."""
    return pd.DataFrame(
        [
            {
                "from": names[who],
                "found": count_cell(one.found, one.shown),
                "with_false": count_cell(one.with_false, frames),
                "by_false": count_cell(one.by_false, one.tracks),
                "rmse": number(one.sight["rmse"], 1),
            }
            for who, one in counts.items()
        ]
    )
