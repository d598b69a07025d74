"""What the report on gating, H 6.4.3, says: rates beside published, and what moves them, as tables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.reporting.spread import range_words, spread_words
from wildlab.studies.gating.monte_carlo import FORMS
from wildlab.studies.gating.variations import standard_error

Array = NDArray[np.float64]

NAMES = {"position": "position", "pixels": "pixels", "angles": "azimuth and elevation"}
#: What the track is updated with, in words.
FED = {
    "assigned": "with what was assigned",
    "own": "with the main object's own",
    "nothing": "with nothing",
}
_RATES_COLUMNS = {
    "fed": "track updated",
    "form": "gating by",
    "published": "published (%)",
    "here": "here (%)",
    "se": "standard error",
    "difference": "difference",
    "sd": "SD over runs",
}
RATES_DIGITS = {"published": 2, "here": 2, "se": 2, "difference": 2, "sd": 1}


def rates_columns(runs: int) -> dict[str, str]:
    """Headings of the table that `rates_table` gives for so many runs."""
    return {**_RATES_COLUMNS, "range": spread_words(runs, "run").heading}


def rates_table(rates: Mapping[str, Array], published: Mapping[str, float]) -> pd.DataFrame:
    """A row for each of `FED` and each form: published and mean success rates, and their spread over runs.

    ``rates`` are (3, runs) in per cent.
    """
    return pd.DataFrame(
        [
            {
                "fed": words,
                "form": NAMES[form],
                "published": published[form],
                "here": runs.mean(),
                "se": standard_error(runs),
                "difference": runs.mean() - published[form],
                "sd": runs.std(ddof=1),
                "range": range_words(runs, 0),
            }
            for fed, words in FED.items()
            for form, runs in zip(FORMS, rates[fed], strict=True)
        ]
    )


def varied_table(varied: pd.DataFrame) -> pd.DataFrame:
    """Success rates of each variation of `wildlab.studies.gating.variations.vary`, in per cent as text.

    In brackets stands the change of each with twice its standard error.
    """
    shown = pd.DataFrame({"changed": varied["variation"]})
    for form in FORMS:
        cells = varied[[form, f"{form}_change", f"{form}_se"]].to_numpy(float)
        words = [f"{rate:.1f} ({change:+.1f} ± {2 * se:.1f})" for rate, change, se in cells]
        shown[f"{NAMES[form]} (%)"] = [f"{cells[0, 0]:.1f}", *(w.replace("-", "−") for w in words[1:])]
    return shown
