"""One target by the scans of one sensor, or of several together, each with its own noise, clock and errors
that last.

Every filter of a target gets the same detections: those that the filter with white noise let into its gate,
nearest first. What differs is what they assume of the errors, see below.

Detections that name their target are its own. Where none does, a track starts on the first detection near the
target's true position, and nearer to it than to another target; from there on the truth is not looked at.
Without truth all are of one target, whose track starts on the first. A track ends where nothing falls into
its gate for as long as its patience lasts; and where it is too uncertain for a linearisation: then the next
detection starts another in the same way (H 3.4).

Errors of one name that two sensors believe in alike (same standard deviation, same correlation time) and
share are one error, as that of the heading of the platform that both are on; others are each sensor's own.

``ekf`` (``kf`` where positions are measured)
    Errors are new at every scan, H (3.5), (3.7).
``ukf``, ``imm``
    The same by sigma points; and with two motions, a calm one and a lively one, H 3.2.3.
``coloured``
    Errors of successive scans are alike, and the filter works on differences of positions, H 7.2.2.
``schmidt``
    Platform, clock or range are wrong by something that lasts, considered and not estimated, H 7.4.
``thinned``
    As the first, on detections so far apart that their errors hardly have to do with each other.

A target that is out of sight for long has a track that knows less and less. The next detection would be taken
by a filter whose linearisation does not hold, and throw the track to where the target never was. Such a track
ends, and a new one starts on the next detection, in the same way as the first.

It ends at the first scan at which it was without a detection for longer than a filter on differences would
wait (`NoiseModel.longest_gap_s`), and what a linearisation leaves out of a detection, by the geometry in
which the target was last seen, is more than all that the detection may be wrong by: its noise and the
considered errors (`wildlab.tracking.sensors`). Where it is seen again sooner but from nearer, the geometry of
that scan decides too. The filter with white noise decides for all, as it chooses the detections for all: they
are compared over the same scans.

Positions are not bent. One bearing says no place to start on, and a track by bearings alone does not end so.
Of several sensors together, that which saw the target last and that which sees it again decide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.tracks.noise_model import NoiseModel, SensorInputs, TargetModel, errors_of, spread_of
from wildlab.analysis.tracks.scans import SLOTS, Scans, Truth, errors_near, predict_scan, sensor_of
from wildlab.evaluation.consistency import position_nees
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.kalman import Considered, consider_all
from wildlab.tracking.kalman import errors_of as filter_errors
from wildlab.tracking.motion import Motion
from wildlab.tracking.run import Ends, Start, Track, known_before, run_filter, smooth, start_from_position
from wildlab.tracking.sensors import (
    Merged,
    Prediction,
    Sensor,
    SensorMeasurements,
    merge,
    renamed,
    second_derivatives,
    share_left_out,
)

# -- where a track starts and where it ends


def own_detections(scans: Scans, target: str) -> Array:
    """Detections (N, K, m) that may be of a target: where the platform is known, and of its name."""
    mine = np.asarray(np.isfinite(scans.platform).all(axis=1))[:, None]
    if scans.labelled:
        mine = mine & (scans.labels == target)
    return np.where(mine[..., None], scans.detections, np.nan)


def start_of_target(one: SensorInputs, target: str, targets: TargetModel, first: int = 0) -> Start | None:
    """Where a track of a target starts by one sensor, from its scan ``first`` on; see the module."""
    truth, others = one.split(target)
    detections = one.scans.detections.copy()
    detections[:first] = np.nan
    scans = one.scans._replace(detections=detections)
    if not scans.labelled and np.isfinite(truth.position).any():
        return start_near(scans, truth, one.noise, targets, others)
    seen = own_detections(scans, target)
    which = np.argmax(np.isfinite(seen).all(axis=-1), axis=1)
    return start_first(scans, seen[np.arange(len(seen)), which], one.noise, targets)


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
    """A start on the first usable row of ``own`` (N, m), which is used up; None where there is none."""
    for row in np.flatnonzero(np.isfinite(own).all(axis=1) & np.isfinite(scans.platform).all(axis=1)):
        place = place_of(scans, int(row), own[row], beliefs)
        if place is not None:
            return start_from_position(scans.times[row], *place, targets.start_speed_m_s, int(row))
    return None


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
    """One track of a target: rows from ``first`` to before ``last``, and where it starts among all."""

    first: int
    last: int
    begin: Start

    @property
    def rows(self) -> slice:
        """Its rows."""
        return slice(self.first, self.last)

    def inside(self, count: int) -> NDArray[np.bool_]:
        """(N,) which of so many rows are its own."""
        rows = np.arange(count)
        return (rows >= self.first) & (rows < self.last)


#: Row of a scan and place (2,) of a target: second derivatives (m, 2, 2) of what is seen there, and all that
#: a detection may be wrong by (m, m).
Bend = Callable[[int, Array], tuple[Array, Array]]


def bend_of(one: SensorInputs) -> Bend | None:
    """Of one sensor; None where nothing is bent, or a detection says no place to start on."""
    scans = one.scans
    if scans.kind in ("position", "velocity") or scans.elements == ("azimuth",):
        return None
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    errors = errors_of(scans, one.noise)

    def bend(row: int, place: Array) -> tuple[Array, Array]:
        state = np.append(place, [0.0, 0.0])
        noise = _noise_at(scans, one.noise, errors, row, sensor.predict(row, state))
        return second_derivatives(sensor, row, state), noise

    return bend


def ends_of(inputs: Mapping[str, SensorInputs], merged: Merged, seen: Mapping[str, Array]) -> Ends | None:
    """When a track by these sensors ends, for `run_filter`; None where none of them bends.

    ``seen`` has the detections (N, K, m) that may be of the target. Of the scan that ends a track it is that
    of the one detection; where there are several it is not known which is the target's own.
    """
    names = list(inputs)
    bends = [bend_of(one) for one in inputs.values()]
    if all(one is None for one in bends):
        return None
    gap_s = max(one.noise.longest_gap_s for one in inputs.values())

    def lone(name: str, row: int) -> Array | None:
        there = np.isfinite(seen[name][row]).all(axis=-1)
        if there.sum() != 1:
            return None
        z = seen[name][row, int(np.argmax(there))]
        found = place_of(inputs[name].scans, row, z, inputs[name].noise)
        return None if found is None else found[0]

    # In a gap the place of the last detection is asked about at every row, and only P changes.
    before: tuple[Array, tuple[Array, Array] | None] = np.empty(0), None

    def bent_at(row: int, place: Array | None) -> tuple[Array, Array] | None:
        bend = bends[int(merged.which[row])]
        return None if bend is None or place is None else bend(int(merged.rows[row]), place)

    def ends(row: int, last: int, x_last: Array, P: Array) -> bool:
        nonlocal before
        if merged.times[row] - merged.times[last] <= gap_s:
            return False
        if before[0] is not x_last:
            before = x_last, bent_at(last, x_last[:2])
        here = bent_at(row, lone(names[int(merged.which[row])], int(merged.rows[row])))
        return any(one is not None and share_left_out(P[:2, :2], *one) > 1 for one in (before[1], here))

    return ends


def joined(tracks: Sequence[Track], pieces: Sequence[Piece]) -> Track:
    """Each track in its piece's rows, all as one; rows without a track are NaN, and used nothing."""
    whole = []
    for parts in zip(*tracks, strict=True):
        empty: float = {"b": False, "i": -1}.get(parts[0].dtype.kind, np.nan)
        one = np.full_like(parts[0], empty)
        for part, piece in zip(parts, pieces, strict=True):
            one[piece.rows] = part[piece.rows]
        whole.append(one)
    return Track._make(whole)


