"""Numbers that say where they come from: a value, its unit, and on whose word.

A parameter is a table with a value, a unit and a status: ``published`` with its source, ``chosen`` with the
reason, or ``fitted`` with the reason and the published tables that it was fitted to. What those tables say
is then no test of the twin. The unit is part of the check: a length in feet is an error, not a surprise.
"""

from __future__ import annotations

import math
import re
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, field_validator, model_validator

from wildlab.flight.files import Strict
from wildlab.geometry.frames import STANDARD_GRAVITY

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
    "deg/s": math.pi / 180,
    "deg/h": math.pi / 180 / 3600,
    "deg/sqrt(h)": math.pi / 180 / 60,
    "m/s/sqrt(h)": 1 / 60,
    "mrad": 1e-3,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
}


_TABLE = re.compile(r"[HF] table [A-Z\d]+\.\d+")


class Parameter(Strict):
    """One parameter of a twin: its value, and on whose word.

    ``fitted_to`` names tables as the published numbers name theirs (``H table 5.4``), so that the two can be
    held against each other.
    """

    value: float | str
    unit: str
    status: Literal["published", "chosen", "fitted"]
    source: str = ""
    reason: str = ""
    fitted_to: tuple[str, ...] = ()

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
        if self.status != "published" and not self.reason.strip():
            raise ValueError(f"the value is called {self.status} but gives no reason; add a reason")
        if self.status == "fitted" and not self.fitted_to:
            raise ValueError('the value is called fitted but not to what; add fitted_to = ["H table 5.4"]')
        if self.status != "fitted" and self.fitted_to:
            raise ValueError(
                f"the value is called {self.status} and has fitted_to; take that out, or call it fitted"
            )
        if wrong := [name for name in self.fitted_to if not _TABLE.fullmatch(name)]:
            raise ValueError(f"{wrong[0]!r:.80} names no table; write it as 'H table 5.4'")
        return self

    @property
    def because(self) -> str:
        """Where the value comes from, in words: source, what it was fitted to, reason."""
        fitted = f"fitted to {', '.join(self.fitted_to)}" if self.fitted_to else ""
        return "; ".join(part for part in (self.source, fitted, self.reason) if part)

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


def ordered(low: str, high: str) -> Any:
    """Refuse a group of which one parameter is above the other."""

    def check(group: Any) -> Any:
        if getattr(group, low).number > getattr(group, high).number:
            raise ValueError(f"{low} is more than {high}; exchange the two")
        return group

    return model_validator(mode="after")(check)


def together(*names: str) -> Any:
    """Refuse a group that has some of these parameters and not the others."""

    def check(group: Any) -> Any:
        if len({getattr(group, name) is None for name in names}) > 1:
            raise ValueError(f"{', '.join(names)} belong together; give all or none")
        return group

    return model_validator(mode="after")(check)


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
Latency = Annotated[Parameter, quantity("ms", 0, 1e4)]
Instant = Annotated[Parameter, quantity("s", 0, 7200)]
Arm = Annotated[Parameter, quantity("m", -1e3, 1e3)]


class TwinCamera(Strict):
    """Intrinsic parameters, frame rate, stamps, and what a person does with the images.

    Stamps are synchronised with the other sensors', unless only the computer that stores the images gives
    them one. ``recording_start``, ``images``: of the recording.
    """

    name: Text
    width: PixelCount
    height: PixelCount
    fx: FocalLength
    fy: FocalLength
    cx: Annotated[Parameter, quantity("px", -1e5, 1e5)]
    cy: Annotated[Parameter, quantity("px", -1e5, 1e5)]
    frame_rate: Rate
    recording_start: Instant
    images: Count
    latency: Latency
    marking_sd: Pixels
    k1: Annotated[Parameter, quantity("1", -1, 1)] | None = None
    stamped_by: Annotated[Parameter, word("synchronisation", "computer")] | None = None


class TwinMount(Strict):
    """The mount; misalignment as H prints it (see `wildlab.geometry.camera_poses.helgesen_misalignment`).

    Looks down unless it says so. What was not calibrated is there, and nobody knows it.
    """

    pan: Angle
    tilt: Angle
    misalignment_roll: Angle
    misalignment_tilt: Angle
    misalignment_pan: Angle
    looks: Annotated[Parameter, word("down", "forward")] | None = None
    calibrated: Annotated[Parameter, word("yes", "no")] | None = None


