"""What drawn lands give for each sentence of F on the line of sight."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.shares import Check
from wildlab.geometry.frames import Array
from wildlab.studies.line_of_sight.timing import furthest_ratio, seconds
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    HEIGHTS,
    INCIDENCES,
    LETTER,
    RAYS,
    TREES,
    VIEW,
    WHOLE_RAYS,
    settings,
)

#: A ratio of times, the larger over the smaller, is never below this.
EQUAL = 1.0


def at_heights(runs: pd.DataFrame, subject: str, name: str) -> Array:
    """(lands, heights) of one number."""
    return np.column_stack([runs[subject, f"{name}_{height}m"] for height in HEIGHTS])


def disagreement(runs: pd.DataFrame, way: str) -> Array:
    """(lands,) share of grid points answered otherwise than exactly by a way, mean over heights."""
    return np.asarray(1 - np.nanmean(at_heights(runs, way, "agreement"), axis=1))


def saved(runs: pd.DataFrame) -> Array:
    """(lands, heights) how many times as many steps rays take that begin at the camera."""
    return at_heights(runs, WHOLE_RAYS, "steps") / at_heights(runs, RAYS, "steps")


def hidden(runs: pd.DataFrame) -> Array:
    """(lands, incidences) share of what is seen without trees that trees hide."""
    return np.column_stack([runs[TREES, f"hidden_{degrees}deg"] for degrees in INCIDENCES])


def check_claims(runs: pd.DataFrame, times: pd.DataFrame) -> dict[str, Check]:
    """What the lands give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each land.
    times
        What `timed` gives, one row for each land that was timed.
    """
    trees, factor = hidden(runs), saved(runs)
    cheap = np.nanmax(seconds(times, VIEW), axis=1)
    dear = np.nanmin(np.hstack([seconds(times, way) for way in (RAYS, ANGLES)]), axis=1)
    letter = np.column_stack([runs[LETTER, f"seen_{name}"] for name, *_ in settings()])
    return {
        "run-times-similar": _times(times, RAYS),
        "run-times-similar-from-the-camera": _times(times, WHOLE_RAYS),
        "occlusion-costs-more": Check(true=dear > cheap, first=1e6 * dear, second=1e6 * cheap, unit="µs"),
        "shortening-pays-high-up": Check(
            true=factor[:, -1] > factor[:, 0], first=factor[:, -1], second=factor[:, 0], unit="times"
        ),
        "view-grows-linearly": Check(measured=np.abs(runs[VIEW, "exponent"].to_numpy(float) - 1)),
        "trees-count-with-incidence": Check(
            true=np.asarray((np.diff(trees, axis=1) > 0).all(axis=1)), first=trees[:, -1], second=trees[:, 0]
        ),
        "algorithms-agree": Check(
            measured=np.maximum(disagreement(runs, RAYS), disagreement(runs, ANGLES)), reach=(0.0, 1.0)
        ),
        "letter-hides-everything": Check(true=np.asarray(np.nanmax(letter, axis=1) == 0)),
    }


def _times(times: pd.DataFrame, way: str) -> Check:
    return Check(measured=furthest_ratio(times, way, ANGLES), reach=(EQUAL, np.inf))
