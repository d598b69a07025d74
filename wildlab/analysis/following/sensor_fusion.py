"""One target by several sensors in one track, each with its own noise, clock and errors that last.

Errors of one name that two sensors believe in alike (same standard deviation, same correlation time) and
share are one error, as that of the heading of the platform that both are on; others are each sensor's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.following.consider_parameters import errors_of
from wildlab.analysis.following.expected import sensor_of
from wildlab.analysis.following.filters import (
    CALM,
    SMOOTHED,
    STAY_S,
    motion_of,
    white_noise,
    without_innovations,
)
from wildlab.analysis.following.noise_model import NoiseModel, TargetModel
from wildlab.analysis.following.reinitialisation import (
    ends_by,
    geometry_of,
    joined,
    one_after_another,
    starts_of,
)
from wildlab.analysis.following.sensor_tracks import (
    SensorTrack,
    begin_of_target,
    ended,
    last_row,
    no_track,
    scored,
)
from wildlab.analysis.scans import Scans, Truth, truths_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import Considered, consider_all
from wildlab.tracking.filters import run_imm, run_unscented
from wildlab.tracking.records import Start, Track
from wildlab.tracking.run import Ends, run_filter
from wildlab.tracking.sensors import Merged, Sensor, SensorMeasurements, merge, renamed
from wildlab.tracking.smoothing import run_smoothed, smooth

#: Filters that take looks of several sensors.
ABLE = ("ekf", "ukf", "imm", "schmidt")
#: Errors of a sensor, not of the platform it is on.
OWN = ("clock", "range_bias")

#: By sensor: its looks, what is believed of it, and the targets that it may follow.
Parts = Mapping[str, tuple[Scans, NoiseModel, list[Truth]]]


def fuse_sensors(
    flight: Flight, parts: Parts, target: str, targets: TargetModel, filters: Sequence[str]
) -> list[SensorTrack]:
    """One target by all sensors that may see it, with each of the filters; nothing by fewer than two."""
    mine = {name: part for name, part in parts.items() if any(one.target == target for one in part[2])}
    if len(mine) < 2:
        return []
    seen, begins = {}, {}
    for name, (scans, beliefs, truths) in mine.items():
        truth = next(one for one in truths if one.target == target)
        others = [one for one in truths if one.target != target]
        seen[name], begins[name] = begin_of_target(scans, truth, beliefs, targets, others)
    merged = _merged(mine, seen, {name: np.zeros_like(part[0].platform) for name, part in mine.items()}, True)
    looks, sizes = _looks(mine, merged), np.asarray(merged.sensor.sizes, np.int64)
    truth = _truth(flight, looks, target)
    begin = _begin(mine, merged, begins)
    if begin is None:
        return [no_track(looks, truth, name, targets)._replace(sizes=sizes) for name in filters]
    labelled = any(part[0].labelled for part in mine.values())
    rows, count = np.arange(len(merged.times)), len(merged.times)
    z = merged.measurements if merged.measurements.ndim == 3 else merged.measurements[:, None]
    ends = _ends(mine, merged, seen)

    def choose_from(at: int, start: Start) -> Track:
        later = np.where((rows >= at)[:, None, None], z, np.nan)
        track = run_filter(
            merged.times, later, merged.R, merged.sensor, motion_of(targets), _shifted(start, at),
            gate_probability=1.0 if labelled else targets.gate_probability, ends=ends,
        )  # fmt: skip
        return Track._make(part[at:] for part in track)

    def again(at: int) -> Start | None:
        later = {}
        for i, (name, (scans, beliefs, truths)) in enumerate(mine.items()):
            cut = scans.detections.copy()
            cut[merged.rows[:at][merged.which[:at] == i]] = np.nan
            own_truth = next(one for one in truths if one.target == target)
            others = [one for one in truths if one.target != target]
            left = scans._replace(detections=cut)
            later[name] = begin_of_target(left, own_truth, beliefs, targets, others)[1]
        found = _begin(mine, merged, later)
        return None if found is None else _shifted(found, -at)

    pieces, first = one_after_another(begin, count, choose_from, again)
    chosen = np.maximum(first.chosen, 0)
    for row in [piece.first + piece.begin.row for piece in pieces if piece.begin.row >= 0]:
        chosen[row] = int(np.argmax(np.isfinite(z[row]).any(axis=-1)))
    own = np.where(first.used[:, None], z[rows, chosen], np.nan)
    ids = np.where(first.used, looks.ids[rows, chosen], "")
    patience = np.inf if labelled else targets.patience_s
    last = last_row(merged.times, first.used, begin.time, patience, targets.patience_s)
    last = min(last, pieces[-1].last)
    first, own = ended(first, own, last)
    starts = starts_of(merged.times, pieces)
    begun = np.zeros(count, bool)
    for piece in pieces:
        at, start = piece.first, piece.begin
        behind = rows > at + start.row if start.row >= 0 else merged.times > start.time
        begun[piece.rows] = behind[piece.rows]
    found = []
    for name in filters:
        tracks = []
        for piece in pieces:
            inside = (rows >= piece.first) & (rows < piece.last)
            mine_only = first._replace(x=np.where(inside[:, None], first.x, np.nan))
            taken = np.where(inside[:, None], own, np.nan)
            track = _run(name, mine, merged, taken, mine_only, targets, _shifted(piece.begin, piece.first))
            if track is not None:
                tracks.append(Track._make(part[piece.rows] for part in track))
        if tracks:
            one = scored(looks, truth, name, joined(tracks, pieces, count), begun, last, targets, ids)
            found.append(one._replace(sizes=sizes, starts=starts[starts < last], last=last))
    return found


def _shifted(start: Start, by: int) -> Start:
    """The start with its row counted from elsewhere."""
    return start._replace(row=start.row + by) if start.row >= 0 else start


def _ends(mine: Parts, merged: Merged, seen: Mapping[str, Array]) -> Ends | None:
    """When a track of all sensors ends; None where none of them bends."""
    shapes = [geometry_of(scans, seen[name], beliefs) for name, (scans, beliefs, _) in mine.items()]
    if all(one is None for one in shapes):
        return None
    gap = max(beliefs.longest_gap_s for _, beliefs, _ in mine.values())
    return ends_by(merged.times, gap, lambda row: (shapes[merged.which[row]], int(merged.rows[row])))


def _merged(mine: Parts, seen: Mapping[str, Array], drift: Mapping[str, Array], white: bool) -> Merged:
    parts = []
    for name, (scans, beliefs, _) in mine.items():
        sds = beliefs.white if white else beliefs.noise
        parts.append(
            SensorMeasurements(
                scans.times, seen[name], white_noise(scans, sds), _named(mine, name, drift[name])
            )
        )
    return merge(parts)


def _named(mine: Parts, name: str, drift: Array) -> Sensor:
    """A sensor whose own errors have names of their own."""
    scans, beliefs, _ = mine[name]
    return renamed(sensor_of(scans, drift), {one: _name(mine, name, one) for one in _errors(scans, beliefs)})


def _errors(scans: Scans, beliefs: NoiseModel) -> tuple[str, ...]:
    errors = errors_of(scans, beliefs)
    return () if errors is None else errors.names


def _name(mine: Parts, name: str, error: str) -> str:
    """The error's name where all that consider it believe in the same one, else the sensor's before it."""
    beliefs = [
        {one.name: one for one in part[1].considered}.get(error)
        for part in mine.values()
        if error in _errors(part[0], part[1])
    ]
    alike = all(one is not None and one.shared and one == beliefs[0] for one in beliefs)
    return error if alike and error not in OWN else f"{name} {error}"


def _considered(mine: Parts, merged: Merged) -> Considered | None:
    """The errors of all sensors at all looks; a pose's covariance as it last was."""
    found: dict[str, Considered] = {}
    for i, (name, (scans, beliefs, _)) in enumerate(mine.items()):
        errors = errors_of(scans, beliefs)
        if errors is None:
            continue
        before = np.searchsorted(scans.times, merged.times, side="right") - 1
        at = np.where(merged.which == i, merged.rows, np.clip(before, 0, len(scans.times) - 1))
        covariance = _filled(errors.covariance)[at]
        names = [_name(mine, name, one) for one in errors.names]
        new = [k for k, one in enumerate(names) if not any(one in other.names for other in found.values())]
        if new:
            found[name] = Considered(
                tuple(names[k] for k in new),
                covariance[:, new][:, :, new],
                tuple(float(np.broadcast_to(errors.correlation_time, len(names))[k]) for k in new),
            )
    return consider_all(*found.values()) if found else None


