"""How tracks that carry identities compare with true targets over many scans: who follows whom, and how long.

At every scan the tracks that are *confirmed* are held against the targets that exist. A target is of one of
three kinds at a scan:

- **visible**: it could be seen. Without a track it is missed.
- **not visible**: nobody asks for a track of it, and one that is there costs nothing; who follows it is
  remembered, so that a track that comes back as another one is found out.
- **don't-care**: as not visible, and neither swaps, breaks nor NEES are taken from it.

`gospa` tells how far a set of estimates is from the true targets, when their number may be wrong.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import nees

Array = NDArray[np.float64]
#: Row of an estimate and row of the target it follows.
Pairs = list[tuple[int, int]]


class Moment(NamedTuple):
    """Tracks and targets at one moment, positions in one frame and unit (m).

    Attributes
    ----------
    time
        Seconds.
    positions, covariances
        Of the tracks, (N, k) and (N, k, k); a covariance of NaN is one that is not known.
    identities
        (N,), which track each is; none twice.
    truth
        Of the targets, (M, k).
    names
        (M,), which target each is; none twice.
    visible
        (M,) bools: whether it could be seen.
    ignored
        (M,) bools: whether it is don't-care.
    complete
        Whether all targets are among these. Where not, a track on none of them may be on another one: it is
        not judged at this scan.
    truth_sd
        (M,) how well each of these places is known, standard deviation of each axis; one number for all. The
        NEES has it beside a track's own covariance.
    """

    time: float
    positions: Array
    covariances: Array
    identities: Sequence[Hashable]
    truth: Array
    names: Sequence[Hashable]
    visible: NDArray[np.bool_]
    ignored: NDArray[np.bool_]
    complete: bool = True
    truth_sd: Array | float = 0.0


class TargetLife(NamedTuple):
    """What became of one target.

    Attributes
    ----------
    visible
        Scans at which it was visible, and not don't-care.
    tracked
        Share of these with a track on it; NaN where there are none.
    time_to_confirm
        From the first of these to the first scan from then on with a track on it, s; NaN if there is none.
    swaps, breaks
        As in `Identities`, on this target.
    """

    visible: int
    tracked: float
    time_to_confirm: float
    swaps: int
    breaks: int


class TrackLife(NamedTuple):
    """What became of one track.

    Attributes
    ----------
    scans
        At which it was there, of those that are complete.
    on_target
        Of them, those at which it followed a target, of any kind.
    anees
        Mean over the scans on a target that is not don't-care of the NEES of its position, not divided by
        its degrees of freedom: k where it is consistent; NaN where none is known.
    false
        Whether it was on no target at more than half of its scans.
    compared
        How many NEES are in their mean.
    anees_alone
        Their mean with the truth taken for exact.
    """

    scans: int
    on_target: int
    anees: float
    false: bool
    compared: int = 0
    anees_alone: float = np.nan


class Identities(NamedTuple):
    """Tracks against targets over all scans.

    Attributes
    ----------
    gospa
        One for each scan.
    followed
        One for each scan: by the target's name, which track is on it.
    swaps
        Times a track is on another target than the last one it was on. Two tracks that exchange their
        targets are two swaps; one that goes to a target that had none is one.
    breaks
        Times a target's track is another one than its last, without the swaps: the new one was on no other
        target before, or comes back.
    false_tracks_per_minute
        Tracks that are false, over the minutes of the scans that are complete; NaN where no time passes.
    targets, tracks
        By name and by identity, in the order of their first scan.
    """

    gospa: list[Gospa]
    followed: list[dict[Hashable, Hashable]]
    swaps: int
    breaks: int
    false_tracks_per_minute: float
    targets: dict[Hashable, TargetLife]
    tracks: dict[Hashable, TrackLife]


def compare_identities(scans: Sequence[Moment], cutoff: float) -> Identities:
    """What became of tracks and targets over scans in the order of time.

    Who follows whom is settled with the memory of CLEAR MOT (Bernardin and Stiefelhagen 2008), for a moment's
    noise beside another target is no swap: GOSPA's assignment, in which the last pair of a track costs less
    by the square of half of the cut-off. So two tracks that exchange their targets swap at the scan
    at which these are half the cut-off apart, and never while they are nearer. CLEAR MOT keeps a pair up to
    the cut-off itself, also where the track is on another target by then, whose own track is left with what
    remains; GOSPA has no memory.

    Parameters
    ----------
    scans
        Of confirmed tracks alone, times not falling.
    cutoff
        Distance from which a track does not follow a target, in the unit of the positions.

    Returns
    -------
    Identities

    Raises
    ------
    WildlabError
        If there are no scans, or their times fall, or as `gospa`.

    Examples
    --------
    Two targets cross, and their tracks are exchanged:

    >>> def scan(t, a, b):
    ...     truth, seen, ignored = [[t], [9 - t]], [True, True], [False, False]
    ...     return Moment(t, [[a], [b]], np.ones((2, 1, 1)), [7, 8], truth, "AB", seen, ignored)
    >>> found = compare_identities([scan(t, min(t, 9 - t), max(t, 9 - t)) for t in range(10)], 3)
    >>> found.swaps, found.breaks, sorted(found.followed[-1].items())
    (2, 0, [('A', 8), ('B', 7)])
    """
    given = [_arrays(scan) for scan in scans]
    times = np.array([one.time for one in given])
    if not len(given) or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise WildlabError(
            "the scans are none, or not in the order of time", "give them by rising time", field="scans"
        )
    pairs: list[Pairs] = []
    before: dict[Hashable, Hashable] = {}
    for one in given:
        found = _follow(one, before, cutoff)
        pairs.append(found)
        before |= {one.identities[row]: one.names[column] for row, column in found}
    swaps, breaks = _changes(given, pairs)
    tracks = _track_lives(given, pairs)
    # Each scan has half of the time to either neighbour.
    shares = (np.diff(times, prepend=times[0]) + np.diff(times, append=times[-1])) / 2
    minutes = float(shares[[one.complete for one in given]].sum()) / 60
    n_false = sum(track.false for track in tracks.values())
    return Identities(
        [_gospa(one, cutoff) for one in given],
        [
            {one.names[column]: one.identities[row] for row, column in found}
            for one, found in zip(given, pairs, strict=True)
        ],
        sum(swaps.values()),
        sum(breaks.values()),
        n_false / minutes if minutes > 0 else np.nan,
        _target_lives(given, pairs, swaps, breaks),
        tracks,
    )


def _arrays(scan: Moment) -> Moment:
    x, truth = (np.asarray(points, float) for points in (scan.positions, scan.truth))
    size = max(points.shape[1] if points.ndim == 2 else 0 for points in (x, truth))
    x, truth = (points.reshape(0, size) if points.size == 0 else points for points in (x, truth))
    P = np.asarray(scan.covariances, float)
    P = P.reshape(0, size, size) if P.size == 0 else P
    visible, ignored = (np.asarray(flags, bool) for flags in (scan.visible, scan.ignored))
    return scan._replace(
        positions=x, covariances=P, truth=truth, visible=visible, ignored=ignored,
        truth_sd=np.broadcast_to(np.asarray(scan.truth_sd, float), (len(truth),)),
    )  # fmt: skip


def _gospa(one: Moment, cutoff: float) -> Gospa:
    """GOSPA of one scan, in which tracks on targets that nobody asks for cost nothing.

    The tracks are assigned to all targets as in `gospa`. Those on targets that are not visible or don't-care
    then leave with them, and such targets without a track leave too; what remains is assigned best as it is.
    A target takes one track: a second one beside a don't-care target is a false one.
    """
    asked = one.visible & ~one.ignored
    on = dict(_assign(one.positions, one.truth, cutoff))
    excused = {row for row, column in on.items() if not asked[column]}
    if not one.complete:
        excused |= set(range(len(one.positions))) - set(on)
    kept = [row for row in range(len(one.positions)) if row not in excused]
    return gospa(one.truth[asked], one.positions[kept], cutoff)


def _assign(x: Array, truth: Array, cutoff: float, kept: NDArray[np.bool_] | None = None) -> Pairs:
    """GOSPA's pairs: of those nearer than the cut-off, what costs least; ``kept`` (N, M) costs less."""
    if not (len(x) and len(truth)):
        return []
    cost = np.minimum(cdist(x, truth), cutoff) ** 2
    near = cost < cutoff**2
    if kept is not None:
        cost = cost - np.where(kept & near, (cutoff / 2) ** 2, 0.0)
    rows, columns = linear_sum_assignment(cost)
    made = near[rows, columns]
    return list(zip(rows[made].tolist(), columns[made].tolist(), strict=True))


