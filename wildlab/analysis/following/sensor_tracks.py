"""Targets followed by each sensor of a platform on its own: a flight in, a table out.

Every filter of a target gets the same detections: those that the filter with white noise let into its gate,
nearest first. What differs is what they believe of the errors, see `wildlab.analysis.following.filters`.

Detections that name their target are its own. Where none does, a track starts on the first detection near the
target's true position, and nearer to it than to another target; from there on the truth is not looked at.
Without truth all are of one target, whose track starts on the first. A track ends where nothing falls into
its gate for as long as its patience lasts; and where it is too uncertain for a linearisation: then the next
detection starts another in the same way, see `wildlab.analysis.following.reinitialisation`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.following.expected import errors_near
from wildlab.analysis.following.filters import choose, follow_with
from wildlab.analysis.following.initiation import start_first, start_near
from wildlab.analysis.following.noise_model import NoiseModel, TargetModel, from_tuning
from wildlab.analysis.following.reinitialisation import (
    Piece,
    begun_of,
    ends_of,
    joined,
    one_after_another,
    part_of,
    starts_of,
    truth_of,
)
from wildlab.analysis.following.sensor_tuning import SensorTuning
from wildlab.analysis.scans import Scans, Truth, scans_of, truths_at
from wildlab.evaluation.consistency import average, chi_square_interval, position_nees, share_inside
from wildlab.evaluation.track_errors import summarise_track, track_errors
from wildlab.evaluation.whiteness import autocorrelation, effective_sample_size
from wildlab.flight.store import Flight
from wildlab.tracking.records import Start, Track

Array = NDArray[np.float64]

#: The filters that a study holds against each other, by kind of detection.
FILTERS = {
    "position": ("kf", "coloured", "schmidt", "thinned"),
    "bearing": ("ekf", "schmidt", "thinned"),
}
#: The filter that the others are held against, by kind of detection.
WHITE = {kind: names[0] for kind, names in FILTERS.items()}


class SensorTrack(NamedTuple):
    """One target followed by one filter.

    Row by row of the scans: ``estimate`` (N, 4) north, east, velocities, NaN without a track; ``error``
    (N, 4) truth minus estimate and ``nees`` (N,) of the position, NaN without truth too; ``innovation``
    (N, m) and ``nis`` (N,) of the detections used, NaN elsewhere. ``known`` (N,): where there is truth.
    ``near`` (N,): where the sensor saw something within reach of the target's true place, or its label.
    ``covariance`` (N, 4, 4) of the estimate, ``S`` (N, m, m) of the innovation, ``detection`` (N,) the name
    of the one that was used, "" none. ``sizes`` (N,) how many elements its detection has, where looks are of
    several sensors. ``starts`` (T,) the looks at which a track of the target starts, and ``last``, at which
    the last of them is over.
    """

    sensor: str
    target: str
    filter: str
    times: Array
    estimate: Array
    error: Array
    nees: Array
    innovation: Array
    nis: Array
    known: NDArray[np.bool_]
    near: NDArray[np.bool_]
    covariance: Array = np.empty((0, 4, 4))
    S: Array = np.empty((0, 0, 0))
    detection: NDArray[np.object_] = np.empty(0, object)
    sizes: NDArray[np.int64] = np.empty(0, np.int64)
    starts: NDArray[np.int64] = np.empty(0, np.int64)
    last: int = 0

    @property
    def without(self) -> NDArray[np.bool_]:
        """(N,) looks at which there is no track, from the first start to where the last track ends."""
        gone: NDArray[np.bool_] = np.asarray(~np.isfinite(self.estimate).all(axis=1))
        gone[self.last :] = False
        gone[: self.starts[0] if len(self.starts) else None] = False
        return gone

    @property
    def dof(self) -> float:
        """Elements of a detection used, on average: what the mean NIS should be."""
        m = self.innovation.shape[1]
        used = np.isfinite(self.nis)
        return float(self.sizes[used].mean()) if len(self.sizes) and used.any() else float(m)


def follow_flight(
    flight: Flight, tunings: Mapping[str, SensorTuning], targets: TargetModel
) -> list[SensorTrack]:
    """Every target with truth, by every sensor that has a tuning, with every filter of a study.

    A target that a sensor never saw near its true place has no track: all rows are NaN.

    Raises
    ------
    WildlabError
        Where the flight lacks a sensor, poses or truth.
    """
    found = []
    for sensor, tuning in tunings.items():
        scans = scans_of(flight, sensor, tuning.offset_s)
        truths = truths_at(flight, scans.times)
        for truth in truths:
            others = [one for one in truths if one.target != truth.target]
            found += follow(scans, truth, from_tuning(tuning), targets, FILTERS[scans.kind], others)
    return found


def follow(
    scans: Scans,
    truth: Truth,
    beliefs: NoiseModel,
    targets: TargetModel,
    filters: Sequence[str],
    others: Sequence[Truth] = (),
) -> list[SensorTrack]:
    """One target by one sensor, with each of the filters.

    Parameters
    ----------
    truth
        Of the target; its positions may all be NaN, where it is not known.
    others
        Targets not to start on.

    Raises
    ------
    WildlabError
        Where the detections cannot go through one of the filters.
    """
    seen, pieces, first = choose_in_pieces(scans, truth, beliefs, targets, others)
    if first is None:
        return [no_track(scans, truth, name, targets) for name in filters]
    # From here on one detection a scan: the same for all.
    rows = np.arange(len(seen))
    chosen = first.chosen.copy()
    for row in [piece.first + piece.begin.row for piece in pieces if piece.begin.row >= 0]:
        chosen[row] = int(np.argmax(np.isfinite(seen[row]).all(axis=-1)))
    own = np.where(first.used[:, None], seen[rows, np.maximum(chosen, 0)], np.nan)
    ids = np.where(first.used, scans.ids[rows, np.maximum(chosen, 0)], "")
    # What names its target finds it again, however long that was out of view.
    patience = np.inf if scans.labelled else targets.patience_s
    last = last_row(scans.times, first.used, pieces[0].begin.time, patience, targets.patience_s)
    last = min(last, pieces[-1].last)
    first, own = ended(first, own, last)
    begun, starts = begun_of(scans.times, pieces), starts_of(scans.times, pieces)
    found = []
    for name in filters:
        filtered = "ekf" if name == "kf" else name
        tracks = [
            follow_with(
                filtered, part_of(scans, one.rows), own[one.rows],
                Track._make(part[one.rows] for part in first), beliefs, targets, one.begin,
            )
            for one in pieces
        ]  # fmt: skip
        track = scored(scans, truth, name, joined(tracks, pieces, len(seen)), begun, last, targets, ids)
        found.append(track._replace(starts=starts[starts < last], last=last))
    return found


def choose_in_pieces(
    scans: Scans,
    truth: Truth,
    beliefs: NoiseModel,
    targets: TargetModel,
    others: Sequence[Truth] = (),
) -> tuple[Array, list[Piece], Track | None]:
    """The filter with white noise, which chooses detections and says when a track ends.

    Returns
    -------
    Detections (N, K, m) that may be of the target; the tracks' looks, and all tracks as one: none and None
    where nothing starts one.
    """
    count = len(scans.times)
    seen, begin = begin_of_target(scans, truth, beliefs, targets, others)
    if begin is None:
        return seen, [], None

    def choose_from(at: int, start: Start) -> Track:
        rows = slice(at, count)
        part = part_of(scans, rows)
        ends = ends_of(part, seen[rows], beliefs)
        # What names its target needs no gate to be told apart.
        return choose(part, seen[rows], beliefs, targets, start, gate=not scans.labelled, ends=ends)

    def again(at: int) -> Start | None:
        rows = slice(at, count)
        rivals = [truth_of(one, rows) for one in others]
        return begin_of_target(part_of(scans, rows), truth_of(truth, rows), beliefs, targets, rivals)[1]

    return seen, *one_after_another(begin, count, choose_from, again)


def begin_of_target(
    scans: Scans,
    truth: Truth,
    beliefs: NoiseModel,
    targets: TargetModel,
    others: Sequence[Truth] = (),
) -> tuple[Array, Start | None]:
    """Detections (N, K, m) that may be of a target, and where its track starts, see the module."""
    usable = np.asarray(np.isfinite(scans.platform).all(axis=1))
    seen = np.where(usable[:, None, None], scans.detections, np.nan)
    if not scans.labelled and np.isfinite(truth.position).any():
        return seen, start_near(scans, truth, beliefs, targets, others)
    if scans.labelled:
        seen = np.where((scans.labels == truth.target)[..., None], seen, np.nan)
    mine = np.asarray(np.isfinite(seen).all(axis=-1))
    any_of = np.asarray(mine.any(axis=1))
    own = np.where(any_of[:, None], seen[np.arange(len(seen)), np.argmax(mine, axis=1)], np.nan)
    return seen, start_first(scans, own, beliefs, targets)


def last_row(
    times: Array, used: NDArray[np.bool_], start: float, patience: float, after: float | None = None
) -> int:
    """The first row that has a track no more: ``after`` s behind the last one used before a longer pause."""
    hits = np.concatenate([[start], times[used]])
    pauses = np.flatnonzero(np.diff(hits) > patience)
    end = hits[pauses[0]] if len(pauses) else hits[-1]
    return int(np.searchsorted(times, end + (patience if after is None else after), side="right"))


def ended(first: Track, own: Array, last: int) -> tuple[Track, Array]:
    """The track and its detections (N, m) up to its end: what the filter took in behind it is of no track,
    and a smoother must not know it."""
    x, P, kept = first.x.copy(), first.P.copy(), own.copy()
    x[last:], P[last:], kept[last:] = np.nan, np.nan, np.nan
    return first._replace(x=x, P=P), kept


def scored(
    scans: Scans,
    truth: Truth,
    name: str,
    track: Track,
    begun: NDArray[np.bool_],
    last: int,
    targets: TargetModel,
    ids: NDArray[np.object_],
) -> SensorTrack:
    """A filter's track as far as it goes, beside the truth; ``begun`` (N,) and before ``last``."""
    x, innovation, nis = track.x.copy(), track.innovation.copy(), track.nis.copy()
    P, S = track.P.copy(), track.S.copy()
    x[last:], P[last:] = np.nan, np.nan
    # The first detection is where the track was put: it surprises nobody.
    off = ~(track.used & begun)
    off[last:] = True
    innovation[off], nis[off], S[off] = np.nan, np.nan, np.nan
    where = np.column_stack([truth.position, truth.velocity])
    error = np.where(np.isfinite(x), where - x, np.nan)
    nees = position_nees(error[:, :2], track.P[:, :2, :2], truth.covariance)
    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    near = errors_near(scans, truth, targets.reach(scans.kind))[1] >= 0
    names = np.where(track.used, ids, "")
    names[last:] = ""
    return SensorTrack(
        scans.sensor, truth.target, name, scans.times, x, error, nees, innovation, nis, known, near, P, S,
        names,
    )  # fmt: skip


