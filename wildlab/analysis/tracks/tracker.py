"""The tracker: targets of a flight through all of its sensors, as `wildlab track` and `wildlab.track` call
it.

What depends on a flight is read once (`read_inputs`). Identity is known or the nearest in the gate is taken:
each target has tracks of its own, by each sensor and by all together, through several filters.
`wildlab.analysis.tracks.many` tracks all targets at once instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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
    SensorTrack,
    possible,
    track_target,
)
from wildlab.errors import WildlabError
from wildlab.flight.checks.sensors import looks_of_others
from wildlab.flight.manifest import Settings, absent_sensors
from wildlab.flight.store import Flight

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
    stated = settings_of(flight, settings)
    targets, given = model_targets(stated.targets)
    if tuned is not None and tuned.density is not None and stated.targets.acceleration_m_s_sqrt_s is None:
        targets = targets._replace(density=tuned.density)
        given = [one for one in given if not one.what.startswith("acceleration")]
        given.insert(0, tuned.given_density())
    notes = [*_notes_of_absent(flight, stated), *_notes_of_sources(flight)]
    found: dict[str, SensorInputs] = {}
    for name in sensors_with_detections(flight, sensors):
        scans = scans_of(flight, name, 0.0, source)
        if joint and scans.kind not in PLACEABLE and not sensors:
            notes.append(f"{name} was left out: what it detects ({scans.kind}) tells nothing of a place.")
            continue
        there, on = (None, "") if tuned is None else (tuned.sensors.get(name), tuned.flight)
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
    if flight.manifest.time.kind != "utc":
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
