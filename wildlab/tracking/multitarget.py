"""All targets of a flight at once: scan after scan, whichever sensor it is of.

Errors that a scan's measurements share move all of them: what one target tells of them serves another. Given
these errors, targets are independent. What each target's measurements tell of them is kept as one Gaussian,
of which a pair that nobody is sure of makes little; and what all others tell, never a target itself, says
where its measurement is to be expected. That is repeated, since all are surer then: belief propagation
between the targets' associations and the errors. Only the probabilities of association come from it.
Estimates are corrected with the errors considered and not estimated, as of H 7.4: what other targets tell of
them would be used again at the next scan as if it were new. Where errors last, places relative to each other
are known well nevertheless; where each scan has another error, they are known no better than the places
themselves.

Once the flight is over, a track that was ever confirmed is a trajectory from its first measurement on. Back
over it, which measurements were of which target stays as it was taken at the time, and the covariance knows
nothing of what was taken wrongly: among many false measurements it is too small. Errors that last stay
considered: see `wildlab.tracking.run`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wildlab.geometry.frames import Array
from wildlab.tracking.association import association_probabilities
from wildlab.tracking.kalman import fade
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.multitarget_tracks import (
    Compared,
    Tracks,
    after_scan,
    alive,
    begin,
    both,
    compare,
    compare_bearings,
    judged_by_motion,
    later,
    likelihoods,
    no_tracks,
    still_there,
    update,
    visible_later,
    weights,
    without_doubles,
)
from wildlab.tracking.run import Later, begin_back, step_back
from wildlab.tracking.target_model import (
    LEAST_KIND,
    ManySensorModel,
    ManyTargetModel,
    Scan,
    at_least,
    gather,
    hull_noise,
    largest_of,
    near_side,
    own_columns,
    own_lasting,
)

#: How often what all tell each other is asked again. After the second time little changes.
ROUNDS = 2


def of_all(values: Array, near: NDArray[np.intp], count: int) -> Array:
    """(T, K, G) of measurements by number ``near`` (T, G), -1 none, as (T, K, count); zero elsewhere."""
    dense = np.zeros((*values.shape[:2], count))
    track, place = np.nonzero(near >= 0)
    dense[track, :, near[track, place]] = values[track, :, place]
    return dense


def learnt_from_others(compared: Compared, weight: Array) -> tuple[Array, Array]:
    """What all other targets tell each one of the shared errors.

    Parameters
    ----------
    compared
        T tracks of K kinds beside M measurements.
    weight
        (T, K, M) how probable it is that a target is there, of that kind, and the measurement its own.

    Returns
    -------
    mean, covariance
        (T, k) and (T, k, k), in standard deviations of the errors.
    """
    nu, S, _, _, G = compared
    k = G.shape[-1]
    probable = weight.sum(axis=(1, 2))
    share = np.divide(
        weight, probable[:, None, None], out=np.zeros_like(weight), where=probable[:, None, None] > 0
    )
    middle = np.einsum("tkm,tkmi->ti", share, nu)
    moved = np.einsum("tkm,tkmij->tij", share, G)
    off = nu - middle[:, None, None]
    alone = S - G @ np.swapaxes(G, -1, -2) + off[..., :, None] * off[..., None, :]
    spread = np.einsum("tkm,tkmij->tij", share, alone)
    spread[probable <= 0] = np.eye(2)
    by_spread = np.swapaxes(np.linalg.solve(spread, moved), -1, -2) * probable[:, None, None]
    information, pulled = by_spread @ moved, (by_spread @ middle[..., None])[..., 0]
    covariance = np.linalg.inv(np.eye(k) + information.sum(axis=0) - information)
    mean = (covariance @ (pulled.sum(axis=0) - pulled)[..., None])[..., 0]
    return mean, covariance


def moved_together(
    compared: Compared,
    near: NDArray[np.intp],
    kinds: Array,
    probabilities: Array,
    gate: float,
    probable: Callable[[Array], Array],
) -> tuple[Compared, Array]:
    """Likelihoods and probabilities of association with one value of each shared error for all targets.

    Parameters
    ----------
    compared
        T tracks of K kinds beside G measurements each, without regard to other targets.
    near
        (T, G) which of M measurements these are, -1 none.
    kinds
        (T, K).
    probabilities
        (T, 1 + M) by `compared`.
    gate
        As in `wildlab.tracking.multitarget_tracks.compare`.
    probable
        From likelihoods (T, K, M) to probabilities (T, 1 + M).

    Returns
    -------
    compared, probabilities
        The first with other likelihoods, the rest as it was.
    """
    if len(kinds) < 2 or not near.size:
        return compared, probabilities
    nu, S, likelihood, _, G = compared
    alone, count = S - G @ np.swapaxes(G, -1, -2), probabilities.shape[1] - 1
    for _ in range(ROUNDS):
        mine = np.where(near >= 0, np.take_along_axis(probabilities, near + 1, axis=1), 0.0)
        of_kind = kinds[..., None] * likelihood
        of_any = of_kind.sum(axis=1, keepdims=True)
        share = np.divide(of_kind, of_any, out=np.zeros_like(of_kind), where=of_any > 0)
        mean, covariance = learnt_from_others(compared, share * mine[:, None])
        left = nu - np.einsum("tkmij,tj->tkmi", G, mean)
        spread = alone + G @ covariance[:, None, None] @ np.swapaxes(G, -1, -2)
        likelihood = np.where((near >= 0)[:, None], likelihoods(left, spread, gate), 0.0)
        probabilities = probable(of_all(likelihood, near, count))
    return compared._replace(likelihood=likelihood), probabilities


#: A measurement less probable than this to be of any track is of none of them.
TAKEN = 0.3
#: A target is as good as there at this probability; one more certain could not be doubted any more.
CERTAIN = 0.999


class Measured(NamedTuple):
    """M measurements of a scan that are within reach: as in `Scan`, but (M, m, k) of errors that are shared
    are always there."""

    z: Array
    R: Array
    shared: Array


class Shown(NamedTuple):
    """What is believed after a scan: N confirmed targets that move and were seen not long ago.

    ``identity`` (N,), ``x`` (N, 4), ``P`` (N, 4, 4), ``existence`` (N,) and ``kinds`` (N, K).
    """

    time: float
    sensor: int
    identity: NDArray[np.int64]
    x: Array
    P: Array
    existence: Array
    kinds: Array


def run_many(
    scans: Sequence[Scan],
    sensors: Sequence[ManySensorModel],
    targets: ManyTargetModel,
    lasting_s: Sequence[float] = (),
) -> list[Shown]:
    """Follow all targets of all sensors, by joint integrated data association with visibility and hulls.

    Parameters
    ----------
    scans
        In any order; those of one time are taken as they come.
    sensors
        S of them; `Scan.sensor` is a place among them.
    targets
        What is known of the targets.
    lasting_s
        (k,) of each error that measurements of a scan share (`Scan.shared`), for how long it lasts: a
        first-order process of that correlation time, of which zero is another error at each scan, and
        infinity one for the whole flight.

    Returns
    -------
    list[Shown]
        One for each scan, in order of time.
    """
    return [shown for _, shown in follow_many(scans, sensors, targets, lasting_s)]


def follow_many(
    scans: Sequence[Scan],
    sensors: Sequence[ManySensorModel],
    targets: ManyTargetModel,
    lasting_s: Sequence[float] = (),
) -> Iterator[tuple[Tracks, Shown]]:
    """The same scan by scan, with all tracks: also those that are not believed yet.

    Parameters
    ----------
    scans, sensors, targets, lasting_s
        As in `run_many`.

    Returns
    -------
    Iterator of Tracks, Shown
        After each scan, in order of time.
    """
    eyes = tuple(sensors)
    lasting_s = (*lasting_s, *own_lasting(eyes))
    tracks, first, before = no_tracks(len(targets.hulls), len(eyes), len(lasting_s)), 0, None
    looked: dict[int, float] = {}
    for scan in sorted(scans, key=lambda one: one.time):
        dt = 0.0 if before is None else scan.time - before
        before = scan.time
        own_dt = scan.time - looked.get(scan.sensor, -np.inf)
        looked[scan.sensor] = scan.time
        tracks, first = step(tracks, scan, dt, own_dt, eyes, targets, first, lasting_s)
        yield tracks, _shown(tracks, scan, eyes, targets)


def step(
    tracks: Tracks,
    scan: Scan,
    dt: float,
    own_dt: float,
    sensors: tuple[ManySensorModel, ...],
    targets: ManyTargetModel,
    first: int,
    lasting_s: Sequence[float] = (),
) -> tuple[Tracks, int]:
    """Tracks after a scan that comes ``dt`` s after the one before, and ``own_dt`` s after the one before of
    its sensor, and the next free identity."""
    sensor = sensors[scan.sensor]
    tracks = later(tracks, dt, targets, lasting_s)
    seen = _within_reach(scan, sensor, tracks.C.shape[-1])
    mean, _ = tracks.estimate()
    inside = _sees(mean[:, :2], scan, sensor)
    # A target gets older while it is looked at: since any sensor did, or this one could have.
    aged = np.minimum(scan.time - tracks.looked.max(axis=1, initial=-np.inf), own_dt) * inside
    tracks = tracks._replace(aged=aged, existence=still_there(tracks.existence, aged, targets.lifetime_s))
    watched, rest = tracks.only(np.flatnonzero(inside)), tracks.only(np.flatnonzero(~inside))
    watched, seen, taken = _corrected(watched, seen, scan, sensors, targets)
    if sensor.bearings:
        return alive(both(watched, rest), targets), first
    new = (taken < TAKEN) & ~_on_a_known_one(seen.z, watched, targets)
    z, R, shared = (part[new] for part in seen)
    fresh = begin(z, R, scan.time, scan.platform, sensors, scan.sensor, targets, first, shared)
    everyone = both(both(watched, rest), fresh)
    everyone = without_doubles(alive(everyone, targets), targets, sensor.several)
    return judged_by_motion(everyone, scan.time, targets), first + int(new.sum())


def _corrected(
    tracks: Tracks, seen: Measured, scan: Scan, sensors: tuple[ManySensorModel, ...], targets: ManyTargetModel
) -> tuple[Tracks, Measured, Array]:
    """Tracks after the measurements, these with those of one hull merged, and how much of each is taken."""
    if not tracks.number:
        return tracks, seen, np.zeros(len(seen.z))
    sensor, errors = sensors[scan.sensor], seen.shared.shape[-1]
    own, shared = (own_columns(sensors, which, errors) for which in (scan.sensor, 0))
    offset, noise = near_side(tracks.x, scan.platform, sensor), hull_noise(tracks.x, sensor)
    compared, near, likely = _compared(tracks, offset, noise, seen, scan, sensor, targets.gate, own)
    largest = largest_of(targets.hulls)
    of_largest = tracks.kinds[:, largest] + np.finfo(float).tiny
    middle = np.einsum("tk,tki->ti", of_largest, tracks.x[:, largest, :2]) / of_largest.sum(axis=1)[:, None]
    established = (tracks.existence >= 0.5) | (tracks.hits >= 2)
    gathered = gather(*seen, middle, tracks.kinds, established, likely, sensor, targets.hulls)
    if len(gathered.z) != len(seen.z):
        seen = Measured(gathered.z, gathered.R, gathered.shared)
        compared, near, likely = _compared(tracks, offset, noise, seen, scan, sensor, targets.gate, own)
    kinds = gathered.kinds
    which = scan.sensor
    visible = visible_later(
        tracks.visible[:, which], scan.time - tracks.looked[:, which], targets.visible_s, targets.hidden_s
    )

    def probable(likely: Array) -> Array:
        likelihood = np.einsum("tk,tkm->tm", kinds, likely)
        pairs, none = weights(tracks.existence, visible, sensor.detection, likelihood, sensor.clutter)
        return association_probabilities(pairs, none)

    p = probable(likely)
    if shared.start and not sensor.bearings:
        common = compared._replace(G=compared.G[..., : shared.start])
        together, p = moved_together(common, near, kinds, p, targets.gate, probable)
        compared = compared._replace(likelihood=together.likelihood)
    existence, visible, taken = after_scan(tracks.existence, visible, sensor.detection, p)
    mine = np.where(near >= 0, np.take_along_axis(taken, near + 1, axis=1), 0.0)
    if sensor.bearings:
        # Nobody knows where a camera looked that only tells bearings: what it did not see may be there.
        existence, visible = tracks.existence, tracks.visible[:, which]
    own_here = np.concatenate([taken[:, :1], mine], axis=1)
    x, P, kinds, C = update(tracks.x, tracks.P, kinds, own_here, compared, tracks.C)
    kinds = at_least(kinds, LEAST_KIND)
    hit = (taken[:, 1:].sum(axis=1) > 0.5) & (not sensor.bearings)
    all_visible, looked = tracks.visible.copy(), tracks.looked.copy()
    all_visible[:, which], looked[:, which] = visible, scan.time
    existence, hits = np.minimum(existence, CERTAIN), tracks.hits + hit
    place = np.einsum("tk,tki->ti", kinds / kinds.sum(axis=1, keepdims=True), x)
    trail = tuple(
        np.concatenate([old, [[scan.time, *place[row, :2]]]]) if hit[row] else old
        for row, old in enumerate(tracks.trail)
    )
    tracks = tracks._replace(
        x=x,
        P=P,
        C=C,
        kinds=kinds / kinds.sum(axis=1, keepdims=True),
        existence=existence,
        visible=all_visible,
        looked=looked,
        hits=hits,
        last=np.where(hit, scan.time, tracks.last),
        by=np.where(hit, which, tracks.by),
        confirmed=tracks.confirmed | ((existence > targets.confirmed) & (hits >= targets.hits)),
        trail=trail,
    )
    return tracks, seen, p[:, 1:].sum(axis=0)


def _compared(
    tracks: Tracks,
    offset: Array,
    noise: Array,
    seen: Measured,
    scan: Scan,
    sensor: ManySensorModel,
    gate: float,
    own: slice,
) -> tuple[Compared, NDArray[np.intp], Array]:
    """Every track beside the G measurements that may lie in its gate: of thousands in a scan it is few.

    Returns
    -------
    What is compared, (T, G) which measurements these are, -1 none, and (T, K, M) likelihoods of all.
    """
    z, R, shared = seen
    T, K, M = tracks.number, tracks.x.shape[1], len(z)
    if sensor.bearings:
        found = compare_bearings(tracks.x, tracks.P, noise, scan.platform, z, R, gate, tracks.C)
        return found, np.tile(np.arange(M), (T, 1)), found.likelihood
    if not M:
        nothing = compare(tracks.x, tracks.P, offset, noise, z, R, gate, tracks.C, shared)
        return nothing, np.zeros((T, 0), np.intp), np.zeros((T, K, 0))
    spread = np.trace(tracks.P[..., :2, :2] + noise, axis1=-2, axis2=-1).max(axis=1)
    # Of what track and scan have in common no more than twice the sum of both can be in an innovation.
    common = 2 if sensor.correlation or shared.any() else 1
    noises = np.trace(R, axis1=-2, axis2=-1) + (shared**2).sum(axis=(-2, -1))
    widest = gate * np.sqrt(common * (spread + noises.max()))
    expected = tracks.x[..., :2] + offset
    middle = expected.mean(axis=1)
    widest += np.linalg.norm(expected - middle[:, None], axis=2).max(axis=1)
    within = cKDTree(z).query_ball_point(middle, widest, return_sorted=True)
    near = np.full((T, max(map(len, within))), -1, np.intp)
    for row, rows in enumerate(within):
        near[row, : len(rows)] = rows
    compared = compare(
        tracks.x, tracks.P, offset, noise, z[near], R[near], gate, tracks.C, shared[near], sensor.correlation,
        own,
    )  # fmt: skip
    compared = compared._replace(likelihood=np.where((near >= 0)[:, None], compared.likelihood, 0.0))
    return compared, near, of_all(compared.likelihood, near, M)


def _within_reach(scan: Scan, sensor: ManySensorModel, errors: int) -> Measured:
    size = 1 if sensor.bearings else 2
    z, R = np.asarray(scan.z, float).reshape(-1, size), np.asarray(scan.R, float).reshape(-1, size, size)
    if sensor.bearings:
        good = np.isfinite(z[:, 0])
    else:
        good = in_reach(z, scan.platform, sensor.near_m, sensor.far_m)
    shared = np.zeros((len(z), size, errors))
    if scan.shared is not None:
        shared[..., : scan.shared.shape[-1]] = scan.shared
    return Measured(z[good], R[good], shared[good])


def in_reach(z: Array, platform: Array, near_m: float, far_m: float) -> NDArray[np.bool_]:
    """Which of (M, 2) places lie between two distances from the platform; none that is not finite."""
    distance = np.linalg.norm(z - platform, axis=1)
    return np.asarray((distance > near_m) & (distance < far_m))


def _sees(places: Array, scan: Scan, sensor: ManySensorModel) -> NDArray[np.bool_]:
    """(N,) places that are looked at: others are not missed."""
    near = np.asarray(np.linalg.norm(places - scan.platform, axis=1) < sensor.far_m)
    return near if scan.sees is None else near & scan.sees(places)


def _on_a_known_one(z: Array, tracks: Tracks, targets: ManyTargetModel) -> NDArray[np.bool_]:
    """(M,) measurements on a confirmed target's hull: parts of it, and no targets of their own."""
    sure = np.flatnonzero(tracks.confirmed)
    if not len(sure) or not len(z):
        return np.zeros(len(z), bool)
    mean, _ = tracks.estimate()
    length = tracks.kinds[sure] @ np.array([hull.length_m for hull in targets.hulls])
    apart = np.linalg.norm(z[:, None] - mean[sure, :2][None], axis=2)
    return np.asarray((apart < np.maximum(0.7 * length, targets.apart_m)).any(axis=1))


