"""Tracks of animals that wander, from what was detected of each: a Kalman filter of a random walk (F 4.4).

F follows each animal with a particle filter; here a Gaussian stands for the particles. A track is not ended:
its covariance grows for as long as nothing is seen of its animal.
"""

from __future__ import annotations

import numpy as np

from wildlab.evaluation.consistency import position_nees
from wildlab.flight.clocks import truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.replay.scene import Estimates, Points
from wildlab.tracking.records import Start
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import positions

#: Variance that a place gains in a second, m^2, along each axis: a metre in a second, chosen.
WALK = 1.0
#: Seconds between estimates where nothing is detected.
EVERY_S = 2.0
FILTER = "kf"


def random_walk(dt: float) -> tuple[Array, Array]:
    """Transition and noise of a place that wanders, F (4.5)."""
    return np.eye(2), WALK * dt * np.eye(2)


def track_targets(flight: Flight, points: Points, begin: float, end: float) -> tuple[Estimates, ...]:
    """A track for each target that detections name, from its first detection to the end.

    Parameters
    ----------
    flight
        Its truth is what errors are counted from.
    points
        Detections on the ground, with covariances; seconds from `begin`.
    begin
        Flight time of the scene's zero, s.
    end
        Last time of the scene, s.

    Returns
    -------
    tuple of Estimates
    """
    found = []
    truth = {} if flight.truth is None else dict(tuple(flight.truth.groupby("target_id", sort=False)))
    usable = np.isfinite(points.covariance).all(axis=(1, 2))
    for name in dict.fromkeys(points.names[usable]):
        if not name:
            continue
        rows = np.flatnonzero(usable & (points.names == name))
        first = points.times[rows[0]]
        ticks = np.arange(first + EVERY_S, end, EVERY_S)
        times = np.concatenate([points.times[rows], ticks])
        z = np.concatenate([points.places[rows, :2], np.full((len(ticks), 2), np.nan)])
        R = np.concatenate([points.covariance[rows], np.tile(np.eye(2), (len(ticks), 1, 1))])
        order = np.argsort(times, kind="stable")
        times, z, R = times[order], z[order], R[order]
        start = Start(float(times[0]), z[0].copy(), R[0].copy())
        z[0] = np.nan  # it is where the track starts, and counts once
        track = run_filter(times, z, R, positions(), random_walk, start)
        down = np.interp(times, points.times[rows], points.places[rows, 2])
        error = np.full((len(times), 2), np.nan)
        if name in truth:
            offset = flight.manifest.clocks.truth_offset_s
            where = truth_at(truth[name], times + begin, offset_s=offset)[1][0, :, :2]
            error = where - track.x[:, :2]
        found.append(
            Estimates(
                str(name),
                FILTER,
                "camera",
                times,
                np.column_stack([track.x[:, :2], down]),
                track.P[:, :2, :2],
                np.hypot(*error.T),
                position_nees(error, track.P[:, :2, :2]),
            )
        )
    return tuple(found)
