"""Parameters of a twin's sensors, of how they are mounted, and of what one would assume about them."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from wildlab.flight.files import Strict
from wildlab.simulation.parameter_quantities import (
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
    quantity,
    word,
)

Latency = Annotated[Parameter, quantity("ms", 0, 1e4)]
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
    tilt_middle: Annotated[Parameter, quantity("s", 0, 7200)] | None = None

    @model_validator(mode="after")
    def _tilts(self) -> Gimbal:
        if len({part is None for part in (self.tilt_limit, self.tilt_period, self.tilt_middle)}) > 1:
            raise ValueError("tilt_limit, tilt_period and tilt_middle belong together; give all or none")
        return self


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


class Tolerance(Strict):
    """How far what is stated of the sensors may be from what they are: `wildlab.simulation.perturbed_flight`.

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

    Tilt and heading: see `wildlab.geometry.attitude_uncertainty`.
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

    @model_validator(mode="after")
    def _band(self) -> Boresight:
        if self.shortest_period.number > self.longest_period.number:
            raise ValueError("shortest_period is longer than longest_period; exchange the two")
        return self


class CameraSway(Strict):
    """How the camera turns against the airframe after the bank has changed.

    Its standard deviation per axis is the ``share`` of what the bank has changed over the last ``memory`` or
    so: see `wildlab.simulation.camera_sway`.
    """

    share: Annotated[Parameter, quantity("1", 0, 1)]
    memory: Duration
    shortest_period: Duration
    longest_period: Duration

    @model_validator(mode="after")
    def _band(self) -> CameraSway:
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
