"""What the width of the operator's window does, which F 3.1 leaves to whoever stands in the field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    CLOUDY,
    METHODS,
    PRINTED,
    WINDOW,
    Picture,
    Pictures,
    find,
    judge,
    read_as,
)

#: Widths that are tried, as multiples of what animals have over the ground.
WIDTHS = (1.0, 1.5, 2.0, 3.0)
#: Readings of a level that are tried with them.
TRIED = ("floor", "offset")


def with_window(picture: Picture, width: float) -> Picture:
    """The same picture with a window about the same middle, of another width.

    Parameters
    ----------
    picture
        Taken with a width of `WINDOW`.
    width
        As a multiple of what animals have over the ground.

    Returns
    -------
    Picture
    """
    low, high = picture.window
    middle, half = (low + high) / 2, (high - low) / 2 * width / WINDOW
    return replace(picture, window=(middle - half, middle + half))


def f1_of(pictures: Sequence[Picture], method: str, reading: str) -> float:
    """F1 of a printed setting over pictures, with a reading of its level."""
    thresholds = read_as(METHODS[method], reading)
    found, invented, missed = np.sum([judge(one, find(one, thresholds)).counts for one in pictures], axis=0)
    whole = 2 * found + invented + missed
    return float(2 * found / whole) if whole else float("nan")


def over_windows(pictures: Pictures, widths: Sequence[float] = WIDTHS) -> pd.DataFrame:
    """The pictures of one seed under clouds, and its sequence, with windows of several widths.

    Parameters
    ----------
    pictures
        Of one seed.
    widths
        As multiples of what animals have over the ground.

    Returns
    -------
    DataFrame
        ``width``, ``reading``; F1 of each of `PRINTED` under clouds, and of `ADAPTIVE` in the sequence
        ``before`` and ``after``.
    """
    cloudy = [one for (weather, _), one in pictures.plain.items() if weather == CLOUDY]
    rows = []
    for width in widths:
        shown = [with_window(one, width) for one in cloudy]
        before, after = (with_window(one, width) for one in pictures.sequence)
        for reading in TRIED:
            row: dict[str, object] = {"width": width, "reading": reading}
            row |= {method: f1_of(shown, method, reading) for method in PRINTED}
            row["before"] = f1_of([before], ADAPTIVE, reading)
            row["after"] = f1_of([after], ADAPTIVE, reading)
            rows.append(row)
    return pd.DataFrame(rows)
