"""One target by the looks of one sensor, or of several together, each with its own noise, clock and errors
that last.

Every filter of a target gets the same detections: those that the filter with white noise let into its gate,
nearest first. What differs is what they believe of the errors, see below.

Detections that name their target are its own. Where none does, a track starts on the first detection near the
target's true position, and nearer to it than to another target; from there on the truth is not looked at.
Without truth all are of one target, whose track starts on the first. A track ends where nothing falls into
its gate for as long as its patience lasts; and where it is too uncertain for a linearisation: then the next
detection starts another in the same way, see `wildlab.analysis.tracks.initiation`.

Errors of one name that two sensors believe in alike (same standard deviation, same correlation time) and
share are one error, as that of the heading of the platform that both are on; others are each sensor's own.

``ekf`` (``kf`` where positions are measured)
    Errors are new at every look, H (3.5), (3.7).
``ukf``, ``imm``
    The same by sigma points; and with two motions, a calm one and a lively one, H 3.2.3.
``coloured``
    Errors of successive looks are alike, and the filter works on differences of positions, H 7.2.2.
``schmidt``
    Platform, clock or range are wrong by something that lasts, considered and not estimated, H 7.4.
``thinned``
    As the first, on detections so far apart that their errors hardly have to do with each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.tracks.initiation import (
    Piece,
    ends_by,
    geometry_of,
    joined,
    one_after_another,
    place_of,
    start_of_target,
    starts_of,
)
from wildlab.analysis.tracks.inputs import BySensor
from wildlab.analysis.tracks.noise_model import NoiseModel, TargetModel, errors_of, spread_of
from wildlab.analysis.tracks.scans import Scans, Truth, errors_near, predict_scan, sensor_of
from wildlab.evaluation.consistency import position_nees
from wildlab.geometry.frames import Array
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.motion import Motion, rest
from wildlab.tracking.run import Ends, Start, Track, run_filter
from wildlab.tracking.schmidt import Considered, consider_all
from wildlab.tracking.sensors import Merged, Sensor, SensorMeasurements, cut, merge, renamed
from wildlab.tracking.smoothing import known_before, run_smoothed, smooth

#: What the name of a filter ends with whose estimates know later detections too, and those that can.
SMOOTHED = "-smoothed"
SMOOTHABLE = tuple(f"{name}{SMOOTHED}" for name in ("ekf", "schmidt", "ukf", "thinned"))
NAMES = ("ekf", "ukf", "imm", "coloured", "schmidt", "thinned")
#: The two motions of ``imm``: as lively as the target is believed to be, and a third of it; each lasts so
#: long, s.
CALM, STAY_S = 1 / 3, 30.0


def possible(scans: Scans, beliefs: NoiseModel) -> dict[str, str]:
    """Filters that a sensor's detections can go through: ``""``, or why they cannot."""
    considered = errors_of(scans, beliefs) is not None
    placed = "range" in scans.elements or scans.kind in ("position", "pixel")
    return {
        **dict.fromkeys(("ekf", "ukf", "imm"), ""),
        "coloured": "" if placed else f"a {scans.kind} is no position, and only those are differenced",
        "schmidt": "" if considered else "nothing is said of errors that last, and poses have no covariance",
        "thinned": ""
        if np.isfinite(beliefs.thinning_s)
        else "nothing is said of how long errors last (thinning_s)",
    }


