"""`flight.toml`: what a flight is, apart from its tables.

Degrees and metres stand in the file, and the names say so; the functions at the end give radians.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, Field, field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import (
    Below,
    SafeName,
    Strict,
    check_model,
    did_you_mean,
    dump_toml,
    parse_toml,
    read_toml,
)
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount
from wildlab.geometry.frames import Origin

Angle = Annotated[float, Field(ge=-360, le=360)]
Spread = Annotated[float, Field(gt=0, le=1e6)]
Vector = tuple[float, float, float]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


Sensitivity = Literal["open", "generalised", "withheld"]


class LocationsPart(Strict):
    """How sensitive the places are: whoever shares a report decides by this. Denied unless stated.

    Where ``sensitivity`` is not "open", neither the flight's own reports nor its checks print coordinates,
    and parts of it and other programs have numbers; targets keep their names but in copies for others.
    ``category`` is that of GBIF's guide to sensitive species, from 1 (place withheld) to 4 (0.001 degrees),
    and says what copies for others give; ``agreed_category`` is what was agreed for partners. Left out,
    ``data/sharing/tiers.toml`` says what is assumed.
    """

    sensitivity: Sensitivity = "withheld"
    category: Annotated[int, Field(ge=1, le=4)] | None = None
    agreed_category: Annotated[int, Field(ge=1, le=4)] | None = None


class OriginPart(Strict):
    """Origin of frame n: WGS84, height above the ellipsoid.

    Printed, it does not say where that is: notebooks are shared.
    """

    latitude_deg: Annotated[float, Field(ge=-90, le=90, repr=False)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180, repr=False)]
    height_m: Annotated[float, Field(ge=-1e4, le=1e5, repr=False)]


class PlatformPart(Strict):
    name: str


class CameraPart(Strict):
    """Intrinsic parameters in pixels; Brown distortion without unit."""

    name: str
    width_px: Annotated[int, Field(gt=0, le=1_000_000)]
    height_px: Annotated[int, Field(gt=0, le=1_000_000)]
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    skew_px: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @field_validator("fx_px", "fy_px")
    @classmethod
    def _focal_length(cls, value: float) -> float:
        if value <= 0:
            raise ValueError(f"the focal length is {value:g} px; give the calibrated one, above 0")
        return value


class MountPart(Strict):
    """How the camera is fixed to the airframe: see `wildlab.geometry.camera_poses.Mount`.

    ``poses`` names the nav source whose axes it counts from, where the flight has several: that of the
    vehicle and that of a camera with a log of its own take different mounts. Left out, it holds for all.
    """

    poses: str = ""
    looks: Literal["down", "forward"] = "down"
    pan_deg: Angle = 0.0
    tilt_deg: Angle = 0.0
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    misalignment_roll_deg: Angle = 0.0
    misalignment_tilt_deg: Angle = 0.0
    misalignment_pan_deg: Angle = 0.0


class TimePart(Strict):
    """`sequence`: the photos carry no time, `time_s` merely numbers them."""

    kind: Literal["utc", "sequence"]
    epoch: AwareDatetime | None = None

    @field_validator("epoch", mode="before")
    @classmethod
    def _zone(cls, value: Any) -> Any:
        if isinstance(value, datetime) and value.tzinfo is None:
            raise ValueError("the time has no zone; end it with Z for UTC")
        return value

    @field_validator("epoch")
    @classmethod
    def _utc(cls, value: datetime | None) -> datetime | None:
        return value.astimezone(UTC) if value is not None else None

    @model_validator(mode="after")
    def _needs_epoch(self) -> TimePart:
        if self.kind == "utc" and self.epoch is None:
            raise ValueError('kind = "utc" has no epoch; add it')
        return self


class ClocksPart(Strict):
    """What to add to a stamp of each clock to get flight time. The raw stamps are never rewritten.
    `camera_set`: that of the camera is of this very flight, as `wildlab clock --set` leaves it."""

    camera_offset_s: float = 0.0
    camera_set: bool | None = None
    truth_offset_s: float = 0.0
    gnss_offset_s: float = 0.0


class GnssPart(Strict):
    """The receiver: `lever_arm_m` from b to its antenna, in b (forward, right, down).

    `latency_s`: how long after the instant it is of a fix is stamped. It belongs to the fix, the offset in
    `[clocks]` to the clock; `wildlab.flight.clocks.gnss_times` applies both. `wander_...`: the part of a
    position's standard deviation that fixes share for as long as `wander_time_s` (multipath, for instance).
    """

    name: str = ""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    latency_s: Annotated[float, Field(ge=0, le=10)] = 0.0
    wander_horizontal_m: Spread | None = None
    wander_vertical_m: Spread | None = None
    wander_time_s: Spread | None = None
    note: str = ""


class ImuPart(Strict):
    """The inertial sensor, and its errors as a data sheet gives them. Absent = not known.

    White noise as random walks; the slow part of a bias as its standard deviation, with the time over which
    it changes. The rest stays as it is from switching on to switching off: `..._turn_on_...` is the standard
    deviation of the bias found then; the others are limits: `misalignment_deg` of how far all axes together
    are turned about each axis of b, `axis_misalignment_deg` of how far single ones lean on top of that, and
    `scale_error_percent` of how far a factor is off.
    """

    name: str = ""
    velocity_random_walk_m_s_sqrt_h: Spread | None = None
    angle_random_walk_deg_sqrt_h: Spread | None = None
    accelerometer_bias_m_s2: Spread | None = None
    accelerometer_bias_time_s: Spread | None = None
    gyro_bias_deg_h: Spread | None = None
    gyro_bias_time_s: Spread | None = None
    accelerometer_turn_on_m_s2: Spread | None = None
    gyro_turn_on_deg_h: Spread | None = None
    misalignment_deg: Annotated[float, Field(gt=0, le=45)] | None = None
    axis_misalignment_deg: Annotated[float, Field(gt=0, le=45)] | None = None
    scale_error_percent: Annotated[float, Field(gt=0, le=50)] | None = None
    note: str = ""

    def unstated_noise(self) -> list[str]:
        """What a navigation filter has to know and is not stated."""
        return [name for name in IMU_NOISE if getattr(self, name) is None]


#: What a navigation filter has to know of how an inertial sensor errs.
IMU_NOISE = (
    "velocity_random_walk_m_s_sqrt_h",
    "angle_random_walk_deg_sqrt_h",
    "accelerometer_bias_m_s2",
    "accelerometer_bias_time_s",
    "gyro_bias_deg_h",
    "gyro_bias_time_s",
)


class MagnetometerPart(Strict):
    """The magnetometer, and the Earth's field at the place and time of the flight, as a model of it says.

    `declination_deg` counts from true north towards east, `inclination_deg` downwards. `hard_iron_ut`
    (microtesla, in b) is what is magnetic on board, where that is known; else the flight's own measurements
    say it.
    """

    name: str = ""
    declination_deg: Annotated[float, Field(ge=-180, le=180)] | None = None
    inclination_deg: Annotated[float, Field(ge=-90, le=90)] | None = None
    hard_iron_ut: Vector | None = None
    note: str = ""


class VerticalPart(Strict):
    """Heights are ellipsoidal inside; this says what they were, and what was taken off on import."""

    reference: str = "ellipsoid"
    correction_m: float = 0.0
    note: str = ""

    @property
    def counted_from(self) -> str:
        """What heights count from inside."""
        return "ellipsoid" if self.correction_m else self.reference


class UncertaintyPart(Strict):
    """Standard deviations to assume where the log has none. Absent = not assumed.

    ``tilt_deg`` and ``heading_deg``: see `wildlab.geometry.covariances`.
    """

    pixel_px: Spread | None = None
    position_horizontal_m: Spread | None = None
    position_vertical_m: Spread | None = None
    velocity_horizontal_m_s: Spread | None = None
    velocity_vertical_m_s: Spread | None = None
    tilt_deg: Spread | None = None
    heading_deg: Spread | None = None
    misalignment_deg: Spread | None = None
    plane_height_m: Spread | None = None
    note: str = ""


class ScoringPart(Strict):
    """Which truth a detection is scored against: the target it names, or the nearest one."""

    rule: Literal["labelled", "nearest"] = "labelled"


class TwinPart(Strict):
    name: str
    seed: Annotated[int, Field(ge=0)]


class SourcePart(Strict):
    """A raw file the flight was made from, by its name below the source folder."""

    file: Below
    sha256: Sha256
    what: str = ""


#: Metres by the names of units that a user may state.
UNITS = {"m": 1.0, "ft": 0.3048, "us-ft": 1200 / 3937}

Metres = Annotated[float, Field(gt=0, le=1e6)]


class TerrainSays(Strict):
    """The part ``[terrain]`` of a recipe, or the options of the command: the map, and what it does not say.

    Attributes
    ----------
    file
        GeoTIFF, or the 8-bit PNG of F (6.1); a recipe's is below the source folder.
    heights
        What its heights count from: ``ellipsoid``; ``flight``, the same as those that the flight recorded; or
        how many metres the geoid is above the ellipsoid there. Needed unless its CRS says so.
    crs
        Of a file that states none, ``EPSG:32633`` for instance.
    unit
        Of its heights; left out, what the file says, else metres.
    nodata
        A value that stands for a hole and that the file does not declare.
    sd_m
        Standard deviation of its heights, metres.
    step_m, margin_m
        Of the grid in n, and how far it reaches beyond the flight, metres; left out, by the map's cells and
        by the height above ground.
    cell_m, corner
        Of a PNG: the side of a pixel, and easting and northing of its upper left corner, in `crs`.
    """

    file: str
    heights: Literal["ellipsoid", "flight"] | float | None = None
    crs: str | None = None
    unit: Literal["m", "ft", "us-ft"] | None = None
    nodata: float | None = None
    sd_m: Metres | None = None
    step_m: Metres | None = None
    margin_m: Metres | None = None
    cell_m: Metres | None = None
    corner: tuple[float, float] | None = None

    @field_validator("heights")
    @classmethod
    def _geoid(cls, value: str | float | None) -> str | float | None:
        if isinstance(value, float) and abs(value) > 200:
            raise ValueError(f"a geoid {value:g} m above the ellipsoid; on Earth it is between -110 and 90 m")
        return value

    @model_validator(mode="after")
    def _picture(self) -> Self:
        if (self.cell_m is None) != (self.corner is None):
            raise ValueError("cell_m and corner belong together; give both or none")
        return self


class TerrainPart(Strict):
    """What `flight.toml` says of ``terrain.tif``: which map it comes from, and what was done with it.

    Attributes
    ----------
    source, sha256
        The map, by its name, and its digest.
    crs, heights, added_m
        The map's reference, what its heights count from, and what was added for heights above the ellipsoid.
    unit
        Of the map's heights, as it was taken.
    cell_m, averaged
        Its cell's sides, metres, and how many cells a side were averaged.
    step_m, rows, columns, holes
        Of the grid in n; nodes without a height.
    error_rms_m, error_max_m
        How far the grid lies from the map's own nodes: resampling.
    sd_m
        Standard deviation of the map's heights, where it was stated.
    """

    source: Below
    sha256: Sha256
    crs: str
    heights: Literal["ellipsoid", "flight", "geoid"]
    added_m: float
    unit: str
    cell_m: tuple[Metres, Metres]
    averaged: Annotated[int, Field(ge=1)] = 1
    step_m: Metres
    rows: Annotated[int, Field(ge=2)]
    columns: Annotated[int, Field(ge=2)]
    holes: Annotated[int, Field(ge=0)]
    error_rms_m: Annotated[float, Field(ge=0)]
    error_max_m: Annotated[float, Field(ge=0)]
    sd_m: Metres | None = None


#: Errors that a filter may consider, with the unit of their standard deviation. Position of the platform (and
#: of the part of a target that is seen), the tilt (about each level axis) and the heading of its attitude,
#: the clock of the sensor, and a range that is too long.
CONSIDERED: dict[str, str] = {
    "platform_north": "m", "platform_east": "m", "platform_down": "m",
    "tilt": "deg", "heading": "deg", "clock": "s", "range_bias": "m",
}  # fmt: skip

#: A kind of target of which many are followed at once has at most so many fellows.
MOST_HULLS = 5

Above = Annotated[float, Field(gt=0, le=1e6)]
NotNegative = Annotated[float, Field(ge=0, le=1e6)]
Share = Annotated[float, Field(ge=0, lt=1)]
Probability = Annotated[float, Field(gt=0, lt=1)]
Lengths = tuple[Annotated[float, Field(ge=0, le=1000)], ...]


class HullPart(Strict):
    """A kind of target by its size: how long and broad it is, and how many targets are so,
    beside the shares of the other kinds."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    length_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    beam_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    share: Above = 1.0

    @model_validator(mode="after")
    def _longer_than_broad(self) -> HullPart:
        if self.beam_m > self.length_m:
            raise ValueError(f"beam_m = {self.beam_m:g} is above length_m = {self.length_m:g}")
        return self