def _follow(one: Moment, before: dict[Hashable, Hashable], cutoff: float) -> Pairs:
    """The best pairs, the last one of each track being worth more."""
    kept = np.zeros((len(one.positions), len(one.truth)), bool)
    for row, identity in enumerate(one.identities):
        if identity in before:
            kept[row] = [name == before[identity] for name in one.names]
    return sorted(_assign(one.positions, one.truth, cutoff, kept))


def _changes(
    given: Sequence[Moment], pairs: Sequence[Pairs]
) -> tuple[dict[Hashable, int], dict[Hashable, int]]:
    """Swaps and breaks by target."""
    names = [name for one in given for name in one.names]
    swaps: dict[Hashable, int] = dict.fromkeys(names, 0)
    breaks: dict[Hashable, int] = dict.fromkeys(names, 0)
    last_target: dict[Hashable, Hashable] = {}
    last_track: dict[Hashable, Hashable] = {}
    for one, found in zip(given, pairs, strict=True):
        for row, column in found:
            if one.ignored[column]:
                continue
            identity, name = one.identities[row], one.names[column]
            if last_target.get(identity, name) != name:
                swaps[name] += 1
            elif last_track.get(name, identity) != identity:
                breaks[name] += 1
            last_target[identity], last_track[name] = name, identity
    return swaps, breaks


