"""Noise that follows the view, and fewer detections, beside a filter of the thesis's tables, for a report."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.measurement_noise import FRACTION, NOISES, THINNED, VARIATIONS
from wildlab.studies.track_text import accuracy_words, stated_words

#: Words for the variations, by the end of their subject.
NAMES = {
    "noise-by-altitude": "noise by height",
    "noise-by-tilt": "by height and tilt",
    "noise-by-place": "by height, tilt and place in the image",
    THINNED: "fewer detections",
}
#: Headings of `table`.
COLUMNS = {
    "filter": "filter",
    "detections": "detections",
    "mae": "mean distance (m)",
    "nees": "mean NEES",
    "nis": "mean NIS",
}
#: Decimals of `table`.
DIGITS = {"detections": 0, "mae": 2, "nees": 2, "nis": 2}


def table(spread: pd.DataFrame, base: str, measurement: float) -> pd.DataFrame:
    """Medians over flights of a filter and of its variations; none of these is in the thesis's tables.

    Parameters
    ----------
    spread
        Columns (subject, name), one row for each flight.
    base
        Subject of the filter that is varied.
    measurement
        The standard deviation that the thesis tells it, m.

    Returns
    -------
    DataFrame
        With the columns of `COLUMNS`, the filter itself first.
    """
    middle = spread.median()
    given = {base: middle["measurements", "detections"]}
    given |= {f"{base}-{name}": middle[f"{base}-{name}", "detections"] for name in VARIATIONS}
    called = {base: f"of the table, {measurement:g} m"}
    called |= {f"{base}-{name}": NAMES[name] for name in VARIATIONS}
    return pd.DataFrame(
        [
            {
                "filter": called[who],
                "detections": detections,
                **{name: middle[who, name] for name in ("mae", "nees", "nis")},
            }
            for who, detections in given.items()
        ]
    )


def explanation() -> str:
    """What was varied, and where it comes from."""
    return (
        "None of these is in the thesis's tables. H 8.2 proposes measurement noise that grows with the "
        "height, with roll and pitch, and towards the borders of the image. Its standard deviation here is "
        f"{100 * FRACTION:g} % of the height for a ray straight down, which H 6.4.4 flies with; a slanting "
        "ray has more, most of all along its bearing. Fewer detections are not in H: those of the table's "
        "filter are thinned until its own innovations say that each is new, and its noise is left as it is."
    )


def words(spread: pd.DataFrame, base: str) -> str:
    """What came of it, from the numbers.

    Parameters
    ----------
    spread, base
        As for `table`.
    """
    middle = spread.median()
    subjects = {name: f"{base}-{name}" for name in VARIATIONS}
    nees = {name: float(middle[who, "nees"]) for name, who in subjects.items()}
    own = float(middle[base, "nees"])
    share = 100 * (nees[NOISES[-1]] / nees[NOISES[0]] - 1)
    change = "the same as"
    if abs(share) >= 0.5:
        change = f"{abs(share):.0f} % {'higher' if share > 0 else 'lower'} than"
    every = {"": own, **nees}
    best = min(every, key=lambda name: abs(np.log(every[name] / 2)))
    called = {"": "the filter of the table", **NAMES}[best]
    kept, seen = middle[subjects[THINNED], "detections"], middle["measurements", "detections"]
    mae = pd.DataFrame({who: spread[who, "mae"] for who in (base, subjects[NOISES[-1]], subjects[THINNED])})
    accuracy = " ".join(
        f"Compared with {NAMES[name].replace('by height, tilt', 'noise by height, tilt')}, "
        + accuracy_words(
            {base: "the filter of the table", subjects[name]: "the variation"}, mae[[base, subjects[name]]]
        )
        + "."
        for name in (NOISES[-1], THINNED)
    )
    return (
        f"Errors of the filter of the table are {stated_words(own)}; with noise by height, tilt and place "
        f"in the image they are {stated_words(nees[NOISES[-1]])}, with {kept:.0f} of {seen:.0f} detections "
        f"{stated_words(nees[THINNED])}. Nearest to a mean NEES of 2 comes {called} ({every[best]:.1f}). "
        f"Tilt and place make the mean NEES {change} the height alone does. {accuracy}"
    )
