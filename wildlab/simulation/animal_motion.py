"""Animals in enclosures: where the fences are, how animals move within them, and what is known about that."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from wildlab.geometry.frames import Array
from wildlab.simulation.error_models import stream
from wildlab.simulation.land import ground_heights
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.target_parameters import Animals, Enclosure
from wildlab.simulation.trajectory import Signal


def enclosure_axes(enclosure: Enclosure) -> tuple[Array, Array, Array]:
    """Middle (2,) m, and unit vectors along the length and the width, (2,) each; north and east."""
    cos, sin = np.cos(enclosure.course.si), np.sin(enclosure.course.si)
    middle = np.array([enclosure.north.si, enclosure.east.si])
    return middle, np.array([cos, sin]), np.array([-sin, cos])


def enclosure_corners(enclosure: Enclosure) -> Array:
    """North and east of the corners of the fence, in order, (4, 2) m."""
    middle, along, across = enclosure_axes(enclosure)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [enclosure.length.si / 2, enclosure.width.si / 2]
    return np.asarray(middle + half @ np.stack([along, across]))


def reflected(walk: Array, limit: float) -> Array:
    """A coordinate that is reflected whenever it reaches -limit or limit, from one that is not."""
    lap = np.mod(walk + limit, 4 * limit)
    return np.asarray(np.where(lap < 2 * limit, lap, 4 * limit - lap) - limit)


def animal_path(
    enclosure: Enclosure,
    animals: Animals,
    duration: float,
    rng: np.random.Generator,
    ground: Callable[[Array], Array] | None = None,
) -> Signal:
    """One animal's walk: times (N,) s from 0 to the duration -> (N, 3) m, the middle of its body.

    A new velocity every step, as (4.5) has it with the noise of (4.8); a fence reflects it. It starts
    anywhere in its enclosure (F 7.5.1). ``ground`` gives the heights of the ground at (N, 2) places.
    """
    middle, along, across = enclosure_axes(enclosure)
    half = np.array([enclosure.length.si, enclosure.width.si]) / 2
    count = int(np.ceil(duration / animals.step.si)) + 2
    steps = animals.step.si * animals.speed_sd.si * rng.standard_normal((count, 2))
    walk = rng.uniform(-half, half) + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    at = animals.step.si * np.arange(count + 1)

    def path(times: Array) -> Array:
        t = np.asarray(times, float)
        x, y = (reflected(np.interp(t, at, walk[:, i]), half[i]) for i in range(2))
        p = np.empty((len(t), 3))
        p[:, :2] = middle + np.outer(x, along) + np.outer(y, across)
        p[:, 2] = -animals.height.si - (0.0 if ground is None else ground(p[:, :2]))
        return p

    return path


def animal_paths(twin: TwinParameters, seed: int) -> dict[str, Signal]:
    """Every animal by its name: the enclosure's, and a number from 1."""
    if twin.animals is None:
        return {}
    named = {}
    for name, enclosure in twin.enclosures.items():
        for number in range(1, int(enclosure.animals.number) + 1):
            animal = f"{name}-{number}"
            rng = stream(seed, f"motion of {animal}")
            ground = partial(ground_heights, twin)
            named[animal] = animal_path(enclosure, twin.animals, twin.flight.duration.si, rng, ground)
    return named


def animals_truth(twin: TwinParameters, animals: Animals, seed: int) -> pd.DataFrame:
    """Where each animal was at the rate of ``animals.rate``."""
    times = np.arange(int(twin.flight.duration.si * animals.rate.si + 1e-9) + 1) / animals.rate.si
    tables = []
    for name, path in animal_paths(twin, seed).items():
        position = path(times)
        columns = {"target_id": [name] * len(times), "time_s": times}
        columns |= {f"{axis}_m": position[:, i] for i, axis in enumerate(("north", "east", "down"))}
        columns |= {f"sd_{axis}_m": np.full(len(times), animals.sd.si) for axis in ("horizontal", "vertical")}
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)