# -- the filters

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
        "schmidt": "" if considered else "no correlated errors are stated, and poses have no covariance",
        "thinned": "" if np.isfinite(beliefs.thinning_s) else "thinning_s is not stated",
    }


class Considering(NamedTuple):
    """Noise that is new at each detection, and the considered errors beside it."""

    R: Array  # (N, m, m)
    sensor: Sensor
    errors: Considered


def run_named(
    name: str,
    merged: Merged,
    own: Array,
    first: Track,
    begin: Start,
    targets: TargetModel,
    considering: Considering | None,
    alone: SensorInputs | None,
) -> Track | None:
    """One filter on the detections that the white one chose.

    Parameters
    ----------
    merged, own, first, begin
        Scans with white noise, the target's own detections (N, m) among them, the track that the filter with
        white noise made of these, and where it begins.
    considering
        Of all sensors.
    alone
        The sensor; None: there are several.

    Returns
    -------
    Track
        None where there is nothing to consider.
    """
    base = name.removesuffix(SMOOTHED)
    base, smoothed = "ekf" if base == "kf" else base, name.endswith(SMOOTHED)
    times, _, R, sensor, *_ = merged
    R, motion = R[:, 0], targets.motion()
    errors = None
    if base == "coloured" and alone is not None:
        return _coloured(alone.scans, alone.noise, own, motion, begin)
    if base == "imm":
        both = [targets.motion(CALM), motion]
        return run_imm(times, own, R, sensor, both, (STAY_S, STAY_S), begin)
    if base in ("ekf", "ukf"):
        track = first if base == "ekf" else run_unscented(times, own, R, sensor, motion, begin)
    elif base == "thinned" and alone is not None:
        kept = thin(times, alone.noise.thinning_s, first.used)[:, None]
        track = run_filter(times, np.where(kept, own, np.nan), R, sensor, motion, begin)
    elif considering is not None:
        pose, errors = considering.errors, filter_errors(considering.errors, considering.sensor, len(times))
        track = run_filter(times, own, considering.R, considering.sensor, motion, begin, pose=pose)
    else:
        return None
    if not smoothed:
        return track
    track = smooth(track, motion, errors)
    # The innovations of a smoothed track are the filter's, and not counted twice.
    innovation, S, nis = (np.full_like(one, np.nan) for one in (track.innovation, track.S, track.nis))
    return track._replace(innovation=innovation, S=S, nis=nis)


