"""A bank of Kalman filters on positions with firm association: the tracking system of H 3.3, 3.4 and 6.4.4.

A track starts on detections in two consecutive images that lie near each other (H 6.2.4, 6.4.4) and in no
gate that has room for them (H 3.3); it never ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many.assignment import Assignment, global_nearest
from wildlab.tracking.many.features import feature_distances, veto, with_features
from wildlab.tracking.many.life import pair_scans
from wildlab.tracking.motion import constant_velocity, in_steps

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: What association goes by: distance alone; with features weighed in; with features as a veto on what was
#: associated by distance.
DISTANCE, FEATURES, VETO = "distance", "features", "veto"

_H = np.eye(2, 4)


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
    veto_probability
        Of a target's own looks, how many a veto lets through.
    """

    measurement: float
    acceleration: float
    velocity_0: float
    gate: float
    max_speed: float
    veto_probability: float = 0.999


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


class Appearance(NamedTuple):
    """What detections look like, (D, f), and what is told of it: spreads and weights, (f,)."""

    features: Array
    sd: Array
    weights: Array


class Bank(NamedTuple):
    """What the tracking system made of it.

    Attributes
    ----------
    track
        (D,) the track of each detection, from 0; -1 where it went to none.
    started
        (T,) the first detection of each track.
    images
        (K,) images with detections.
    x, P
        (K, T, 4) and (K, T, 4, 4) after each of these; NaN before a track starts.
    """

    track: Index
    started: Index
    images: Index
    x: Array
    P: Array


def run_bank(
    looks: Looks, tuning: Tuning, rule: str = DISTANCE, appearance: Appearance | None = None
) -> Bank:
    """Track everything that was detected.

    Parameters
    ----------
    looks
        Without NaN.
    tuning
        Of filters, gates and starts.
    rule
        `DISTANCE`, or one of `FEATURES` and `VETO`, which need an appearance.
    appearance
        Of the detections. A track keeps the mean of the two that it starts with.

    Returns
    -------
    Bank

    Raises
    ------
    WildlabError
        If there is no such rule, it lacks an appearance, images are not in order or positions not finite.
    """
    _check(looks, rule, appearance)
    motion = cache(partial(_motion, sd=tuning.acceleration, interval=looks.interval))
    R = tuning.measurement**2 * np.eye(2)
    track = np.full(len(looks.image), -1)
    x, P = np.empty((0, 4)), np.empty((0, 4, 4))
    started: list[int] = []
    stored = np.empty((0, 0 if appearance is None else appearance.features.shape[1]))
    states: list[tuple[Array, Array]] = []
    waiting, before = np.empty(0, int), 0
    for image, rows in _images(looks.image):
        z = looks.positions[rows]
        free = np.ones(len(rows), bool)
        if len(x):
            x, P = predict(x, P, *motion(image - before))
            gap = z[:, None] - x[:, :2]
            S = np.broadcast_to(P[:, :2, :2] + R, (*gap.shape, 2))
            distances = innovation_squared(gap, S)
            seen = None
            if appearance is not None:
                # What is stored is the mean of two, and as uncertain as half of a detection.
                spread = np.sqrt(1.5) * appearance.sd
                seen = feature_distances(appearance.features[rows], stored, spread, appearance.weights)
            chosen = associate(distances, seen, rule, tuning, stored.shape[1])
            one = np.flatnonzero(chosen.track >= 0)
            to = chosen.track[one]
            if len(one):
                done = update(x[to], P[to], z[one], _H, R)
                x[to], P[to], track[rows[one]] = done.x, done.P, to
            # In the gate of a track that took nothing it is nothing new (H 3.3); only a veto leaves such.
            free = (chosen.track < 0) & ~_has_room(distances, chosen, tuning.gate)
        new = rows[free]
        if len(waiting) and image - before == 1 and len(new):
            pairs = pair_scans(
                looks.positions[waiting],
                looks.positions[new],
                looks.interval,
                R,
                tuning.max_speed,
                tuning.gate,
            )
            for first, at in zip(waiting, pairs.measurement, strict=True):
                if at < 0:
                    continue
                two = np.array([first, new[at]])
                begun = _start(looks.positions[two], tuning, motion(1))
                x, P = np.vstack([x, begun[0][None]]), np.concatenate([P, begun[1][None]])
                if appearance is not None:
                    stored = np.vstack([stored, appearance.features[two].mean(axis=0)])
                track[two] = len(started)
                started.append(int(first))
            new = new[pairs.track < 0]
        waiting, before = new, image
        states.append((x.copy(), P.copy()))
    return Bank(track, np.array(started, int), np.unique(looks.image), *_padded(states))