class Gimbal(Strict):
    """A gimbal that swings, and what it says about its angles.

    Pan goes from side to side (F 5.4.1). Where the ``tilt_`` parameters are given, tilt goes to and fro about
    ``tilt`` too, from ahead to behind at ``tilt_middle``, as one that follows what is flown over.
    """

    limit: Annotated[Parameter, quantity("deg", 0, 180)]
    period: Duration
    tilt: Angle
    rate: Rate
    noise: AngleSpread
    tilt_limit: Annotated[Parameter, quantity("deg", 0, 90)] | None = None
    tilt_period: Duration | None = None
    tilt_middle: Instant | None = None

    _tilts = together("tilt_limit", "tilt_period", "tilt_middle")


class OnboardClock(Strict):
    """The clock of the computer that stores the images."""

    offset: Annotated[Parameter, quantity("s", -3600, 3600)]
    drift: Annotated[Parameter, quantity("ppm", -1e4, 1e4)]
    latency: Latency


class Autopilot(Strict):
    """The pose that the autopilot logs and, where that was read, how its IMU is turned in the airframe."""

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
    imu_roll: Angle | None = None
    imu_pitch: Angle | None = None
    imu_yaw: Angle | None = None

    _levelled = together("imu_roll", "imu_pitch", "imu_yaw")


class Tolerance(Strict):
    """How far what is stated of the sensors may be from what they are: `wildlab.simulation.manifest`.

    ``noise`` and ``bias`` are limits, as shares of noise densities and of standard deviations of biases;
    ``focal_length`` (a share), ``principal_point`` and ``mount`` are standard deviations, per axis.
    """

    noise: Annotated[Parameter, quantity("1", 0, 0.9)]
    bias: Annotated[Parameter, quantity("1", 0, 0.9)]
    focal_length: Annotated[Parameter, quantity("1", 0, 0.2)]
    principal_point: Pixels
    mount: AngleSpread


class TruePose(Strict):
    """The pose that no sensor knows, written down for figures."""

    rate: Rate


class Assumed(Strict):
    """Standard deviations that someone who only has the published facts would assume.

    Tilt and heading: see `wildlab.geometry.covariances`.
    """

    pixel: FocalLength
    horizontal: Length
    vertical: Length
    plane_height: Length
    tilt: Annotated[Parameter, quantity("deg", high=45, above=0)]
    heading: Annotated[Parameter, quantity("deg", high=180, above=0)]


class Boresight(Strict):
    """How the payload (IMU and antennas) turns against the airframe that carries the camera.

    Smooth and slow: a standing error that drifts, which no data sheet of a sensor explains.
    """

    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    shortest_period: Duration
    longest_period: Duration

    _band = ordered("shortest_period", "longest_period")


class CameraSway(Strict):
    """How the camera turns against the airframe after the bank has changed.

    Its standard deviation per axis is the ``share`` of what the bank has changed over the last ``memory`` or
    so: see `wildlab.simulation.trajectory`.
    """

    share: Annotated[Parameter, quantity("1", 0, 1)]
    memory: Duration
    shortest_period: Duration
    longest_period: Duration

    _band = ordered("shortest_period", "longest_period")


class Imu(Strict):
    """An inertial measurement unit as its data sheet describes it; random walks as noise densities."""

    name: Text
    rate: Annotated[Parameter, quantity("Hz", 100, 1000)]
    gyro_range: Annotated[Parameter, quantity("deg/s", high=1e4, above=0)]
    gyro_random_walk: Annotated[Parameter, quantity("deg/sqrt(h)", 0, 10)]
    gyro_bias_stability: Annotated[Parameter, quantity("deg/h", 0, 1e4)]
    gyro_bias_time: Duration
    gyro_turn_on_bias: Annotated[Parameter, quantity("deg/h", 0, 1e4)]
    gyro_resolution: Annotated[Parameter, quantity("deg/s", 0, 1)]
    accelerometer_range: Annotated[Parameter, quantity("g", high=1000, above=0)]
    accelerometer_random_walk: Annotated[Parameter, quantity("m/s/sqrt(h)", 0, 10)]
    accelerometer_bias_stability: Annotated[Parameter, quantity("ug", 0, 1e5)]
    accelerometer_bias_time: Duration
    accelerometer_turn_on_bias: Annotated[Parameter, quantity("mg", 0, 100)]
    accelerometer_resolution: Annotated[Parameter, quantity("ug", 0, 1e4)]
    axis_misalignment: AngleSpread
    package_misalignment: AngleSpread


