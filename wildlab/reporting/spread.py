"""How far simulated flights spread, and what that is called.

Of many flights the 90 % prediction interval of one more is shown (`wildlab.evaluation.replication`). Fewer
than 19 have none: there the lowest and the highest are shown. One flight has no spread at all.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.order_statistics import prediction_interval

#: From how many flights on there is a 90 % prediction interval of one more.
MANY = 19


def spread_key(n: int) -> str:
    """What a legend calls the spread over ``n`` flights; nothing for one."""
    return "" if n < 2 else "lowest to highest" if n < MANY else "middle 90 %"


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