def associate(distances: Array, features: Array | None, rule: str, tuning: Tuning, count: int) -> Assignment:
    """One image's association by a rule.

    Parameters
    ----------
    distances, features
        (N, M), by (3.9) and from `feature_distances`.
    rule
        One of the three.
    tuning
        With the gate, and what a veto lets through.
    count
        How many features there are.

    Returns
    -------
    Assignment
    """
    if rule == FEATURES and features is not None:
        return global_nearest(with_features(distances, features, tuning.gate), np.inf)
    chosen = global_nearest(distances, tuning.gate)
    if rule == VETO and features is not None:
        return veto(chosen, features, gate_threshold(tuning.veto_probability, count))
    return chosen


def _check(looks: Looks, rule: str, appearance: Appearance | None) -> None:
    if rule not in (DISTANCE, FEATURES, VETO):
        known = ", ".join((DISTANCE, FEATURES, VETO))
        raise WildlabError(f"there is no rule {rule!r}", f"use one of: {known}", field="rule")
    if rule != DISTANCE and appearance is None:
        raise WildlabError(
            f"the rule {rule!r} needs what detections look like", "give an appearance", field="appearance"
        )
    if not np.isfinite(looks.positions).all() or (np.diff(looks.image) < 0).any():
        raise WildlabError(
            "detections are not in the order of their images, or one has no position",
            "sort them by image, and leave out those without a position",
            field="looks",
        )


def _has_room(distances: Array, chosen: Assignment, gate: float) -> NDArray[np.bool_]:
    """Which rows lie in the gate of a track that took nothing."""
    return np.asarray(((distances <= gate) & (chosen.measurement < 0)).any(axis=1))


def _images(image: Index) -> Iterator[tuple[int, Index]]:
    numbers, first = np.unique(image, return_index=True)
    ends = np.append(first, len(image))[1:]
    for number, a, b in zip(numbers, first, ends, strict=True):
        yield int(number), np.arange(a, b)


def _motion(images: int, sd: float, interval: float) -> tuple[Array, Array]:
    """Noise is held over the time between two images, as often as H predicted (6.2)."""
    motion = partial(constant_velocity, sd_acceleration=sd)
    return in_steps(images * interval, motion, 1.001 * interval)


def _start(z: Array, tuning: Tuning, step: tuple[Array, Array]) -> tuple[Array, Array]:
    """On the first of two positions with zero speed (H 6.2.4), updated with the second."""
    x = np.concatenate([z[0], np.zeros(2)])
    P = np.diag([tuning.measurement**2] * 2 + [tuning.velocity_0**2] * 2)
    x, P = predict(x, P, *step)
    done = update(x, P, z[1], _H, tuning.measurement**2 * np.eye(2))
    return done.x, done.P


def _padded(states: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    most = max((len(x) for x, _ in states), default=0)
    xs, Ps = np.full((len(states), most, 4), np.nan), np.full((len(states), most, 4, 4), np.nan)
    for row, (x, P) in enumerate(states):
        xs[row, : len(x)], Ps[row, : len(x)] = x, P
    return xs, Ps
