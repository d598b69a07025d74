"""Targets followed by each sensor of a moving platform on its own: a flight in, a table out.

Every filter of a target gets the same detections: those that the filter with white noise let into its gate,
nearest first. What differs is what they believe of the errors:

``kf`` (positions), ``ekf`` (bearings)
    Errors are new at every scan, H (3.5), (3.7).
``coloured``
    Errors of successive scans are alike, and the filter works on differences, H 7.2.2. Positions only.
``schmidt``
    Position, heading and clock are wrong by something that lasts, considered and not estimated, H 7.4.
``thinned``
    As the first, on detections so far apart that their errors hardly have to do with each other.

A track starts on the first detection near the target's true position, and nearer to it than to another
target, since no detection says what it is of; from there on the truth is not looked at. A bearing leaves the
distance open: it starts at the mean distance of the tuning's flight. A track ends where nothing falls into
its gate for `PATIENCE_S`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.consistency import average, chi_square_interval, position_nees, share_inside
from wildlab.evaluation.track_errors import summarise_track, track_errors
from wildlab.evaluation.whiteness import autocorrelation, effective_sample_size
from wildlab.flight.store import Flight
from wildlab.pipeline.scans import Scans, Truth, scans_of, truths_at
from wildlab.pipeline.sensor_tuning import REACH, SensorTuning, errors_near
from wildlab.tracking.coloured import run_coloured, thin
from wildlab.tracking.maritime import bearings_from, positions_from, white_acceleration
from wildlab.tracking.run import Start, Track, run_filter
from wildlab.tracking.schmidt import PoseUncertainty

Array = NDArray[np.float64]

FILTERS = {
    "position": ("kf", "coloured", "schmidt", "thinned"),
    "bearing": ("ekf", "schmidt", "thinned"),
}
#: The filter that the others are held against, by kind of detection.
WHITE = {kind: names[0] for kind, names in FILTERS.items()}

#: A boat at 2.5 m/s may turn by a right angle in 20 s: each axis of its velocity changes by 2.5 m/s, taken
#: for two standard deviations. m/s per square root of a second.
ACCELERATION_DENSITY = float(2.5 / 2 / np.sqrt(20.0))
#: A boat in a harbour keeps below 6 m/s, taken for two standard deviations; nothing is known of its course.
START_SPEED_M_S = 3.0
#: Probability with which a target's own detection lies in the gate.
GATE = 0.99
PATIENCE_S = 10.0
#: H 7.2.2: measurements further apart than this (s) are taken for independent; but the next scan of a slow
#: sensor is no gap, so it is one and a half scans at least.
LONGEST_GAP_S, LONGEST_GAP_LOOKS = 1.0, 1.5


class SensorTrack(NamedTuple):
    """One target followed by one filter.

    Row by row of the scans: ``estimate`` (N, 4) north, east, velocities, NaN without a track; ``error``
    (N, 4) truth minus estimate and ``nees`` (N,) of the position, NaN without truth too; ``innovation``
    (N, m) and ``nis`` (N,) of the detections used, NaN elsewhere. ``known`` (N,): where there is truth.
    ``near`` (N,): where the sensor saw something within `REACH` of the target's true place.
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