def _coloured(scans: Scans, beliefs: NoiseModel, own: Array, motion: Motion, begin: Start) -> Track:
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
    R_w = np.where(whole[:, None, None], total, driving)
    return run_coloured(scans.times, positions, R_w, motion, begin, F_c=np.eye(2) * F_c, longest_gap=gap)


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


# -- tracks

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
    of the one that was used, "" none. ``sizes`` (N,) how many elements its detection has, where scans are of
    several sensors. ``starts`` (T,) the scans at which a track of the target starts, and ``last``, at which
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
        """(N,) scans at which there is no track, from the first start to where the last track ends."""
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

    ``scans`` of all sensors as those of one, ``merged`` as filters take them; the ``pieces`` are its tracks,
    none where nothing starts one; ``track`` is all of them as one, its detections ``own`` (N, m) with their
    names ``ids`` (N,).
    """

    scans: Scans
    truth: Truth
    merged: Merged
    pieces: list[Piece]
    track: Track | None = None
    own: Array = np.empty((0, 0))
    ids: NDArray[np.object_] = np.empty(0, object)


#: Inputs by sensor.
BySensor = Mapping[str, SensorInputs]


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
    scans, truth, merged, pieces, first, own, ids = chosen
    nothing = _no_track(scans, truth, targets)
    if len(inputs) > 1:
        nothing = nothing._replace(sizes=np.asarray(merged.sensor.sizes, np.int64))
    if first is None:
        return [nothing._replace(filter=name) for name in filters]
    times, rows = merged.times, np.arange(len(merged.times))
    # What names its target re-identifies it, however long that was out of view.
    patience = np.inf if scans.labelled else targets.patience_s
    last = _last_row(times, first.used, pieces[0].begin.time, patience, targets.patience_s)
    last = min(last, pieces[-1].last)
    # What the filter took in behind the end is of no track, and a smoother must not know it.
    pieces = [one._replace(last=min(one.last, last)) for one in pieces if one.first < last]
    first, own = joined([first] * len(pieces), pieces), np.where(rows[:, None] < last, own, np.nan)
    starts = [max(one.first, int(np.searchsorted(times, one.begin.time))) for one in pieces]
    starts = [row for row in starts if row < last]
    nothing = nothing._replace(starts=np.array(starts, np.int64), last=last)
    # The detection that a track is put on surprises nobody.
    begun = np.zeros(len(times), bool)
    for piece in pieces:
        behind = rows > piece.begin.row if piece.begin.row >= 0 else times > piece.begin.time
        begun[piece.rows] = behind[piece.rows]
    considering = _considering(inputs, chosen._replace(track=first, own=own))
    alone = next(iter(inputs.values())) if len(inputs) == 1 else None
    found = []
    for name in filters:
        tracks = []
        for piece in pieces:
            part = joined([first], [piece])
            mine = np.where(piece.inside(len(times))[:, None], own, np.nan)
            track = run_named(name, merged, mine, part, piece.begin, targets, considering, alone)
            tracks += [] if track is None else [track]
        if tracks:
            found.append(_scored(nothing, name, joined(tracks, pieces), truth, begun, ids))
    return found


def choose(inputs: BySensor, target: str, targets: TargetModel) -> Chosen:
    """The filter with white noise, which chooses detections and says when a track ends."""
    seen = {name: own_detections(one.scans, target) for name, one in inputs.items()}
    still = {name: np.zeros_like(one.scans.platform) for name, one in inputs.items()}
    merged = _merged(inputs, seen, still, white=True)
    scans, truth = _together(inputs, merged, target)
    z, left = merged.measurements, merged.measurements.copy()
    ends, count = ends_of(inputs, merged, seen), len(merged.times)
    pieces, tracks, at = list[Piece](), list[Track](), 0
    start = _begin(inputs, merged, target, targets, at)
    while start is not None:
        left[:at] = np.nan
        # What names its target needs no gate to be distinguished.
        track = run_filter(
            merged.times, left, merged.R, merged.sensor, targets.motion(), start,
            gate_probability=1.0 if scans.labelled else targets.gate_probability, ends=ends,
        )  # fmt: skip
        alive = np.flatnonzero(np.isfinite(track.x).all(axis=1))
        first, at = at, int(alive[-1]) + 1 if len(alive) else count
        pieces.append(Piece(first, at, start))
        tracks.append(track)
        start = _begin(inputs, merged, target, targets, at) if at < count else None
    if not pieces:
        return Chosen(scans, truth, merged, pieces)
    whole = joined(tracks, pieces)
    which, rows = np.maximum(whole.chosen, 0), np.arange(count)
    for row in [piece.begin.row for piece in pieces if piece.begin.row >= 0]:
        which[row] = int(np.argmax(np.isfinite(z[row]).any(axis=-1)))
    own = np.where(whole.used[:, None], z[rows, which], np.nan)
    return Chosen(scans, truth, merged, pieces, whole, own, np.where(whole.used, scans.ids[rows, which], ""))


def _merged(inputs: BySensor, seen: Mapping[str, Array], drift: Mapping[str, Array], white: bool) -> Merged:
    """The scans of all sensors, with all their noise, or what is new at every scan."""
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
    """The error's name where all that consider it have the same one, else the sensor's before it."""
    beliefs = [
        {one.name: one for one in noise.considered}.get(error)
        for scans, noise, *_ in inputs.values()
        if error in _errors(scans, noise)
    ]
    alike = all(one is not None and one.shared and one == beliefs[0] for one in beliefs)
    return error if alike and error not in OWN else f"{name} {error}"


def _considering(inputs: BySensor, chosen: Chosen) -> Considering | None:
    """Errors of all sensors at all scans; None where nothing is considered.

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
    if not found:
        return None
    by = _merged(inputs, seen, drift, white=False)
    return Considering(by.R[:, 0], by.sensor, consider_all(*found))