class ManyTargetsPart(Strict):
    """What a tracker of many targets is told, see `wildlab.tracking.target_model.ManyTargetModel`."""

    hulls: Annotated[tuple[HullPart, ...], Field(max_length=MOST_HULLS)] = ()
    lifetime_s: Above | None = None
    birth: Probability | None = None
    visible_s: Above | None = None
    hidden_s: Above | None = None
    gate: Above | None = None
    confirmed: Probability | None = None
    hits: Annotated[int, Field(ge=1, le=1000)] | None = None
    shown: Share | None = None
    forgotten: Probability | None = None
    lost_m: Above | None = None
    fastest_m_s: Above | None = None
    moves_m: Annotated[float, Field(ge=0, le=1e6)] | None = None
    over_s: Above | None = None
    apart_m: Above | None = None
    others: bool = False


class ManySensorPart(Strict):
    """What it is told of a sensor, see `wildlab.tracking.target_model.ManySensorModel`; those of hulls
    have one number for each kind."""

    detection: Probability | None = None
    clutter_per_m2: Above | None = None
    clutter_per_rad: Above | None = None
    near_m: Annotated[float, Field(ge=0, le=1e6)] | None = None
    far_m: Above | None = None
    patience_s: Above | None = None
    several: bool | None = None
    rough_m: Lengths = ()
    along_m: Lengths = ()
    near_side_m: Lengths = ()
    near_end_m: Lengths = ()

    @model_validator(mode="after")
    def _near_before_far(self) -> ManySensorPart:
        if self.near_m is not None and self.far_m is not None and self.near_m >= self.far_m:
            raise ValueError(f"near_m = {self.near_m:g} is not below far_m = {self.far_m:g}")
        return self