def follow_flight(flight: Flight, tunings: Mapping[str, SensorTuning]) -> list[SensorTrack]:
    """Every target with truth, by every sensor that has a tuning, with every filter.

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
            found += follow(scans, truth, tuning, others)
    return found


def follow(
    scans: Scans, truth: Truth, tuning: SensorTuning, others: Sequence[Truth] = ()
) -> list[SensorTrack]:
    """One target by one sensor, with every filter of its kind; ``others`` are targets not to start on."""
    begin = start_near(scans, truth, tuning, others)
    if begin is None:
        return [_nothing(scans, truth, name) for name in FILTERS[scans.kind]]
    usable = np.asarray(np.isfinite(scans.platform).all(axis=1))
    seen = np.where(usable[:, None, None], scans.detections, np.nan)
    at, m = np.nan_to_num(scans.platform), seen.shape[-1]
    sensor = positions_from if scans.kind == "position" else bearings_from
    motion = partial(white_acceleration, density=ACCELERATION_DENSITY)
    white = np.eye(m) * tuning.sd**2
    own_drift = np.zeros_like(at)
    first = run_filter(scans.times, seen, white, sensor(at, own_drift), motion, begin, gate_probability=GATE)
    # From here on one detection a scan: the same for all.
    own = np.where(first.used[:, None], seen[np.arange(len(seen)), np.maximum(first.chosen, 0)], np.nan)
    rest: dict[str, Callable[[], Track]] = {
        "coloured": lambda: _coloured(scans.times, own, tuning, motion, begin),
        "schmidt": lambda: run_filter(
            scans.times,
            own,
            np.eye(m) * tuning.white_sd**2,
            # An error of the clock moves the target by what the filter with white noise says it moves.
            sensor(at, np.nan_to_num(first.x[:, 2:] - scans.platform_velocity)),
            motion,
            begin,
            pose=PoseUncertainty(
                np.tile(tuning.pose_covariance, (len(own), 1, 1)), tuning.correlation_time_s
            ),
        ),
        "thinned": lambda: run_filter(
            scans.times,
            np.where(thin(scans.times, tuning.thinning_s, first.used)[:, None], own, np.nan),
            white,
            sensor(at, np.zeros_like(at)),
            motion,
            begin,
        ),
    }
    last = _last_row(scans.times, first.used, begin.time)
    begun = scans.times > begin.time
    names = FILTERS[scans.kind]
    tracks = {names[0]: first} | {name: rest[name]() for name in names[1:]}
    return [_score(scans, truth, name, track, begun, last) for name, track in tracks.items()]


def start_near(
    scans: Scans, truth: Truth, tuning: SensorTuning, others: Sequence[Truth] = ()
) -> Start | None:
    """Where a track starts: at the first detection within reach of the target's true place, at rest.

    One that lies nearer to one of the ``others`` is not taken. The detection itself is not used up: the start
    is as uncertain as the search was wide, and the detection is the first that the filter is given.
    """
    error, nearest = errors_near(scans, truth)
    taken = nearest >= 0
    for other in others:
        beside, its = errors_near(scans, other)
        rival = (its == nearest) & (np.linalg.norm(beside, axis=1) < np.linalg.norm(error, axis=1))
        taken &= ~rival
    rows = np.flatnonzero(taken & np.isfinite(scans.platform).all(axis=1))
    if not len(rows):
        return None
    row = int(rows[0])
    z = scans.detections[row, nearest[row]]
    x, P = np.zeros(4), np.diag([0.0, 0.0, START_SPEED_M_S**2, START_SPEED_M_S**2])
    if scans.kind == "position":
        x[:2] = z
        P[:2, :2] = np.eye(2) * REACH["position"] ** 2
    else:
        ahead = np.array([np.cos(z[0]), np.sin(z[0])])
        right = np.array([-ahead[1], ahead[0]])
        x[:2] = scans.platform[row] + tuning.range_m * ahead
        P[:2, :2] = tuning.range_sd_m**2 * np.outer(ahead, ahead)
        P[:2, :2] += (tuning.range_m * REACH["bearing"]) ** 2 * np.outer(right, right)
    return Start(float(scans.times[row]), x, P)


def _coloured(
    times: Array,
    own: Array,
    tuning: SensorTuning,
    motion: Callable[[float], tuple[Array, Array]],
    begin: Start,
) -> Track:
    gap = max(LONGEST_GAP_S, LONGEST_GAP_LOOKS * tuning.interval_s)
    used = np.flatnonzero(np.isfinite(own[:, 0]))
    # Behind a gap the measurement itself is used, and its error is the whole one.
    whole = np.ones(len(times), bool)
    whole[used[1:]] = np.diff(times[used]) > gap
    sd = np.where(whole, tuning.sd, tuning.driving_sd)
    R_w = sd[:, None, None] ** 2 * np.eye(2)
    return run_coloured(times, own, R_w, motion, begin, F_c=np.eye(2) * tuning.fading, longest_gap=gap)


def _last_row(times: Array, used: NDArray[np.bool_], start: float) -> int:
    """The first row that has a track no more."""
    hits = np.concatenate([[start], times[used]])
    pauses = np.flatnonzero(np.diff(hits) > PATIENCE_S)
    end = hits[pauses[0]] if len(pauses) else hits[-1]
    return int(np.searchsorted(times, end + PATIENCE_S, side="right"))


def _score(
    scans: Scans, truth: Truth, name: str, track: Track, begun: NDArray[np.bool_], last: int
) -> SensorTrack:
    x, innovation, nis = track.x.copy(), track.innovation.copy(), track.nis.copy()
    x[last:] = np.nan
    # The first detection is where the track was put: it surprises nobody.
    off = ~(track.used & begun)
    off[last:] = True
    innovation[off], nis[off] = np.nan, np.nan
    where = np.column_stack([truth.position, truth.velocity])
    error = np.where(np.isfinite(x), where - x, np.nan)
    nees = position_nees(error[:, :2], track.P[:, :2, :2], truth.covariance)
    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    near = errors_near(scans, truth)[1] >= 0
    return SensorTrack(
        scans.sensor, truth.target, name, scans.times, x, error, nees, innovation, nis, known, near
    )


def _nothing(scans: Scans, truth: Truth, name: str) -> SensorTrack:
    n, m = len(scans.times), scans.detections.shape[-1]
    empty = np.full((n, 4), np.nan)
    known = np.asarray(np.isfinite(truth.position).all(axis=1))
    nan, near = np.full(n, np.nan), errors_near(scans, truth)[1] >= 0
    unused = np.full((n, m), np.nan)
    return SensorTrack(
        scans.sensor, truth.target, name, scans.times, empty, empty, nan, unused, nan, known, near
    )


#: A track whose error (m) is below this is with its target: about the length of the ferry's smaller boats.
WITH_ITS_TARGET_M = 15.0
#: Numbers of a row of `table`, with their units.
COLUMNS = {
    "rmse": "m",
    "mae": "m",
    "anees": "1",
    "anis": "1",
    "lag1_autocorrelation_north": "1",
    "lag1_autocorrelation_east": "1",
    "lag1_autocorrelation": "1",
    "fraction_nees_inside": "1",
    "share_followed": "1",
    "share_with_target": "1",
}


def table(followed: list[SensorTrack]) -> pd.DataFrame:
    """One row for each track, its columns those of `COLUMNS` and:

    ``sensor``, ``kind``, ``target``, ``filter``; ``detections`` used; ``compared``, scans with a track and
    truth; ``nees_low`` and ``nees_high``, the 95 % interval of the mean NEES of a consistent filter, for as
    many values as the correlated ones are worth; ``nis_low`` and ``nis_high`` likewise. ``anees`` is of the
    position, 2 is right; ``anis`` is of the detections that were let in, 2 or 1 is right, by the elements of
    a measurement. ``share_followed``: of the scans with truth, those that have a track. ``seen``: scans in
    which the sensor saw something near the target's true place, and ``share_with_target``: in how many of
    them a track is within `WITH_ITS_TARGET_M` of it.
    """
    return pd.DataFrame([_row(one) for one in followed])


def _row(one: SensorTrack) -> dict[str, object]:
    summary = summarise_track(track_errors(one.estimate + one.error, one.estimate))
    m = one.innovation.shape[1]
    used = one.innovation[np.isfinite(one.nis)]
    lag1 = [_lag1(column) for column in used.T]
    nees, nis = average(one.nees, 2, _worth(one.nees)), average(one.nis, m, _worth(one.nis))
    on = np.isfinite(one.error[:, 0])
    there = np.hypot(*one.error[:, :2].T) < WITH_ITS_TARGET_M  # NaN, where there is no track, is not there
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
        "share_with_target": float(there[one.near].mean()) if one.near.any() else np.nan,
    }


def _worth(values: Array) -> float:
    known = values[np.isfinite(values)]
    return effective_sample_size(known, len(known) - 1) if len(known) > 3 else float(len(known))


def _lag1(values: Array) -> float:
    return float(autocorrelation(values, 1)[1]) if len(values) > 2 else float("nan")