def no_track(scans: Scans, truth: Truth, name: str, targets: TargetModel) -> SensorTrack:
    """Of a target that was never found."""
    n, m = len(scans.times), scans.detections.shape[-1]
    empty = np.full((n, 4), np.nan)
    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    nan, near = np.full(n, np.nan), errors_near(scans, truth, targets.reach(scans.kind))[1] >= 0
    unused = np.full((n, m), np.nan)
    return SensorTrack(
        scans.sensor, truth.target, name, scans.times, empty, empty, nan, unused, nan, known, near,
        np.full((n, 4, 4), np.nan), np.full((n, m, m), np.nan), np.full(n, "", object),
    )  # fmt: skip


#: Numbers of a row of `table`, with their units.
COLUMNS = {
    "rmse": "m",
    "mae": "m",
    "anees": "1",
    "anees_alone": "1",
    "anis": "1",
    "lag1_autocorrelation_north": "1",
    "lag1_autocorrelation_east": "1",
    "lag1_autocorrelation": "1",
    "fraction_nees_inside": "1",
    "share_followed": "1",
    "share_with_target": "1",
}


def table(followed: Sequence[SensorTrack], size_m: float = float("nan")) -> pd.DataFrame:
    """One row for each track, its columns those of `COLUMNS` and:

    ``sensor``, ``kind``, ``target``, ``filter``; ``detections`` used; ``compared``, scans with a track and
    truth; ``nees_low`` and ``nees_high``, the 95 % interval of the mean NEES of a consistent filter, for as
    many values as the correlated ones are worth; ``nis_low`` and ``nis_high`` likewise. ``anees`` is of the
    position, 2 is right, with the truth's own error where it is stated, and ``anees_alone`` with the truth
    taken for exact; ``anis`` is of the detections that were let in, 2 or 1 is right, by the elements of
    a measurement. ``share_followed``: of the scans with truth, those that have a track. ``seen``: scans in
    which the sensor saw something near the target's true place, and ``share_with_target``: in how many of
    them a track is nearer to it than ``size_m``; NaN where that is.
    """
    return pd.DataFrame([_row(one, size_m) for one in followed])