class Gnss(Strict):
    """Two RTK receivers on one clock, and where on the body their antennas are (x ahead, y right, z down)."""

    name: Text
    rate: Annotated[Parameter, quantity("Hz", high=50, above=0)]
    horizontal_noise: LengthSpread
    vertical_noise: LengthSpread
    horizontal_correlated_sd: LengthSpread
    vertical_correlated_sd: LengthSpread
    correlation_time: Duration
    velocity_noise: Speed
    resolution: LengthSpread
    latency: Latency
    first_x: Arm
    first_y: Arm
    first_z: Arm
    second_x: Arm
    second_y: Arm
    second_z: Arm


class Place(Strict):
    """Where and when the twin flies."""

    latitude: Annotated[Parameter, quantity("deg", -90, 90)]
    longitude: Annotated[Parameter, quantity("deg", -180, 180)]
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    gravity: Annotated[Parameter, quantity("m/s^2", 9, 10)]
    epoch: Annotated[Parameter, moment()]


class AirframeFlight(Strict):
    """The airframe, the wind, and how well course and attitude are held; the course itself stands apart.

    A fixed wing, unless ``kind`` says something else: it banks into turns. A multicopter leans towards where
    it accelerates, a gondola hangs level; ``airspeed`` is their speed along the course.
    """

    platform: Text
    duration: Duration
    altitude: Length
    airspeed: Annotated[Parameter, quantity("m/s", high=100, above=0)]
    wind_speed: Speed
    wind_from: Angle
    trim_pitch: Annotated[Parameter, quantity("deg", -30, 30)]
    track_sd: LengthSpread
    altitude_sd: LengthSpread
    path_shortest_period: Duration
    path_longest_period: Duration
    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    attitude_shortest_period: Duration
    attitude_longest_period: Duration
    kind: Annotated[Parameter, word("fixed wing", "multicopter", "gondola")] | None = None

    _path_band = ordered("path_shortest_period", "path_longest_period")
    _attitude_band = ordered("attitude_shortest_period", "attitude_longest_period")

    @model_validator(mode="after")
    def _flies(self) -> AirframeFlight:
        if self.wind_speed.number > 0.8 * self.airspeed.number:
            raise ValueError(
                "wind_speed is more than 0.8 of airspeed, too much to hold a course; "
                "lower wind_speed or raise airspeed"
            )
        return self


class Loiter(Strict):
    """A circle beside the target, flown from wherever on it the log happens to begin."""

    radius: Length
    turn: Annotated[Parameter, word("clockwise", "counter-clockwise")]
    course_at_target: Angle


class Route(Strict):
    """A closed course over the target (see `wildlab.simulation.courses`), moved along with it."""

    shape: Annotated[Parameter, word("eight", "racetrack")]
    length: Length
    width: Length
    turn_radius: Length
    course: Angle
    ahead: Arm
    right: Arm
    drift_speed: Speed
    drift_course: Angle
    start: Annotated[Parameter, quantity("1", -1, 1)]
    roll_time: Annotated[Parameter, quantity("s", high=20, above=0.2)]


class Survey(Strict):
    """Rows back and forth over one enclosure after the other, and round again (F 5.2)."""

    row_distance: Length
    turn_time: Annotated[Parameter, quantity("s", high=60, above=0.2)]


class Cable(Strict):
    """What a gondola hangs from: its height over the ground, up and down once in each span of a lap."""

    lowest: Length
    highest: Length
    spans: Count

    _heights = ordered("lowest", "highest")