class ConsideredPart(Strict):
    """One error that lasts: its standard deviation, and for how long it is the same.

    Without ``correlation_time_s`` it is constant. ``shared``: sensors that also consider it have one and the
    same error, as those on one platform have its position and heading.
    """

    sd_m: Above | None = None
    sd_deg: Above | None = None
    sd_s: Above | None = None
    correlation_time_s: Above | None = None
    shared: bool = True

    @property
    def sd(self) -> float:
        """In the unit that is stated."""
        return next(float(one) for one in (self.sd_m, self.sd_deg, self.sd_s) if one is not None)


class NoisePart(Strict):
    """Standard deviations of what is new at every detection, per axis. Absent: not known."""

    position_m: Above | None = None
    range_m: Above | None = None
    azimuth_deg: Above | None = None
    elevation_deg: Above | None = None
    pixel_px: Above | None = None
    velocity_m_s: Above | None = None


class SensorPart(Strict):
    """One sensor.

    ``clock_offset_s`` is added to its stamps. ``correlation`` is the share of the variance of its errors that
    lasts from one look to the next, fading over ``correlation_time_s``: what the filter for coloured noise
    and the tracker of many targets work with. ``thinning_s``: how far apart detections have to be whose
    errors are new. ``range_m`` and ``range_sd_m``: how far away targets are when a bearing is all that is
    known.
    """

    noise: NoisePart = NoisePart()
    rate_hz: Above | None = None
    clock_offset_s: float = 0.0
    correlation: Share | None = None
    correlation_time_s: Above | None = None
    thinning_s: Annotated[float, Field(ge=0, le=1e5)] | None = None
    range_m: Above | None = None
    range_sd_m: Above | None = None
    considered: dict[str, ConsideredPart] = Field(default_factory=dict)
    many: ManySensorPart = ManySensorPart()

    @model_validator(mode="after")
    def _known(self) -> SensorPart:
        for name, one in self.considered.items():
            if name not in CONSIDERED:
                raise ValueError(f"no error {name!r} can be considered; use one of {', '.join(CONSIDERED)}")
            stated = [unit for unit in ("m", "deg", "s") if getattr(one, f"sd_{unit}") is not None]
            if stated != [CONSIDERED[name]]:
                raise ValueError(
                    f"the error {name!r} has its standard deviation in {CONSIDERED[name]}; "
                    f"give sd_{CONSIDERED[name]} and no other"
                )
        return self


