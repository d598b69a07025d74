"""The tracker: targets of a flight through all of its sensors, as `wildlab track` and `wildlab.track` call
it, and how far to believe the tracks: errors and NEES by the truth, NIS and whiteness, two sensors side by
side.

What depends on a flight is read once (`read_inputs`). Identity is known or the nearest in the gate is taken:
each target has tracks of its own, by each sensor and by all together, through several filters.
`wildlab.analysis.tracks.many` tracks all targets at once instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.accuracy import as_calibrated
from wildlab.analysis.tracks.noise_model import (
    OF_UNNAMED,
    STATED,
    GivenValue,
    NoiseModel,
    SensorInputs,
    TargetModel,
    Tuned,
    model_noise,
    model_targets,
    settings_of,
)
from wildlab.analysis.tracks.scans import PLACEABLE, Scans, Truth, scans_of, sensors_of, truths_at
from wildlab.analysis.tracks.single_target import (
    NAMES,
    SMOOTHABLE,
    SMOOTHED,
    STATE,
    TOGETHER,
    SensorTrack,
    possible,
    track_target,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    Average,
    autocorrelation,
    average,
    chi_square_interval,
    share_inside,
    whiten,
    worth,
    worth_of_errors,
)
from wildlab.evaluation.errors import summarise_track, track_errors
from wildlab.evaluation.intervals import share_interval
from wildlab.files import write_csv
from wildlab.flight.checks.check import FEWEST_SCANS
from wildlab.flight.checks.sensors import looks_of_others
from wildlab.flight.manifest import Settings, absent_sensors
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: What a target is called of which nobody says a name.
UNNAMED = "target"
#: The filter without anything but white noise, which the others are held against.
WHITE = "ekf"
#: Filters that take scans of several sensors.
ABLE = ("ekf", "ukf", "imm", "schmidt")


class TrackingInputs(NamedTuple):
    """What trackers take of a flight.

    Attributes
    ----------
    sensors
        By name.
    settings
        As stated, else as the flight has it.
    targets
        What is believed of them.
    given
        What filters are given of the targets, and who says so.
    notes
        What was done to the measurements, in sentences.
    """

    sensors: dict[str, SensorInputs]
    settings: Settings
    targets: TargetModel
    given: list[GivenValue]
    notes: list[str]


def read_inputs(
    flight: Flight,
    *,
    settings: Settings | None = None,
    tuned: Tuned | None = None,
    sensors: Sequence[str] = (),
    source: str | None = None,
    joint: bool = False,
) -> TrackingInputs:
    """Read what a tracker takes of a flight; arguments as of `wildlab.analysis.tracks.tracker.track`.

    ``joint``: for all targets at once, whatever detections name.

    Raises
    ------
    WildlabError
        Where there is no such sensor, no detection, no time, or noise nobody knows.
    """
    refuse_without_times(flight)
    notes = [] if flight.calibration is None else ["The calibration that the flight keeps is applied."]
    flight = as_calibrated(flight, source)
    stated = settings_of(flight, settings)
    targets, given = model_targets(stated.targets)
    if tuned is not None and tuned.density is not None and stated.targets.acceleration_m_s_sqrt_s is None:
        targets = targets._replace(density=tuned.density)
        given = [one for one in given if not one.what.startswith("acceleration")]
        given.insert(0, tuned.given_density())
    notes += [*_notes_of_absent(flight, stated), *_notes_of_sources(flight)]
    found: dict[str, SensorInputs] = {}
    for name in sensors_with_detections(flight, sensors):
        scans = scans_of(flight, name, 0.0, source)
        if joint and scans.kind not in PLACEABLE and not sensors:
            notes.append(f"{name} was left out: what it detects ({scans.kind}) tells nothing of a place.")
            continue
        there, on = (None, "") if tuned is None else (tuned.sensors.get(name), tuned.words)
        if joint and there is not None:
            # What lasts is each target's own there: which part of it is seen.
            there = there.of_each_target()
        noise, more = model_noise(flight, scans, stated, there, on)
        if noise.offset_s:
            scans = scans_of(flight, name, noise.offset_s, source)
        scans = scans if joint else _identified(scans, targets)
        found[name] = SensorInputs(scans, noise, _targets_of(flight, scans), more)
    return TrackingInputs(found, stated, targets, given, notes)


def refuse_without_times(flight: Flight) -> None:
    """Refuse a flight whose photos carry no time.

    Raises
    ------
    WildlabError
        Of such a flight.
    """
    if not flight.timed:
        raise WildlabError(
            "the photos carry no time",
            "import the flight with times",
            file=flight.folder,
            field="time.kind",
        )


def _notes_of_absent(flight: Flight, stated: Settings) -> list[str]:
    """A sentence for each sensor that the settings speak of and the flight does not have."""
    absent = absent_sensors(stated, sensors_of(flight))
    return [
        f"The settings speak of a sensor {name!r}, which this flight does not have; {meant}."
        for name, meant in absent.items()
    ]


def _notes_of_sources(flight: Flight) -> list[str]:
    """A sentence for each source whose detections are of no sensor: these are not used."""
    frames, seen = flight.frames, flight.detections
    if frames is None or seen is None:
        return []
    others = looks_of_others(frames, seen)
    strange = others[~others["source"].isin(sensors_of(flight))]
    return [
        f"{len(rows)} detections of the source {str(source)!r} are in looks of "
        f"{f'the sensor {str(sensor)!r}' if sensor else 'no sensor'} and are not used: detections are a "
        "sensor's where their source has its name."
        for (source, sensor), rows in strange.groupby(["source", "sensor"], sort=True)
    ]


def sensors_with_detections(flight: Flight, wanted: Sequence[str] = ()) -> list[str]:
    """The sensors that are named, or all that detected something.

    Raises
    ------
    WildlabError
        Where nothing was detected, or there is no such sensor.
    """
    seen = flight.detections
    if seen is None or not len(seen):
        raise WildlabError(
            "there are no detections to track",
            "add detections: wildlab import, wildlab detect",
            file=flight.folder,
            field="detections",
        )
    known = sensors_of(flight)
    for name in wanted:
        if name not in known:
            raise WildlabError(
                f"there is no sensor {name!r}",
                f"use one of {', '.join(known)}",
                file=flight.folder,
                field="--sensor",
            )
    saw = set(seen["source"])
    found = list(dict.fromkeys(wanted)) or [name for name in known if name in saw]
    if not found:
        raise WildlabError(
            "no detection is by a sensor that the frames name",
            f"give them one of these as source: {', '.join(known)}",
            file=flight.folder,
            field="detections.source",
        )
    return found


def _identified(scans: Scans, targets: TargetModel) -> Scans:
    """The scans with labels as far as they are to be believed."""
    if targets.identified in ("gate", "one"):
        return scans._replace(labels=np.full(scans.labels.shape, "", object))
    if targets.identified == "label" and not scans.labelled:
        raise WildlabError(
            f"no detection of the sensor {scans.sensor!r} names its target",
            'set identified = "gate" in [targets], or leave it out',
            field="targets.identified",
        )
    return scans


def _targets_of(flight: Flight, scans: Scans) -> list[Truth]:
    """The targets that a sensor may follow, with their true places as far as they are known."""
    truths = [] if flight.truth is None or not len(flight.truth) else truths_at(flight, scans.times)
    nowhere = np.full((len(scans.times), 2), np.nan)
    if not scans.labelled:
        return truths or [Truth(UNNAMED, nowhere, nowhere, 0.0)]
    by_name = {one.target: one for one in truths}
    names = dict.fromkeys(str(one) for one in scans.labels.ravel() if one)
    return [by_name.get(name) or Truth(name, nowhere, nowhere, 0.0) for name in names]


class TrackingResult(NamedTuple):
    """Targets followed through a flight.

    Attributes
    ----------
    tracks
        One for each sensor, target and filter, in this order.
    scans, beliefs
        By sensor.
    given
        What filters were given, and who says so.
    notes
        What was done to the measurements, in sentences.
    truth
        Whether any target's true place is known.
    """

    tracks: list[SensorTrack]
    scans: dict[str, Scans]
    beliefs: dict[str, NoiseModel]
    targets: TargetModel
    given: list[GivenValue]
    notes: list[str]
    truth: bool


def track(
    flight: Flight,
    *,
    settings: Settings | None = None,
    tuned: Tuned | None = None,
    filters: Sequence[str] = (),
    targets: Sequence[str] = (),
    sensors: Sequence[str] = (),
    source: str | None = None,
    smooth: bool = False,
) -> TrackingResult:
    """Track each target alone, by each sensor and by all together.

    Parameters
    ----------
    settings
        What is stated of sensors and targets besides ``flight.toml``.
    tuned
        What another flight says of the sensors.
    filters
        Of `wildlab.analysis.tracks.single_target.NAMES`; left out: the one with white noise, and the Schmidt
        filter beside it where there are errors to consider.
    targets, sensors
        Names; left out: all of them.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    smooth
        Backwards in time as well.

    Raises
    ------
    WildlabError
        Where there is no such sensor, target or filter, no detection, no time, or noise nobody knows.
    """
    inputs = read_inputs(flight, settings=settings, tuned=tuned, sensors=sensors, source=source)
    given, notes, tracks = list(inputs.given), list(inputs.notes), list[SensorTrack]()
    known: set[str] = set()
    for sensor, one in inputs.sensors.items():
        given += one.given
        names, without = chosen_filters(one.scans, one.noise, filters)
        notes += without
        if smooth:
            names, without = _smoothed(names, sensor)
            notes += without
        for truth in one.truths:
            known.add(truth.target)
            if not targets or truth.target in targets:
                mine = track_target({sensor: one}, truth.target, inputs.targets, names)
                notes += _never(mine, one.scans)
                tracks += mine
    _refuse_unknown(targets, known, flight)
    if all(one.scans.labelled for one in inputs.sensors.values()):
        given = [one for one in given if one.subject != "targets" or one.what not in OF_UNNAMED]
    truths = [truth for one in inputs.sensors.values() for truth in one.truths]
    if still := {truth.target for truth in truths if truth.fixed}:
        given.append(GivenValue("targets", "at rest, as their truth has no time", str(len(still)), STATED))
    names = [name for name in (filters or (WHITE, "schmidt")) if name in ABLE]
    names = list(dict.fromkeys([WHITE, *(_smoothed(names, "")[0] if smooth else names)]))
    for target in sorted(known):
        able = {
            name: one
            for name, one in inputs.sensors.items()
            if any(truth.target == target for truth in one.truths)
        }
        if len(able) > 1 and (not targets or target in targets):
            tracks += track_target(able, target, inputs.targets, names)
    return TrackingResult(
        tracks,
        {name: one.scans for name, one in inputs.sensors.items()},
        {name: one.noise for name, one in inputs.sensors.items()},
        inputs.targets,
        given,
        notes,
        any(np.isfinite(truth.position).any() for truth in truths),
    )


def chosen_filters(scans: Scans, beliefs: NoiseModel, wanted: Sequence[str]) -> tuple[list[str], list[str]]:
    """The filters for a sensor, the white one first: those wanted, or what there is data for.

    Returns
    -------
    Names, and for each that the sensor's detections cannot go through a sentence.

    Raises
    ------
    WildlabError
        Where there is no such filter.
    """
    names = ["ekf" if name == "kf" else name for name in wanted]
    _refuse_unknown_filters(wanted)
    able = possible(scans, beliefs)
    if not names:
        names = [name for name in ("schmidt", "coloured") if not able[name] and not able["schmidt"]]
    without = [
        f"The filter {name!r} was not used by the sensor {scans.sensor!r}: {able[name]}."
        for name in dict.fromkeys(names)
        if able[name]
    ]
    return [name for name in dict.fromkeys([WHITE, *names]) if not able[name]], without


def _refuse_unknown_filters(wanted: Sequence[str]) -> None:
    for name in wanted:
        if name not in (*NAMES, "kf"):
            raise WildlabError(
                f"there is no filter {name!r}", f"use one of {', '.join(NAMES)}", field="--filter"
            )


def _smoothed(names: Sequence[str], sensor: str) -> tuple[list[str], list[str]]:
    """Each with its smoothed one behind it; and a sentence for each that has none."""
    both = [one for name in names for one in (name, f"{name}{SMOOTHED}")]
    without = [name for name in names if f"{name}{SMOOTHED}" not in SMOOTHABLE]
    notes = [f"The filter {name!r} of {sensor} was not smoothed: there is no smoother." for name in without]
    return [one for one in both if one in (*NAMES, *SMOOTHABLE)], notes


def _never(tracks: Sequence[SensorTrack], scans: Scans) -> list[str]:
    """Why a target that was seen has no track."""
    one = tracks[0]
    if np.isfinite(one.estimate).any() or not one.near.any():
        return []
    why = {
        "bearing": "a bearing says no distance; state range_m of the sensor, or tune it",
        "velocity": "a velocity gives no position",
        "pixel": "no ray meets the ground; is plane_down_m right?",
    }.get(scans.kind, "no detection has a pose; do poses cover the flight?")
    return [f"{one.target} was never followed by {one.sensor}: {why}."]


def _refuse_unknown(targets: Sequence[str], known: set[str], flight: Flight) -> None:
    for name in targets:
        if name not in known:
            fix = f"use one of {', '.join(sorted(known))}"
            if known == {UNNAMED}:
                fix = "leave --target out: detections name none"
            raise WildlabError(f"there is no target {name!r}", fix, file=flight.folder, field="--target")


def refuse_unusable(
    flight: Flight,
    settings: Settings | None,
    filters: Sequence[str],
    targets: Sequence[str],
    sensors: Sequence[str],
    source: str | None,
) -> None:
    """Refuse what `track` would refuse, as far as that shows without tracking anything.

    Raises
    ------
    WildlabError
        As `track`.
    """
    _refuse_unknown_filters(filters)
    refuse_without_times(flight)
    model, _ = model_targets(settings_of(flight, settings).targets)
    known: set[str] = set()
    for sensor in sensors_with_detections(flight, sensors):
        scans = _identified(scans_of(flight, sensor, 0.0, source), model)
        known |= {one.target for one in _targets_of(flight, scans)}
    _refuse_unknown(targets, known, flight)


#: The metric whose subject is the filter that a page speaks of.
LEADING = "leading_filter"
CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not judged"


def verdict(mean: Average) -> str:
    """Whether a filter is consistent, by the 95 % band of its mean NEES or NIS.

    Few scans are not judged, nor is a mean inside of a band so wide that nearly any filter would pass.
    """
    if mean.n < FEWEST_SCANS or (mean.inside and not mean.telling):
        return UNKNOWN
    return CONSISTENT if mean.inside else OVERCONFIDENT if mean.mean > mean.high else CAUTIOUS


def score_tracks(followed: TrackingResult) -> pd.DataFrame:
    """One row for each track.

    ``sensor``, ``kind``, ``target``, ``filter``; ``detections`` used after the start, and ``used`` with it;
    ``rmse`` and ``mae`` beside the truth, of ``compared`` scans at which the target was seen, and
    ``rmse_without`` of the ``without`` others; of those seen: ``nees`` with ``nees_low``, ``nees_high`` and
    ``nees_worth`` independent values, its ``verdict``; ``inside``, the share of scans in the band of single
    values, with ``inside_low``, ``inside_high``; the same of ``nis``, its degrees of freedom ``dof`` and
    ``nis_verdict``; ``lag1``: the largest autocorrelation of an element of the whitened innovations from one
    detection to the next; ``followed``: the share of scans with truth that have a track; ``restarts``: how
    often a track ended and another started, and ``untracked``: scans without a track, of ``spanned`` from the
    first start to the end of the last, ``untracked_in_view`` of them with the target in sight.
    """
    return pd.DataFrame([score_track(one, kind_of(followed, one.sensor)) for one in followed.tracks])


def leading_filter(rows: pd.DataFrame) -> str:
    """The filter that is spoken of: of those with most tracks that nothing speaks against, the one nearest.

    Parameters
    ----------
    rows
        From `score_tracks`. Without truth NIS takes the place of errors and of
        NEES; smoothed tracks, and those of all sensors together where there are others, do not count.

    Returns
    -------
    str
    """
    alone = rows[~rows["filter"].str.endswith(SMOOTHED)]
    alone = alone if (alone["kind"] == TOGETHER).all() else alone[alone["kind"] != TOGETHER]
    truth = bool((alone["compared"] > 0).any())
    ratio = (alone["nis"] / alone["dof"]).where(alone["nis"] > 0)
    off = alone["rmse"] if truth else pd.Series(np.abs(np.log(ratio)), alone.index)
    # Beside the best filter on the same target: filters need not have the same tracks.
    least = off.groupby([alone["sensor"], alone["target"]]).transform("min")
    of = alone["filter"]
    known, against = alone["nees" if truth else "nis"].notna(), alone["verdict" if truth else "nis_verdict"]
    sound = (known & ~against.isin([OVERCONFIDENT, CAUTIOUS])).groupby(of).sum()
    worse = (off - least if not truth else off / least).groupby(of).median().fillna(np.inf)

    def order(name: str) -> tuple[int, bool, float, bool]:
        # Innovations do not show an error that lasts: without truth the white filter comes after its equals.
        white = name == "ekf"
        return -sound[name], white and not truth and sound[name] > 0, worse[name], white

    return str(min(dict.fromkeys(of), key=order))


def kind_of(followed: TrackingResult, sensor: str) -> str:
    """What a sensor detects; several at once are ``together``."""
    return followed.scans[sensor].kind if sensor in followed.scans else TOGETHER


def score_track(one: SensorTrack, kind: str) -> dict[str, object]:
    """A row of `score_tracks`, of a track by a sensor that detects what the kind says."""
    seen, used = seen_of(one), used_of(one)
    summary = summarise_track(track_errors((one.estimate + one.error)[seen], one.estimate[seen]))
    away = np.hypot(*one.error[~seen, :2].T)
    away = away[np.isfinite(away)]
    m, squares, white = one.dof, one.nees[seen], whitened(one)
    off = whiten(one.error[seen, :2], one.covariance[seen, :2, :2])
    of_nees = average(squares, 2, worth_of_errors(off))
    of_nis = average(one.nis, m, nis_worth(one))
    inside = share_inside(squares, chi_square_interval(2))
    band = (np.nan, np.nan)
    if of_nees.n and of_nees.worth >= 1:
        band = share_interval(inside * of_nees.worth, of_nees.worth)[1:]
    lags = [float(autocorrelation(column, 1)[1]) for column in white.T] if len(white) > 3 else []
    return {
        "sensor": one.sensor,
        "kind": kind,
        "target": one.target,
        "filter": one.filter,
        "detections": int(np.isfinite(one.nis).sum()),
        "used": int(used.sum()),
        "restarts": max(len(one.starts) - 1, 0),
        "untracked": int(one.without.sum()),
        "spanned": int(one.last - one.starts[0]) if len(one.starts) else 0,
        "untracked_in_view": int((one.without & seen).sum()),
        "compared": of_nees.n,
        "rmse": summary.rmse,
        "without": len(away),
        "rmse_without": float(np.sqrt(np.mean(away**2))) if len(away) else np.nan,
        "mae": summary.mae,
        "nees": of_nees.mean,
        "nees_low": of_nees.low,
        "nees_high": of_nees.high,
        "nees_worth": of_nees.worth,
        "verdict": verdict(of_nees) if used.sum() >= FEWEST_SCANS else UNKNOWN,
        "inside": inside,
        "inside_low": band[0],
        "inside_high": band[1],
        "nis": of_nis.mean,
        "nis_low": of_nis.low,
        "nis_high": of_nis.high,
        "nis_worth": of_nis.worth,
        "nis_verdict": verdict(of_nis),
        "dof": m,
        "lag1": max(lags, key=abs, default=np.nan),
        "followed": float(np.isfinite(one.error[:, 0]).sum() / one.known.sum())
        if one.known.any()
        else np.nan,
    }


def used_of(one: SensorTrack) -> NDArray[np.bool_]:
    """(N,) scans whose detection a track took, that of its start among them."""
    return np.isfinite(one.nis) | (one.detection != "" if len(one.detection) else False)


def seen_of(one: SensorTrack) -> NDArray[np.bool_]:
    """(N,) scans at which the target was seen, whether or not its track took the detection."""
    return one.near | used_of(one)


def whitened(one: SensorTrack) -> Array:
    """(K, m) innovations of the detections used, each in units of its own standard deviation."""
    used = np.isfinite(one.nis)
    if len(one.sizes):
        return np.empty((0, 0))  # scans of several sensors have no elements in common
    return np.asarray(whiten(one.innovation[used], one.S[used])) if used.any() else one.innovation[used]


def nis_worth(one: SensorTrack) -> float:
    """How many independent values the NIS of a track are worth."""
    return worth(one.nis) if len(one.sizes) else worth_of_errors(whitened(one))


class SensorPair(NamedTuple):
    """Two sensors' tracks of one target by one filter: how far apart, and how far they say they may be.

    ``rms`` m over ``n`` scans; ``squares``: the mean of the squared distance in units of both covariances,
    two where both are right and their errors have nothing to do with each other.
    """

    target: str
    filter: str
    one: str
    other: str
    rms: float
    n: int
    squares: Average


def compare_sensors(followed: TrackingResult) -> list[SensorPair]:
    """Every two sensors that follow the same target by the same filter, at the scans of the first."""
    found = []
    groups: dict[tuple[str, str], list[SensorTrack]] = {}
    for track in followed.tracks:
        groups.setdefault((track.target, track.filter), []).append(track)
    for (target, name), tracks in groups.items():
        # Smoothed ones lean on the motion that both assume, twice: their distance proves little.
        apart_from = [one for one in tracks if one.sensor in followed.scans and not name.endswith(SMOOTHED)]
        for a, b in combinations(apart_from, 2):
            x, P = _between(b, a.times, 0.0 if is_at_rest(b) else followed.targets.density)
            gap = a.estimate[:, :2] - x
            both = np.isfinite(gap).all(axis=1)
            if not both.any():
                continue
            off = whiten(gap[both], (a.covariance[:, :2, :2] + P)[both])
            squares = average((off**2).sum(axis=1), 2, worth_of_errors(off))
            rms = float(np.sqrt(np.mean(np.sum(gap[both] ** 2, axis=1))))
            found.append(SensorPair(target, name, a.sensor, b.sensor, rms, int(both.sum()), squares))
    return found


def is_at_rest(one: SensorTrack) -> bool:
    """Whether a track is of a target that never moves: it has no velocity to be uncertain of."""
    velocity = one.covariance[np.isfinite(one.estimate[:, 0]), 2:4, 2:4]
    return len(velocity) > 0 and not velocity.any()


def _between(one: SensorTrack, times: Array, density: float) -> tuple[Array, Array]:
    """Position (N, 2) and its covariance at other times: carried on from the scan before, and the
    less certain the longer, as the filters believe."""
    row = np.searchsorted(one.times, times, side="right") - 1
    there = row >= 0
    row = np.maximum(row, 0)
    dt = (times - one.times[row])[:, None]
    x = one.estimate[row, :2] + dt * one.estimate[row, 2:4]
    F = np.tile(np.eye(2, 4), (len(times), 1, 1))
    F[:, 0, 2] = F[:, 1, 3] = dt[:, 0]
    P = F @ one.covariance[row] @ np.swapaxes(F, 1, 2)
    P[:, :2, :2] += (density**2 * np.maximum(dt[:, 0], 0.0) ** 3 / 3)[:, None, None] * np.eye(2)
    ended = ~there | (times > one.times[-1])
    x[ended] = np.nan
    return x, P


#: Units of the elements of a measurement, as names of columns have them.
UNITS = {
    "north": "m", "east": "m", "range": "m", "azimuth": "rad", "elevation": "rad", "u": "px", "v": "px",
    "v_north": "m_s", "v_east": "m_s",
}  # fmt: skip
#: Columns that a table of tracks must have for its tracks to be shown.
COLUMNS = (
    "target", "filter", "sensor", "time_s", "north_m", "east_m", "p_00", "p_01", "p_11",
    "error_north_m", "error_east_m", "nees",
)  # fmt: skip


def estimates_table(tracks: Sequence[SensorTrack], scans: dict[str, Scans]) -> pd.DataFrame:
    """Every scan at which a track was under way.

    Parameters
    ----------
    tracks
        From `wildlab.analysis.tracks.tracker.track`.
    scans
        Likewise, by sensor.

    Returns
    -------
    DataFrame
        ``sensor``, ``target``, ``filter``, ``time_s``; ``track``, which of the target's tracks it is, from 1:
        between two there is none; the state, metres and m/s in n; ``p_ij`` its
        covariance, the upper triangle; ``detection`` that was used, "" none; ``innovation_...`` in the unit
        of each element, ``s_ij`` their covariance, in the order of the elements; ``nis``; and
        ``error_north_m``, ``error_east_m`` (truth minus estimate) and ``nees`` where the truth is known.
    """
    return pd.concat([_of(one, scans) for one in tracks], ignore_index=True)


def _of(one: SensorTrack, scans: dict[str, Scans]) -> pd.DataFrame:
    rows = np.isfinite(one.estimate).all(axis=1)
    n = int(rows.sum())
    columns: dict[str, object] = {
        "sensor": np.full(n, one.sensor, object),
        "target": np.full(n, one.target, object),
        "filter": np.full(n, one.filter, object),
        "time_s": one.times[rows],
        "track": np.maximum(np.searchsorted(one.starts, np.flatnonzero(rows), side="right"), 1),
    }
    columns |= dict(zip(STATE, one.estimate[rows].T, strict=True))
    for i in range(4):
        columns |= {f"p_{i}{j}": one.covariance[rows, i, j] for j in range(i, 4)}
    columns["detection"] = one.detection[rows]
    if one.sensor not in scans:  # of several sensors: each scan has the elements of its own
        names = tuple(str(i) for i in range(one.innovation.shape[1]))
        columns |= {f"innovation_{name}": one.innovation[rows, i] for i, name in enumerate(names)}
    else:
        names = ("north", "east") if one.filter == "coloured" else scans[one.sensor].elements
        for i, name in enumerate(names):
            columns[f"innovation_{name}_{UNITS[name]}"] = one.innovation[rows, i]
    for i in range(len(names)):
        columns |= {f"s_{i}{j}": one.S[rows, i, j] for j in range(i, len(names))}
    columns["nis"] = one.nis[rows]
    columns |= dict(zip(("error_north_m", "error_east_m"), one.error[rows, :2].T, strict=True))
    columns["nees"] = one.nees[rows]
    return pd.DataFrame(columns)


def write_estimates(table: pd.DataFrame, folder: Path) -> None:
    """Write ``estimates.parquet`` and ``estimates.csv`` into a folder; metres, no place on Earth."""
    table.to_parquet(folder / "estimates.parquet", index=False)
    write_csv(folder / "estimates.csv", table, "%.9g")


def read_estimates(path: Path) -> pd.DataFrame:
    """A table that `write_estimates` wrote.

    Raises
    ------
    WildlabError
        Where it cannot be read, or lacks one of `COLUMNS`, or has words where numbers belong.
    """
    again = "make the table again: wildlab track"
    try:
        table = pd.read_parquet(path)
        lacking = [name for name in COLUMNS if name not in table]
        if not lacking:
            table = table.astype(dict.fromkeys(COLUMNS[3:], float))
    except Exception as error:  # whatever a damaged file gives
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise WildlabError(f"is not a readable table of tracks ({first})", again, file=path) from None
    if lacking:
        raise WildlabError("this column is missing", again, file=path, field=lacking[0])
    return table
