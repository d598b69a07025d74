"""Tracks that end when they are too uncertain, and those that start in their place, H 3.4.

A target that is out of sight for long has a track that knows less and less. The next detection would be taken
by a filter whose linearisation does not hold, and throw the track to where the target never was. Such a track
ends, and a new one starts on the next detection, in the same way as the first.

It ends at the first look at which it was without a detection for longer than a filter on differences would
wait (`NoiseModel.longest_gap_s`), and what a linearisation leaves out of a detection, by the geometry in
which the target was last seen, is more than all that the detection may be wrong by: its noise and the
considered errors (`wildlab.tracking.sensors`). Where it is seen again sooner but from nearer, the geometry of
that look decides too. The filter with white noise decides for all, as it chooses the detections for all: they
are compared over the same looks.

Positions are not bent. One bearing says no place to start on, and a track by bearings alone does not end so.
Of several sensors together, that which saw the target last and that which sees it again decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.following.consider_parameters import errors_of
from wildlab.analysis.following.expected import SLOTS, sensor_of
from wildlab.analysis.following.initiation import place_of
from wildlab.analysis.following.noise_model import NoiseModel
from wildlab.analysis.scans import Scans, Truth
from wildlab.geometry.frames import Array
from wildlab.tracking.records import Start, Track
from wildlab.tracking.run import Ends
from wildlab.tracking.sensors import second_derivatives, share_left_out


class Piece(NamedTuple):
    """One track of a target: looks from ``first`` to before ``last``, and where it starts among them."""

    first: int
    last: int
    begin: Start  # its row counts from ``first``

    @property
    def rows(self) -> slice:
        """The looks."""
        return slice(self.first, self.last)


class Geometry(NamedTuple):
    """How a sensor's looks bend, and all that its detections may be wrong by.

    ``at``: a look and a place (2,) to second derivatives (m, 2, 2) and noise (m, m). ``now``: the same of a
    look at the place that its one detection says; None where there is none, or several: it is not known which
    is the target's own.
    """

    at: Callable[[int, Array], tuple[Array, Array]]
    now: Callable[[int], tuple[Array, Array] | None]


def geometry_of(scans: Scans, seen: Array, beliefs: NoiseModel) -> Geometry | None:
    """Of a sensor whose detections ``seen`` (N, K, m) may be of the target; None where nothing is bent, or a
    detection says no place to start on."""
    alone = scans.kind == "bearing" and len(scans.elements) == 1
    if scans.kind in ("position", "velocity") or alone:
        return None
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    errors = errors_of(scans, beliefs)
    slots = [] if errors is None else [SLOTS[scans.kind].index(name) for name in errors.names]
    there: NDArray[np.bool_] = np.asarray(np.isfinite(seen).all(axis=-1))

    def at(row: int, place: Array) -> tuple[Array, Array]:
        state = np.append(place, [0.0, 0.0])
        noise = np.diag(beliefs.white**2)
        if errors is not None and np.isfinite(errors.covariance[row]).all():
            G = sensor.predict(row, state).H_pose[:, slots]
            noise = noise + G @ errors.covariance[row] @ G.T
        return second_derivatives(sensor, row, state), noise

    def now(row: int) -> tuple[Array, Array] | None:
        if there[row].sum() != 1:
            return None
        place = place_of(scans, row, seen[row, int(np.argmax(there[row]))], beliefs)
        return None if place is None else at(row, place[0])

    return Geometry(at, now)


def ends_of(scans: Scans, seen: Array, beliefs: NoiseModel) -> Ends | None:
    """When a track by this sensor ends, for `run_filter`; None for a sensor by which it never does.

    Parameters
    ----------
    seen
        (N, K, m) detections that may be of the target.
    """
    geometry = geometry_of(scans, seen, beliefs)
    if geometry is None:
        return None
    return ends_by(scans.times, beliefs.longest_gap_s, lambda row: (geometry, row))


def ends_by(times: Array, gap_s: float, look: Callable[[int], tuple[Geometry | None, int]]) -> Ends:
    """The same for looks of any sensors: ``look`` gives a row's sensor, and the row among that one's own."""
    known: dict[int, tuple[Array, Array]] = {}

    def ends(row: int, last: int, x_last: Array, P: Array) -> bool:
        if times[row] - times[last] <= gap_s:
            return False
        seen_last, own_last = look(last)
        if seen_last is not None:
            if last not in known:
                known[last] = seen_last.at(own_last, x_last[:2])
            if share_left_out(P[:2, :2], *known[last]) > 1:
                return True
        seen_now, own_now = look(row)
        here = None if seen_now is None else seen_now.now(own_now)
        return here is not None and share_left_out(P[:2, :2], *here) > 1

    return ends


def part_of(scans: Scans, rows: slice) -> Scans:
    """Some looks of a sensor, one after the other."""
    if rows == slice(0, len(scans.times)):
        return scans
    n = len(scans.times)
    cut: dict[str, Any] = {
        name: value[rows]
        for name, value in scans._asdict().items()
        if isinstance(value, np.ndarray) and len(value) == n
    }
    poses = None if scans.poses is None else scans.poses.take(rows)
    return scans._replace(**cut, poses=poses)


def truth_of(truth: Truth, rows: slice) -> Truth:
    """The truth at some looks."""
    return truth._replace(position=truth.position[rows], velocity=truth.velocity[rows])


def one_after_another(
    begin: Start, count: int, follow: Callable[[int, Start], Track], again: Callable[[int], Start | None]
) -> tuple[list[Piece], Track]:
    """A track, and a new one behind each that ended.

    Parameters
    ----------
    begin
        Of the first.
    count
        N looks.
    follow
        From a look on and a start, whose row counts from there, to a track that is NaN behind its end.
    again
        A start among the looks from one on; its row counts from there. None: there is no more.

    Returns
    -------
    The tracks' looks, which are all N where none ended, and all of them as one (N).
    """
    pieces, tracks, at = list[Piece](), list[Track](), 0
    start: Start | None = begin
    while start is not None:
        track = follow(at, start)
        alive = np.flatnonzero(np.isfinite(track.x).all(axis=1))
        stopped = int(alive[-1]) + 1 if len(alive) else count - at
        pieces.append(Piece(at, at + stopped, start))
        tracks.append(Track._make(part[:stopped] for part in track))
        at += stopped
        start = again(at) if at < count else None
    return pieces, joined(tracks, pieces, count)


def joined(tracks: Sequence[Track], pieces: Sequence[Piece], count: int) -> Track:
    """Tracks of some looks each as one of all; looks without a track are NaN, and used nothing."""
    if len(tracks) == 1 and pieces[0].rows == slice(0, count):
        return tracks[0]
    whole = []
    for parts in zip(*tracks, strict=True):
        empty: float = {"b": False, "i": -1}.get(parts[0].dtype.kind, np.nan)
        one = np.full((count, *parts[0].shape[1:]), empty, parts[0].dtype)
        for part, piece in zip(parts, pieces, strict=True):
            one[piece.rows] = part
        whole.append(one)
    return Track._make(whole)


def begun_of(times: Array, pieces: Sequence[Piece]) -> NDArray[np.bool_]:
    """(N,) looks behind the start of their track: the detection that it was put on surprises nobody."""
    begun = np.zeros(len(times), bool)
    for piece in pieces:
        begun[piece.rows] = times[piece.rows] > piece.begin.time
    return begun


def starts_of(times: Array, pieces: Sequence[Piece]) -> NDArray[np.int64]:
    """(T,) the look at which each track starts."""
    return np.array(
        [piece.first + np.searchsorted(times[piece.rows], piece.begin.time) for piece in pieces], np.int64
    )
