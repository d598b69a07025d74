"""What targets do, and what the receivers they carry say about it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import ground_heights
from wildlab.simulation.onboard_sensors import position_fixes
from wildlab.simulation.parameters import Group, TwinParameters
from wildlab.simulation.trajectory import Signal, band_limited_disturbance


def enclosure_axes(enclosure: Group) -> tuple[Array, Array, Array]:
    """Middle (2,) m, and unit vectors along the length and the width, (2,) each; north and east."""
    cos, sin = np.cos(enclosure.course.si), np.sin(enclosure.course.si)
    middle = np.array([enclosure.north.si, enclosure.east.si])
    return middle, np.array([cos, sin]), np.array([-sin, cos])


def enclosure_corners(enclosure: Group) -> Array:
    """North and east of the corners of the fence, in order, (4, 2) m."""
    middle, along, across = enclosure_axes(enclosure)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [enclosure.length.si / 2, enclosure.width.si / 2]
    return np.asarray(middle + half @ np.stack([along, across]))


def reflected(walk: Array, limit: float) -> Array:
    """A coordinate that is reflected whenever it reaches -limit or limit, from one that is not."""
    lap = np.mod(walk + limit, 4 * limit)
    return np.asarray(np.where(lap < 2 * limit, lap, 4 * limit - lap) - limit)


def animal_path(
    enclosure: Group,
    animals: Group,
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


def animals_truth(twin: TwinParameters, animals: Group, seed: int) -> pd.DataFrame:
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


def target_path(target: Group, seed: int) -> Signal:
    """Where a target is. Without a motion it stays at its height above the origin of n.

    Parameters
    ----------
    target
        Its parameters, from a twin's.
    seed
        Of the flight, a whole number from 0: how the target deviates from its course follows from it.

    Returns
    -------
    Times (N,) s -> position in n, (N, 3) m.

    Raises
    ------
    ValueError
        Where the target moves and the seed is negative.
    """
    motion, down = target.motion, -target.height.si
    if motion is None:
        return lambda times: np.broadcast_to([0.0, 0.0, down], (len(np.asarray(times)), 3))
    rng = stream(seed, f"motion of {target.identifier.text}")
    band = (motion.deviation_shortest_period.si, motion.deviation_longest_period.si)
    north, east = (band_limited_disturbance(motion.deviation_sd.si, *band, rng) for _ in range(2))
    start, course = (motion.north.si, motion.east.si), motion.course.si
    ahead = np.array([np.cos(course), np.sin(course)])

    def path(times: Array) -> Array:
        t = np.asarray(times, float)
        p = np.empty((len(t), 3))
        along = way_along(motion, t)
        p[:, 0] = start[0] + ahead[0] * along + north(t)
        p[:, 1] = start[1] + ahead[1] * along + east(t)
        p[:, 2] = down
        return p

    return path


def way_along(motion: Group, times: ArrayLike) -> Array:
    """How far a target has come along its course, without its deviations.

    Where it is faster in the beginning it starts from behind, so that later it is where a target with the
    steady speed alone would be.

    Parameters
    ----------
    motion
        Its parameters.
    times
        (N,) s, from 0.

    Returns
    -------
    (N,) m from the place that the parameters give for time 0; below zero behind it.
    """
    t = np.asarray(times, float)
    steady = motion.speed.si * t
    if motion.early_speed is None or motion.slowing_time is None:
        return np.asarray(steady)
    slowing = motion.slowing_time.si
    return np.asarray(steady - (motion.early_speed.si - motion.speed.si) * slowing * np.exp(-t / slowing))


def target_outline(target: Group, seed: int) -> Signal:
    """Corners of a target's outline in n: times (N,) s -> (N, 4, 3) m, the bow along its mean course."""
    outline, motion = target.outline, target.motion
    cos, sin = np.cos(motion.course.si), np.sin(motion.course.si)
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [outline.length.si / 2, outline.beam.si / 2]
    corners = np.zeros((4, 3))
    corners[:, :2] = half @ np.array([[cos, sin], [-sin, cos]])
    path = target_path(target, seed)
    return lambda times: np.asarray(path(times)[:, None] + corners)


def truth_table(target: Group, duration: float, seed: int) -> pd.DataFrame:
    """What counts as the truth about a target: a surveyed point, or the log of its receiver.

    The antenna may be ahead of the middle that a camera sees, along the target's mean course.
    """
    name, path = target.identifier.text, target_path(target, seed)
    gps, motion = target.gps, target.motion
    if gps is None or motion is None:
        times, position = np.array([np.nan]), path(np.zeros(1))
    else:
        times = np.arange(int(duration * gps.rate.si + 1e-9) + 1) / gps.rate.si
        course = motion.course.si
        antenna = path(times) + gps.ahead.si * np.array([np.cos(course), np.sin(course), 0.0])
        position = position_fixes(antenna, gps, stream(seed, f"gps of {name}"))
    return pd.DataFrame(
        {
            "target_id": [name] * len(times),
            "time_s": times,
            "north_m": position[:, 0],
            "east_m": position[:, 1],
            "down_m": position[:, 2],
            "sd_horizontal_m": np.full(len(times), target.sd.si),
            "sd_vertical_m": np.full(len(times), target.sd.si),
        }
    )
