"""Where a track starts, at rest on a detection and as uncertain as that leaves it; and where it ends, too
uncertain, for a new one to start in its place, H 3.4.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.tracks.noise_model import NoiseModel, TargetModel, errors_of
from wildlab.analysis.tracks.scans import SLOTS, Scans, Truth, errors_near, sensor_of
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking.initiation import start_from_position, start_from_rays
from wildlab.tracking.run import Ends, Start, Track
from wildlab.tracking.schmidt import Considered
from wildlab.tracking.sensors import Prediction, second_derivatives, share_left_out


def start_of_target(
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


def start_near(
    scans: Scans, truth: Truth, beliefs: NoiseModel, targets: TargetModel, others: Sequence[Truth] = ()
) -> Start | None:
    """A start at the first detection within reach of the target's true place; None where there is none.

    One that lies nearer to one of the ``others`` is not taken. The detection itself is not used up: the start
    is as uncertain as the search was wide, and the detection is the first that the filter is given.
    """
    reach = targets.reach(scans.kind)
    error, nearest = errors_near(scans, truth, reach)
    taken = nearest >= 0
    for other in others:
        beside, its = errors_near(scans, other, reach)
        rival = (its == nearest) & (np.linalg.norm(beside, axis=1) < np.linalg.norm(error, axis=1))
        taken &= ~rival
    rows = np.flatnonzero(taken & np.isfinite(scans.platform).all(axis=1))
    for row in rows:
        z = scans.detections[row, nearest[row]]
        place = place_of(scans, int(row), z, beliefs)
        if place is None:
            continue
        x, P = place
        if scans.kind == "position":
            P = np.eye(2) * reach**2
        elif scans.kind == "bearing" and len(z) == 1:
            P = _along_ray(float(z[0]), beliefs.range_sd_m, beliefs.range_m * reach)
        return start_from_position(scans.times[row], x, P, targets.start_speed_m_s)
    return None


def start_first(scans: Scans, own: Array, beliefs: NoiseModel, targets: TargetModel) -> Start | None:
    """A start on the first usable row of ``own`` (N, m), which is used up; None where there is none.

    Bearings whose distance nobody knows start where the first of them meet that cross.
    """
    if scans.elements == ("azimuth",) and not np.isfinite(beliefs.range_m):
        return _start_from_rays(scans, own, beliefs, targets)
    for row in np.flatnonzero(np.isfinite(own).all(axis=1) & np.isfinite(scans.platform).all(axis=1)):
        place = place_of(scans, int(row), own[row], beliefs)
        if place is not None:
            return start_from_position(scans.times[row], *place, targets.start_speed_m_s, int(row))
    return None


def _start_from_rays(scans: Scans, own: Array, beliefs: NoiseModel, targets: TargetModel) -> Start | None:
    there = np.asarray(np.isfinite(scans.platform).all(axis=1))
    usable = np.where(there[:, None], own, np.nan)
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    try:
        return start_from_rays(
            scans.times, usable, np.diag(beliefs.white**2), sensor, sd_velocity=targets.start_speed_m_s
        )
    except WildlabError:
        return None  # all near parallel, or they settle on no place


def _noise_at(
    scans: Scans, beliefs: NoiseModel, errors: Considered | None, row: int, seen: Prediction
) -> Array:
    """(m, m) all that a detection may be wrong by: white noise, and what considered errors make of it."""
    R: Array = np.diag(beliefs.white**2)
    if errors is not None and np.isfinite(errors.covariance[row]).all():
        G = seen.H_pose[:, [SLOTS[scans.kind].index(name) for name in errors.names]]
        R = R + G @ errors.covariance[row] @ G.T
    return R


def place_of(
    scans: Scans, row: int, z: Array, beliefs: NoiseModel, white: bool = False
) -> tuple[Array, Array] | None:
    """North and east that a measurement (m,) says, with what noise and considered errors leave uncertain.

    ``white``: noise alone.

    None where it does not say: a velocity, a ray that meets no ground, a bearing whose distance nobody knows.
    """
    place = _place(scans, row, z, beliefs)
    if place is None or not np.isfinite(place).all():
        return None
    if scans.kind == "bearing" and len(z) == 1:
        across = beliefs.range_m * float(beliefs.white[0])
        return place, _along_ray(float(z[0]), beliefs.range_sd_m, across)
    seen = sensor_of(scans, np.zeros_like(scans.platform)).predict(row, np.append(place, [0.0, 0.0]))
    H = seen.H_position[:, :2]
    if not np.isfinite(H).all():
        return None
    inverse = np.linalg.pinv(H)
    R = _noise_at(scans, beliefs, None if white else errors_of(scans, beliefs), row, seen)
    return place, np.asarray(inverse @ R @ inverse.T)


def _along_ray(azimuth: float, sd_along: float, sd_across: float) -> Array:
    """Covariance (2, 2) of a place on a ray, by its standard deviations along it and across, m."""
    ahead = np.array([np.cos(azimuth), np.sin(azimuth)])
    right = np.array([-ahead[1], ahead[0]])
    return sd_along**2 * np.outer(ahead, ahead) + sd_across**2 * np.outer(right, right)


def _place(scans: Scans, row: int, z: Array, beliefs: NoiseModel) -> Array | None:
    if scans.kind == "position":
        return z[:2]
    if scans.kind == "pixel" and scans.poses is not None:
        ground = georeference_pixels(scans.poses.take(np.array([row])), z[None], scans.plane_down[[row]])
        return ground[0, :2]
    if scans.kind == "velocity":
        return None
    elements = dict(zip(scans.elements, z, strict=True))
    drop = float(np.nan_to_num(scans.drop[row]))
    if "range" in elements:
        r = float(np.sqrt(max(elements["range"] ** 2 - drop**2, 0.0)))
    elif "elevation" in elements:
        below = np.tan(-elements["elevation"])
        r = drop / below if below * drop > 0 else np.nan
    else:
        r = beliefs.range_m
    azimuth = elements["azimuth"]
    return scans.platform[row] + r * np.array([np.cos(azimuth), np.sin(azimuth)])


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
    there = np.asarray(np.isfinite(seen).all(axis=-1))

    def at(row: int, place: Array) -> tuple[Array, Array]:
        state = np.append(place, [0.0, 0.0])
        noise = _noise_at(scans, beliefs, errors, row, sensor.predict(row, state))
        return second_derivatives(sensor, row, state), noise

    def now(row: int) -> tuple[Array, Array] | None:
        if there[row].sum() != 1:
            return None
        place = place_of(scans, row, seen[row, int(np.argmax(there[row]))], beliefs)
        return None if place is None else at(row, place[0])

    return Geometry(at, now)


def ends_by(times: Array, gap_s: float, look: Callable[[int], tuple[Geometry | None, int]]) -> Ends:
    """When a track ends, for `run_filter`.

    ``look`` gives a row's sensor, None for one by which no track ends, and the row among that one's own;
    ``gap_s`` is how long it must be without a detection.
    """
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


def starts_of(times: Array, pieces: Sequence[Piece]) -> NDArray[np.int64]:
    """(T,) the look at which each track starts."""
    return np.array(
        [piece.first + np.searchsorted(times[piece.rows], piece.begin.time) for piece in pieces], np.int64
    )
