"""The tracker: targets of a flight through all of its sensors, as `wildlab track` and `wildlab.track` call
it.

What depends on a flight is read once (`wildlab.analysis.tracks.inputs`). Identity is known or the nearest in
the gate is taken: each target has tracks of its own, by each sensor and by all together, through several
filters. `wildlab.analysis.tracks.many` follows all targets at once instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wildlab.analysis.tracks.inputs import UNNAMED, names_of, read_inputs
from wildlab.analysis.tracks.noise_model import (
    OF_UNNAMED,
    STATED,
    GivenValue,
    NoiseModel,
    TargetModel,
    Tuned,
)
from wildlab.analysis.tracks.scans import Scans
from wildlab.analysis.tracks.single_target import (
    NAMES,
    SMOOTHABLE,
    SMOOTHED,
    SensorTrack,
    possible,
    track_target,
)
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import Settings

#: The filter without anything but white noise, which the others are held against.
WHITE = "ekf"
#: Filters that take looks of several sensors.
ABLE = ("ekf", "ukf", "imm", "schmidt")


class TrackingResult(NamedTuple):
    """Targets followed through a flight.

    Attributes
    ----------
    tracks
        One for each sensor, target and filter, in this order.
    scans, beliefs
        By sensor.
    given
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
        What is told of sensors and targets besides ``flight.toml``.
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
    said, notes, tracks = list(inputs.given), list(inputs.notes), list[SensorTrack]()
    known: set[str] = set()
    for sensor, one in inputs.sensors.items():
        said += one.given
        names, without = chosen_filters(one.scans, one.noise, filters)
        notes += without
        notes += _not_smoothed(names, sensor) if smooth else []
        names = _with_smoothed(names) if smooth else names
        for truth in one.truths:
            known.add(truth.target)
            if not targets or truth.target in targets:
                mine = track_target({sensor: one}, truth.target, inputs.targets, names)
                notes += _never(mine, one.scans)
                tracks += mine
    _refuse_unknown(targets, known, flight)
    if all(one.scans.labelled for one in inputs.sensors.values()):
        said = [one for one in said if one.subject != "targets" or one.what not in OF_UNNAMED]
    truths = [truth for one in inputs.sensors.values() for truth in one.truths]
    if still := {truth.target for truth in truths if truth.fixed}:
        said.append(GivenValue("targets", "at rest, as their truth has no time", str(len(still)), STATED))
    names = [name for name in (filters or (WHITE, "schmidt")) if name in ABLE]
    names = list(dict.fromkeys([WHITE, *(_with_smoothed(names) if smooth else names)]))
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
        said,
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
    """Refuse what `track` would refuse, as far as that shows without tracking anything.

    Raises
    ------
    WildlabError
        As `track`.
    """
    _refuse_unknown_filters(filters)
    _refuse_unknown(targets, names_of(flight, settings, sensors, source), flight)
