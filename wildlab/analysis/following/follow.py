"""Targets of a flight followed by all of its sensors: what `wildlab track` does, as one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wildlab.analysis.following.filters import NAMES, SMOOTHABLE, SMOOTHED, possible
from wildlab.analysis.following.noise_model import (
    OF_UNNAMED,
    NoiseModel,
    TargetModel,
    ToldValue,
    of_flight,
    of_sensor,
    of_targets,
)
from wildlab.analysis.following.sensor_fusion import ABLE, fuse_sensors
from wildlab.analysis.following.sensor_tracks import SensorTrack, follow
from wildlab.analysis.following.target_identity import UNNAMED, identified, targets_of
from wildlab.analysis.following.tuned import Tuned
from wildlab.analysis.scans import Scans, Truth, scans_of, sensors_of
from wildlab.errors import WildlabError
from wildlab.flight.checks.sensors import looks_of_others
from wildlab.flight.following import Settings, absent_sensors
from wildlab.flight.store import Flight

#: The filter without anything but white noise, which the others are held against.
WHITE = "ekf"
#: What all sensors at once are called.
TOGETHER = "together"


class TrackingResult(NamedTuple):
    """Targets followed through a flight.

    Attributes
    ----------
    tracks
        One for each sensor, target and filter, in this order.
    scans, beliefs
        By sensor.
    said
        What filters were told, and who says so.
    notes
        What was done to the measurements, in sentences.
    truth
        Whether any target's true place is known.
    """

    tracks: list[SensorTrack]
    scans: dict[str, Scans]
    beliefs: dict[str, NoiseModel]
    targets: TargetModel
    said: list[ToldValue]
    notes: list[str]
    truth: bool


def follow_targets(
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
    """Follow targets by each sensor.

    Parameters
    ----------
    settings
        What is told of sensors and targets besides ``flight.toml``.
    tuned
        What another flight says of the sensors.
    filters
        Of `wildlab.analysis.following.filters.NAMES`; left out: the one with white noise, and the Schmidt
        filter beside it where there are errors to consider.
    targets, sensors
        Names; left out: all of them.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Raises
    ------
    WildlabError
        Where there is no such sensor, target or filter, no detection, no time, or noise nobody knows.
    """
    refuse_without_times(flight)
    told = of_flight(flight, settings)
    believed, said = of_targets(told.targets)
    if tuned is not None and tuned.density is not None and told.targets.acceleration_m_s_sqrt_s is None:
        believed = believed._replace(density=tuned.density)
        said = [one for one in said if not one.what.startswith("acceleration")]
        said.insert(0, tuned.said_of_density())
    wanted = sensors_with_detections(flight, sensors)
    notes = [*notes_of_absent(flight, told), *notes_of_sources(flight)]
    scans: dict[str, Scans] = {}
    beliefs: dict[str, NoiseModel] = {}
    tracks: list[SensorTrack] = []
    known: set[str] = set()
    any_truth = False
    looked: dict[str, list[Truth]] = {}
    for sensor in wanted:
        there = None if tuned is None else tuned.sensors.get(sensor)
        looks = scans_of(flight, sensor, 0.0, source)
        belief, more = of_sensor(flight, looks, told, there, "" if tuned is None else tuned.flight)
        if belief.offset_s:
            looks = scans_of(flight, sensor, belief.offset_s, source)
        looks = identified(looks, believed)
        said += more
        notes += order_notes(looks)
        scans[sensor], beliefs[sensor] = looks, belief
        truths = targets_of(flight, looks)
        looked[sensor] = truths
        known |= {one.target for one in truths}
        any_truth |= any(np.isfinite(one.position).any() for one in truths)
        names, without = chosen_filters(looks, belief, filters)
        notes += without
        notes += _not_smoothed(names, sensor) if smooth else []
        names = _with_smoothed(names) if smooth else names
        for truth in truths:
            if targets and truth.target not in targets:
                continue
            others = [one for one in truths if one.target != truth.target]
            mine = follow(looks, truth, belief, believed, names, others)
            notes += _never(mine, looks)
            tracks += mine
    _refuse_unknown(targets, known, flight)
    if all(one.labelled for one in scans.values()):
        said = [one for one in said if one.subject != "targets" or one.what not in OF_UNNAMED]
    if len(wanted) > 1:
        names = [name for name in (filters or (WHITE, "schmidt")) if name in ABLE]
        names = _with_smoothed(names) if smooth else names
        for target in sorted(known):
            if targets and target not in targets:
                continue
            parts = {name: (scans[name], beliefs[name], looked[name]) for name in wanted}
            tracks += fuse_sensors(flight, parts, target, believed, list(dict.fromkeys([WHITE, *names])))
    return TrackingResult(tracks, scans, beliefs, believed, said, notes, any_truth)


def refuse_without_times(flight: Flight) -> None:
    """Refuse a flight whose photos carry no time.

    Raises
    ------
    WildlabError
        Of such a flight.
    """
    if flight.manifest.time.kind != "utc":
        raise WildlabError(
            "the photos carry no time, and a track is over time",
            "import the flight with times",
            file=flight.folder,
            field="time.kind",
        )


def notes_of_absent(flight: Flight, told: Settings) -> list[str]:
    """A sentence for each sensor that the settings speak of and the flight does not have."""
    absent = absent_sensors(told, sensors_of(flight))
    return [
        f"The settings speak of a sensor {name!r}, which this flight does not have; {meant}."
        for name, meant in absent.items()
    ]


def notes_of_sources(flight: Flight) -> list[str]:
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
            "there are no detections, so there is nothing to follow",
            "add detections: wildlab import takes them, wildlab detect finds them in images",
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
            f"give the detections one of these as their source: {', '.join(known)}",
            file=flight.folder,
            field="detections.source",
        )
    return found


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


def _with_smoothed(names: Sequence[str]) -> list[str]:
    """Each with its smoothed one behind it, where there is such."""
    both = [one for name in names for one in (name, f"{name}{SMOOTHED}")]
    return [one for one in both if one in (*NAMES, *SMOOTHABLE)]


def _not_smoothed(names: Sequence[str], sensor: str) -> list[str]:
    """Filters that have no way back, in a sentence each."""
    without = [name for name in names if f"{name}{SMOOTHED}" not in SMOOTHABLE]
    return [
        f"The filter {name!r} of {sensor} was not smoothed: there is no smoother for it." for name in without
    ]


def _never(tracks: Sequence[SensorTrack], scans: Scans) -> list[str]:
    """Why a target that was seen has no track."""
    one = tracks[0]
    if np.isfinite(one.estimate).any() or not one.near.any():
        return []
    why = {
        "bearing": "its first bearings do not settle on a place; state range_m of the sensor, or tune it",
        "velocity": "a velocity says nothing of the place; another sensor has to",
        "pixel": "no ray meets the ground; is the height of its plane stated (plane_down_m)?",
    }.get(scans.kind, "no detection has a platform beside it; do poses cover the flight?")
    return [f"{one.target} was never followed by {one.sensor}: {why}."]


def order_notes(scans: Scans) -> list[str]:
    """What was done about looks that were logged late, or at one time."""
    found = []
    if scans.late:
        looks = "1 look" if scans.late == 1 else f"{scans.late} looks"
        found.append(
            f"{looks} of {scans.sensor} of {len(scans.times)} came after one with a later stamp, and "
            f"{'was' if scans.late == 1 else 'were'} put in order."
        )
    if scans.same_time:
        found.append(f"{scans.same_time} of {scans.sensor} have the stamp of the look before: both count.")
    return found


def _refuse_unknown(targets: Sequence[str], known: set[str], flight: Flight) -> None:
    for name in targets:
        if name not in known:
            fix = f"use one of {', '.join(sorted(known))}"
            if known == {UNNAMED}:
                fix = "leave --target out: no detection names one, and there is no truth"
            raise WildlabError(f"there is no target {name!r}", fix, file=flight.folder, field="--target")


def refuse_unusable(
    flight: Flight,
    settings: Settings | None,
    filters: Sequence[str],
    targets: Sequence[str],
    sensors: Sequence[str],
    source: str | None,
) -> None:
    """Refuse what `follow_targets` would refuse, as far as that shows without following anything.

    Raises
    ------
    WildlabError
        As `follow_targets`.
    """
    refuse_without_times(flight)
    believed, _ = of_targets(of_flight(flight, settings).targets)
    _refuse_unknown_filters(filters)
    known: set[str] = set()
    for sensor in sensors_with_detections(flight, sensors):
        looks = identified(scans_of(flight, sensor, 0.0, source), believed)
        known |= {one.target for one in targets_of(flight, looks)}
    _refuse_unknown(targets, known, flight)
