"""A bank of Kalman filters on positions with firm association: the tracking system of H 3.3, 3.4 and 6.4.4.

A track starts on detections in two consecutive images that lie near each other (H 6.2.4, 6.4.4) and in no
gate that has room for them (H 3.3). It ends if the tuning says when (H 3.4.2); one that had ended is found
again by where its target can have come to and by what it looks like.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many.bank_life import (
    Alive,
    Life,
    Motion,
    begun,
    come_to,
    looked,
    nobody,
    over,
    verdicts,
    who,
)
from wildlab.tracking.many.bank_rules import (
    DISTANCE,
    RULES,
    STATE,
    Appearance,
    alike_limit,
    associate,
    compare_looks,
    has_room,
    limits_of,
)
from wildlab.tracking.many.life import CONFIRMED, DROPPED, pair_scans
from wildlab.tracking.many.target_model import Sees
from wildlab.tracking.motion import constant_velocity, in_steps

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_H = np.eye(2, 4)
#: New tracks, kept ones and identities to the kept ones that remain.
_Recall = Callable[[Alive, Alive, list[int]], Alive]


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
        Of a target's own looks, how many a veto lets through; with which a track that had ended is looked
        for, too.
    life
        When tracks are believed and end; by default at once and never.
    """

    measurement: float
    acceleration: float
    velocity_0: float
    gate: float
    max_speed: float
    veto_probability: float = 0.999
    life: Life = Life()


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
    sees
        By the number of an image, with detections or without: which of (N, 2) places it shows. An image that
        is not there shows every place; those between two with detections count.
    """

    image: Index
    positions: Array
    interval: float
    sees: Mapping[int, Sees] | None = None


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
        (K, T, 4) and (K, T, 4, 4) after each of these; NaN before a track starts and once it has ended.
    identity
        (T,) the first track of the same target, as far as it was found again by the end of the flight; of one
        that is new, itself.
    ended
        (T,) the image with detections by which each had ended; -1 where it lives on.
    believed
        (T,) whether it was ever confirmed.
    """

    track: Index
    started: Index
    images: Index
    x: Array
    P: Array
    identity: Index
    ended: Index
    believed: NDArray[np.bool_]


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
        One of `RULES`; all but `DISTANCE` need an appearance.
    appearance
        Of the detections. A track keeps the mean of the two that it starts with, and by `STATE` that of all
        that went to it.

    Returns
    -------
    Bank

    Raises
    ------
    WildlabError
        If there is no such rule, it lacks an appearance, images are not in order or positions not finite.
    """
    _check(looks, rule, appearance)
    motion: Motion = cache(partial(_motion, sd=tuning.acceleration, interval=looks.interval))
    R = tuning.measurement**2 * np.eye(2)
    track = np.full(len(looks.image), -1)
    features = np.empty((len(track), 0)) if appearance is None else appearance.features
    alive = kept = nobody(features.shape[1])
    book = _Book([], [], [], [])
    by = appearance if rule != DISTANCE else None
    limits = limits_of(rule, tuning.gate, tuning.veto_probability, appearance)
    recall: _Recall = partial(_recall, tuning=tuning, appearance=by, interval=looks.interval, motion=motion)
    # A place tells no more by then; what a track looks like is better known at its end.
    once_more = None if by is None else recall
    states: list[tuple[Index, Array, Array]] = []
    waiting, before, views = np.empty(0, int), 0, looks.sees or {}
    for image, rows in _images(looks.image):
        z = looks.positions[rows]
        free = np.ones(len(rows), bool)
        if len(alive.number):
            alive = come_to(alive, before, image, views, motion)
            if tuning.life.ends:
                gone = over(alive, image, looks.interval, tuning.life)
                alive, kept = _part(alive, kept, gone, image, book, once_more)
        if len(alive.number):
            gap = z[:, None] - alive.x[:, :2]
            S = np.broadcast_to(alive.P[:, :2, :2] + R, (*gap.shape, 2))
            distances = innovation_squared(gap, S)
            seen = (
                None
                if appearance is None
                else compare_looks(features[rows], alive, appearance, rule, tuning.gate)
            )
            if rule == STATE and seen is not None:
                distances = distances + seen
            chosen = associate(distances, seen, rule, limits)
            one = np.flatnonzero(chosen.track >= 0)
            to = chosen.track[one]
            if len(one):
                done = update(alive.x[to], alive.P[to], z[one], _H, R)
                alive.x[to], alive.P[to], track[rows[one]] = done.x, done.P, alive.number[to]
            # In the gate of a track that took nothing it is nothing new (H 3.3); only a veto leaves such.
            free = (chosen.track < 0) & ~has_room(distances, chosen, limits.gate)
            if tuning.life.ends or rule == STATE:
                near = np.asarray((distances <= limits.gate).any(axis=0))
                alive = looked(alive, to, near, image, views, features[rows[one]])
            if tuning.life.confirm:
                said = verdicts(alive, tuning.life)
                alive = alive._replace(believed=said == CONFIRMED)
                alive, kept = _part(alive, kept, said == DROPPED, image, book, once_more)
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
                x, P = _start(looks.positions[two], tuning, motion(1))
                track[two] = number = book.begin(int(first))
                alive = alive.and_also(begun(number, x, P, image, features[two], tuning.life))
            new = new[pairs.track < 0]
        fresh = alive.only(book.unknown(alive) & alive.believed)
        for number in fresh.number:
            book.believed[number] = True
        kept = recall(fresh, kept, book.identity)
        waiting, before = new, image
        states.append((alive.number, alive.x.copy(), alive.P.copy()))
    if once_more:
        once_more(alive.only(alive.believed), kept, book.identity)
    x, P = _padded(states, len(book.started))
    numbers = (np.array(one, int) for one in (book.started, book.identity, book.ended))
    first, identity, ended = numbers
    return Bank(track, first, np.unique(looks.image), x, P, identity, ended, np.array(book.believed, bool))


class _Book(NamedTuple):
    """Of each track the first detection, its identity, the image by which it had ended, whether believed."""

    started: list[int]
    identity: list[int]
    ended: list[int]
    believed: list[bool]

    def begin(self, first: int) -> int:
        """The number of a new track."""
        number = len(self.started)
        self.started.append(first)
        self.identity.append(number)
        self.ended.append(-1)
        self.believed.append(False)
        return number

    def unknown(self, alive: Alive) -> NDArray[np.bool_]:
        """(A,) which of them were not believed until now."""
        return np.array([not self.believed[number] for number in alive.number], bool)


def _part(
    alive: Alive, kept: Alive, gone: NDArray[np.bool_], image: int, book: _Book, recall: _Recall | None
) -> tuple[Alive, Alive]:
    """Those that live on, and those that are kept: of what has ended what was believed.

    Whose identity is not known by then is looked for once more, by all its detections, with ``recall``.
    """
    if not gone.any():
        return alive, kept
    for number in alive.number[gone]:
        book.ended[number] = image
    past = alive.only(gone & alive.believed)
    # One that ends by the same image may have been over before another one of them began.
    kept = kept.and_also(past)
    return alive.only(~gone), recall(past, kept, book.identity) if recall else kept


def _recall(
    new: Alive,
    kept: Alive,
    identity: list[int],
    *,
    tuning: Tuning,
    appearance: Appearance | None,
    interval: float,
    motion: Motion,
) -> Alive:
    """Give tracks that count as new the identities of those kept that they are; the kept ones that remain."""
    rows = [row for row, number in enumerate(new.number) if identity[number] == number]
    if not rows or not len(kept.number):
        return kept
    looks, alike = None, np.inf
    if appearance is not None:
        looks = appearance.sd, appearance.used
        alike = alike_limit(tuning.veto_probability, appearance)
    limits = tuning.max_speed, tuning.gate, alike
    taken = who(new.only(np.array(rows)), kept, interval, motion, limits, looks, tuning.life.likelier)
    for row, old in zip(rows, taken, strict=True):
        if old >= 0:
            identity[new.number[row]] = identity[kept.number[old]]
    return kept.only(np.setdiff1d(np.arange(len(kept.number)), taken))


def _check(looks: Looks, rule: str, appearance: Appearance | None) -> None:
    if rule not in RULES:
        raise WildlabError(f"there is no rule {rule!r}", f"use one of: {', '.join(RULES)}", field="rule")
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


def _padded(states: list[tuple[Index, Array, Array]], count: int) -> tuple[Array, Array]:
    xs, Ps = np.full((len(states), count, 4), np.nan), np.full((len(states), count, 4, 4), np.nan)
    for row, (number, x, P) in enumerate(states):
        xs[row, number], Ps[row, number] = x, P
    return xs, Ps
