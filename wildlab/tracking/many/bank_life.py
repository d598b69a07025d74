"""The tracks of a bank of filters while they live, and what is kept of those that ended: H 3.4."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.kalman import predict
from wildlab.tracking.many.life import CONFIRMED, DROPPED, judge_start, outlived
from wildlab.tracking.many.reacquisition import look_differences, place_costs, reachable, recognise
from wildlab.tracking.many.target_model import Sees

Array = NDArray[np.float64]
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
