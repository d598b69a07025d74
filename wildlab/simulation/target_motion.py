"""What targets do, and what the receivers they carry say about it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.disturbances import band_limited_disturbance
from wildlab.simulation.error_models import rounded, stream
from wildlab.simulation.gnss import PositionErrors, position_fixes
from wildlab.simulation.target_parameters import Target, TargetMotion
from wildlab.simulation.trajectory import Signal


def target_path(target: Target, seed: int) -> Signal:
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


def way_along(motion: TargetMotion, times: ArrayLike) -> Array:
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


def target_outline(target: Target, seed: int) -> Signal:
    """Corners of a target's outline in n: times (N,) s -> (N, 4, 3) m, the bow along its mean course.

    Raises
    ------
    ValueError
        Where it has none.
    """
    outline, motion = target.outline, target.motion
    if outline is None or motion is None:
        raise ValueError("this target has no outline")
    cos, sin = np.cos(motion.course.si), np.sin(motion.course.si)
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [outline.length.si / 2, outline.beam.si / 2]
    corners = np.zeros((4, 3))
    corners[:, :2] = half @ np.array([[cos, sin], [-sin, cos]])
    path = target_path(target, seed)
    return lambda times: np.asarray(path(times)[:, None] + corners)


def truth_table(target: Target, duration: float, seed: int) -> pd.DataFrame:
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
        errors = PositionErrors(
            (gps.horizontal_correlated_sd.si, gps.vertical_correlated_sd.si),
            gps.correlation_time.si,
            (gps.horizontal_noise.si, gps.vertical_noise.si),
        )
        position = position_fixes(antenna, 1 / gps.rate.si, errors, stream(seed, f"gps of {name}"))
        position = rounded(position, gps.resolution.si)
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