def run_named(
    name: str,
    merged: Merged,
    own: Array,
    first: Track,
    begin: Start,
    targets: TargetModel,
    considering: tuple[Merged, Considered] | None,
    alone: tuple[Scans, NoiseModel, slice] | None,
) -> Track | None:
    """One filter on the detections that the white one chose.

    Parameters
    ----------
    merged, own, first, begin
        Looks with white noise, the target's own detections (N, m) among them, the track that the filter with
        white noise made of these, and where it begins.
    considering
        The same detections with what is new at each, and the errors that are considered beside it.
    alone
        Of one sensor its looks, what is believed of it, and which looks these are. None: there are several.

    Returns
    -------
    Track
        None where there is nothing to consider.
    """
    base = name.removesuffix(SMOOTHED)
    base, smoothed = "ekf" if base == "kf" else base, name.endswith(SMOOTHED)
    times, _, R, sensor, *_ = merged
    R, motion = R if R.ndim == 3 else R[:, 0], targets.motion()
    run = run_smoothed if smoothed else run_filter
    if base == "coloured" and alone is not None:
        return _coloured(*alone, own, motion, begin)
    if base == "imm":
        both = [targets.motion(CALM), motion]
        return run_imm(times, own, R, sensor, both, (STAY_S, STAY_S), begin).track
    if base in ("ekf", "ukf"):
        if base == "ekf":
            track = first
        elif targets.start_speed_m_s:
            track = run_unscented(times, own, R, sensor, motion, begin)
        else:
            track = _unscented_at_rest(times, own, R, sensor, begin)
        track = smooth(track, motion) if smoothed else track
    elif base == "thinned" and alone is not None:
        kept = thin(times, alone[1].thinning_s, first.used)[:, None]
        track = run(times, np.where(kept, own, np.nan), R, sensor, motion, begin)
    elif considering is not None:
        track = run(*considering[0][:4], motion, begin, pose=considering[1])
    else:
        return None
    if not smoothed:
        return track
    # The innovations of a smoothed track are the filter's, and not counted twice.
    innovation, S, nis = (np.full_like(one, np.nan) for one in (track.innovation, track.S, track.nis))
    return track._replace(innovation=innovation, S=S, nis=nis)


def _unscented_at_rest(times: Array, own: Array, R: Array, sensor: Sensor, begin: Start) -> Track:
    """Sigma points of the place alone: a speed that is known to be zero has no spread."""
    start = begin._replace(x=begin.x[:2], P=begin.P[:2, :2])
    track = run_unscented(times, own, R, sensor, rest, start)
    x, P = np.zeros((len(times), 4)), np.zeros((len(times), 4, 4))
    x[:, :2], P[:, :2, :2] = track.x, track.P
    gone = np.asarray(~np.isfinite(track.x).all(axis=1))
    x[gone], P[gone] = np.nan, np.nan
    return track._replace(x=x, P=P)


def _coloured(
    scans: Scans, beliefs: NoiseModel, rows: slice, seen: Array, motion: Motion, begin: Start
) -> Track:
    own = np.full((len(scans.times), seen.shape[-1]), np.nan)
    own[rows] = seen
    positions, R = _positions(scans, own, beliefs)
    gap, F_c = beliefs.longest_gap_s, beliefs.fading
    used = np.flatnonzero(np.isfinite(positions[:, 0]))
    # Behind a gap the measurement itself is used, and its error is the whole one.
    whole = np.ones(len(scans.times), bool)
    whole[used[1:]] = np.diff(scans.times[used]) > gap
    if beliefs.lasting is None:
        lasting = _lasting(scans, positions, beliefs)
        total = R + lasting
        driving = (1 + F_c**2) * total - 2 * F_c * lasting
    else:
        total, driving = R, (1 + F_c**2 - 2 * F_c * beliefs.lasting) * R
    R_w = np.where(whole[:, None, None], total, driving)[rows]
    return run_coloured(
        scans.times[rows], positions[rows], R_w, motion, begin, F_c=np.eye(2) * F_c, longest_gap=gap
    )


def _positions(scans: Scans, own: Array, beliefs: NoiseModel) -> tuple[Array, Array]:
    """North and east (N, 2) of measurements (N, m), and the covariances (N, 2, 2) that white noise gives."""
    n = len(own)
    if scans.kind == "position":
        return own, np.tile(np.diag(beliefs.white**2), (n, 1, 1))
    places, R = np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
    for row in np.flatnonzero(np.isfinite(own).all(axis=1)):
        found = place_of(scans, int(row), own[row], beliefs, white=True)
        if found is not None:
            places[row], R[row] = found
    return places, R


def _lasting(scans: Scans, positions: Array, beliefs: NoiseModel) -> Array:
    """(N, 2, 2) what considered errors do to positions."""
    expected = predict_scan(scans, positions, np.zeros_like(positions))
    inverse = np.linalg.pinv(np.nan_to_num(expected.H_position[..., :2]))
    spread = spread_of(scans, beliefs, np.nan_to_num(expected.H_pose))
    if spread is None:
        return np.zeros((len(positions), 2, 2))
    return inverse @ np.nan_to_num(spread) @ np.swapaxes(inverse, 1, 2)


