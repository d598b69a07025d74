"""How long each way takes on this machine: the counterpart of F figure 7.1.

Times are not the same twice, and those of another machine are others: nothing of this is kept with the
trials. What is compared are ratios of times that were taken in turn, in one process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np
import pandas as pd

from wildlab.geometry.frames import Array
from wildlab.geometry.line_of_sight import cast_rays, compare_angles, field_of_view, in_field_of_view
from wildlab.geometry.visibility import lines_clear
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    EXACT,
    FEWEST,
    HEIGHTS,
    RAYS,
    STEP,
    TILT,
    TOLERANCE,
    VIEW,
    WHOLE_RAYS,
    camera_of,
    look,
    nodes_of,
)

#: How often each call is timed; the quickest counts.
REPEATS = 5
#: What is timed.
WAYS = (RAYS, WHOLE_RAYS, ANGLES, EXACT)
#: Over how many lands at most: more would tell no more of a ratio than this.
MOST = 20
#: Grid points in view that are timed, at most; and of the whole map one in so many.
MOST_POINTS, PART = 2000, 10


def best_times(calls: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Fewest seconds of the processor for each call, all in turn: what else a machine does only adds."""
    for call in calls.values():
        call()  # the first one compiles, and fills the caches
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            begun = time.process_time()
            call()
            times[name].append(time.process_time() - begun)
    return {name: min(each) for name, each in times.items()}


def timed(seeds: Iterable[int], twin: str, repeats: int = REPEATS) -> pd.DataFrame:
    """Times of the three ways over views like those of the trials.

    Parameters
    ----------
    seeds
        Of the lands; the first `MOST` are taken.
    twin
        Whose camera it is.
    repeats
        Of each call, of which the quickest counts.

    Returns
    -------
    DataFrame
        A row for each seed; columns (way, height): seconds a grid point in view; `VIEW`: seconds for each
        grid point of the map to tell whether it is in view.
    """
    camera, rows, lands = camera_of(twin), {}, list(seeds)[:MOST]
    angles = field_of_view(camera)
    for seed in lands:
        land, rng = synthetic_landscape(seed), stream(seed, "times")
        row: dict[tuple[str, int], float] = {}
        _, points = nodes_of(land)
        for height in HEIGHTS:
            view = look(land, camera, rng, height, TILT)
            # In the order of the map: to fetch heights from all over it would be what takes the time.
            some = np.sort(rng.permutation(len(view.nodes))[:MOST_POINTS])
            nodes, ends, lens = view.nodes[some], view.points[some], view.p_nc
            found = best_times(
                {
                    RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE),
                    WHOLE_RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE, shorten=False),
                    ANGLES: partial(compare_angles, land, nodes, lens),
                    EXACT: partial(lines_clear, land, ends, lens),
                    VIEW: partial(in_field_of_view, angles, points[::PART], lens, view.R_nc),
                },
                repeats,
            )
            for way, seconds in found.items():
                count = len(points[::PART]) if way == VIEW else len(some)
                row[way, height] = seconds / count if count >= FEWEST else np.nan
        rows[seed] = row
    names = [(way, height) for height in HEIGHTS for way in (*WAYS, VIEW)]
    values = np.array([[row[name] for name in names] for row in rows.values()])
    return pd.DataFrame(values, pd.Index(rows, name="seed"), pd.MultiIndex.from_tuples(names))


def seconds(times: pd.DataFrame, way: str) -> Array:
    """(lands, heights) of one way, s a grid point."""
    return np.column_stack([times[way, height].to_numpy(float) for height in HEIGHTS])


def furthest_ratio(times: pd.DataFrame, way: str, beside: str) -> Array:
    """(lands,) where both differ most, how many times the quicker's time the slower one takes."""
    apart = np.abs(np.log(seconds(times, way) / seconds(times, beside)))
    return np.asarray(np.exp(np.nanmax(apart, axis=1)))
