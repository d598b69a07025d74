"""Tracks of many targets between and after scans: where they begin, move, double each other and are
corrected.

After a scan every measurement of the gate counts in the share in which it is the target's.

Whether targets are there and can be seen, and how many there are.

Of a target, r is the probability that it exists, v that it can be seen if it does, and d that it is detected
if it can be seen. A measurement is its own with the weight r v d L / c, where L is the density of the
measurement given the target and c that of clutter; it has none with the weight 1 - r v d (H 8.2; Musicki and
Evans, Joint integrated probabilistic data association, IEEE Transactions on Aerospace and Electronic Systems
40, 2004). With v = 1 that is the textbook's; with r = 1 too, joint probabilistic data association.

Tracks are no count: each is there with some probability, so that their number has a Poisson-binomial
distribution; targets never seen, where they are strewn independently, a Poisson one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from wildlab.geometry.frames import Array, wrap
from wildlab.tracking.kalman import fade
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.sensors import left_out
from wildlab.tracking.target_model import (
    ManySensorModel,
    ManyTargetModel,
    largest_of,
    lasting_part,
    near_side,
    on_one_hull,
    own_columns,
)


def still_there(existence: ArrayLike, dt: ArrayLike, lifetime: float) -> Array:
    """Probability of existence ``dt`` s later, of targets that are there for ``lifetime`` s in the mean."""
    return np.asarray(np.asarray(existence, float) * np.exp(-np.asarray(dt, float) / lifetime))


def visible_later(visible: ArrayLike, dt: ArrayLike, visible_s: float, hidden_s: float) -> Array:
    """Probability of being visible ``dt`` s later: a Markov process with two states and its mean stays, s.

    Examples
    --------
    After a long time nothing is left of what was known:

    >>> print(visible_later(1.0, [0.0, 1e6], 30.0, 10.0))
    [1.   0.75]
    """
    lasting = visible_s / (visible_s + hidden_s)
    left = np.exp(-np.asarray(dt, float) * (1 / visible_s + 1 / hidden_s))
    return np.asarray(lasting + (np.asarray(visible, float) - lasting) * left)


def weights(
    existence: ArrayLike, visible: ArrayLike, detection: float, likelihood: ArrayLike, clutter: float
) -> tuple[Array, Array]:
    """Weights for `association_probabilities`.

    Parameters
    ----------
    existence, visible
        (T,) r and v.
    detection
        d.
    likelihood
        (T, M) L, 1/m^2; zero outside of the gate.
    clutter
        c, 1/m^2.

    Returns
    -------
    (T, M) of pairs and (T,) of none.
    """
    seen = np.asarray(existence, float) * np.asarray(visible, float) * detection
    return seen[:, None] * np.asarray(likelihood, float) / clutter, np.asarray(1 - seen)


def after_scan(
    existence: ArrayLike, visible: ArrayLike, detection: float, probabilities: ArrayLike
) -> tuple[Array, Array, Array]:
    """What a scan says of existence and visibility.

    Parameters
    ----------
    existence, visible, detection
        r (T,), v (T,) and d before it.
    probabilities
        (T, 1 + M), of `association_probabilities` with `weights`.

    Returns
    -------
    existence, visible
        (T,) after it; visible given that the target exists.
    own
        (T, 1 + M): probabilities that none or each of the measurements is its own, given that it exists.
    """
    r, v = np.asarray(existence, float), np.asarray(visible, float)
    p = np.array(probabilities, float)
    none = 1 - r * v * detection
    unseen = np.divide(r * (1 - v * detection), none, out=np.zeros_like(r), where=none > 0)
    there = p.copy()
    there[:, 0] = p[:, 0] * unseen
    after = there.sum(axis=1)
    own = np.divide(there, after[:, None], out=np.zeros_like(there), where=after[:, None] > 0)
    own[after <= 0, 0] = 1.0
    hidden = np.divide(v * (1 - detection), 1 - v * detection, out=np.ones_like(v), where=v * detection < 1)
    return after, np.asarray(own[:, 1:].sum(axis=1) + own[:, 0] * hidden), own


class Count(NamedTuple):
    """A number of animals.

    Attributes
    ----------
    mean
        Animals.
    low, high
        The fewest numbers in a row that hold the asked probability.
    probability
        That they hold in fact: more, as numbers are whole.
    """

    mean: float
    low: int
    high: int
    probability: float


def count_probabilities(existence: ArrayLike) -> Array:
    """Probability of each number of animals.

    Parameters
    ----------
    existence
        (A,) probability that each track is an animal that is there; independent of each other.

    Returns
    -------
    (K,) of 0 to K - 1 animals; sums to one.

    Examples
    --------
    >>> print(count_probabilities([0.5, 1.0]))
    [0.  0.5 0.5]
    """
    r = np.asarray(existence, float).reshape(-1)
    p = np.ones(1)
    for one in r:
        p = np.convolve(p, [1 - one, one])
    return np.asarray(p / p.sum())


def count_interval(probabilities: ArrayLike, probability: float = 0.9) -> Count:
    """Mean and shortest interval of a number of animals.

    Parameters
    ----------
    probabilities
        (K,) of 0 to K - 1 animals, from `count_probabilities`.
    probability
        That the interval shall hold at least, above 0 and below 1.

    Returns
    -------
    Count

    Examples
    --------
    >>> count_interval(count_probabilities([0.9, 0.8, 0.05]), 0.9)
    Count(mean=1.75, low=1, high=2, probability=0.945)
    """
    p = np.asarray(probabilities, float)
    below = np.concatenate([[0.0], np.cumsum(p)])
    held = below[None, 1:] - below[:-1, None]  # from a row's number to a column's
    length = np.arange(len(p))[None] - np.arange(len(p))[:, None]
    enough = (length >= 0) & (held >= min(probability, below[-1]) - 1e-12)
    shortest = length == length[enough].min()
    low, high = np.unravel_index(int(np.argmax(np.where(enough & shortest, held, -1.0))), held.shape)
    mean = float(np.arange(len(p)) @ p)
    return Count(round(mean, 12), int(low), int(high), round(float(held[low, high]), 12))


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
        their standard deviations: those that all measurements of a scan share (`Scan.shared`), and behind
        them those that each target has of its own (`wildlab.tracking.target_model.own_lasting`).
    kinds
        (T, K) probabilities.
    existence, aged
        (T,) probability, and for how much longer than at the scan before it was looked at, s.
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
    aged: Array
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

    def estimate(self, shares: Array | None = None) -> tuple[Array, Array]:
        """(T, 4) and (T, 4, 4): the kinds merged, in ``shares`` (K,) for their spread, else as probable."""
        mean = np.einsum("tk,tki->ti", self.kinds, self.x)
        apart = self.x - mean[:, None]
        P = self.P + apart[..., :, None] * apart[..., None, :]
        weight = self.kinds if shares is None else np.broadcast_to(shares, self.kinds.shape)
        return mean, np.einsum("tk,tkij->tij", weight, P)


def no_tracks(kinds: int, sensors: int, errors: int = 0) -> Tracks:
    """None yet, of so many kinds of hull, seen by so many sensors that share so many errors."""
    whole, flag = np.zeros(0, np.int64), np.zeros(0, bool)
    one = np.zeros(0)
    of_kinds, of_sensors = np.zeros((0, kinds)), np.zeros((0, sensors))
    x, P, C = (np.zeros((0, kinds, 4, *more)) for more in ((), (4,), (errors,)))
    return Tracks(
        x, P, C, of_kinds, one, one, of_sensors, of_sensors, whole, whole, one, whole, flag, flag, ()
    )


def both(tracks: Tracks, more: Tracks) -> Tracks:
    """One after the other."""
    parts: list[Any] = [np.concatenate(pair) for pair in zip(tracks[:-1], more[:-1], strict=True)]
    return Tracks._make([*parts, tracks.trail + more.trail])


def later(tracks: Tracks, dt: float, targets: ManyTargetModel, lasting_s: ArrayLike = ()) -> Tracks:
    """Estimates ``dt`` s later, driven by white acceleration; shared errors last for (k,) s in the mean."""
    F, Q = white_acceleration(dt, targets.density)
    C = F @ tracks.C * [fade(dt, float(one)) for one in np.asarray(lasting_s, float)]
    return tracks._replace(x=tracks.x @ F.T, P=F @ tracks.P @ F.T + Q, C=C)


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
        np.zeros(count),
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
    if not v.any():  # also of targets at rest, whose speeds have no spread
        return True
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


#: A target this near to the platform, m, is in no direction.
NEAREST_M = 1.0


class Compared(NamedTuple):
    """T tracks of K kinds beside M measurements of m elements: two of a place, one of a bearing.

    ``innovation`` (T, K, M, m), its covariance ``S`` (T, K, M, m, m), ``likelihood`` (T, K, M), 1/m^2 or
    1/rad, zero outside of the gate, ``H`` (T, K, m, 2) of a place, and ``G`` (T, K, M, m, k): what one
    standard deviation of each shared error makes of an innovation.
    """

    innovation: Array
    S: Array
    likelihood: Array
    H: Array
    G: Array


def compare(
    x: ArrayLike,
    P: ArrayLike,
    offset: ArrayLike,
    noise: ArrayLike,
    z: ArrayLike,
    R: ArrayLike,
    gate: float,
    C: ArrayLike | None = None,
    shared: ArrayLike | None = None,
    correlation: float = 0.0,
    own: slice = slice(0),
) -> Compared:
    """How far every measurement is from where every track expects one.

    Parameters
    ----------
    x, P
        (T, K, 4) and (T, K, 4, 4).
    offset, noise
        (T, K, 2) from the middle of a target to what is seen, and (T, K, 2, 2) how much that varies.
    z, R
        (M, 2) and (M, 2, 2); or (T, M, 2) and (T, M, 2, 2), where each track has measurements of its own.
    gate
        How many standard deviations it may be.
    C, shared
        (T, K, 4, k) of `Tracks` and (M, 2, k) or (T, M, 2, k) of `Scan`; left out: no error is shared.
    correlation, own
        Share of the variance of the rest that lasts, and which two of the k errors it is, each target's own.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    places, noises = np.asarray(z, float), np.asarray(R, float)
    if C is None or shared is None:
        C, shared = np.zeros((*x.shape, 0)), np.zeros((*places.shape, 0))
    C, moved = np.asarray(C, float), np.asarray(shared, float)
    if places.ndim == 2:
        places, noises, moved = places[None], noises[None], moved[None]
    innovation = places[:, None] - (x[..., :2] + np.asarray(offset, float))[:, :, None]
    alone = np.asarray(noise, float)[:, :, None] + noises[:, None]
    G = C[..., None, :2, :] + moved[:, None]
    if correlation:
        G[..., own] += lasting_part(alone, correlation)
        alone = (1 - correlation) * alone
    S = P[..., None, :2, :2] + alone
    if G.shape[-1]:
        # H (7.34) with both halves of what track and scan have in common.
        S = S + G @ np.swapaxes(G, -1, -2) - (C[..., :2, :] @ np.swapaxes(C[..., :2, :], -1, -2))[:, :, None]
    H = np.broadcast_to(np.eye(2), (*x.shape[:2], 2, 2))
    return Compared(innovation, S, likelihoods(innovation, S, gate), H, G)