def _row(one: SensorTrack, size_m: float) -> dict[str, object]:
    summary = summarise_track(track_errors(one.estimate + one.error, one.estimate))
    m = one.innovation.shape[1]
    used = one.innovation[np.isfinite(one.nis)]
    lag1 = [_lag1(column) for column in used.T]
    nees, nis = average(one.nees, 2, _worth(one.nees)), average(one.nis, m, _worth(one.nis))
    alone = position_nees(one.error[:, :2], one.covariance[:, :2, :2])
    on = np.isfinite(one.error[:, 0])
    there = np.hypot(*one.error[:, :2].T) < size_m  # NaN, where there is no track, is not there
    return {
        "sensor": one.sensor,
        "kind": "position" if m == 2 else "bearing",
        "target": one.target,
        "filter": one.filter,
        "detections": len(used),
        "compared": summary.n,
        "rmse": summary.rmse,
        "mae": summary.mae,
        "anees": nees.mean,
        "anees_alone": average(alone, 2, _worth(alone)).mean,
        "nees_low": nees.low,
        "nees_high": nees.high,
        "anis": nis.mean,
        "nis_low": nis.low,
        "nis_high": nis.high,
        "lag1_autocorrelation_north": lag1[0] if m == 2 else np.nan,
        "lag1_autocorrelation_east": lag1[1] if m == 2 else np.nan,
        "lag1_autocorrelation": lag1[0] if m == 1 else np.nan,
        "fraction_nees_inside": share_inside(one.nees, chi_square_interval(2)),
        "share_followed": float(on.sum() / one.known.sum()) if one.known.any() else np.nan,
        "seen": int(one.near.sum()),
        "share_with_target": float(there[one.near].mean()) if one.near.any() and size_m > 0 else np.nan,
    }


def _worth(values: Array) -> float:
    known = values[np.isfinite(values)]
    return effective_sample_size(known, len(known) - 1) if len(known) > 3 else float(len(known))


def _lag1(values: Array) -> float:
    return float(autocorrelation(values, 1)[1]) if len(values) > 2 else float("nan")