def _target_lives(
    given: Sequence[Moment],
    pairs: Sequence[Pairs],
    swaps: dict[Hashable, int],
    breaks: dict[Hashable, int],
) -> dict[Hashable, TargetLife]:
    first: dict[Hashable, float] = {}
    confirmed: dict[Hashable, float] = {}
    seen, had = dict.fromkeys(swaps, 0), dict.fromkeys(swaps, 0)
    for one, found in zip(given, pairs, strict=True):
        with_track = {column for _, column in found}
        for column, name in enumerate(one.names):
            asked = bool(one.visible[column] and not one.ignored[column])
            if asked:
                first.setdefault(name, one.time)
                seen[name] += 1
                had[name] += column in with_track
            if name in first and column in with_track and not one.ignored[column]:
                confirmed.setdefault(name, one.time)
    return {
        name: TargetLife(
            seen[name],
            had[name] / seen[name] if seen[name] else np.nan,
            confirmed[name] - first[name] if name in confirmed else np.nan,
            swaps[name],
            breaks[name],
        )
        for name in swaps
    }


def _track_lives(given: Sequence[Moment], pairs: Sequence[Pairs]) -> dict[Hashable, TrackLife]:
    scans: dict[Hashable, int] = {}
    on: dict[Hashable, int] = {}
    errors: dict[Hashable, list[tuple[Array, Array, Array]]] = {}
    for one, found in zip(given, pairs, strict=True):
        for identity in one.identities:
            scans[identity] = scans.get(identity, 0) + one.complete
        for row, column in found:
            identity = one.identities[row]
            on[identity] = on.get(identity, 0) + one.complete
            if not one.ignored[column]:
                error = one.truth[column] - one.positions[row]
                own = np.take(one.truth_sd, column) ** 2 * np.eye(len(error))
                errors.setdefault(identity, []).append((error, one.covariances[row], own))
    lives = {}
    for identity, count in scans.items():
        values, alone = _nees_of(errors.get(identity, []))
        own = on.get(identity, 0)
        lives[identity] = TrackLife(count, own, _mean(values), 2 * own < count, len(values), _mean(alone))
    return lives


def _nees_of(errors: Sequence[tuple[Array, Array, Array]]) -> tuple[Array, Array]:
    """NEES that are known, with the truth's own error and without."""
    if not errors:
        return np.empty(0), np.empty(0)
    error, P, own = (np.array(part) for part in zip(*errors, strict=True))
    both = np.array([nees(error, P + own), nees(error, P)])
    with_truth, alone = both[:, np.isfinite(both).all(axis=0)]
    return with_truth, alone


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else np.nan


class Gospa(NamedTuple):
    """``distance ** p == localisation ** p + missed ** p + false ** p``, all in the unit of the points.

    ``n_missed`` true targets have no estimate nearer than the cut-off, ``n_false`` estimates no target.
    """

    distance: float
    localisation: float
    missed: float
    false: float
    n_missed: int
    n_false: int


def gospa(truth: ArrayLike, estimates: ArrayLike, cutoff: float) -> Gospa:
    """Generalised OSPA (Rahmathullah, Garcia-Fernandez and Svensson 2017) of order 2 with alpha = 2.

    A sum over the targets, not a mean; with alpha = 2 it falls into localisation, missed and false targets. A
    pair as far apart as ``cutoff``, or further, is not a pair: it is a missed target and a false one.

    Parameters
    ----------
    truth, estimates
        (M, k) and (N, k), in one unit; either may be empty.
    cutoff
        Distance from which a target counts as missed and an estimate as false, in that unit; of its square
        each costs half.

    Returns
    -------
    Gospa
        All zero where both sets are empty.

    Raises
    ------
    WildlabError
        If the cut-off is not positive.
    """
    if not 0 < cutoff < np.inf:
        raise WildlabError(f"a cut-off of {cutoff:g} makes no metric", "give a positive one")
    x, y = (np.asarray(points, float) for points in (truth, estimates))
    cost = np.minimum(cdist(x, y), cutoff) ** 2 if len(x) and len(y) else np.empty((len(x), len(y)))
    rows, columns = linear_sum_assignment(cost)
    # A pair at the cut-off costs as much as the two left alone: it counts as left alone.
    paired = cost[rows, columns] < cutoff**2
    near = float(cost[rows, columns][paired].sum())
    n_missed, n_false = (size - int(paired.sum()) for size in cost.shape)
    missed, false = (n * cutoff**2 / 2 for n in (n_missed, n_false))
    whole, *parts = (part**0.5 for part in (near + missed + false, near, missed, false))
    return Gospa(whole, parts[0], parts[1], parts[2], n_missed, n_false)
