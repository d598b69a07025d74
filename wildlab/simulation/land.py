"""The ground that a twin flies over, where it is not level: drawn land, and heights above it."""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha256

import numpy as np
from scipy import ndimage

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.simulation.parameters import TwinParameters

#: Between heights of a course that follows the ground, s.
_EVERY = 1.0


def twin_land(twin: TwinParameters) -> Terrain | None:
    """The land under a twin: the same for all its seeds, as a place is; None where the ground is level."""
    land = twin.land
    if land is None:
        return None
    return _drawn(int(land.seed.number), land.north.si, land.east.si, land.step.si, land.relief.si)


@lru_cache(maxsize=4)
def _drawn(seed: int, north: float, east: float, step: float, relief: float) -> Terrain:
    return synthetic_landscape(seed, north=north, east=east, step=step, relief=relief)


def ground_heights(twin: TwinParameters, north_east: Array) -> Array:
    """(N,) heights of the ground at (N, 2) places, m; zero everywhere where it is level.

    Raises
    ------
    WildlabError
        Where a place is not on the land.
    """
    land = twin_land(twin)
    if land is None:
        return np.zeros(len(north_east))
    heights = land.heights_at(north_east)
    if np.isnan(heights).any():
        raise WildlabError(
            f"{int(np.isnan(heights).sum())} of {len(heights)} places are not on the land",
            "make it larger: land.north, land.east",
            field="land",
        )
    return heights


def heights_along(twin: TwinParameters, times: Array, north_east: Array, speed: float) -> Array:
    """(N,) heights of the ground along a course at even times, as an autopilot that looks ahead follows it.

    The mean over ``land.follow`` metres of the way: what is shorter is flown over, not along.
    """
    heights = ground_heights(twin, north_east)
    if twin.land is None:
        return heights
    spacing = max(float(times[1] - times[0]) * speed, 1e-9)
    count = max(round(twin.land.follow.si / spacing), 1)
    return np.asarray(ndimage.uniform_filter1d(heights, count, mode="nearest"))


def even_times(duration: float, margin: float = 30.0) -> Array:
    """Times at which heights of a course are taken, s: from some before 0 to some after the duration."""
    return np.arange(-margin, duration + margin + _EVERY, _EVERY)


def land_record(twin: TwinParameters) -> dict[str, object] | None:
    """What the manifest says of the land; None where the ground is level."""
    land = twin_land(twin)
    if land is None:
        return None
    rows, columns = land.height.shape
    return {
        "source": "simulated",
        "sha256": sha256(land.height.tobytes()).hexdigest(),
        "crs": "n",
        "heights": "flight",
        "added_m": 0.0,
        "unit": "m",
        "cell_m": (land.step, land.step),
        "step_m": land.step,
        "rows": rows,
        "columns": columns,
        "holes": 0,
        "error_rms_m": 0.0,
        "error_max_m": 0.0,
    }