#: Names of a track's state in tables.
STATE = ("north_m", "east_m", "v_north_m_s", "v_east_m_s")
#: What all sensors at once are called.
TOGETHER = "together"
#: Errors of a sensor, not of the platform it is on.
OWN = ("clock", "range_bias")


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
        gone = np.asarray(~np.isfinite(self.estimate).all(axis=1))
        gone[self.last :] = False
        gone[: self.starts[0] if len(self.starts) else None] = False
        return gone

    @property
    def dof(self) -> float:
        """Elements of a detection used, on average: what the mean NIS should be."""
        m = self.innovation.shape[1]
        used = np.isfinite(self.nis)
        return float(self.sizes[used].mean()) if len(self.sizes) and used.any() else float(m)


class Chosen(NamedTuple):
    """Which detections are a target's own, as the filter with white noise chooses them.

    ``looks`` of all sensors as those of one, ``merged`` as filters take them; the ``pieces`` are its tracks,
    none where nothing starts one; ``track`` is all of them as one, its detections ``own`` (N, m) with their
    names ``ids`` (N,).
    """

    looks: Scans
    truth: Truth
    merged: Merged
    pieces: list[Piece]
    track: Track | None = None
    own: Array = np.empty((0, 0))
    ids: NDArray[np.object_] = np.empty(0, object)


def track_target(
    inputs: BySensor, target: str, targets: TargetModel, filters: Sequence[str]
) -> list[SensorTrack]:
    """One target by all sensors of the inputs that may see it, with each of the filters.

    A target that was never seen near its true place has no track: all rows are NaN. Several sensors together
    have no track by a filter that asks for errors to consider where there are none. The filters are such that
    the sensor's detections can go through (`possible`).
    """
    if any(one.split(target)[0].fixed for one in inputs.values()):
        targets = targets.at_rest
    chosen = choose(inputs, target, targets)
    looks, truth, merged, pieces, first, own, ids = chosen
    sizes = np.asarray(merged.sensor.sizes, np.int64) if len(inputs) > 1 else np.empty(0, np.int64)
    if first is None:
        return [_no_track(looks, truth, name, targets)._replace(sizes=sizes) for name in filters]
    count = len(merged.times)
    # What names its target finds it again, however long that was out of view.
    patience = np.inf if looks.labelled else targets.patience_s
    last = _last_row(merged.times, first.used, pieces[0].begin.time, patience, targets.patience_s)
    last = min(last, pieces[-1].last)
    first, own = _ended(first, own, last)
    starts, begun = starts_of(merged.times, pieces), np.zeros(count, bool)
    for piece in pieces:
        own_times, start = merged.times[piece.rows], piece.begin
        begun[piece.rows] = (
            np.arange(len(own_times)) > start.row if start.row >= 0 else own_times > start.time
        )
    considering = _considering(inputs, chosen._replace(track=first, own=own))
    alone = next(iter(inputs.values())) if len(inputs) == 1 else None
    found = []
    for name in filters:
        tracks = []
        for piece in pieces:
            rows, errors = piece.rows, None
            if considering is not None:
                by, every = considering
                errors = cut(by, rows), every._replace(covariance=every.covariance[rows])
            white = None if alone is None else (alone.scans, alone.noise, rows)
            part = Track._make(column[rows] for column in first)
            track = run_named(name, cut(merged, rows), own[rows], part, piece.begin, targets, errors, white)
            tracks += [] if track is None else [track]
        if tracks:
            one = _scored(looks, truth, name, joined(tracks, pieces, count), begun, last, targets, ids)
            found.append(one._replace(sizes=sizes, starts=starts[starts < last], last=last))
    return found