def _begin(inputs: BySensor, merged: Merged, target: str, targets: TargetModel, at: int) -> Start | None:
    """From a row on, the first of the sensors' starts that knows the distance, else the first of all."""
    found = []
    for i, one in enumerate(inputs.values()):
        begin = start_of_target(one, target, targets, int((merged.which[:at] == i).sum()))
        if begin is None:
            continue
        row = -1
        if begin.row >= 0:
            row = int(np.flatnonzero((merged.which == i) & (merged.rows == begin.row))[0])
        found.append((one.scans.elements == ("azimuth",), begin.time, begin._replace(row=row)))
    return min(found, key=lambda one: one[:2])[2] if found else None


def _together(inputs: BySensor, merged: Merged, target: str) -> tuple[Scans, Truth]:
    """All scans as those of one sensor, as far as a track's scores need them, and the target's truth."""
    scans = [one.scans for one in inputs.values()]
    truths = [one.split(target)[0] for one in inputs.values()]
    if len(scans) == 1:
        return scans[0], truths[0]
    K, m = max(one.ids.shape[1] for one in scans), len(merged.sensor.angles)
    firsts = np.cumsum([0, *(len(one.times) for one in scans)])
    order = firsts[merged.which] + merged.rows
    ids, labels = (
        np.concatenate(
            [np.pad(one, ((0, 0), (0, K - one.shape[1])), constant_values="") for one in each]
        )[order]
        for each in ([one.ids for one in scans], [one.labels for one in scans])
    )  # fmt: skip
    position, velocity = (
        np.concatenate(each)[order]
        for each in ([one.position for one in truths], [one.velocity for one in truths])
    )
    nowhere = np.full((len(order), 2), np.nan)
    together = Scans(
        TOGETHER, TOGETHER, merged.times, np.full((len(order), K, m), np.nan), nowhere, nowhere,
        tuple(f"element_{i}" for i in range(m)), labels, ids,
    )  # fmt: skip
    return together, Truth(target, position, velocity, max(one.sd_m for one in truths))


