"""A bank of Kalman filters on positions with firm association: the tracking system of H 3.3, 3.4 and 6.4.4.

A track starts on detections in two consecutive images that lie near each other (H 6.2.4, 6.4.4) and in no
gate that has room for them (H 3.3). None ends.
"""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import (
    Appearance,
    Assignment,
    feature_distances,
    global_nearest,
    innovation_squared,
)
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.motion import constant_velocity, in_steps

Index = NDArray[np.int64]
_H = np.eye(2, 4)


class Known(NamedTuple):
    """What is known of T tracks, by their numbers.

    Attributes
    ----------
    x, P
        (T, 4) and (T, 4, 4) state.
    stored
        (T, f) means of the features of the two first detections.
    """

    x: Array
    P: Array
    stored: Array


def nobody(f: int) -> Known:
    """No track, with so many features."""
    return Known(np.empty((0, 4)), np.empty((0, 4, 4)), np.empty((0, f)))


def pair_scans(
    waiting: ArrayLike, arrived: ArrayLike, dt: float, R: ArrayLike, max_speed: float, gate: float
) -> Assignment:
    """Which detection of a scan continues which one of the scan before: steps 1 and 2 of H 3.4.1.

    The validation region is that of the noise of both, about all places that the target may have come to:
    what lies in between counts only where it is more than the target can have moved. Where several lie in
    one region, those are paired whose distances, all counted, have the least sum.

    Parameters
    ----------
    waiting, arrived
        (M, 2) and (N, 2) positions of the scan before and of this one, m.
    dt
        Time between the two, s, not negative.
    R
        (2, 2) covariance of the noise of a position, m^2.
    max_speed
        Largest speed of a target, m/s.
    gate
        On the square of the distance in units of its spread, as of (3.9).

    Returns
    -------
    Assignment
        The waiting detections stand for its tracks.

    Raises
    ------
    WildlabError
        If time or speed are negative or not finite.

    Examples
    --------
    >>> pair_scans([[0.0, 0.0]], [[90.0, 0.0], [4.0, 3.0]], 1.0, np.eye(2), max_speed=5.0, gate=9.21)
    Assignment(track=array([-1,  0]), measurement=array([1]))
    """
    for field, value in (("dt", dt), ("max_speed", max_speed)):
        if not 0 <= value < np.inf:
            raise WildlabError(f"{field} is {value:g}", "give a number that is not negative", field=field)
    old, new = (np.asarray(points, float).reshape(-1, 2) for points in (waiting, arrived))
    gap = new[:, None] - old
    distance = innovation_squared(gap, 2 * np.asarray(R, float)) if gap.size else np.zeros(gap.shape[:2])
    length = np.linalg.norm(gap, axis=-1)
    beyond = np.maximum(length - max_speed * dt, 0.0) / np.where(length > 0, length, 1.0)
    return global_nearest(np.where(beyond**2 * distance <= gate, distance, np.inf), np.inf)


class Tuning(NamedTuple):
    """What the tracking system is told; standard deviations are per axis.

    Attributes
    ----------
    measurement
        m: of a measurement, and of the first position.
    acceleration
        m/s^2, of the process noise of constant velocity, H (6.2), held from image to image.
    velocity_0
        m/s, of the first velocity.
    gate
        On the normalised innovation squared, H (3.9).
    max_speed
        m/s: of a target from the first detection of a track to its second.
    """

    measurement: float
    acceleration: float
    velocity_0: float
    gate: float
    max_speed: float


class Looks(NamedTuple):
    """Images with detections, in order of time; D detections in all, image after image.

    Attributes
    ----------
    image
        (D,) number of the image of each, of the camera's.
    positions
        (D, 2) on the sea, m.
    interval
        Between two images, s.
    """

    image: Index
    positions: Array
    interval: float


class Bank(NamedTuple):
    """What the tracking system made of it.

    Attributes
    ----------
    track
        (D,) the track that each detection went to, -1 where it went to none.
    started
        (T,) the detection that each track started with.
    images
        (K,) numbers of the images with detections.
    x, P
        (K, T, 4) and (K, T, 4, 4) states after each image; NaN before a track has started.
    """

    track: Index
    started: Index
    images: Index
    x: Array
    P: Array