class TargetsPart(Strict):
    """The targets.

    ``acceleration_m_s_sqrt_s``: the standard deviation of each axis of the velocity that grows in a second.
    ``start_speed_m_s``: of each axis at the start; where both are zero targets are at rest.
    ``gate_probability``: that a target's own detection is let in. ``patience_s``: without one for longer, a
    track ends. ``reach_m`` and ``reach_deg``: what lies no farther from the true place of a target than this
    may be its detection, where none has a name. ``size_m``: a track that is nearer to its target than this is
    with it. ``identified``: detections belong to the target they name, to the one in whose gate they are
    nearest, or all to one.
    """

    acceleration_m_s_sqrt_s: NotNegative | None = None
    start_speed_m_s: NotNegative | None = None
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = None
    patience_s: Above | None = None
    reach_m: Above | None = None
    reach_deg: Annotated[float, Field(gt=0, le=180)] | None = None
    size_m: Above | None = None
    identified: Literal["label", "gate", "one"] | None = None
    many: ManyTargetsPart | None = None

    @property
    def others(self) -> bool:
        """Whether it is stated that targets are about whose places nobody knows."""
        return self.many is not None and self.many.others

    @model_validator(mode="after")
    def _at_rest(self) -> TargetsPart:
        if self.start_speed_m_s == 0 and self.acceleration_m_s_sqrt_s != 0:
            raise ValueError("without a start_speed_m_s targets are at rest; set acceleration_m_s_sqrt_s = 0")
        return self