def choose(inputs: BySensor, target: str, targets: TargetModel) -> Chosen:
    """The filter with white noise, which chooses detections and says when a track ends."""
    seen, begins = {}, {}
    for name, one in inputs.items():
        truth, others = one.split(target)
        seen[name], begins[name] = start_of_target(one.scans, truth, one.noise, targets, others)
    still = {name: np.zeros_like(one.scans.platform) for name, one in inputs.items()}
    merged = _merged(inputs, seen, still, white=True)
    looks, truth = _together(inputs, merged, target)
    begin = _begin(inputs, merged, begins)
    if begin is None:
        return Chosen(looks, truth, merged, [])
    count, ends = len(merged.times), _ends(inputs, merged, seen)

    def choose_from(at: int, start: Start) -> Track:
        part = cut(merged, slice(at, count))

        def part_ends(row: int, last: int, x_last: Array, P: Array) -> bool:
            return ends is not None and ends(row + at, last + at, x_last, P)

        # What names its target needs no gate to be told apart.
        return run_filter(
            part.times, part.measurements, part.R, part.sensor, targets.motion(), start,
            gate_probability=1.0 if looks.labelled else targets.gate_probability, ends=part_ends,
        )  # fmt: skip

    def again(at: int) -> Start | None:
        later = {}
        for i, (name, one) in enumerate(inputs.items()):
            cut_off = one.scans.detections.copy()
            cut_off[merged.rows[:at][merged.which[:at] == i]] = np.nan
            truth, others = one.split(target)
            left = one.scans._replace(detections=cut_off)
            later[name] = start_of_target(left, truth, one.noise, targets, others)[1]
        found = _begin(inputs, merged, later)
        return None if found is None else found._replace(row=found.row - at if found.row >= 0 else -1)

    pieces, first = one_after_another(begin, count, choose_from, again)
    z = merged.measurements if merged.measurements.ndim == 3 else merged.measurements[:, None]
    which, rows = np.maximum(first.chosen, 0), np.arange(count)
    for row in [piece.first + piece.begin.row for piece in pieces if piece.begin.row >= 0]:
        which[row] = int(np.argmax(np.isfinite(z[row]).any(axis=-1)))
    own = np.where(first.used[:, None], z[rows, which], np.nan)
    ids = np.where(first.used, looks.ids[rows, which], "")
    return Chosen(looks, truth, merged, pieces, first, own, ids)


def _merged(inputs: BySensor, seen: Mapping[str, Array], drift: Mapping[str, Array], white: bool) -> Merged:
    """The looks of all sensors, with all their noise, or what is new at every look."""
    parts = []
    for name, (scans, noise, *_) in inputs.items():
        names = {one: _name(inputs, name, one) for one in _errors(scans, noise)}
        R = np.diag((noise.white if white else noise.noise) ** 2)
        sensor: Sensor = renamed(sensor_of(scans, drift[name]), names)
        parts.append(SensorMeasurements(scans.times, seen[name], R, sensor))
    return merge(parts)


def _errors(scans: Scans, noise: NoiseModel) -> tuple[str, ...]:
    errors = errors_of(scans, noise)
    return () if errors is None else errors.names


def _name(inputs: BySensor, name: str, error: str) -> str:
    """The error's name where all that consider it believe in the same one, else the sensor's before it."""
    beliefs = [
        {one.name: one for one in noise.considered}.get(error)
        for scans, noise, *_ in inputs.values()
        if error in _errors(scans, noise)
    ]
    alike = all(one is not None and one.shared and one == beliefs[0] for one in beliefs)
    return error if alike and error not in OWN else f"{name} {error}"


def _considering(inputs: BySensor, chosen: Chosen) -> tuple[Merged, Considered] | None:
    """The chosen detections beside the errors of all sensors at all looks; None where nothing is considered.

    An error of the clock moves the target by what the filter with white noise says it moves. Of several
    sensors a pose's covariance is as it last was.
    """
    merged, found, drift, seen = chosen.merged, list[Considered](), {}, {}
    for i, (name, (scans, noise, *_)) in enumerate(inputs.items()):
        rows = np.flatnonzero(merged.which == i)
        own = merged.rows[rows]
        velocity = np.zeros((len(scans.times), 2))
        seen[name] = np.full((len(scans.times), len(scans.elements)), np.nan)
        if chosen.track is not None:
            velocity[own] = np.nan_to_num(chosen.track.x[rows, 2:4])
            seen[name][own] = chosen.own[rows, : len(scans.elements)]
        drift[name] = velocity - np.nan_to_num(scans.platform_velocity)
        errors = errors_of(scans, noise)
        if errors is None:
            continue
        before = np.searchsorted(scans.times, merged.times, side="right") - 1
        at = np.where(merged.which == i, merged.rows, np.clip(before, 0, len(scans.times) - 1))
        covariance = (known_before(errors.covariance) if len(inputs) > 1 else errors.covariance)[at]
        names = [_name(inputs, name, one) for one in errors.names]
        new = [k for k, one in enumerate(names) if not any(one in other.names for other in found)]
        if new:
            times = np.broadcast_to(errors.correlation_time, len(names))
            found.append(
                Considered(
                    tuple(names[k] for k in new), covariance[:, new][:, :, new], tuple(times[new].tolist())
                )
            )
    return (_merged(inputs, seen, drift, white=False), consider_all(*found)) if found else None


