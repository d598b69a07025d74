"""How far simulated flights spread, and what that is called.

Of many flights the 90 % prediction interval of one more is shown (`wildlab.evaluation.replication`). Fewer
than 19 have none: there the lowest and the highest are shown. One flight has no spread at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.order_statistics import prediction_interval

#: From how many flights on there is a 90 % prediction interval of one more.
MANY = 19


class SpreadWords(NamedTuple):
    """What the spread over some flights is called; each is empty for one flight, but for ``over``.

    Attributes
    ----------
    over
        After "beside": "the median of 200 simulated flights, and the range that nine of ten lie in".
    on
        After a range: "on nine flights of ten".
    heading
        Of a column of ranges.
    key
        Of a legend.
    """

    over: str
    on: str
    heading: str
    key: str


def spread_words(n: int, one: str = "flight") -> SpreadWords:
    """What the spread over ``n`` flights, or whatever ``one`` of them is, is called."""
    many = f"{one}s"
    if n < 2:
        return SpreadWords(f"one simulated {one}", "", "", "")
    if n < MANY:
        low_high = "lowest to highest"
        return SpreadWords(
            f"the median of {n} simulated {many}, and the lowest and the highest of them",
            f"on {n} {many}",
            f"{low_high} of {n} {many}",
            low_high,
        )
    return SpreadWords(
        f"the median of {n} simulated {many}, and the range that nine of ten lie in",
        f"on nine {many} of ten",
        f"90 % of {many}",
        "middle 90 %",
    )


def bounds_of(values: pd.Series) -> tuple[float, float]:
    """Lower and upper bound of what is shown as the spread over flights, one row for each.

    NaN for one flight. Rows that are NaN are left out.
    """
    if len(values) < 2:
        return np.nan, np.nan
    if values.notna().sum() < MANY:
        return float(values.min()), float(values.max())
    return prediction_interval(values)


def share_below(values: pd.Series, printed: float) -> float:
    """Which share of the flights lies below a printed number, those on it by halves; NaN for none known."""
    known = values[np.isfinite(values)]
    return float(((known < printed).mean() + (known <= printed).mean()) / 2) if len(known) else np.nan


def range_words(values: ArrayLike, decimals: int = 1) -> str:
    """The bounds of ``values`` (N,) as "6.1 to 13.0"; nothing for one flight."""
    column = pd.Series(np.asarray(values, float))
    low, high = bounds_of(column)
    return f"{low:.{decimals}f} to {high:.{decimals}f}".replace("-", "−") if len(column) > 1 else ""


def range_clause(values: ArrayLike, decimals: int = 1) -> str:
    """The same to put behind a noun: "; 6.1 to 13.0 on nine flights of ten"."""
    between, on = range_words(values, decimals), spread_words(np.size(values)).on
    return f"; {between} {on}" if between else ""
