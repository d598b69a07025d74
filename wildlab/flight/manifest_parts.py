"""The parts of `flight.toml`, a class for each of its tables.

Degrees and metres stand in the file, and the names say so.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, Field, field_validator, model_validator

from wildlab.flight.files import Below, Strict

Angle = Annotated[float, Field(ge=-360, le=360)]
Spread = Annotated[float, Field(gt=0, le=1e6)]
Vector = tuple[float, float, float]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


Sensitivity = Literal["open", "generalised", "withheld"]


class LocationsPart(Strict):
    """How sensitive the places are: whoever shares a report decides by this. Denied unless stated.

    ``sensitivity`` says what reports print. ``category`` is that of GBIF's guide to sensitive species, from 1
    (place withheld) to 4 (0.001 degrees), and says what copies for others give; ``agreed_category`` is what
    was agreed for partners. Left out, ``data/sharing/tiers.toml`` says what is assumed.
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
    """How the camera is fixed to the airframe: see `wildlab.geometry.mount.Mount`.

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
    """What to add to a stamp of each clock to get flight time. The raw stamps are never rewritten."""

    camera_offset_s: float = 0.0
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


class UncertaintyPart(Strict):
    """Standard deviations to assume where the log has none. Absent = not assumed.

    ``tilt_deg`` and ``heading_deg``: see `wildlab.geometry.attitude_uncertainty`.
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