def _filled(covariance: Array) -> Array:
    """Rows (N, k, k) without a covariance have that of the known row before, or of the first."""
    known = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))
    if not len(known):
        return covariance
    at = known[np.clip(np.searchsorted(known, np.arange(len(covariance)), side="right") - 1, 0, None)]
    return np.asarray(covariance[at])


def _begin(mine: Parts, merged: Merged, begins: Mapping[str, Start | None]) -> Start | None:
    """The first of the sensors' starts that knows the distance, else the first of all."""
    found = []
    for i, (name, (scans, _, _)) in enumerate(mine.items()):
        begin = begins[name]
        if begin is None:
            continue
        row = -1
        if begin.row >= 0:
            row = int(np.flatnonzero((merged.which == i) & (merged.rows == begin.row))[0])
        ray = scans.kind == "bearing" and "elevation" not in scans.elements
        found.append((ray, begin.time, begin._replace(row=row)))
    return min(found, key=lambda one: one[:2])[2] if found else None


def _looks(mine: Parts, merged: Merged) -> Scans:
    """All looks as those of one sensor, as far as a track's scores need them."""
    scans = [part[0] for part in mine.values()]
    K = max(one.ids.shape[1] for one in scans)
    n, m = len(merged.times), len(merged.sensor.angles)
    ids, labels = np.full((n, K), "", object), np.full((n, K), "", object)
    for i, one in enumerate(scans):
        rows: NDArray[np.intp] = np.flatnonzero(merged.which == i)
        ids[rows, : one.ids.shape[1]] = one.ids[merged.rows[rows]]
        labels[rows, : one.ids.shape[1]] = one.labels[merged.rows[rows]]
    nowhere = np.full((n, 2), np.nan)
    elements = tuple(f"element_{i}" for i in range(m))
    return Scans(
        "together", "together", merged.times, np.full((n, K, m), np.nan), nowhere, nowhere, elements, labels,
        ids,
    )  # fmt: skip