def _shown(
    tracks: Tracks, scan: Scan, sensors: tuple[ManySensorModel, ...], targets: ManyTargetModel
) -> Shown:
    believed = tracks.confirmed & (tracks.moving | (targets.moves_m <= 0))
    return _present(tracks.only(np.flatnonzero(believed)), scan, sensors, targets)


def _present(
    tracks: Tracks,
    scan: Scan,
    sensors: tuple[ManySensorModel, ...],
    targets: ManyTargetModel,
    shares: Array | None = None,
) -> Shown:
    """Those that exist within any sensor's reach and were seen not long ago; ``shares`` as of `Tracks`."""
    x, P = tracks.estimate(shares)
    near = np.linalg.norm(x[:, :2] - scan.platform, axis=1) < max(sensor.far_m for sensor in sensors)
    recent = scan.time - tracks.last < np.array([one.patience_s for one in sensors])[tracks.by]
    rows = np.flatnonzero(near & recent & (tracks.existence > targets.shown))
    parts = (part[rows] for part in (x, P, tracks.existence, tracks.kinds))
    return Shown(scan.time, scan.sensor, tracks.identity[rows], *parts)


def smooth_many(
    scans: Sequence[Scan],
    sensors: Sequence[ManySensorModel],
    targets: ManyTargetModel,
    lasting_s: Sequence[float] = (),
) -> tuple[list[Shown], list[Shown]]:
    """Follow all targets, and go back over them once all scans are known.

    A track that was ever shown is a trajectory, from the measurement that it began with: its estimates by
    Rauch, Tung and Striebel (`wildlab.tracking.run`) for each kind of hull by itself, its existence by the
    chain in which what is gone does not come back. It ends where it no longer exists in that light.

    A scan makes kinds probable by how far measurements scatter, which says nothing of errors that last:
    smoothed covariances take kinds to be as frequent as they are in general.

    Parameters
    ----------
    scans, sensors, targets, lasting_s
        As in `run_many`.

    Returns
    -------
    filtered, smoothed
        What was believed after each scan, as of `run_many`, and what is believed in the end.
    """
    order, eyes = sorted(scans, key=lambda one: one.time), tuple(sensors)
    steps = list(follow_many(order, eyes, targets, lasting_s))
    filtered = [shown for _, shown in steps]
    believed = list({int(one) for shown in filtered for one in shown.identity})
    errors, shares = (*lasting_s, *own_lasting(eyes)), np.array([one.share for one in targets.hulls])
    smoothed: list[Shown] = []
    time, ahead = 0.0, None
    for scan, (tracks, _) in zip(reversed(order), reversed(steps), strict=True):
        here = tracks.only(np.flatnonzero(np.isin(tracks.identity, believed)))
        later = begin_back(here.x, here.P, len(errors))
        final = here if ahead is None else _back(here, later, *ahead, time - scan.time, targets, errors)
        time, ahead = scan.time, (here, later, final)
        smoothed.append(_present(final, scan, eyes, targets, shares / shares.sum()))
    return filtered, smoothed[::-1]


