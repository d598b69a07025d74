"""What planning by information takes of the processor of the machine that makes the report."""

from __future__ import annotations

from collections.abc import Iterable
from time import process_time

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.search import Searcher, search
from wildlab.planning.legs import Leg, Platform
from wildlab.studies.information_planning.trial import INFORMATION, draw_scene, searchers

#: Over how many worlds at most planning is timed.
TIMED = 10


class _Timed:
    """A planner, and how much of the processor's time it takes to choose and to add what was seen."""

    def __init__(self, searcher: Searcher) -> None:
        self.searcher = searcher
        self.seconds: list[float] = []

    def next_leg(self, platform: Platform, open_areas: NDArray[np.bool_]) -> tuple[Leg, int]:
        """As `Searcher` has it."""
        began = process_time()
        chosen = self.searcher.next_leg(platform, open_areas)
        self.seconds.append(process_time() - began)
        return chosen

    def flown(self, leg: Leg) -> None:
        """As `Searcher` has it."""
        began = process_time()
        self.searcher.flown(leg)
        self.seconds[-1] += process_time() - began


def planning_cost(seeds: Iterable[int], twin: str) -> pd.DataFrame:
    """What planning by information takes of the processor, without the world and the camera about it.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    twin
        As for `trial`.

    Returns
    -------
    DataFrame
        A row for each seed: ``decision``, s for each decision on the mean, and ``load``, share of one core
        over the search. The first decision is left out: it loads what is compiled.
    """
    rows = {}
    for seed in list(seeds)[:TIMED]:
        scene = draw_scene(seed, twin)
        timed = _Timed(searchers(scene, seed)[INFORMATION]())
        found = search(scene.world, timed, scene.start, scene.sensor, scene.flying, scene.grid[:1])
        spent = timed.seconds[1:]
        flown = found.at[-1] - found.at[scene.flying.images - 1]
        rows[seed] = {"decision": float(np.mean(spent)), "load": float(np.sum(spent) / flown)}
    return pd.DataFrame.from_dict(rows, orient="index")