class Settings(Strict):
    """The whole of a ``settings.toml``, and the two parts of a ``flight.toml``."""

    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()


def read_settings(path: Path) -> Settings:
    """Read a ``settings.toml``.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Settings, read_toml(path, "what a tracking filter is told"), path)


def parse_settings(text: str) -> Settings:
    """The same from a text; nothing is stated in an empty one.

    Raises
    ------
    WildlabError
        Where it is not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Settings, parse_toml(text, Path("settings.toml")), None)


def absent_sensors(settings: Settings, there: Collection[str]) -> dict[str, str]:
    """The sensors that are told of and that a flight does not have, each with a clause on what may be meant.

    Examples
    --------
    >>> absent_sensors(parse_settings("[sensors.radra]"), ["radar", "lidar"])
    {'radra': "did you mean 'radar'? Known are lidar, radar"}
    """
    return {name: did_you_mean(name, there) for name in settings.sensors if name not in there}


def settings_over(stated: Settings, own: Settings) -> Settings:
    """``stated`` where it says something, else what a flight says of ``own``; a sensor counts as a whole."""
    before, after = (one.targets.model_dump(exclude_none=True, exclude_unset=True) for one in (own, stated))
    targets = before | after
    if "many" in before and "many" in after:
        targets["many"] = before["many"] | after["many"]
    return Settings(sensors={**own.sensors, **stated.sensors}, targets=TargetsPart(**targets))


FILE_NAME = "flight.toml"


