"""The parameters of a twin: one TOML file, in which every number says where it comes from.

A parameter is a table with a value, a unit, a status (``published`` with its source, or ``chosen`` with the
reason). The unit is part of the check: a length in feet is an error, not a surprise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import pandas as pd
from pydantic import AfterValidator, field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Strict, check_model, did_you_mean, is_safe_name, read_toml
from wildlab.paths import DATA

TWINS = DATA / "twins"

#: Units a twin may use, and what one of each is in SI and radians.
UNITS = {
    "": 1.0,
    "1": 1.0,
    "deg": math.pi / 180,
    "m": 1.0,
    "m/s": 1.0,
    "m/s^2": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "Hz": 1.0,
    "ppm": 1e-6,
    "px": 1.0,
}


class Parameter(Strict):
    """One parameter of a twin: its value, and on whose word."""

    value: float | str
    unit: str
    status: Literal["published", "chosen"]
    source: str = ""
    reason: str = ""

    @field_validator("value", mode="before")
    @classmethod
    def _number_or_text(cls, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"{value!r:.80} is neither a number nor a text; give one or the other")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number; give one that is")
        return value

    @model_validator(mode="after")
    def _accounted_for(self) -> Parameter:
        if self.status == "published" and not self.source.strip():
            raise ValueError("the value is called published but names no source; add the section or table")
        if self.status == "chosen" and not self.reason.strip():
            raise ValueError("the value is called chosen but gives no reason; add a reason")
        return self

    @property
    def number(self) -> float:
        """The value in the unit of the file."""
        if isinstance(self.value, str):
            raise TypeError(f"{self.value!r} is not a number")
        return self.value

    @property
    def si(self) -> float:
        """The value in SI units and radians."""
        return self.number * UNITS[self.unit]

    @property
    def text(self) -> str:
        """The value as text."""
        return str(self.value)


def quantity(
    unit: str,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float = -math.inf,
    whole: bool = False,
) -> AfterValidator:
    """A parameter that is a number in that unit, between ``low`` and ``high`` and greater than ``above``."""

    def check(parameter: Parameter) -> Parameter:
        if isinstance(parameter.value, str):
            raise ValueError(f"{parameter.value!r} is not a number; give the value in {unit or 'no unit'}")
        if parameter.unit != unit:
            raise ValueError(f"the unit is {parameter.unit!r}; convert the value and write unit = {unit!r}")
        if not (low <= parameter.value <= high and parameter.value > above):
            least = f"above {above:g}" if above > low else f"from {low:g}"
            raise ValueError(f"{parameter.value:g} is out of range; give a value {least} to {high:g}")
        if whole and parameter.value != int(parameter.value):
            raise ValueError(f"{parameter.value:g} is not a whole number; give one")
        return parameter

    return AfterValidator(check)


def word(*allowed: str) -> AfterValidator:
    """A parameter that is a text, one of those allowed where any are named."""

    def check(parameter: Parameter) -> Parameter:
        if not isinstance(parameter.value, str) or not parameter.value.strip() or parameter.unit:
            raise ValueError("this parameter is not a text; give a text and unit = ''")
        if allowed and parameter.value not in allowed:
            raise ValueError(f"{parameter.value!r} is not known; use one of {', '.join(allowed)}")
        return parameter

    return AfterValidator(check)


def moment() -> AfterValidator:
    """A parameter that is a time with its zone, as text."""

    def check(parameter: Parameter) -> Parameter:
        try:
            zone = datetime.fromisoformat(parameter.text).tzinfo
        except ValueError:
            zone = None
        if zone is None or parameter.unit:
            raise ValueError(
                f"{parameter.text!r:.80} is not a time; write it as 2018-06-01T10:00:00Z, with unit = ''"
            )
        return parameter

    return AfterValidator(check)


# Upper bounds keep a mistyped file from asking for a flight of days.
Text = Annotated[Parameter, word()]
Angle = Annotated[Parameter, quantity("deg", -360, 360)]
AngleSpread = Annotated[Parameter, quantity("deg", 0, 45)]
Length = Annotated[Parameter, quantity("m", high=1e5, above=0)]
LengthSpread = Annotated[Parameter, quantity("m", 0, 1e4)]
Speed = Annotated[Parameter, quantity("m/s", 0, 100)]
Duration = Annotated[Parameter, quantity("s", high=7200, above=0)]
Rate = Annotated[Parameter, quantity("Hz", high=500, above=0)]
Pixels = Annotated[Parameter, quantity("px", 0, 1e6)]
PixelCount = Annotated[Parameter, quantity("px", high=1e5, above=0, whole=True)]
FocalLength = Annotated[Parameter, quantity("px", high=1e6, above=0)]
Count = Annotated[Parameter, quantity("1", 1, 1e6, whole=True)]


class Place(Strict):
    """Where and when the twin flies."""

    latitude: Annotated[Parameter, quantity("deg", -90, 90)]
    longitude: Annotated[Parameter, quantity("deg", -180, 180)]
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    gravity: Annotated[Parameter, quantity("m/s^2", 9, 10)]
    epoch: Annotated[Parameter, moment()]


class LoiterFlight(Strict):
    """The airframe and the circle it flies."""

    platform: Text
    duration: Duration
    altitude: Length
    airspeed: Annotated[Parameter, quantity("m/s", high=100, above=0)]
    wind_speed: Speed
    wind_from: Angle
    loiter_radius: Length
    turn: Annotated[Parameter, word("clockwise", "counter-clockwise")]
    course_at_target: Angle
    trim_pitch: Annotated[Parameter, quantity("deg", -30, 30)]
    radius_sd: LengthSpread
    altitude_sd: LengthSpread
    path_shortest_period: Duration
    path_longest_period: Duration
    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    sway_shortest_period: Duration
    sway_longest_period: Duration

    @model_validator(mode="after")
    def _flies(self) -> LoiterFlight:
        if self.wind_speed.number > 0.8 * self.airspeed.number:
            raise ValueError(
                "wind_speed is more than 0.8 of airspeed, too much to hold a circle; "
                "lower wind_speed or raise airspeed"
            )
        for band in ("path", "sway"):
            shortest, longest = f"{band}_shortest_period", f"{band}_longest_period"
            if getattr(self, shortest).number > getattr(self, longest).number:
                raise ValueError(f"{shortest} is longer than {longest}; exchange the two")
        return self


class StaticTarget(Strict):
    """A point that never moves, and how often it is marked."""

    identifier: Text
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    sd: Annotated[Parameter, quantity("m", high=100, above=0)]
    observations: Count
    border: Pixels


class TwinCamera(Strict):
    """Intrinsic parameters, frame rate, and what a person does with the images."""

    name: Text
    width: PixelCount
    height: PixelCount
    fx: FocalLength
    fy: FocalLength
    cx: Annotated[Parameter, quantity("px", -1e5, 1e5)]
    cy: Annotated[Parameter, quantity("px", -1e5, 1e5)]
    frame_rate: Rate
    recording_start: Annotated[Parameter, quantity("s", 0, 7200)]
    images: Count
    latency: Annotated[Parameter, quantity("ms", 0, 1e4)]
    marking_sd: Pixels


class TwinMount(Strict):
    """The gimbal; misalignment as H prints it (see `geometry.mount.helgesen_misalignment`)."""

    pan: Angle
    tilt: Angle
    misalignment_roll: Angle
    misalignment_tilt: Angle
    misalignment_pan: Angle


class OnboardClock(Strict):
    """The clock of the computer that stores the images."""

    offset: Annotated[Parameter, quantity("s", -3600, 3600)]
    drift: Annotated[Parameter, quantity("ppm", -1e4, 1e4)]
    latency: Annotated[Parameter, quantity("ms", 0, 1e4)]


class Autopilot(Strict):
    """The pose that the autopilot logs."""

    rate: Rate
    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    attitude_correlation_time: Duration
    attitude_noise: AngleSpread
    horizontal_sd: LengthSpread
    vertical_sd: LengthSpread
    position_correlation_time: Duration
    position_noise: LengthSpread
    position_resolution: LengthSpread
    velocity_sd: Speed
    velocity_correlation_time: Duration
    imu_roll: Angle
    imu_pitch: Angle
    imu_yaw: Angle


class TruePose(Strict):
    """The pose that no sensor knows, written down for figures."""

    rate: Rate


class Assumed(Strict):
    """Standard deviations that someone who only has the published facts would assume."""

    pixel: FocalLength
    horizontal: Length
    vertical: Length
    plane_height: Length
    roll: Annotated[Parameter, quantity("deg", high=45, above=0)]
    pitch: Annotated[Parameter, quantity("deg", high=45, above=0)]
    yaw: Annotated[Parameter, quantity("deg", high=180, above=0)]


class TwinParameters(Strict):
    """The whole of a twin's file."""

    name: str
    section: str
    description: str
    place: Place
    flight: LoiterFlight
    target: StaticTarget
    camera: TwinCamera
    mount: TwinMount
    onboard_clock: OnboardClock
    autopilot: Autopilot
    truth: TruePose
    assumed: Assumed

    @field_validator("name")
    @classmethod
    def _safe_name(cls, value: str) -> str:
        if not is_safe_name(f"{value}-{2**63}"):  # the flight's name has the seed behind it
            raise ValueError(
                f"{value!r:.80} cannot be the name of a twin; use letters, digits, - and _ only, 80 at most"
            )
        return value

    @model_validator(mode="after")
    def _recorded_in_flight(self) -> TwinParameters:
        end = self.camera.recording_start.si + (self.camera.images.si - 1) / self.camera.frame_rate.si
        if end > self.flight.duration.si:
            raise ValueError(
                f"the camera would record until {end:.0f} s, after the flight's end; lower camera.images or "
                "camera.recording_start"
            )
        return self


