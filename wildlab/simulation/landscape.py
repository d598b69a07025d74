"""Land for flights over terrain: rolling ground of a stated relief, the same for the same seed.

The map of the safari area of Kolmården (F 2.1) was not published. What is known of it is kept: about 1000 m
by 500 m, a cell every 2 m, and heights from 71 to 122 m (F 6.1). How its hills lie is drawn: a random field
whose power falls with the wave number as that of natural ground does, without trees or houses, as F's map.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha256

import numpy as np
from scipy import fft, ndimage

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain
from wildlab.simulation.parameters import TwinParameters

#: Between heights of a course that follows the ground, and how far beyond the flight they reach, s.
_EVERY, _MARGIN = 1.0, 30.0


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


def even_times(duration: float) -> Array:
    """Times at which heights of a course are taken, s: from some before 0 to some after the duration."""
    return np.arange(-_MARGIN, duration + _MARGIN + _EVERY, _EVERY)


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


#: F 2.1 and 6.1: metres north and east, metres between nodes, metres above the sea.
NORTH_M, EAST_M, STEP_M, LOWEST_M, HIGHEST_M = 500.0, 1000.0, 2.0, 71.0, 122.0
#: How fast the power of heights falls with the wave number; 3 to 4 is usual for natural ground. Chosen.
ROUGHNESS = 3.6
#: The longest waves, metres: hills, no tilt of the whole. Chosen.
LONGEST_M = 600.0
#: Trees: share of the ground below them, mean height, and how large a stand is, metres. Chosen.
TREES_SHARE, TREES_M, STAND_M = 0.15, 12.0, 12.0
#: By how much of its mean the height of a tree differs from its neighbour's, at most. Chosen.
UNEVEN = 0.3


def synthetic_landscape(
    seed: int,
    *,
    north: float = NORTH_M,
    east: float = EAST_M,
    step: float = STEP_M,
    relief: float = HIGHEST_M - LOWEST_M,
) -> Terrain:
    """Rolling land about the origin of n, its lowest node at zero.

    Parameters
    ----------
    seed
        The same gives the same land.
    north, east
        Size, metres; the origin is in the middle.
    step
        Between nodes, metres.
    relief
        From the lowest node to the highest, metres.

    Returns
    -------
    Terrain
        Its heights are exact: ``sd`` is zero.

    Raises
    ------
    WildlabError
        Where a size is not above zero, or the map is smaller than two steps.

    Examples
    --------
    >>> land = synthetic_landscape(1)
    >>> land.height.shape, float(land.height.min()), round(float(land.height.max()), 3)
    ((251, 501), 0.0, 51.0)
    """
    if not (step > 0 and relief >= 0 and min(north, east) >= 2 * step and max(north, east) < np.inf):
        raise WildlabError(
            f"land of {north:g} m by {east:g} m with {relief:g} m of relief, a node every {step:g} m",
            "give metres above zero, and two steps each way at least",
        )
    shape = (round(north / step) + 1, round(east / step) + 1)
    height = _field(shape, step, np.random.default_rng(seed))
    height *= relief / max(float(np.ptp(height)), 1e-12)
    height = (height - height.min()).astype(np.float32)
    corner = (-(shape[0] - 1) / 2 * step, -(shape[1] - 1) / 2 * step)
    return Terrain(height, north=corner[0], east=corner[1], step=step, sd=0.0)


def grow_trees(land: Terrain, seed: int, share: float = TREES_SHARE) -> Terrain:
    """The same land with trees on it: the surface that hides what stands below and behind it.

    F's map has none (F 8.2). Here they stand in groups, wherever a smooth random field is highest.

    Parameters
    ----------
    land
        The ground, every height known.
    seed
        The same gives the same trees.
    share
        Of the ground that is below trees, 0 to 1.

    Returns
    -------
    Terrain
        Its nodes are those of the land, as high as the tree that stands there.

    Examples
    --------
    >>> land = synthetic_landscape(1)
    >>> round(float((grow_trees(land, 1).height > land.height).mean()), 2)
    0.15
    """
    rng = np.random.default_rng([seed, 1])
    noise = ndimage.gaussian_filter(rng.standard_normal(land.height.shape), STAND_M / land.step, mode="wrap")
    covered = noise > np.quantile(noise, 1 - share) if share < 1 else np.ones(noise.shape, bool)
    trees = covered * TREES_M * rng.uniform(1 - UNEVEN, 1 + UNEVEN, noise.shape)
    return Terrain((land.height + trees).astype(np.float32), land.north, land.east, land.step, land.sd)


def _field(shape: tuple[int, int], step: float, rng: np.random.Generator) -> Array:
    """(R, C) a random field whose power falls with the wave number, of no particular scale."""
    # Twice as large as what is used: the field repeats itself.
    rows, columns = (fft.next_fast_len(2 * n, real=True) for n in shape)
    k = (
        2
        * np.pi
        * np.hypot(*np.meshgrid(fft.fftfreq(rows, step), fft.rfftfreq(columns, step), indexing="ij"))
    )
    amplitude = np.hypot(k, 2 * np.pi / LONGEST_M) ** (-ROUGHNESS / 2)
    amplitude[0, 0] = 0.0
    noise = fft.rfft2(rng.standard_normal((rows, columns)))
    return np.asarray(fft.irfft2(noise * amplitude, s=(rows, columns)))[: shape[0], : shape[1]]
