"""What the report says of readings of “level”, of the window's width, and of pieces of one animal."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, share_interval
from wildlab.studies.wildlife_detection.claims import rates_of
from wildlab.studies.wildlife_detection.text import FIGURE, READ_AS, best_of, copes_words, equals, ranged
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    LARGE,
    PIECES,
    PRINTED,
    READ_AT,
    READINGS,
    SMALL,
    read_subject,
)


def readings_table(spread: pd.DataFrame) -> pd.DataFrame:
    """F1 and recall of each printed setting with each reading of its level."""
    at = [str(height) for height in READ_AT]
    rows = []
    for reading in READINGS:
        row: dict[str, object] = {"reading": READ_AS[reading]}
        for method in PRINTED:
            found = rates_of(spread, read_subject(method, reading), at)
            row[method] = ranged(found.f1)
        for when in ("before", "after"):
            row[when] = ranged(rates_of(spread, read_subject(ADAPTIVE, reading), [when]).f1)
        rows.append(row)
    return pd.DataFrame(rows)


def readings_words(spread: pd.DataFrame) -> str:
    """Which reading of each printed level finds most in these images, and which are not told from it."""
    parts = []
    for method in PRINTED:
        (best, *more), value = best_of(spread, method)
        tied = ", not told from " + " and ".join(f"“{READ_AS[one]}”" for one in more) if more else ""
        parts.append(f"figure {FIGURE[method]}: “{READ_AS[best]}” (F1 {ranged(value)}){tied}")
    return (
        f"The thesis does not define the level of an adaptive threshold. Of {len(READINGS)} readings the "
        "best in the rendered images under clouds, on which they were tried, is, for "
        + "; for ".join(parts)
        + ". Nothing was held against the thesis's own pictures."
    )


def windows_words(windows: pd.DataFrame) -> str:
    """Which width and reading find most in these images, and whether the adaptive one then copes."""
    sense = windows["mean"]
    best = windows.loc[sense.idxmax()]
    rivals = [
        f"“{READ_AS[str(reading)]}” with {windows.loc[own.idxmax(), 'width']:g} times ({own.max():.2f})"
        for reading, own in sense.groupby(windows["reading"])
    ]
    tied = int(windows["tied"].sum()) - 1
    among = f", {tied} more of which {'is' if tied == 1 else 'are'} not told from it" if tied else ""
    copes = copes_words(Interval(*(float(best[one]) for one in ("fall", "fall_low", "fall_high"))))
    same = windows[(windows["width"] == best["width"]) & (windows["reading"] != best["reading"])]
    beside = "".join(
        f"; read the other way, from {row.before:.2f} to {row.after:.2f}" for row in same.itertuples()
    )
    return (
        "The window's width was chosen, and the levels hang on it. The mean F1 of the printed settings and "
        f"of the sequence is largest for {'; for '.join(rivals)} the difference between animals and ground. "
        f"With the best of {len(windows)}, taken from the images it is told of{among}, the adaptive "
        f"threshold's F1 goes from {best['before']:.2f} to {best['after']:.2f} when the sun comes out: it "
        f"{copes}{beside}."
    )


def windows_table(windows: pd.DataFrame) -> pd.DataFrame:
    """The same as a table, readings in words."""
    return windows.assign(reading=windows["reading"].map(READ_AS))


def _pieces(spread: pd.DataFrame, kind: str, level: float) -> tuple[pd.Series, pd.Series]:
    """Detections for each animal with the small and with the large block, of the seeds that have both."""
    small, large = (spread[method, f"pieces_{kind}_{level:g}"] for method in (SMALL, LARGE))
    known = np.isfinite(small) & np.isfinite(large)
    return small[known], large[known]


def level_words(kind: str, level: float) -> str:
    """What a level in its reading is called."""
    if level == 0:
        return "above the mean of the block: no level"
    beside = (
        "above the mean of the block by" if kind == "offset" else "above the mean of the block, and above"
    )
    return f"{beside} {level:g}"


def pieces_table(spread: pd.DataFrame) -> pd.DataFrame:
    """Into how many detections animals fall with F's two blocks, by the reading of the missing level."""
    rows = []
    for kind, level in PIECES:
        small, large = _pieces(spread, kind, level)
        row = {"reading": level_words(kind, level), "seeds": len(small)}
        for name, own in (("small", small), ("large", large)):
            row[name] = f"{own.mean():.2f}" if len(own) else ""
            row[f"{name}_split"] = f"{int((own > 1).sum())}" if len(own) else ""
        rows.append(row)
    return pd.DataFrame(rows)


def pieces_words(spread: pd.DataFrame) -> str:
    """Which reading of the missing level gives what figures 7.7 and 7.8 show, and how often."""
    shown, counted = {}, {}
    for kind, level in PIECES:
        small, large = _pieces(spread, kind, level)
        count, words = int(((small > 1) & (large == 1)).sum()), level_words(kind, level)
        counted[words] = (count, len(small))
        shown[words] = share_interval(count, len(small)) if len(small) else Interval(*[np.nan] * 3)
    best, *more = equals(shown)
    count, of = counted[best]
    start = "Animals longer than 51 pixels, seen from the gondola; the figures print no level. "
    if not count:
        return f"{start}With no reading of it a small region splits an animal that a large one leaves whole."
    beside = (
        f"not told from {' and '.join(f'“{one}”' for one in more)}"
        if more
        else "more often than with the other readings"
    )
    return (
        f"{start}That the small region splits some and the large one none comes on {count} of {of} images "
        f"({100 * shown[best].low:.0f} to {100 * shown[best].high:.0f} %) with “{best}”, {beside}."
    )