def _back(
    here: Tracks,
    later: Later,
    ahead: Tracks,
    after: Later,
    final: Tracks,
    dt: float,
    targets: ManyTargetModel,
    errors: Sequence[float],
) -> Tracks:
    """The tracks of a scan in the light of the next one, ``ahead`` as filtered and ``final`` as smoothed.

    Those that the next scan does not have any more stay as they are. ``later`` and ``after`` are of this scan
    and the next; the first is filled.
    """
    _, mine, its = np.intersect1d(here.identity, ahead.identity, return_indices=True)
    old, new, known = here.only(mine), ahead.only(its), final.only(its)
    unit, psi = np.eye(len(errors)), np.diag([fade(dt, one) for one in errors])
    stepped = step_back(
        Later(*(part[its] for part in after)),
        old.x,
        (old.P, old.C, unit),
        (new.P, new.C, unit),
        *white_acceleration(dt, targets.density),
        psi,
    )
    lasts = still_there(1.0, new.aged, targets.lifetime_s)
    # Of one that does not exist at the next scan: that it did before, and ended.
    ended = old.existence * (1 - lasts) / (1 - old.existence * lasts)
    ended = known.existence + (1 - known.existence) * ended
    x, P, existence, last, by = later.x, later.P, here.existence.copy(), here.last.copy(), here.by.copy()
    found = (*later, existence, last, by)
    for part, value in zip(found, (*stepped, ended, known.last, known.by), strict=True):
        part[mine] = value
    return here._replace(x=x, P=P, existence=existence, last=last, by=by)
