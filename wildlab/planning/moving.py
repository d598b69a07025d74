"""How surely animals that move are found: walks within a fence, and the images that show where they are.

A wide row distance saves time and lets more of them slip through between two rows (F 5.2): both follow from
one plan.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.areas import check_area, contains, inside_of
from wildlab.planning.sightings import Sightings


def walks(
    fence: ArrayLike,
    times: ArrayLike,
    count: int,
    speed_sd: float,
    step: float,
    rng: np.random.Generator,
) -> Array:
    """Random walks within an area, F (4.5) with the noise of (4.8): a new velocity every step.

    Parameters
    ----------
    fence
        (K, 2) metres. An animal whose step would lead out of it stays where it is.
    times
        (N,) s from 0, ascending.
    count
        Of animals; each starts anywhere in the area with equal chance.
    speed_sd
        Standard deviation of each component of the velocity, m/s.
    step
        How long an animal keeps to a velocity, s.
    rng
        Random numbers.

    Returns
    -------
    (count, N, 2) metres, linear between steps.

    Raises
    ------
    WildlabError
        As `check_area`; where the spread of speeds is below zero or the step not above it.
    """
    if not (speed_sd >= 0 and step > 0):
        raise WildlabError(
            f"speeds of {speed_sd} m/s that last {step} s",
            "give zero or more, and more than zero",
            field="step",
        )
    corners = check_area(fence, "fence")
    t = np.asarray(times, float)
    here = _anywhere(corners, count, rng)
    steps = int(np.ceil(float(t.max(initial=0.0)) / step)) + 1
    way = np.empty((steps + 1, count, 2))
    way[0] = here
    within = inside_of(corners)
    for k in range(steps):
        there = here + step * speed_sd * rng.standard_normal((count, 2))
        here = np.where(within(there)[:, None], there, here)
        way[k + 1] = here
    at = t / step
    before = np.minimum(at.astype(np.intp), steps - 1)
    part = (at - before)[:, None, None]
    return np.asarray(np.swapaxes(way[before] * (1 - part) + way[before + 1] * part, 0, 1))


def first_seen(
    found: Sightings, terrain: Terrain, times: ArrayLike, sharp: NDArray[np.bool_], ways: ArrayLike
) -> Array:
    """When each animal was first in a sharp image that shows the node nearest to it.

    Parameters
    ----------
    found
        Sightings of nodes, from `see`.
    terrain
        Of which they tell; its step is how precisely "in the image" is known.
    times
        (N,) s of the images.
    sharp
        (N,) bool.
    ways
        (A, N, 2) where the animals are at these times, metres, from `walks`.

    Returns
    -------
    (A,) s; NaN of those that were never seen.
    """
    t, where = np.asarray(times, float), np.asarray(ways, float)
    rows, columns = terrain.height.shape
    i = np.rint((where[..., 0] - terrain.north) / terrain.step).astype(np.int64)
    j = np.rint((where[..., 1] - terrain.east) / terrain.step).astype(np.int64)
    on = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
    size = np.int64(rows * columns)
    # Image and node as one number: those that are shown are few beside all there could be.
    shown = np.sort(found.image.astype(np.int64) * size + found.node)
    asked = np.where(on, np.arange(len(t)) * size + i * columns + j, -1)
    place = np.minimum(np.searchsorted(shown, asked), max(len(shown) - 1, 0))
    hit = (shown[place] == asked) & sharp if len(shown) else np.zeros(asked.shape, bool)
    return np.where(hit.any(axis=1), t[hit.argmax(axis=1)], np.nan)


def _anywhere(corners: Array, count: int, rng: np.random.Generator) -> Array:
    low, high = corners.min(axis=0), corners.max(axis=0)
    found = np.zeros((0, 2))
    while len(found) < count:
        tried = rng.uniform(low, high, (2 * count + 10, 2))
        found = np.concatenate([found, tried[contains(corners, tried)]])
    return found[:count]
