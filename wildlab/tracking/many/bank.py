"""A bank of Kalman filters on positions with firm association: the tracking system of H 3.3, 3.4 and 6.4.4.

A track starts on detections in two consecutive images that lie near each other (H 6.2.4, 6.4.4) and in no
gate that has room for them (H 3.3). It ends if the tuning says when (H 3.4.2); one that had ended is found
again by where its target can have come to and by what it looks like.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import (
    DISTANCE,
    FEATURES,
    RULES,
    STATE,
    Appearance,
    Limits,
    alike_limit,
    associate,
    estimated_distances,
    feature_distances,
    gate_with_more,
    has_room,
    innovation_squared,
    limits_of,
)
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many import bank_kernel
from wildlab.tracking.many.life import (
    CONFIRMED,
    DROPPED,
    judge_start,
    look_differences,
    outlived,
    pair_scans,
    place_costs,
    reachable,
    recognise,
)
from wildlab.tracking.many.target_model import Sees
from wildlab.tracking.motion import constant_velocity, in_steps

Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
#: Images to the transition and the noise over so many.
Motion = Callable[[int], tuple[Array, Array]]


class Life(NamedTuple):
    """When tracks are believed, end, and are found again; by default all are believed and none ends.

    Attributes
    ----------
    max_absence
        s: so long may a target not be detected while its place is looked at.
    max_age
        s: so long may it not be detected at all.
    max_sd
        m: the largest standard deviation of a position, in any direction.
    confirm
        m and n of H 3.4.1: a new track is preliminary until m of the next n images in which its place is
        looked at have a detection in its gate; empty: believed at once.
    likelier
        A new track is taken for one that had ended where that is so many times as likely as every other
        one; 19 is 95 % of two.
    """

    max_absence: float = np.inf
    max_age: float = np.inf
    max_sd: float = np.inf
    confirm: tuple[int, int] | tuple[()] = ()
    likelier: float = 19.0

    @property
    def ends(self) -> bool:
        """Whether tracks can end at all."""
        return bool(np.isfinite([self.max_absence, self.max_age, self.max_sd]).any()) or bool(self.confirm)


class Alive(NamedTuple):
    """The A tracks that live, or those that are kept.

    Attributes
    ----------
    number
        (A,) of all tracks.
    x, P
        (A, 4) and (A, 4, 4) at the present image; ``x_then``, ``P_then`` at the last with a detection, and
        ``x_first``, ``P_first`` where it began.
    stored
        (A, f) the looks that association goes by.
    first, last
        (A,) the image with its second detection, at which it began, and the last with one.
    absent
        (A,) images since, in which it could have been seen.
    total, known
        (A, f) sums of the features of all its detections, and of how many each was known.
    hits, scans
        (A,) of a preliminary track, as `judge_start` has them.
    believed
        (A,) whether it is confirmed.
    """

    number: Index
    x: Array
    P: Array
    x_then: Array
    P_then: Array
    x_first: Array
    P_first: Array
    stored: Array
    first: Index
    last: Index
    absent: Index
    total: Array
    known: Array
    hits: Index
    scans: Index
    believed: Flags

    def only(self, rows: Index | Flags) -> Alive:
        """Some of them."""
        parts: list[Any] = [one[rows] for one in self]
        return Alive._make(parts)

    def and_also(self, more: Alive) -> Alive:
        """These and then others."""
        parts: list[Any] = [np.concatenate(pair) for pair in zip(self, more, strict=True)]
        return Alive._make(parts)

    def looks(self) -> Array:
        """(A, f) what they look like: means over all detections, NaN where a feature was never known."""
        return np.asarray(self.total / np.where(self.known > 0, self.known, np.nan))


def nobody(f: int) -> Alive:
    """No track, with so many features."""
    none, looks = np.empty(0, int), np.empty((0, f))
    x, P = np.empty((0, 4)), np.empty((0, 4, 4))
    return Alive(none, x, P, x, P, x, P, looks, none, none, none, looks, looks, none, none, np.empty(0, bool))


def begun(number: int, x: Array, P: Array, image: int, features: Array, life: Life) -> Alive:
    """One new track on detections with these features, (2, f), the second in this image."""
    zero = np.zeros(1, int)
    return Alive(
        np.array([number]), x[None], P[None], x[None], P[None], x[None], P[None],
        features.mean(axis=0)[None], zero + image, zero + image, zero,
        np.nansum(features, axis=0)[None], np.isfinite(features).sum(axis=0)[None].astype(float), zero, zero,
        np.array([not life.confirm]),
    )  # fmt: skip


def come_to(alive: Alive, before: int, image: int, views: Mapping[int, Sees], motion: Motion) -> Alive:
    """The tracks predicted to an image, with the images in between, which had no detection, counted."""
    missed = np.full(len(alive.number), image - before - 1)
    for number in views:
        if before < number < image:
            ahead, _ = motion(number - before)
            missed -= ~views[number]((alive.x @ ahead.T)[:, :2])
    x, P = predict(alive.x, alive.P, *motion(image - before))
    scans = np.where(alive.believed, 0, alive.scans + missed)
    return alive._replace(x=x, P=P, absent=alive.absent + missed, scans=scans)


def over(alive: Alive, image: int, interval: float, life: Life) -> Flags:
    """(A,) which end before an image: by absence, age or covariance, or as never to be confirmed."""
    places = alive.P[:, :2, :2]
    gone = outlived(alive.absent * interval, places, life.max_absence, life.max_sd)
    gone |= outlived((image - alive.last) * interval, places, life.max_age, np.inf)
    return np.asarray(gone | (verdicts(alive, life) == DROPPED))


def looked(
    alive: Alive, measured: Index, near: Flags, image: int, views: Mapping[int, Sees], features: Array
) -> Alive:
    """The counts and the looks after an image.

    Parameters
    ----------
    alive
        With the states after it.
    measured
        Rows that took a detection in it.
    near
        (A,) which had one in their gate.
    image
        Its number.
    views
        What images show.
    features
        (n, f) of the detections that were taken.
    """
    took = np.zeros(len(alive.number), bool)
    took[measured] = True
    seen = views[image](alive.x[:, :2]) if image in views else np.ones(len(took), bool)
    # What was detected was looked at, whatever the view says.
    seen = np.asarray(seen | took | near)
    then = alive._replace(
        last=np.where(took, image, alive.last),
        absent=np.where(took, 0, alive.absent + seen),
        hits=np.where(alive.believed, 0, alive.hits + near),
        scans=np.where(alive.believed, 0, alive.scans + seen),
    )
    then.x_then[took], then.P_then[took] = alive.x[took], alive.P[took]
    then.total[measured] += np.nan_to_num(features, nan=0.0)
    then.known[measured] += np.isfinite(features)
    return then


def verdicts(alive: Alive, life: Life) -> NDArray[np.int8]:
    """(A,) what `judge_start` says; those that are believed stay so."""
    said = np.full(len(alive.number), CONFIRMED, np.int8)
    if life.confirm:
        m, n = life.confirm
        rows = np.flatnonzero(~alive.believed)
        said[rows] = judge_start(alive.hits[rows], np.minimum(alive.scans[rows], n), m, n)
    return said


def who(
    new: Alive,
    kept: Alive,
    interval: float,
    motion: Motion,
    limits: tuple[float, float, float],
    looks: tuple[Array, Array] | None,
    likelier: float,
) -> Index:
    """(N,) the row of the kept track that each new one is, or -1: by where it began, and its looks until now.

    Parameters
    ----------
    new, kept
        N tracks whose identity is not known, and M that ended.
    interval
        Between two images, s.
    motion
        Over a number of images.
    limits
        Largest speed, m/s; gate on places; largest feature distance.
    looks
        Spreads and weights of the features; None: looks do not count.
    likelier
        See `Life`.
    """
    N, M = len(new.number), len(kept.number)
    if not N or not M:
        return np.full(N, -1)
    differ = np.zeros((N, M, 0)) if looks is None else look_differences(new.looks(), kept.looks(), *looks)
    may, costs = np.zeros((N, M), bool), np.full((N, M), np.inf)
    for row in range(N):
        passed = new.first[row] - kept.last
        # Who was still detected beside its first detection, one image before, is another one.
        old = np.flatnonzero(passed > 1)
        place, spread = new.x_first[[row], :2], new.P_first[[row], :2, :2]
        then, then_P = kept.x_then[old], kept.P_then[old]
        steps = [motion(int(images)) for images in passed[old]]
        F, Q = (np.array([step[part] for step in steps]).reshape(-1, 4, 4) for part in (0, 1))
        x, P = predict(then, then_P, F, Q)
        seconds, (max_speed, gate) = passed[old] * interval, limits[:2]
        may[row, old] = reachable(place, spread, then[:, :2], then_P[:, :2, :2], seconds, max_speed, gate)[0]
        costs[row, old] = place_costs(place, spread, x[:, :2], P[:, :2, :2])[0]
    return recognise(may, costs, differ, limits[2], likelier).track


_H = np.eye(2, 4)
#: New tracks, kept ones and identities to the kept ones that remain.
_Recall = Callable[[Alive, Alive, list[int]], Alive]


def compare_looks(rows: Array, alive: Alive, appearance: Appearance, rule: str, gate: float) -> Array:
    """(N, M) how far detections with features (N, f) are from what the tracks look like.

    By `STATE` features that are not known of both take the gate on places, ``gate``, as far: of any pair it
    lets in as many as of one whose features are all known.
    """
    if rule == STATE:
        used = appearance.used
        known = (np.isfinite(rows) * used) @ (alive.known > 0).T
        wider = gate_with_more(gate, np.array([used.sum()])) - gate_with_more(gate, known)
        return wider + estimated_distances(rows, alive.total, alive.known, appearance.sd, used)
    # What is stored is the mean of two, and as uncertain as half of a detection.
    weights = appearance.weights if rule == FEATURES else appearance.used
    return feature_distances(rows, alive.stored, np.sqrt(1.5) * appearance.sd, weights)


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
    images, firsts = np.unique(looks.image, return_index=True)
    ends = np.append(firsts, len(looks.image))[1:]
    quiet = _quiet_images(looks, tuning, rule, by, limits, images, ends, motion)
    while len(states) < len(images):
        if quiet is not None and len(alive.number):
            alive, xs, Ps = quiet(len(states), before, alive, track)
            if len(xs):
                states += [(alive.number, *one) for one in zip(xs, Ps, strict=True)]
                waiting, before = waiting[:0], int(images[len(states) - 1])
                continue
        k = len(states)
        image, rows = int(images[k]), np.arange(firsts[k], ends[k])
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
    return Bank(track, first, images, x, P, identity, ended, np.array(book.believed, bool))


#: Place of the first image, number of the one before, tracks and (D,) numbers of tracks -> the tracks after
#: all images that are quiet, none or more, and their states after each.
_Quiet = Callable[[int, int, Alive, Index], tuple[Alive, Array, Array]]


def _quiet_images(
    looks: Looks, tuning: Tuning, rule: str, appearance: Appearance | None, limits: Limits, images: Index,
    ends: Index, motion: Motion,
) -> _Quiet | None:  # fmt: skip
    """What follows tracks while nothing but updates happens; None where views or confirmation count."""
    life = tuning.life
    if looks.sees is not None or life.confirm:
        return None
    gaps, steps = np.unique(np.diff(images, prepend=images[0]), return_inverse=True)
    F, Q = (np.array([motion(int(gap))[part] for gap in gaps]) for part in (0, 1))
    R = tuning.measurement**2 * np.eye(2)
    sd, weights, features = np.ones(0), np.ones(0), np.empty((len(looks.image), 0))
    if appearance is not None:
        sd, features = appearance.sd, appearance.features
        weights = appearance.weights if rule == FEATURES else appearance.used
    counts = np.arange(len(sd) + 1.0)
    wider = gate_with_more(tuning.gate, weights.sum() + 0 * counts) - gate_with_more(tuning.gate, counts)
    longest = np.array([life.max_absence, life.max_age, life.max_sd])
    z = np.ascontiguousarray(looks.positions)
    features, code = np.ascontiguousarray(features), RULES.index(rule)

    def follow(start: int, before: int, alive: Alive, track: Index) -> tuple[Alive, Array, Array]:
        parts: list[Any] = [np.ascontiguousarray(one) for one in alive]
        now = Alive._make(parts)
        taken = np.full(len(track), -1)
        xs, Ps = (np.empty((len(images), *one.shape)) for one in (now.x, now.P))
        stop = bank_kernel.follow_quietly(
            start, before, images, ends, z, features, steps, F, Q, R, code, *limits, sd, weights, wider,
            looks.interval, longest, now.x, now.P, now.x_then, now.P_then, now.stored, now.total, now.known,
            now.last, now.absent, taken, xs, Ps,
        )  # fmt: skip
        done = taken >= 0
        track[done] = now.number[taken[done]]
        return now, xs[start:stop], Ps[start:stop]

    return follow


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
