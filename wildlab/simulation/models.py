"""The groups of parameters a twin has: place, flight, targets, and one per sensor."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from wildlab.flight.files import Strict
from wildlab.simulation.quantities import (
    Angle,
    AngleSpread,
    Count,
    Duration,
    FocalLength,
    Length,
    LengthSpread,
    Parameter,
    PixelCount,
    Pixels,
    Rate,
    Speed,
    Text,
    moment,
    quantity,
    word,
)

Latency = Annotated[Parameter, quantity("ms", 0, 1e4)]
Arm = Annotated[Parameter, quantity("m", -1e3, 1e3)]


class Place(Strict):
    """Where and when the twin flies."""

    latitude: Annotated[Parameter, quantity("deg", -90, 90)]
    longitude: Annotated[Parameter, quantity("deg", -180, 180)]
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    gravity: Annotated[Parameter, quantity("m/s^2", 9, 10)]
    epoch: Annotated[Parameter, moment()]


class AirframeFlight(Strict):
    """The airframe, the wind, and how well course and attitude are held; the course itself stands apart."""

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
    sway_shortest_period: Duration
    sway_longest_period: Duration

    @model_validator(mode="after")
    def _flies(self) -> AirframeFlight:
        if self.wind_speed.number > 0.8 * self.airspeed.number:
            raise ValueError(
                "wind_speed is more than 0.8 of airspeed, too much to hold a course; "
                "lower wind_speed or raise airspeed"
            )
        for band in ("path", "sway"):
            shortest, longest = f"{band}_shortest_period", f"{band}_longest_period"
            if getattr(self, shortest).number > getattr(self, longest).number:
                raise ValueError(f"{shortest} is longer than {longest}; exchange the two")
        return self


class Loiter(Strict):
    """A circle beside the target, flown from wherever on it the log happens to begin."""

    radius: Length
    turn: Annotated[Parameter, word("clockwise", "counter-clockwise")]
    course_at_target: Angle


class Route(Strict):
    """A closed course over the target (see `simulation.routes`), moved along with it."""

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


class Climb(Strict):
    """One change of altitude during the flight."""

    altitude: Length
    start: Annotated[Parameter, quantity("s", 0, 7200)]
    duration: Duration


class TargetMotion(Strict):
    """A steady course from where the target is at time 0, and what it strays from it."""

    north: Annotated[Parameter, quantity("m", -1e4, 1e4)]
    east: Annotated[Parameter, quantity("m", -1e4, 1e4)]
    speed: Speed
    course: Angle
    stray_sd: LengthSpread
    stray_shortest_period: Duration
    stray_longest_period: Duration

    @model_validator(mode="after")
    def _band(self) -> TargetMotion:
        if self.stray_shortest_period.number > self.stray_longest_period.number:
            raise ValueError("stray_shortest_period is longer than stray_longest_period; exchange the two")
        return self


class TargetGps(Strict):
    """The single-frequency receiver that a target carries, whose log counts as the truth about it."""

    rate: Rate
    horizontal_wander: LengthSpread
    vertical_wander: LengthSpread
    wander_time: Duration
    horizontal_noise: LengthSpread
    vertical_noise: LengthSpread
    resolution: LengthSpread
    ahead: Arm


class Target(Strict):
    """Something that is seen: a point that never moves, or, with a motion and a GPS, a vessel."""

    identifier: Text
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    sd: Annotated[Parameter, quantity("m", high=100, above=0)]
    marked_by: Text
    observations: Count
    choice: Annotated[Parameter, word("first", "missed at random")]
    border: Pixels
    motion: TargetMotion | None = None
    gps: TargetGps | None = None

    @model_validator(mode="after")
    def _logged(self) -> Target:
        if (self.motion is None) != (self.gps is None):
            raise ValueError(
                "a target that moves needs both motion and gps, one that never moves neither; "
                "add the one or take out the other"
            )
        return self


class Pair(Strict):
    """Images in which both targets are marked."""

    both: Annotated[Parameter, quantity("1", 0, 1e6, whole=True)]


class Subset(Strict):
    """Detections in succession that a table of the source has apart."""

    first: Count
    observations: Count


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


class Boresight(Strict):
    """How the payload (IMU and antennas) turns against the airframe that carries the camera.

    Smooth and slow: a standing error that wanders, which no data sheet of a sensor explains.
    """

    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    shortest_period: Duration
    longest_period: Duration

    @model_validator(mode="after")
    def _band(self) -> Boresight:
        if self.shortest_period.number > self.longest_period.number:
            raise ValueError("shortest_period is longer than longest_period; exchange the two")
        return self


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
    horizontal_wander: LengthSpread
    vertical_wander: LengthSpread
    wander_time: Duration
    velocity_noise: Speed
    resolution: LengthSpread
    latency: Latency
    first_x: Arm
    first_y: Arm
    first_z: Arm
    second_x: Arm
    second_y: Arm
    second_z: Arm
