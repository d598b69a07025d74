"""What trackers take of a flight, read once: looks and errors of each sensor, the targets, and where these
truly were.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wildlab.analysis.tracks.ground_positions import ABLE
from wildlab.analysis.tracks.noise_model import (
    GivenValue,
    NoiseModel,
    TargetModel,
    Tuned,
    model_noise,
    model_targets,
    settings_of,
)
from wildlab.analysis.tracks.scans import Scans, Truth, scans_of, sensors_of, truths_at
from wildlab.errors import WildlabError
from wildlab.flight.checks.sensors import looks_of_others
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import Settings, absent_sensors

#: What a target is called of which nobody says a name.
UNNAMED = "target"


class SensorInputs(NamedTuple):
    """One sensor's looks, what is believed of its errors, the targets that it may see, and what was told."""

    scans: Scans
    noise: NoiseModel
    truths: list[Truth]
    given: Sequence[GivenValue] = ()

    def split(self, target: str) -> tuple[Truth, list[Truth]]:
        """A target's truth, and those of the others."""
        mine = next(one for one in self.truths if one.target == target)
        return mine, [one for one in self.truths if one.target != target]


#: By sensor.
BySensor = Mapping[str, SensorInputs]


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
        What filters are told of the targets, and who says so.
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
    told = settings_of(flight, settings)
    targets, said = model_targets(told.targets)
    if tuned is not None and tuned.density is not None and told.targets.acceleration_m_s_sqrt_s is None:
        targets = targets._replace(density=tuned.density)
        said = [one for one in said if not one.what.startswith("acceleration")]
        said.insert(0, tuned.given_density())
    notes = [*_notes_of_absent(flight, told), *_notes_of_sources(flight)]
    found: dict[str, SensorInputs] = {}
    for name in sensors_with_detections(flight, sensors):
        looks = scans_of(flight, name, 0.0, source)
        if joint and looks.kind not in ABLE and not sensors:
            notes.append(f"{name} was left out: what it detects ({looks.kind}) tells nothing of a place.")
            continue
        there, on = (None, "") if tuned is None else (tuned.sensors.get(name), tuned.flight)
        noise, more = model_noise(flight, looks, told, there, on)
        if noise.offset_s:
            looks = scans_of(flight, name, noise.offset_s, source)
        looks = looks if joint else _identified(looks, targets)
        found[name] = SensorInputs(looks, noise, _targets_of(flight, looks), more)
    return TrackingInputs(found, told, targets, said, notes)


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


def _notes_of_absent(flight: Flight, told: Settings) -> list[str]:
    """A sentence for each sensor that the settings speak of and the flight does not have."""
    absent = absent_sensors(told, sensors_of(flight))
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
    if not scans.labelled:
        return truths or [_unknown(UNNAMED, scans)]
    by_name = {one.target: one for one in truths}
    names = dict.fromkeys(str(one) for one in scans.labels.ravel() if one)
    return [by_name.get(name) or _unknown(name, scans) for name in names]


def _unknown(name: str, scans: Scans) -> Truth:
    nowhere = np.full((len(scans.times), 2), np.nan)
    return Truth(name, nowhere, nowhere, 0.0)


def names_of(
    flight: Flight, settings: Settings | None = None, sensors: Sequence[str] = (), source: str | None = None
) -> set[str]:
    """The targets that sensors may see, as far as that shows without reading what noise is believed.

    Raises
    ------
    WildlabError
        As `read_inputs`, but for the noise.
    """
    refuse_without_times(flight)
    targets, _ = model_targets(settings_of(flight, settings).targets)
    known: set[str] = set()
    for sensor in sensors_with_detections(flight, sensors):
        looks = _identified(scans_of(flight, sensor, 0.0, source), targets)
        known |= {one.target for one in _targets_of(flight, looks)}
    return known