def _ends(inputs: BySensor, merged: Merged, seen: Mapping[str, Array]) -> Ends | None:
    """When a track of all sensors ends; None where none of them bends."""
    shapes = [geometry_of(one.scans, seen[name], one.noise) for name, one in inputs.items()]
    if all(one is None for one in shapes):
        return None
    gap = max(one.noise.longest_gap_s for one in inputs.values())
    return ends_by(merged.times, gap, lambda row: (shapes[merged.which[row]], int(merged.rows[row])))


def _begin(inputs: BySensor, merged: Merged, begins: Mapping[str, Start | None]) -> Start | None:
    """The first of the sensors' starts that knows the distance, else the first of all."""
    found = []
    for i, (name, (scans, *_)) in enumerate(inputs.items()):
        begin = begins[name]
        if begin is None:
            continue
        row = -1
        if begin.row >= 0:
            row = int(np.flatnonzero((merged.which == i) & (merged.rows == begin.row))[0])
        ray = scans.kind == "bearing" and "elevation" not in scans.elements
        found.append((ray, begin.time, begin._replace(row=row)))
    return min(found, key=lambda one: one[:2])[2] if found else None


def _together(inputs: BySensor, merged: Merged, target: str) -> tuple[Scans, Truth]:
    """All looks as those of one sensor, as far as a track's scores need them, and the target's truth."""
    scans = [one.scans for one in inputs.values()]
    truths = [one.split(target)[0] for one in inputs.values()]
    if len(scans) == 1:
        return scans[0], truths[0]
    K = max(one.ids.shape[1] for one in scans)
    n, m = len(merged.times), len(merged.sensor.angles)
    ids, labels = np.full((n, K), "", object), np.full((n, K), "", object)
    position, velocity = np.full((n, 2), np.nan), np.full((n, 2), np.nan)
    for i, (one, truth) in enumerate(zip(scans, truths, strict=True)):
        rows: NDArray[np.intp] = np.flatnonzero(merged.which == i)
        ids[rows, : one.ids.shape[1]] = one.ids[merged.rows[rows]]
        labels[rows, : one.ids.shape[1]] = one.labels[merged.rows[rows]]
        position[rows], velocity[rows] = truth.position[merged.rows[rows]], truth.velocity[merged.rows[rows]]
    nowhere = np.full((n, 2), np.nan)
    looks = Scans(
        TOGETHER, TOGETHER, merged.times, np.full((n, K, m), np.nan), nowhere, nowhere,
        tuple(f"element_{i}" for i in range(m)), labels, ids,
    )  # fmt: skip
    return looks, Truth(target, position, velocity, max(one.sd_m for one in truths))


def _last_row(times: Array, used: NDArray[np.bool_], start: float, patience: float, after: float) -> int:
    """The first row that has a track no more: ``after`` s behind the last one used before a longer pause."""
    hits = np.concatenate([[start], times[used]])
    pauses = np.flatnonzero(np.diff(hits) > patience)
    end = hits[pauses[0]] if len(pauses) else hits[-1]
    return int(np.searchsorted(times, end + after, side="right"))


def _ended(first: Track, own: Array, last: int) -> tuple[Track, Array]:
    """The track and its detections (N, m) up to its end: what the filter took in behind it is of no track,
    and a smoother must not know it."""
    x, P, kept = first.x.copy(), first.P.copy(), own.copy()
    x[last:], P[last:], kept[last:] = np.nan, np.nan, np.nan
    return first._replace(x=x, P=P), kept


def _scored(
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
    names = np.where(track.used, ids, "")
    names[last:] = ""
    return _no_track(scans, truth, name, targets)._replace(
        estimate=x, error=error, nees=nees, innovation=innovation, nis=nis, covariance=P, S=S, detection=names
    )


def _no_track(scans: Scans, truth: Truth, name: str, targets: TargetModel) -> SensorTrack:
    """Of a target that was never found."""
    n, m = len(scans.times), scans.detections.shape[-1]

    def empty(*shape: int) -> Array:
        return np.full((n, *shape), np.nan)

    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    near = errors_near(scans, truth, targets.reach(scans.kind))[1] >= 0
    return SensorTrack(
        scans.sensor, truth.target, name, scans.times, empty(4), empty(4), empty(), empty(m), empty(), known,
        near, empty(4, 4), empty(m, m), np.full(n, "", object),
    )  # fmt: skip
