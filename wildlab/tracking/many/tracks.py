"""Tracks of many targets as arrays: begun, moved on, ended, and told from what does not move."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from wildlab.tracking.many.hulls import lasting_part, near_side, on_one_hull
from wildlab.tracking.many.motions import densities_of, interact, largest_of
from wildlab.tracking.many.target_model import ManySensorModel, ManyTargetModel, own_columns
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.schmidt import fade

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A hit within so many metres is on a track however differently both seem to move.
TOUCHING_M = 2.0
#: Two tracks this near move alike if their velocities differ by less than this, m/s.
MOVE_ALIKE_M_S = 3.0
#: Squared distance of two velocities, in units of their covariance, up to which they may be the same: what a
#: chi-square of two degrees of freedom stays below with 95 %.
SAME_VELOCITY = 5.99
#: Slower than this over the time it is watched, m/s, a track stays where it is.
STAYS_M_S = 0.5


class Tracks(NamedTuple):
    """T tracks, each of K kinds of hull at once, seen by S sensors.

    Attributes
    ----------
    x, P
        (T, K, 4) north, east and their velocities, and (T, K, 4, 4); m and s.
    C
        (T, K, 4, k) covariance of a track's error, truth minus estimate, with each of k errors of sensors, in
        their standard deviations: those that all measurements of a look share (`Scan.shared`), and behind
        them those that each target has of its own (`wildlab.tracking.many.target_model.own_lasting`).
    kinds
        (T, K) probabilities.
    existence
        (T,) probability.
    visible, looked
        (T, S) probability that a sensor can see it, and when that was so, s.
    identity, hits
        (T,) its number, and how many scans had a measurement of it.
    last, by
        (T,) s, of its last measurement, and which sensor that was of.
    confirmed, moving
        (T,) whether it is believed, and whether it was seen to move.
    trail
        For each track (L, 3) times and places where it was seen.
    """

    x: Array
    P: Array
    C: Array
    kinds: Array
    existence: Array
    visible: Array
    looked: Array
    identity: NDArray[np.int64]
    hits: NDArray[np.int64]
    last: Array
    by: NDArray[np.int64]
    confirmed: Flags
    moving: Flags
    trail: tuple[Array, ...]

    @property
    def number(self) -> int:
        """T."""
        return len(self.existence)

    def only(self, rows: NDArray[np.intp]) -> Tracks:
        """These, in this order."""
        parts: list[Any] = [one[rows] for one in self[:-1]]
        return Tracks._make([*parts, tuple(self.trail[row] for row in rows)])

    def estimate(self) -> tuple[Array, Array]:
        """(T, 4) and (T, 4, 4): the kinds merged to one."""
        mean = np.einsum("tk,tki->ti", self.kinds, self.x)
        apart = self.x - mean[:, None]
        P = self.P + apart[..., :, None] * apart[..., None, :]
        return mean, np.einsum("tk,tkij->tij", self.kinds, P)


def no_tracks(kinds: int, sensors: int, errors: int = 0) -> Tracks:
    """None yet, of so many kinds of hull, seen by so many sensors that share so many errors."""
    whole, flag = np.zeros(0, np.int64), np.zeros(0, bool)
    one = np.zeros(0)
    of_kinds, of_sensors = np.zeros((0, kinds)), np.zeros((0, sensors))
    x, P, C = (np.zeros((0, kinds, 4, *more)) for more in ((), (4,), (errors,)))
    return Tracks(x, P, C, of_kinds, one, of_sensors, of_sensors, whole, whole, one, whole, flag, flag, ())


def both(tracks: Tracks, more: Tracks) -> Tracks:
    """One after the other."""
    parts: list[Any] = [np.concatenate(pair) for pair in zip(tracks[:-1], more[:-1], strict=True)]
    return Tracks._make([*parts, tracks.trail + more.trail])


def later(tracks: Tracks, dt: float, targets: ManyTargetModel, lasting_s: ArrayLike = ()) -> Tracks:
    """Estimates ``dt`` s later, driven by white acceleration; shared errors last for (k,) s in the mean."""
    densities, x, P, C, kinds = densities_of(targets), tracks.x, tracks.P, tracks.C, tracks.kinds
    if len(densities) > 1:
        x, P, C, kinds = interact(x, P, C, kinds, dt, targets.stay_s)
    steps = [white_acceleration(dt, density) for density in densities]
    F = steps[0][0]
    Q = np.stack([Q for _, Q in steps])[np.arange(kinds.shape[1]) % len(densities)]
    C = F @ C * [fade(dt, float(one)) for one in np.asarray(lasting_s, float)]
    return tracks._replace(x=x @ F.T, P=F @ P @ F.T + Q, C=C, kinds=kinds)


def begin(
    z: Array,
    R: Array,
    time: float,
    platform: ArrayLike,
    sensors: tuple[ManySensorModel, ...],
    sensor: int,
    targets: ManyTargetModel,
    first: int,
    shared: Array,
) -> Tracks:
    """A track on each of M measurements (M, 2) with (M, 2, 2); identities from ``first`` on.

    ``shared`` (M, 2, k) as in `Scan`: what moves a measurement moves its track, the other way than its error.

    It may go anywhere: which part of a hull is seen, and along which heading, is half known for each axis.
    """
    count, K = len(z), len(targets.hulls)
    mine = sensors[sensor]
    at = np.concatenate([z, np.zeros((count, 2))], axis=1)[:, None].repeat(K, axis=1)
    at[..., :2] -= near_side(at, platform, mine)
    rough, along = np.asarray(mine.rough_m), np.asarray(mine.along_m)
    P, C = np.zeros((count, K, 4, 4)), np.zeros((count, K, 4, shared.shape[-1]))
    C[..., :2, :] = -shared[:, None]
    alone = R[:, None] + (rough**2 + along**2 / 2)[:, None, None] * np.eye(2)
    P[..., :2, :2] = alone + (shared @ np.swapaxes(shared, -1, -2))[:, None]
    if mine.correlation:
        C[..., :2, own_columns(sensors, sensor, C.shape[-1])] = -lasting_part(alone, mine.correlation)
    P[..., [2, 3], [2, 3]] = targets.start_speed_m_s**2
    share = np.array([hull.share for hull in targets.hulls])
    lasting = targets.visible_s / (targets.visible_s + targets.hidden_s)
    visible = np.full((count, len(sensors)), lasting)
    visible[:, sensor] = 1.0
    return Tracks(
        at,
        P,
        C,
        np.tile(share / share.sum(), (count, 1)),
        np.full(count, targets.birth),
        visible,
        np.full((count, len(sensors)), time),
        np.arange(first, first + count),
        np.ones(count, np.int64),
        np.full(count, time),
        np.full(count, sensor),
        np.zeros(count, bool),
        np.zeros(count, bool),
        tuple(np.array([[time, *place]]) for place in z),
    )


def alive(tracks: Tracks, targets: ManyTargetModel) -> Tracks:
    """Those that may exist, whose place is known at all, and whose speed is possible.

    What all measurements are wrong by together makes no track hard to find again: it is left out.
    """
    mean, P = tracks.estimate()
    shared = np.einsum("tk,tkij->tij", tracks.kinds, tracks.C)[:, :2]
    good = (np.trace(P[:, :2, :2], axis1=1, axis2=2) - (shared**2).sum(axis=(1, 2))) / 2 < targets.lost_m**2
    good &= (tracks.existence > targets.forgotten) & (
        np.linalg.norm(mean[:, 2:], axis=1) < targets.fastest_m_s
    )
    return tracks.only(np.flatnonzero(good))


def without_doubles(tracks: Tracks, targets: ManyTargetModel, several: bool) -> Tracks:
    """One track for each target: of two on one place or, where ``several``, on one hull, the older stays.

    Parameters
    ----------
    several
        Whether the sensor of this scan may see one hull as several things.
    """
    if tracks.number < 2:
        return tracks
    mean, P = tracks.estimate()
    largest = largest_of(targets.hulls)
    hull = targets.hulls[int(largest.argmax())]
    kinds = tracks.kinds.copy()
    order = sorted(
        range(tracks.number), key=lambda row: (-int(tracks.confirmed[row]), -int(tracks.hits[row]))
    )
    # On one hull they are nowhere farther apart than this.
    widest = max(targets.apart_m, hull.length_m + hull.beam_m + 2.0)
    found: Any = cKDTree(mean[:, :2]).query_ball_point(mean[:, :2], widest)
    close: list[list[int]] = list(found)
    place = {row: number for number, row in enumerate(order)}
    kept: set[int] = set()
    for row in order:
        beside = sorted((one for one in close[row] if one in kept), key=place.__getitem__)
        if not any(_is_of(tracks, mean, P, kinds, row, one, targets, several, largest) for one in beside):
            kept.add(row)
            continue
        for one in beside:
            apart = float(np.linalg.norm(mean[row, :2] - mean[one, :2]))
            if several and apart > targets.apart_m and on_one_hull(mean[one], mean[row], hull):
                # Two that go along one line at one speed are the ends of something long.
                kinds[one, ~largest] = 0.1 / max(int((~largest).sum()), 1)
                kinds[one, largest] = 0.9 / int(largest.sum())
                break
    return tracks._replace(kinds=kinds).only(np.array(sorted(kept), np.intp))


def _is_of(
    tracks: Tracks,
    mean: Array,
    P: Array,
    kinds: Array,
    row: int,
    one: int,
    targets: ManyTargetModel,
    several: bool,
    largest: Flags,
) -> bool:
    """Whether a track is the same target as another that stays."""
    hull = targets.hulls[int(largest.argmax())]
    apart = float(np.linalg.norm(mean[row, :2] - mean[one, :2]))
    differ = float(np.linalg.norm(mean[row, 2:] - mean[one, 2:]))
    old = tracks.hits[row] >= targets.hits and tracks.hits[one] > targets.hits
    if several and old and on_one_hull(mean[one], mean[row], hull):
        return True
    long = kinds[one, largest].sum() >= 0.5 and hull.length_m > 0
    reach = 0.6 * hull.length_m if long else targets.apart_m
    if apart >= reach or (differ >= MOVE_ALIKE_M_S and apart >= TOUCHING_M):
        return False
    if not tracks.confirmed[row]:
        return True
    # Two that are believed are targets that pass each other, unless they move alike and share what is
    # seen.
    share = min(tracks.last[row], tracks.last[one]) < tracks.last.max()
    return bool(apart <= targets.apart_m and share and _as_fast(mean[row], mean[one], P[row] + P[one]))


def _as_fast(x: Array, other: Array, P: Array) -> bool:
    v = x[2:] - other[2:]
    return bool(v @ np.linalg.solve(P[2:, 2:], v) < SAME_VELOCITY)


def moves(trail: Array, before: bool, moves_m: float, over_s: float) -> bool:
    """Whether what went along ``trail`` (L, 3), times and places of the last ``over_s``, moves.

    Parameters
    ----------
    before
        Whether it did until now: in between, and where there is no way to judge by, it still does.
    moves_m, over_s
        As in `ManyTargetModel`.
    """
    if len(trail) < 2:
        return before
    gone = float(np.linalg.norm(trail[-1, 1:] - trail[0, 1:]))
    lasted = float(trail[-1, 0] - trail[0, 0])
    if gone > moves_m and gone > STAYS_M_S * lasted:
        return True
    return before and not (lasted > 0.8 * over_s and gone < 0.6 * moves_m)


def judged_by_motion(tracks: Tracks, time: float, targets: ManyTargetModel) -> Tracks:
    """Which of them move: what stays is a buoy, a moored boat or the shore."""
    moving, trails = tracks.moving.copy(), []
    for row, trail in enumerate(tracks.trail):
        recent = trail[trail[:, 0] > time - targets.over_s]
        trails.append(recent)
        moving[row] = moves(recent, bool(moving[row]), targets.moves_m, targets.over_s)
    return tracks._replace(moving=moving, trail=tuple(trails))