def likelihoods(innovation: Array, S: Array, gate: float) -> Array:
    """(...) of innovations (..., 2) with covariances (..., 2, 2); zero outside of the gate."""
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    a, b = innovation[..., 0], innovation[..., 1]
    square = (S[..., 1, 1] * a**2 - 2 * S[..., 0, 1] * a * b + S[..., 0, 0] * b**2) / det
    return np.asarray(np.where(square < gate**2, np.exp(-square / 2) / (2 * np.pi * np.sqrt(det)), 0.0))


def compare_bearings(
    x: ArrayLike,
    P: ArrayLike,
    noise: ArrayLike,
    platform: ArrayLike,
    z: ArrayLike,
    R: ArrayLike,
    gate: float,
    C: ArrayLike | None = None,
) -> Compared:
    """The same of M bearings from north, to first order at each track's own place.

    Which part of a hull is seen counts as the angle under which it appears; what lies towards the platform
    changes no bearing. What first order leaves out, which is most where a target is near and its place known
    badly, counts as noise (`wildlab.tracking.sensors`); where it is more than the bearing's own, no bearing
    is of that track. A place within `NEAREST_M` of the platform has none.

    Parameters
    ----------
    x, P, noise, gate
        As in `compare`.
    platform
        (2,) where they are measured from.
    z, R
        (M, 1) rad, and (M, 1, 1) rad^2.
    C
        (T, K, 4, k) of `Tracks`; a bearing's own errors are its own.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    to = x[..., :2] - np.asarray(platform, float)
    square = (to**2).sum(axis=-1)
    far = square > NEAREST_M**2
    north, east = to[..., 0], to[..., 1]
    H = np.stack([-east, north], axis=-1)[..., None, :] / np.where(far, square, 1.0)[..., None, None]
    H = np.where(far[..., None, None], H, 0.0)
    bearing = np.asarray(z, float).reshape(-1)
    innovation = np.asarray(wrap(bearing - np.arctan2(east, north)[..., None]), float)
    spread = P[..., :2, :2] + np.asarray(noise, float)
    own = (H @ spread @ np.swapaxes(H, -1, -2))[..., 0, 0]
    D = np.stack(
        [
            np.stack([2 * north * east, east**2 - north**2], axis=-1),
            np.stack([east**2 - north**2, -2 * north * east], axis=-1),
        ],
        axis=-2,
    )
    D = D / np.where(far, square, 1.0)[..., None, None] ** 2
    bent = left_out(spread, D[..., None, :, :])[..., 0]
    variance = np.asarray(R, float).reshape(-1)
    S = own[..., None] + bent + variance
    likelihood = np.exp(-(innovation**2) / S / 2) / np.sqrt(2 * np.pi * S)
    inside = (innovation**2 < gate**2 * S) & far[..., None] & (bent <= variance)
    none = np.zeros((*x.shape, 0))
    G = (H @ np.asarray(none if C is None else C, float)[..., :2, :])[:, :, None]
    G = np.broadcast_to(G, (*innovation.shape, *G.shape[-2:]))
    return Compared(innovation[..., None], S[..., None, None], np.where(inside, likelihood, 0.0), H, G)


def _inverse(S: Array) -> Array:
    """Of covariances of one or two elements."""
    if S.shape[-1] == 1:
        return np.asarray(1 / S)
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    inverse = np.empty_like(S)
    inverse[..., 0, 0], inverse[..., 1, 1] = S[..., 1, 1] / det, S[..., 0, 0] / det
    inverse[..., 0, 1] = inverse[..., 1, 0] = -S[..., 0, 1] / det
    return inverse


class Updated(NamedTuple):
    """(T, K, 4), (T, K, 4, 4), the probabilities of the kinds (T, K), and (T, K, 4, k)."""

    x: Array
    P: Array
    kinds: Array
    C: Array


def update(
    x: ArrayLike,
    P: ArrayLike,
    kinds: ArrayLike,
    own: ArrayLike,
    compared: Compared,
    C: ArrayLike | None = None,
) -> Updated:
    """Merge what every measurement would make of an estimate, one mixture for each kind.

    Shared errors are considered and not estimated, H (7.34)-(7.38): each kind by itself.

    Parameters
    ----------
    x, P, kinds
        (T, K, 4), (T, K, 4, 4) and (T, K) before the scan.
    own
        (T, 1 + M) of `wildlab.tracking.multitarget_tracks.after_scan`.
    C
        (T, K, 4, k) of `Tracks`; left out: no error is shared.
    """
    mean, cov, before = np.asarray(x, float), np.asarray(P, float), np.asarray(kinds, float)
    common = np.zeros((*mean.shape, 0)) if C is None else np.asarray(C, float)
    whose, (innovation, S, likelihood, H, G) = np.asarray(own, float), compared
    mixed = np.einsum("tk,tkm->tm", before, likelihood)[:, None]
    # Of a measurement that is the target's, the share of each kind: how likely that kind makes it.
    share = np.divide(likelihood, mixed, out=np.zeros_like(likelihood), where=mixed > 0) * whose[:, None, 1:]
    weight = whose[:, None, 0] + share.sum(axis=-1)
    beta = np.divide(share, weight[..., None], out=np.zeros_like(share), where=weight[..., None] > 0)
    alone = cov[..., :2] - common @ np.swapaxes(common[..., :2, :], -1, -2)
    # Of an estimate's error with each innovation: what is its own, and what both share.
    cross = (alone @ np.swapaxes(H, -1, -2))[:, :, None] + common[:, :, None] @ np.swapaxes(G, -1, -2)
    gain = cross @ _inverse(S)
    step = np.einsum("tkmij,tkmj->tkmi", gain, innovation)
    moved = np.einsum("tkm,tkmi->tki", beta, step)
    weighed = beta[..., None, None] * gain
    shrunk = (weighed @ np.swapaxes(cross, -1, -2)).sum(axis=2)
    spread = np.einsum("tkm,tkmi,tkmj->tkij", beta, step, step) - moved[..., :, None] * moved[..., None, :]
    cov = cov - shrunk + spread
    after = before * weight
    return Updated(
        mean + moved,
        (cov + np.swapaxes(cov, -1, -2)) / 2,
        after / after.sum(axis=1, keepdims=True),
        common - (weighed @ G).sum(axis=2),
    )