class Land(Strict):
    """Ground that is not level (see `wildlab.simulation.landscape`), and how courses follow it.

    ``follow`` is the length of way over which an autopilot, or a cable's pylons, average the ground's height;
    altitudes are above that.
    """

    seed: Count
    north: Length
    east: Length
    step: Length
    relief: Length
    follow: Length


class Climb(Strict):
    """One change of altitude during the flight."""

    altitude: Length
    start: Instant
    duration: Duration


Coordinate = Annotated[Parameter, quantity("m", -1e4, 1e4)]
Height = Annotated[Parameter, quantity("m", -1e3, 1e4)]
Accuracy = Annotated[Parameter, quantity("m", high=100, above=0)]


class TargetMotion(Strict):
    """A steady course, where on it the target would have been at time 0, and how it deviates from it.

    With an ``early_speed`` it comes up along that course from behind: that fast at time 0, and slower by what
    is left of the difference after each ``slowing_time``, to 1/e.
    """

    north: Coordinate
    east: Coordinate
    speed: Speed
    course: Angle
    deviation_sd: LengthSpread
    deviation_shortest_period: Duration
    deviation_longest_period: Duration
    early_speed: Speed | None = None
    slowing_time: Duration | None = None

    _slowed = together("early_speed", "slowing_time")

    _band = ordered("deviation_shortest_period", "deviation_longest_period")


class TargetGps(Strict):
    """The single-frequency receiver that a target carries, whose log counts as the truth about it."""

    rate: Rate
    horizontal_correlated_sd: LengthSpread
    vertical_correlated_sd: LengthSpread
    correlation_time: Duration
    horizontal_noise: LengthSpread
    vertical_noise: LengthSpread
    resolution: LengthSpread
    ahead: Arm


class Outline(Strict):
    """A rectangle about the target, its bow along the course; an image may show a part of it only."""

    length: Length
    beam: Length


class Target(Strict):
    """Something that is seen: a point that never moves, or, with a motion and a GPS, a vessel.

    ``choice``: marked are the first images that show it, any of them, or those that show most of its outline.
    """

    identifier: Text
    height: Height
    sd: Accuracy
    marked_by: Text
    observations: Count
    choice: Annotated[Parameter, word("first", "missed at random", "largest")]
    border: Pixels
    outline: Outline | None = None
    motion: TargetMotion | None = None
    gps: TargetGps | None = None

    @model_validator(mode="after")
    def _logged(self) -> Target:
        if (self.motion is None) != (self.gps is None):
            raise ValueError(
                "a target that moves needs both motion and gps, one that never moves neither; "
                "add the one or take out the other"
            )
        if self.outline is not None and self.motion is None:
            raise ValueError("an outline needs a motion, whose course is where the bow points; add motion")
        if (self.choice.text == "largest") != (self.outline is not None):
            raise ValueError(
                'what has an outline is marked where most of it shows; write choice = "largest" with an '
                "outline, and only then"
            )
        return self


class MarkedPair(Strict):
    """Images in which both targets are marked."""

    both: Annotated[Parameter, quantity("1", 0, 1e6, whole=True)]


class Subset(Strict):
    """Detections in succession that a table of the source has apart."""

    first: Count
    observations: Count


class Segments(Strict):
    """Periods of a recording in which the target is in view, and of which only these images are kept."""

    count: Count
    images: Count


class Enclosure(Strict):
    """A fenced rectangle about its middle, its long sides along a course, and how many animals live in it."""

    north: Coordinate
    east: Coordinate
    length: Length
    width: Length
    course: Angle
    animals: Count

    @model_validator(mode="after")
    def _long(self) -> Enclosure:
        if self.length.number < self.width.number:
            raise ValueError("the width is more than the length; exchange them and turn the course by 90 deg")
        return self


class Animals(Strict):
    """How animals move, F (4.5) and (4.8), and how they are seen.

    Every ``step`` seconds each takes a new velocity at random, ``speed_sd`` per axis; fences turn it back.
    """

    step: Duration
    speed_sd: Speed
    height: Height
    sd: Accuracy
    rate: Rate
    marked_by: Text
    detected: Annotated[Parameter, quantity("1", high=1, above=0)]
    border: Pixels