class Manifest(Strict):
    """The whole of `flight.toml`."""

    name: SafeName
    kind: Literal["logged", "twin"]
    description: str = ""
    locations: LocationsPart = LocationsPart()
    origin: OriginPart
    platform: PlatformPart
    camera: CameraPart | None = None
    mount: MountPart = MountPart()
    imu: ImuPart = ImuPart()
    gnss: GnssPart = GnssPart()
    magnetometer: MagnetometerPart = MagnetometerPart()
    time: TimePart
    clocks: ClocksPart = ClocksPart()
    vertical: VerticalPart = VerticalPart()
    terrain: TerrainPart | None = None
    uncertainty: UncertaintyPart = UncertaintyPart()
    scoring: ScoringPart = ScoringPart()
    #: What tracking filters are told, see `wildlab.flight.manifest`.
    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()
    twin: TwinPart | None = None
    sources: tuple[SourcePart, ...] = ()
    #: Of the tables by file name, see `wildlab.flight.store`. A flight in memory has none.
    checksums: dict[str, Sha256] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _twin_is_a_twin(self) -> Manifest:
        if (self.kind == "twin") != (self.twin is not None):
            raise ValueError('kind = "twin" and a part [twin] go together; give both or neither')
        return self

    def geometry_camera(self) -> Camera:
        """The camera, as geometry takes it.

        Raises
        ------
        WildlabError
            Where the flight has none.
        """
        c = self.camera
        if c is None:
            fix = "add [camera] to flight.toml"
            raise WildlabError(f"the flight {self.name} has no camera", fix, field="camera")
        distortion = (c.k1, c.k2, c.p1, c.p2, c.k3)
        return Camera(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.skew_px, distortion)

    def geometry_mount(self, source: str | None = None) -> Mount:
        """The mount, in radians and metres, to be used on the poses of ``source``; None: by itself.

        Raises
        ------
        WildlabError
            Where it belongs to other poses.
        """
        m = self.mount
        if source is not None and m.poses not in ("", source):
            raise WildlabError(
                f"[mount] is of a camera on the poses {m.poses!r}, and those of {source!r} are used",
                f"use --source {m.poses}; or state the mount on {source!r} in [mount], with poses = "
                f'"{source}"',
                field="mount.poses",
            )
        turn = math.radians
        return Mount(
            looks=m.looks,
            pan=turn(m.pan_deg),
            tilt=turn(m.tilt_deg),
            misalignment=(
                turn(m.misalignment_roll_deg),
                turn(m.misalignment_tilt_deg),
                turn(m.misalignment_pan_deg),
            ),
            lever_arm=m.lever_arm_m,
        )

    def origin_tuple(self) -> Origin:
        """Latitude, longitude (radians) and ellipsoidal height (metres) of the origin of frame n."""
        o = self.origin
        return math.radians(o.latitude_deg), math.radians(o.longitude_deg), o.height_m


def make_manifest(data: Mapping[str, Any], path: Path | None = None) -> Manifest:
    """A manifest from nested mappings; `path` is only for messages.

    Parameters
    ----------
    data
        As `flight.toml` has it, read.
    path
        Where it comes from, for messages.

    Returns
    -------
    Manifest

    Raises
    ------
    WildlabError
        Naming the key that is unknown, missing or wrong.

    Examples
    --------
    >>> place = {"latitude_deg": 60.0, "longitude_deg": 10.0, "height_m": 0.0}
    >>> parts = {"origin": place, "platform": {"name": "kite"}, "time": {"kind": "sequence"}}
    >>> manifest = make_manifest({"name": "lake", "kind": "logged"} | parts)
    >>> manifest.locations.sensitivity, manifest.origin
    ('withheld', OriginPart())
    """
    return check_model(Manifest, dict(data), path)


def read_manifest(path: Path) -> Manifest:
    """Read `flight.toml`.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    fix = "name the folder of a flight, or make one of logs and images: wildlab import"
    return make_manifest(read_toml(path, "the manifest of a flight", fix), path)


def manifest_toml(manifest: Manifest) -> str:
    """The manifest as TOML text, every value written out, defaults too.

    Parameters
    ----------
    manifest
        The manifest.

    Returns
    -------
    str
    """
    data = manifest.model_dump(exclude_none=True)
    return dump_toml({key: value for key, value in data.items() if value not in ((), {})})


def replace_in_manifest(manifest: Manifest, changes: Mapping[str, Mapping[str, Any] | Any]) -> Manifest:
    """A manifest with some values changed: ``replace_in_manifest(m, {"clocks": {"camera_offset_s": 0.2}})``.

    Parameters
    ----------
    manifest
        Is not changed.
    changes
        New values, by part and key.

    Returns
    -------
    Manifest

    Raises
    ------
    WildlabError
        Where a changed key is unknown or its value is wrong.
    """
    data = manifest.model_dump(exclude_none=True)
    for key, value in changes.items():
        if isinstance(value, Mapping) and isinstance(data.get(key), dict):
            data[key] = {**data[key], **value}
        else:
            data[key] = value
    return make_manifest(data)
