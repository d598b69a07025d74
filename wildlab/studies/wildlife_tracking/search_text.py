"""What the report on tracking animals says of searches with visits, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import mean_interval
from wildlab.reporting.text import number, percent
from wildlab.studies.wildlife_tracking.intervals import changed_words, mean_share_words, positive_words
from wildlab.studies.wildlife_tracking.trial import REVISITS, ROWS

#: What the searches are called.
SEARCHES = {REVISITS: "rows and visits", ROWS: "rows alone"}

#: Rows of `search_table`, with units.
_ROWS = {
    "minutes": ("time", "min"),
    "turns": ("turns to an animal", ""),
    "visits": ("animals found by that", ""),
    "given_up": ("animals given up", ""),
    "rmse": ("off", "m"),
    "sd": ("said", "m"),
}
_SHARES = {"done": "enclosures called done", "animals_share": "animals found"}
SEARCH_COLUMNS = {"what": "of a search", **SEARCHES}
SEARCH_CAPTION = (
    "Means over worlds with their 95 % intervals. Off and said are of animals out of sight while their "
    "enclosure is searched, up to when the shorter search ended. A search ends when all enclosures are "
    "called done, all rows are flown, or after the time of two laps."
)


def search_table(spread: pd.DataFrame) -> pd.DataFrame:
    """One row for each number, one column for each kind of search."""
    rows = [
        {"what": words} | {one: positive_words(spread[one, name], unit=unit) for one in SEARCHES}
        for name, (words, unit) in _ROWS.items()
    ]
    rows += [
        {"what": words} | {one: mean_share_words(spread[one, name]) for one in SEARCHES}
        for name, words in _SHARES.items()
    ]
    return pd.DataFrame(rows)


def search_words(spread: pd.DataFrame) -> str:
    """What visits change."""
    longer = (spread[REVISITS, "minutes"] - spread[ROWS, "minutes"]).to_numpy(float)
    time, longer = "", longer[np.isfinite(longer)]
    if len(longer) > 1 and not longer.any():
        time = " The search takes as long in every world."
    elif len(longer) > 1:
        found = mean_interval(longer)
        sure = found.low > 0 or found.high < 0
        low, high = sorted((abs(found.low), abs(found.high)))
        time = (
            f" The search takes {abs(found.estimate):.1f} min {'longer' if found.estimate > 0 else 'less'} "
            f"({low:.1f} to {high:.1f})."
            if sure
            else f" That the search takes another time is not certain ({number(found.low, 2)} to "
            f"{number(found.high, 2)} min)."
        )
    return (
        f"While an enclosure is searched, with visits the RMS distance of its animals out of sight is "
        f"{changed_words(spread, 'rmse', REVISITS, ROWS)}, and the stated standard deviation is "
        f"{changed_words(spread, 'sd', REVISITS, ROWS)}.{time}{_early_words(spread)}"
    )


def _early_words(spread: pd.DataFrame) -> str:
    """Whether animals were missed where every enclosure was called done: that is of counting by tracks."""
    whole = spread[REVISITS, "done"] == 1
    if not whole.any():
        return ""
    missed = 1 - float(spread[REVISITS, "animals_share"].to_numpy(float)[whole.to_numpy()].mean())
    if not missed > 0:
        return ""
    return (
        f" In the worlds where all enclosures were called done ({int(whole.sum())} of {len(spread)}), "
        f"{percent(missed)} of the animals had not been found by then: two tracks of one animal count as two."
    )
