"""What following animals takes of the processor of the machine that makes the report."""

from __future__ import annotations

from collections.abc import Iterable
from time import process_time

import numpy as np
import pandas as pd

from wildlab.analysis.animals.follow import follow
from wildlab.studies.wildlife_tracking.trial import (
    KALMAN,
    POSITIVE,
    UAV,
    draw_world,
    follower_of,
)

#: Of how many images of each world.
IMAGES = 600
#: Over how many worlds at most it is timed: so many that a claim can hold.
TIMED = 40


def following_cost(seeds: Iterable[int], second: str) -> pd.DataFrame:
    """Processor time of each filter for the multicopter's images, with all that surrounds it.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    second
        The twin of the multicopter.

    Returns
    -------
    DataFrame
        A row for each seed: seconds by filter; ``ratio``, the particle filter, without negative information,
        over the Kalman filter: both look at the same images.
    """
    rows = {}
    for seed in list(seeds)[:TIMED]:
        world = draw_world(UAV, second, seed)
        images = world.images.first(IMAGES)
        spent = {}
        for name in (POSITIVE, KALMAN):
            follower = follower_of(name, world, seed)
            began = process_time()
            follow(images, world.land, world.detector, follower, world.motion)
            spent[name] = process_time() - began
        rows[seed] = spent | {"ratio": spent[POSITIVE] / spent[KALMAN]}
    return pd.DataFrame.from_dict(rows, orient="index")


def middle_ratio(cost: pd.DataFrame) -> float:
    """Median of the ratio over the worlds timed."""
    return float(np.median(cost["ratio"]))