def _last_row(times: Array, used: NDArray[np.bool_], start: float, patience: float, after: float) -> int:
    """The first row that has a track no more: ``after`` s behind the last one used before a longer pause."""
    hits = np.concatenate([[start], times[used]])
    pauses = np.flatnonzero(np.diff(hits) > patience)
    end = hits[pauses[0]] if len(pauses) else hits[-1]
    return int(np.searchsorted(times, end + after, side="right"))


def _scored(
    nothing: SensorTrack,
    name: str,
    track: Track,
    truth: Truth,
    begun: NDArray[np.bool_],
    ids: NDArray[np.object_],
) -> SensorTrack:
    """A filter's track beside the truth; innovations count where ``begun`` (N,)."""
    counts = track.used & begun
    innovation, S = np.where(counts[:, None], track.innovation, np.nan), track.S.copy()
    S[~counts] = np.nan
    error = np.column_stack([truth.position, truth.velocity]) - track.x
    return nothing._replace(
        filter=name,
        estimate=track.x,
        error=error,
        nees=position_nees(error[:, :2], track.P[:, :2, :2], truth.covariance),
        innovation=innovation,
        nis=np.where(counts, track.nis, np.nan),
        covariance=track.P,
        S=S,
        detection=np.where(track.used, ids, ""),
    )


def _no_track(scans: Scans, truth: Truth, targets: TargetModel) -> SensorTrack:
    """Of a target that was never found."""
    n, m = len(scans.times), scans.detections.shape[-1]

    def empty(*shape: int) -> Array:
        return np.full((n, *shape), np.nan)

    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    near = errors_near(scans, truth, targets.reach(scans.kind))[1] >= 0
    return SensorTrack(
        scans.sensor, truth.target, "", scans.times, empty(4), empty(4), empty(), empty(m), empty(), known,
        near, empty(4, 4), empty(m, m), np.full(n, "", object),
    )  # fmt: skip
