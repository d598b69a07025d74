"""What a wrong height of the ground costs: a wrong level, a plane over hills, a coarse map, by pitch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import ndimage

from wildlab.evaluation.runs import mean_interval
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain, intersect_terrain
from wildlab.simulation.landscape import synthetic_landscape

#: Degrees below the horizon that a ray looks.
PITCHES_DEG = (15.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0)
#: Metres above the ground below; metres between the nodes of a coarse map, as of free ones of all the Earth.
ABOVE_M, COARSE_M = 60.0, 30.0
#: Landscapes, and rays on each.
LANDS, RAYS = 12, 300
#: Rays start this far from the border of the map, metres, so that few leave it.
MARGIN_M = 120.0
#: What may be wrong: the ground is a metre too high, it is taken for a plane at the height below the camera,
#: or its map is coarse.
WRONG = ("level", "plane", "coarse")


class Shift(NamedTuple):
    """How far points move, for one pitch.

    Attributes
    ----------
    pitch
        Degrees below the horizon.
    off
        By `WRONG`: (LANDS,) median distance on each landscape, metres; NaN where no ray met both.
    lost
        By `WRONG`: share of the rays that meet the true ground and not the wrong one.
    used
        How many rays met the true ground, of ``drawn``.
    drawn
        All rays.
    """

    pitch: float
    off: dict[str, Array]
    lost: dict[str, float]
    used: int
    drawn: int


def shifts(seed: int = 0, lands: int = LANDS, rays: int = RAYS) -> list[Shift]:
    """Points on rolling land beside those that a wrong height of the ground gives.

    Parameters
    ----------
    seed
        Of landscapes and rays.
    lands, rays
        How many, and how many on each.

    Returns
    -------
    list of Shift
        One for each of `PITCHES_DEG`.
    """
    worlds = [synthetic_landscape(seed + number) for number in range(lands)]
    coarse = [coarser(one, COARSE_M) for one in worlds]
    found = []
    for pitch in PITCHES_DEG:
        off: dict[str, list[float]] = {name: [] for name in WRONG}
        lost = dict.fromkeys(WRONG, 0)
        used = 0
        for number, (land, rough) in enumerate(zip(worlds, coarse, strict=True)):
            # The same rays for every pitch: pitches are compared, not draws.
            starts, directions = _rays(land, np.radians(pitch), rays, np.random.default_rng([seed, number]))
            below = land.heights_at(starts[:, :2])
            true = intersect_terrain(land, directions, starts).points
            met = np.isfinite(true[:, 0])
            used += int(met.sum())
            raised = Terrain(land.height + np.float32(1.0), land.north, land.east, land.step)
            wrong = {
                "level": intersect_terrain(raised, directions, starts).points,
                "plane": starts + ((-below - starts[:, 2]) / directions[:, 2])[:, None] * directions,
                "coarse": intersect_terrain(rough, directions, starts).points,
            }
            for name, points in wrong.items():
                distance = np.hypot(*(points - true)[met, :2].T)
                lost[name] += int((~np.isfinite(distance)).sum())
                known = distance[np.isfinite(distance)]
                off[name].append(float(np.median(known)) if len(known) else np.nan)
        found.append(
            Shift(
                pitch,
                {name: np.array(values) for name, values in off.items()},
                {name: count / max(used, 1) for name, count in lost.items()},
                used,
                lands * rays,
            )
        )
    return found


def coarser(terrain: Terrain, step: float) -> Terrain:
    """The same land from a map with fewer nodes: each the mean of what lies about it.

    Parameters
    ----------
    terrain
        The land.
    step
        Between nodes, metres: a whole number of the land's own steps.

    Returns
    -------
    Terrain
    """
    by = round(step / terrain.step)
    mean = ndimage.uniform_filter(terrain.height.astype(float), by, mode="nearest")
    return Terrain(mean[::by, ::by].astype(np.float32), terrain.north, terrain.east, by * terrain.step)


def _rays(land: Terrain, pitch: float, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """(N, 3) starts above the ground, and (N, 3) directions at a pitch (rad) towards any side."""
    least_north, most_north, least_east, most_east = land.extent
    low, high = (np.array(one) for one in ((least_north, least_east), (most_north, most_east)))
    place = rng.uniform(low + MARGIN_M, high - MARGIN_M, (count, 2))
    course = rng.uniform(-np.pi, np.pi, count)
    starts = np.column_stack([place, -land.heights_at(place) - ABOVE_M])
    flat = np.cos(pitch)
    directions = np.column_stack(
        [flat * np.cos(course), flat * np.sin(course), np.full(count, np.sin(pitch))]
    )
    return starts, directions


def shifts_table(found: list[Shift]) -> pd.DataFrame:
    """Medians with the interval of their mean over landscapes, and what was lost, by pitch."""
    rows = []
    for one in found:
        row: dict[str, object] = {"pitch": one.pitch}
        for name in WRONG:
            estimate, low, high = mean_interval(one.off[name])
            row[name] = f"{estimate:.2f} ({max(low, 0):.2f} to {high:.2f})"
            row[f"{name}_lost"] = 100 * one.lost[name]
        row["rays"] = one.used
        rows.append(row)
    return pd.DataFrame(rows)