def _truth(flight: Flight, looks: Scans, target: str) -> Truth:
    if flight.truth is not None and len(flight.truth):
        for one in truths_at(flight, looks.times):
            if one.target == target:
                return one
    nowhere = np.full((len(looks.times), 2), np.nan)
    return Truth(target, nowhere, nowhere, 0.0)


def _run(
    name: str, mine: Parts, merged: Merged, own: Array, first: Track, targets: TargetModel, begin: Start
) -> Track | None:
    """One filter on the chosen detections (N, m); None where there is nothing to consider."""
    base, smoothed, motion = name.removesuffix(SMOOTHED), name.endswith(SMOOTHED), motion_of(targets)
    R = merged.R if merged.R.ndim == 3 else merged.R[:, 0]
    # All detections of a look have the noise of its sensor; the first may be one that is not there.
    if base == "ekf":
        return without_innovations(smooth(first, motion)) if smoothed else first
    if base == "ukf":
        track = run_unscented(merged.times, own, R, merged.sensor, motion, begin)
        return without_innovations(smooth(track, motion)) if smoothed else track
    if base == "imm":
        both = [motion_of(targets, CALM), motion]
        return run_imm(merged.times, own, R, merged.sensor, both, (STAY_S, STAY_S), begin).track
    errors = _considered(mine, merged)
    if errors is None:
        return None
    drift, seen = {}, {}
    for i, (sensor, (scans, _, _)) in enumerate(mine.items()):
        velocity = np.zeros((len(scans.times), 2))
        rows = np.flatnonzero(merged.which == i)
        velocity[merged.rows[rows]] = np.nan_to_num(first.x[rows, 2:4])
        drift[sensor] = velocity - np.nan_to_num(scans.platform_velocity)
        chosen = np.full((len(scans.times), len(scans.elements)), np.nan)
        chosen[merged.rows[rows]] = own[rows, : len(scans.elements)]
        seen[sensor] = chosen
    given = _merged(mine, seen, drift, False)
    run = run_smoothed if smoothed else run_filter
    track = run(given.times, given.measurements, given.R, given.sensor, motion, begin, pose=errors)
    return without_innovations(track) if smoothed else track
