"""The groups of parameters a twin has: place, flight, and one per sensor. Targets: `subjects`."""

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
    sway_shortest_period: Duration
    sway_longest_period: Duration
    kind: Annotated[Parameter, word("fixed wing", "multicopter", "gondola")] | None = None

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


class Survey(Strict):
    """Rows back and forth over one enclosure after the other, and round again (F 5.2)."""

    row_distance: Length
    turn_time: Annotated[Parameter, quantity("s", high=60, above=0.2)]


class Cable(Strict):
    """What a gondola hangs from: its height over the ground, up and down once in each span of a lap."""

    lowest: Length
    highest: Length
    spans: Count

    @model_validator(mode="after")
    def _ordered(self) -> Cable:
        if self.lowest.number > self.highest.number:
            raise ValueError("lowest is above highest; exchange the two")
        return self


class Climb(Strict):
    """One change of altitude during the flight."""

    altitude: Length
    start: Annotated[Parameter, quantity("s", 0, 7200)]
    duration: Duration


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
    recording_start: Annotated[Parameter, quantity("s", 0, 7200)]
    images: Count
    latency: Annotated[Parameter, quantity("ms", 0, 1e4)]
    marking_sd: Pixels
    k1: Annotated[Parameter, quantity("1", -1, 1)] | None = None
    stamped_by: Annotated[Parameter, word("synchronisation", "computer")] | None = None


class TwinMount(Strict):
    """The mount; misalignment as H prints it (see `geometry.mount.helgesen_misalignment`).

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
    """A gimbal whose pan swings from side to side, and what it says about its angles (F 5.4.1)."""

    limit: Annotated[Parameter, quantity("deg", 0, 180)]
    period: Duration
    tilt: Angle
    rate: Rate
    noise: AngleSpread


class OnboardClock(Strict):
    """The clock of the computer that stores the images."""

    offset: Annotated[Parameter, quantity("s", -3600, 3600)]
    drift: Annotated[Parameter, quantity("ppm", -1e4, 1e4)]
    latency: Annotated[Parameter, quantity("ms", 0, 1e4)]


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

    @model_validator(mode="after")
    def _levelled(self) -> Autopilot:
        if len({angle is None for angle in (self.imu_roll, self.imu_pitch, self.imu_yaw)}) > 1:
            raise ValueError("imu_roll, imu_pitch and imu_yaw belong together; give all or none")
        return self


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