def run_bank(looks: Looks, tuning: Tuning, appearance: Appearance | None = None) -> Bank:
    """Track everything that was detected.

    Parameters
    ----------
    looks
        What was detected.
    tuning
        Of the system.
    appearance
        What the detections look like, to be weighed in; by distance alone where it is left out.

    Returns
    -------
    Bank
        Tracks and their states.

    Raises
    ------
    WildlabError
        If detections do not fit together.
    """
    if not np.isfinite(looks.positions).all() or (np.diff(looks.image) < 0).any():
        raise WildlabError(
            "detections are not in the order of their images, or one has no position",
            "sort them by image, and leave out those without a position",
            field="looks",
        )

    @cache
    def motion(images: int) -> tuple[Array, Array]:
        """Noise is held over the time between two images, as often as H predicted (6.2)."""
        held = partial(constant_velocity, sd_acceleration=tuning.acceleration)
        return in_steps(images * looks.interval, held, 1.001 * looks.interval)

    R = tuning.measurement**2 * np.eye(2)
    track = np.full(len(looks.image), -1)
    features = np.empty((len(track), 0)) if appearance is None else appearance.features
    tracks = nobody(features.shape[1])
    images, firsts = np.unique(looks.image, return_index=True)
    started, states = list[int](), list[Known]()
    waiting, before = np.empty(0, int), 0
    for image, rows in zip(images.tolist(), np.split(np.arange(len(track)), firsts[1:]), strict=True):
        z = looks.positions[rows]
        free = np.ones(len(rows), bool)
        if started:
            x, P = predict(tracks.x, tracks.P, *motion(image - before))
            gap = z[:, None] - x[:, :2]
            distances = innovation_squared(gap, np.broadcast_to(P[:, :2, :2] + R, (*gap.shape, 2)))
            if appearance is None:
                chosen = global_nearest(distances, tuning.gate)
            else:
                # What is stored is the mean of two, and as uncertain as half of a detection.
                sd = np.sqrt(1.5) * appearance.sd
                seen = feature_distances(features[rows], tracks.stored, sd, appearance.weights)
                # The gate is one of the distance alone (H 6.4.4).
                chosen = global_nearest(np.where(distances <= tuning.gate, distances + seen, np.inf), np.inf)
            one = np.flatnonzero(chosen.track >= 0)
            to = chosen.track[one]
            done = update(x[to], P[to], z[one], _H, R)
            x[to], P[to], track[rows[one]] = done.x, done.P, to
            tracks = Known(x, P, tracks.stored)
            free = chosen.track < 0
        new = rows[free]
        if len(waiting) and image - before == 1 and len(new):
            pairs = pair_scans(
                looks.positions[waiting], looks.positions[new], looks.interval, R, tuning.max_speed,
                tuning.gate,
            )  # fmt: skip
            for first, at in zip(waiting, pairs.measurement, strict=True):
                if at < 0:
                    continue
                two = np.array([first, new[at]])
                track[two] = len(started)
                started.append(int(first))
                fresh = _start(looks.positions[two], features[two], tuning, motion(1))
                tracks = Known._make(map(np.append, tracks, fresh, [0] * len(fresh)))
            new = new[pairs.track < 0]
        waiting, before = new, image
        states.append(tracks)
    xs = np.full((len(states), len(started), 4), np.nan)
    Ps = np.full((*xs.shape, 4), np.nan)
    for k, then in enumerate(states):
        xs[k, : len(then.x)], Ps[k, : len(then.x)] = then.x, then.P
    return Bank(track, np.array(started, int), images, xs, Ps)


def _start(z: Array, features: Array, tuning: Tuning, step: tuple[Array, Array]) -> Known:
    """On the first of two positions with zero speed (H 6.2.4), updated with the second."""
    x = np.concatenate([z[0], np.zeros(2)])
    P = np.diag([tuning.measurement**2] * 2 + [tuning.velocity_0**2] * 2)
    x, P = predict(x, P, *step)
    done = update(x, P, z[1], _H, tuning.measurement**2 * np.eye(2))
    parts = done.x, done.P, features.mean(axis=0)
    return Known._make(part[None] for part in parts)