def twin_names() -> list[str]:
    """Names of the twins that come with wildlab."""
    return sorted(path.stem for path in TWINS.glob("*.toml"))


def load_twin(name_or_path: str | Path) -> TwinParameters:
    """Parameters of a twin, by its name among those that come with wildlab, or from a file.

    Raises
    ------
    WildlabError
        Where there is no such twin or file, or a parameter is unknown, missing, without source or reason, in
        another unit, or out of range.
    """
    text = str(name_or_path)
    if isinstance(name_or_path, str) and is_safe_name(text):
        if text not in twin_names():
            raise WildlabError(f"there is no twin {text!r}", did_you_mean(text, twin_names()), field="twin")
        path = TWINS / f"{text}.toml"
    else:
        path = Path(name_or_path)
    return check_model(TwinParameters, read_toml(path, "the parameters of a twin"), path)


def each_parameter(twin: TwinParameters) -> Iterator[tuple[str, str, Parameter]]:
    """Group, name and parameter, in the order of the model."""
    for group in type(twin).model_fields:
        part = getattr(twin, group)
        if isinstance(part, Strict):
            for name in type(part).model_fields:
                yield group, name, getattr(part, name)


def parameters_table(twin: TwinParameters | str | Path) -> pd.DataFrame:
    """Every parameter of a twin, for a report.

    Columns, all of them text: ``parameter``, ``value``, ``unit``, ``status`` (published or chosen) and
    ``because`` (the source, and the reason where there is one).
    """
    parameters = twin if isinstance(twin, TwinParameters) else load_twin(twin)
    return pd.DataFrame(
        [
            {
                "parameter": f"{group}: {name}".replace("_", " "),
                "value": p.value if isinstance(p.value, str) else f"{p.value:.10g}",
                "unit": "" if p.unit == "1" else p.unit,
                "status": p.status,
                "because": "; ".join(part for part in (p.source, p.reason) if part),
            }
            for group, name, p in each_parameter(parameters)
        ],
        columns=["parameter", "value", "unit", "status", "because"],
    )
