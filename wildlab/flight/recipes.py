"""What may stand in a recipe: the models that a `recipe.toml` is checked by.

A recipe says where in plain tables the parts of a flight are. It is data, not a program: columns, units,
signs, constants, and the few operations named here. `data/recipes/README.md` explains it to its writers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import AfterValidator, AwareDatetime, Field, field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import find_zone
from wildlab.flight.files import Below, SafeName, Strict, check_model, did_you_mean, read_toml
from wildlab.flight.manifest import (
    ClocksPart,
    GnssPart,
    ImuPart,
    LocationsPart,
    MagnetometerPart,
    MountPart,
    OriginPart,
    PlatformPart,
    ScoringPart,
    SensorPart,
    TargetsPart,
    TerrainSays,
    UncertaintyPart,
)
from wildlab.flight.readers import FOLDERS, FORMATS
from wildlab.flight.readers.log import PARTS
from wildlab.flight.readers.tracks import Part
from wildlab.flight.schema import Dimension, factor
from wildlab.names import listed


class Ruled(Strict):
    """A part of which one of several groups of fields is given, whole and alone.

    `either` holds such groups, an empty one where none need be. A rule is what is so where it is broken, and
    ``"problem; fix"``.
    """

    either: ClassVar[tuple[tuple[tuple[str, ...], ...], ...]] = ()
    rules: ClassVar[tuple[tuple[Callable[[Any], bool], str], ...]] = ()

    @model_validator(mode="after")
    def _keep_rules(self) -> Self:
        for groups in self.either:
            given = self.given(*dict.fromkeys(name for group in groups for name in group))
            if set(given) not in map(set, groups):
                ways = listed([" with ".join(group) or "none" for group in groups], "or")
                raise ValueError(f"found {listed(given) or 'nothing'}; give either {ways}")
        for broken, message in self.rules:
            if broken(self):
                raise ValueError(message)
        return self

    def given(self, *names: str) -> tuple[str, ...]:
        """Those of the fields that have a value."""
        return tuple(name for name in names if getattr(self, name) not in (None, ()))


class Quantity(Ruled):
    """A column, or one constant for all rows. `negate` turns its sign: a slant is minus the pitch.

    `plus` names a column in the same unit that is added first: what a logger had taken off, such as a bias.
    """

    column: str | None = None
    plus: str | None = None
    value: float | None = None
    unit: str
    negate: bool = False

    either = ((("column",), ("column", "plus"), ("value",)),)


def _of(dimension: Dimension) -> AfterValidator:
    def check(quantity: Quantity) -> Quantity:
        factor(quantity.unit, dimension)
        return quantity

    return AfterValidator(check)


Angle = Annotated[Quantity, _of("angle")]
Length = Annotated[Quantity, _of("length")]
Speed = Annotated[Quantity, _of("speed")]
Pixel = Annotated[Quantity, _of("pixel")]
Acceleration = Annotated[Quantity, _of("acceleration")]
Rate = Annotated[Quantity, _of("rate")]
MagneticField = Annotated[Quantity, _of("field")]


def _known_zone(text: str) -> str:
    try:
        find_zone(text)
    except WildlabError as error:
        raise ValueError(f"{error.problem}; {error.fix}") from None
    return text


Zone = Annotated[str, AfterValidator(_known_zone)]


class Stamp(Ruled):
    """When: one column, or several that are joined by a blank (a date and a time).

    `format` is ``iso`` (ISO 8601), ``unix`` (since 1970), ``elapsed`` (since the epoch), or a pattern as of
    strptime. `unit` is of the two that are numbers. `zone` is only asked for where the text itself has none.
    """

    column: str | None = None
    columns: tuple[str, ...] = ()
    format: str = "iso"
    unit: str = "s"
    zone: Zone | None = None

    @field_validator("unit")
    @classmethod
    def _unit_of_time(cls, value: str) -> str:
        factor(value, "time")
        return value

    @field_validator("format")
    @classmethod
    def _known_format(cls, value: str) -> str:
        if value not in ("iso", "unix", "elapsed") and "%" not in value:
            raise ValueError(
                f"{value!r} is no format of times; use iso, unix, elapsed, or one as %d.%m.%Y %H:%M:%S.%f"
            )
        return value

    either = ((("column",), ("columns",)),)

    @property
    def names(self) -> tuple[str, ...]:
        return (self.column,) if self.column is not None else self.columns


#: The coordinates of a position by what they are about.
FORMS = {
    "wgs84": ("latitude", "longitude", "height"),
    "ned": ("north", "east", "down"),
    "enu": ("east", "north", "up"),
}


class Position(Ruled):
    """Latitude, longitude, height (WGS84); or about the origin north, east, down, or east, north, up."""

    latitude: Angle | None = None
    longitude: Angle | None = None
    height: Length | None = None
    north: Length | None = None
    east: Length | None = None
    down: Length | None = None
    up: Length | None = None

    either = (tuple(FORMS.values()),)

    @property
    def form(self) -> str:
        """One of `FORMS`."""
        return next(form for form, names in FORMS.items() if self.given(*names) == names)


class Velocity(Ruled):
    """North, east, down; or east, north, up; or the speed over ground and its course, with down or up."""

    north: Speed | None = None
    east: Speed | None = None
    speed: Speed | None = None
    course: Angle | None = None
    down: Speed | None = None
    up: Speed | None = None

    either = ((("north", "east"), ("speed", "course")), (("down",), ("up",)))


class PastNadir(Strict):
    """Rays that look backwards: those whose slant minus `minus` is over 90 deg. Their bearing is the other
    way round."""

    slant: Angle
    minus: Angle


class YawFromBearing(Strict):
    """Yaw recovered from recorded rays: bearing from the platform to a recorded point, minus the angle by
    which the ray stood beside the optical axis, averaged over the rays of a frame. None may differ from that
    mean by more than `largest_deviation_deg`."""

    latitude: Angle
    longitude: Angle
    minus: Angle
    past_nadir: PastNadir | None = None
    largest_deviation_deg: Annotated[float, Field(gt=0, le=180)]


class Attitude(Ruled):
    """Roll, pitch and yaw in zyx order, or a quaternion.

    `axes` says between which axes: ``frd-ned`` (forward-right-down to north-east-down, as in aviation) or
    ``flu-enu`` (forward-left-up to east-north-up, as in ROS). `inverse`: the quaternion takes vectors from
    the world to the body instead.
    """

    roll: Angle | None = None
    pitch: Angle | None = None
    yaw: Angle | None = None
    yaw_from_bearing: YawFromBearing | None = None
    quaternion: tuple[str, str, str, str] | None = None
    order: Literal["wxyz", "xyzw"] | None = None
    inverse: bool = False
    axes: Literal["frd-ned", "flu-enu"] = "frd-ned"

    either = ((("roll", "pitch", "yaw"), ("roll", "pitch", "yaw_from_bearing"), ("quaternion", "order")),)
    rules = (
        (
            lambda s: s.inverse and s.quaternion is None,
            "only a quaternion is inverse; leave inverse out",
        ),
        (
            lambda s: s.yaw_from_bearing is not None and s.axes != "frd-ned",
            'a bearing counts from north to east; leave axes at "frd-ned"',
        ),
    )


class Spreads(Ruled):
    """Standard deviations of each pose, as the log has them.

    Of the attitude a tilt and a heading, or roll, pitch and yaw, which are read as such by the rule of
    `wildlab.geometry.attitude_uncertainty`.
    """

    horizontal: Length
    vertical: Length
    tilt: Angle | None = None
    heading: Angle | None = None
    roll: Angle | None = None
    pitch: Angle | None = None
    yaw: Angle | None = None

    either = ((("tilt", "heading"), ("roll", "pitch", "yaw")),)


# -- tables over time, and the sensors on board

Separator = Annotated[str, Field(min_length=1, max_length=1)]
Decimal = Literal[".", ","]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class Block(Ruled):
    """What every part that reads a table has: the name of its file below the source folder, its separator and
    what its numbers have for a decimal point, or the name of one of the `tables`."""

    file: str
    separator: Separator = ","
    decimal: Decimal = "."


class Condition(Ruled):
    """Which rows count, by a column of numbers. Several limits have to hold all at once."""

    column: str
    equals: float | None = None
    differs: float | None = None
    above: float | None = None
    below: float | None = None

    rules = (
        (
            lambda s: not s.given("equals", "differs", "above", "below"),
            "it says nothing; give equals, differs, above or below",
        ),
    )


class Series(Block):
    """A table over time, of which some rows may not count.

    `changed`: a row counts only where one of these columns differs from the row before, as in logs that
    repeat the last fix until there is a new one; decided on the whole table. `where`: all of these hold.
    """

    changed: tuple[str, ...] = ()
    where: tuple[Condition, ...] = ()


class Forces(Strict):
    """x forward, y right, z down: for each axis of the body the column that measures along it."""

    x: Acceleration
    y: Acceleration
    z: Acceleration


class Rates(Strict):
    """About the same axes, each turning right-handed."""

    x: Rate
    y: Rate
    z: Rate


class Inertial(Series, ImuPart):
    """As in the manifest; and specific force and angular rate in the axes of the body. At rest and level the
    force is (0, 0, minus gravity)."""

    time: Stamp
    force: Forces
    rate: Rates


class Satellite(Series, GnssPart):
    """As in the manifest; and what the receiver says: where its antenna is, how fast, how well it knows."""

    time: Stamp
    position: Position
    velocity: Velocity | None = None
    sd_horizontal: Length | None = None
    sd_vertical: Length | None = None
    sd_velocity: Speed | None = None
    satellites: str | None = None
    fix: str | None = None


class MagneticFields(Strict):
    """Along the same axes. In the north it points north and down, in the south north and up."""

    x: MagneticField
    y: MagneticField
    z: MagneticField


class Magnetometer(Series, MagnetometerPart):
    """As in the manifest; and the field in the axes of the body."""

    time: Stamp
    field: MagneticFields


class Gimbal(Series):
    """Angles of the gimbal over time."""

    time: Stamp
    pan: Angle
    tilt: Angle


class MatlabTable(Ruled):
    """A table out of a MATLAB file: `fields` of equal length, or a `matrix` whose columns have names.

    `struct` is the dotted path of the struct that holds them, empty for variables of the file itself.
    `labels` names a cell array with the names of the columns; or `columns` are these names.
    """

    file: Below
    struct: str = ""
    fields: tuple[Name, ...] = ()
    matrix: Name | None = None
    columns: tuple[Name, ...] = ()
    labels: Name | None = None

    either = ((("fields",), ("matrix", "columns"), ("matrix", "labels")),)


class LogTable(Strict):
    """A table out of a log of a known format: one of the parts that its reader tells apart.

    ``height`` makes a column ``height_m`` of the heights that count from there, with ``add_m`` added;
    ``offset_s`` is added to ``time_s``, and makes it of ``time_log_s`` where the log does not know UTC;
    ``zone`` is that of a wall clock without one. ``triggers`` names another log, whose records of triggers
    give images their times; ``camera`` takes the images of one camera; ``images`` names the log of the images
    that pixels have to be of, to be used.
    """

    file: Below
    format: str
    part: str
    height: Literal["ellipsoid", "sea", "home"] | None = None
    add_m: float = 0.0
    offset_s: float = 0.0
    zone: Zone | None = None
    triggers: str | None = None
    camera: str | None = None
    images: str | None = None

    @model_validator(mode="after")
    def _known(self) -> Self:
        formats = {**dict.fromkeys((*FORMATS, *FOLDERS), tuple(PARTS)), "autoferry": get_args(Part)}
        if self.format not in formats:
            raise ValueError(f"{self.format!r} is no format of logs; {did_you_mean(self.format, formats)}")
        if self.part not in formats[self.format]:
            raise ValueError(
                f"{self.part!r} is no part of a log; {did_you_mean(self.part, formats[self.format])}"
            )
        if self.add_m and self.height is None:
            raise ValueError("add_m needs to know which heights; add height")
        return self


class Group(Strict):
    """Label of the sub-flight: straight from a column, or by where a number lies between edges.

    `clear`: no number may come closer to an edge than this; else the groups are not as separate as thought.
    """

    column: str
    edges: tuple[float, ...] = ()
    labels: tuple[str, ...] = ()
    clear: Annotated[float, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _edges_and_labels(self) -> Self:
        edges, labels = len(self.edges), len(self.labels)
        if (edges or labels) and labels != edges + 1:
            raise ValueError(f"{edges} edges make {edges + 1} groups; give as many labels, not {labels}")
        if any(b <= a for a, b in zip(self.edges, self.edges[1:], strict=False)):
            raise ValueError("the edges do not increase; put them in order")
        return self


class FramesPart(Series):
    """The images: one per row with its `id`, or one per `unique` combination of columns.

    `sensor` names the column that says which of several sensors looked; such frames need no camera.
    """

    id: str | None = None
    unique: tuple[str, ...] = ()
    prefix: str = ""
    time: Stamp | None = None
    group: Group | None = None
    sensor: str | None = None
    pan: Angle | None = None
    tilt: Angle | None = None

    either = ((("id",), ("unique",)), ((), ("pan", "tilt")))
    rules = ((lambda s: s.prefix and not s.unique, "a prefix is for unique frames; leave it out"),)


class PixelPart(Strict):
    """To the right and downwards."""

    u: Pixel
    v: Pixel


class Ground(Ruled):
    """How high the ground is at a detection: as down in frame n, or as a height above the ellipsoid, at a
    place (without one: under the camera)."""

    down: Length | None = None
    height: Length | None = None
    latitude: Angle | None = None
    longitude: Angle | None = None

    either = ((("down",), ("height",), ("latitude", "longitude", "height")),)


class Detections(Series):
    """Detections of one source. One of pixel, position, or azimuth says what was measured; with an elevation
    where the sensor has one, and with a range. `counts_from`: whether the azimuth is zero towards north, or
    ahead of the platform, as of a radar whose picture is head up; it grows clockwise either way."""

    source: str
    id: str | None = None
    prefix: str = ""
    frame: str | None = None
    target: str | None = None
    pixel: PixelPart | None = None
    position: Position | None = None
    azimuth: Angle | None = None
    counts_from: Literal["north", "bow"] = "north"
    elevation: Angle | None = None
    range: Length | None = None
    ground: Ground | None = None

    either = (
        (
            ("pixel",),
            ("position",),
            ("azimuth",),
            ("azimuth", "elevation"),
            ("azimuth", "range"),
            ("azimuth", "elevation", "range"),
        ),
    )
    rules = (
        (
            lambda s: s.counts_from == "bow" and s.azimuth is None,
            "only an azimuth counts from the bow; leave counts_from out",
        ),
        (
            lambda s: s.prefix and s.id is not None,
            "a prefix is for detections without id; leave it out",
        ),
    )

    @property
    def kind(self) -> str:
        (what,) = self.given("pixel", "position", "azimuth")
        return {"azimuth": "bearing" if self.range is None else "range-bearing"}.get(what, what)


class Truth(Series):
    """Where targets really were: `id` names the column, or `target` the one target of the whole file. Without
    a time they are points that never move."""

    id: str | None = None
    target: str | None = None
    time: Stamp | None = None
    position: Position
    sd_horizontal: Length | None = None
    sd_vertical: Length | None = None

    either = ((("id",), ("target",)),)


class Poses(Series):
    """A nav source: by time, or one pose per frame (by the column `frame`, or of this very file).

    `position_from` is for logs of attitude alone: their positions are linear between those of the receiver.
    """

    time: Stamp | None = None
    frame: str | None = None
    position: Position | None = None
    position_from: Literal["gnss"] | None = None
    attitude: Attitude
    velocity: Velocity | None = None
    spreads: Spreads | None = None

    either = ((("position",), ("position_from",)),)
    rules = (
        (
            lambda s: s.position_from and s.time is None,
            "position_from is for poses over time; add the time, or give a position",
        ),
    )


class RecipeTime(Strict):
    """As in the manifest; without an epoch, it is the first whole second. `zone` is of stamps without one."""

    kind: Literal["utc", "sequence"]
    epoch: AwareDatetime | None = None
    zone: Zone | None = None


class RecipeVertical(Ruled):
    """What the heights are, and a constant to take off where a source is wrong.

    `taken_off` names which heights: ``poses``, ``gnss``, ``ground`` (of detections), ``positions``
    (detections that are positions), ``truth``.
    """

    reference: str = "ellipsoid"
    correction_m: float = 0.0
    taken_off: tuple[Literal["poses", "gnss", "ground", "positions", "truth"], ...] = ()
    note: str = ""

    rules = (
        (
            lambda s: s.correction_m and not s.taken_off,
            "taken_off does not say which heights the correction is of; "
            "name some of poses, gnss, ground, positions, truth",
        ),
        (
            lambda s: s.correction_m and not s.note,
            "no note says why there is a correction; add it",
        ),
    )


class Recipe(Strict):
    """The whole of a recipe.

    ``camera = "camera.toml"`` in place of the part names a file of `wildlab camera`, and is kept as
    `camera_file`.
    """

    name: SafeName
    description: str = ""
    locations: LocationsPart = LocationsPart()
    origin: OriginPart | None = None
    platform: PlatformPart
    camera: dict[str, Any] | str | None = None
    mount: MountPart = MountPart()
    time: RecipeTime
    clocks: ClocksPart = ClocksPart()
    vertical: RecipeVertical = RecipeVertical()
    terrain: TerrainSays | None = None
    uncertainty: UncertaintyPart = UncertaintyPart()
    scoring: ScoringPart = ScoringPart()
    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()
    files: dict[str, str] = Field(default_factory=dict)
    tables: dict[SafeName, MatlabTable] = Field(default_factory=dict)
    logs: dict[SafeName, LogTable] = Field(default_factory=dict)
    frames: FramesPart | None = None
    poses: dict[SafeName, Poses] = Field(default_factory=dict)
    imu: Inertial | None = None
    gnss: Satellite | None = None
    magnetometer: Magnetometer | None = None
    gimbal: Gimbal | None = None
    detections: tuple[Detections, ...] = ()
    truth: tuple[Truth, ...] = ()

    @property
    def on_board(self) -> dict[str, Inertial | Satellite | Magnetometer | Gimbal]:
        """Those on board, by the names of their tables."""
        every = {"imu": self.imu, "gnss": self.gnss, "magnetometer": self.magnetometer, "gimbal": self.gimbal}
        return {name: one for name, one in every.items() if one is not None}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for problem in self._contradictions():
            raise ValueError(problem)
        return self

    def _contradictions(self) -> Iterator[str]:
        """Where parts contradict each other: ``"problem; fix"``."""
        frames, truth = self.frames, {f"truth[{i}]": one for i, one in enumerate(self.truth)}
        poses = {f"poses.{name}": one for name, one in self.poses.items()}
        detections = {f"detections[{i}]": one for i, one in enumerate(self.detections)}
        for name in sorted(set(self.tables) & set(self.logs))[:1]:
            yield f"{name!r} names a table and a log; rename one"
        for name, one in poses.items():
            if one.position_from and self.gnss is None:
                yield f"[{name}] takes positions from gnss; add [gnss]"
        if not poses and self.gnss is None:
            yield "there are no poses; add [poses.autopilot], or at least [gnss]"
        images = frames is not None and frames.sensor is None
        if self.camera is None and (images or any(one.pixel for one in self.detections)):
            yield "there are images, and no camera; add [camera]"
        times = {} if frames is None else {"frames": frames.time}
        over_time: dict[str, Any] = {**self.on_board, **poses, **truth}
        times |= {name: one.time for name, one in over_time.items()}
        if self.time.kind == "utc" and frames is not None and frames.time is None:
            yield '[frames] has no time; add it, or set time.kind = "sequence"'
        for name, time in times.items():
            if self.time.kind == "sequence" and time is not None:
                yield f'[{name}] has a time; set time.kind = "utc"'
            if time is not None and time.format == "elapsed" and self.time.epoch is None:
                yield f"[{name}] counts time from an epoch; add epoch to [time]"
        if frames is not None and (frames.where or frames.changed):
            by_row = [name for name, one in poses.items() if one.frame is None and one.time is None]
            for name in [*by_row, *(name for name, one in detections.items() if one.frame is None)]:
                yield f"rows of [frames] are left out, and [{name}] goes by rows; give it frame"
        if self.mount.poses and self.mount.poses not in self.poses:
            known = ", ".join(sorted(self.poses)) or "none"
            yield f"[mount] is on the poses {self.mount.poses!r}, which are not there; name one of {known}"
        for name, one in poses.items():
            if one.time is not None and one.frame is not None:
                yield f"[{name}] has a time and a frame; take one out"
            of_frames = frames is not None and (one.frame or one.file == frames.file)
            if one.time is None and not of_frames:
                yield f"[{name}] has neither time nor frame; add one of them"
            if one.time is None and one.frame is None and (one.where or one.changed):
                yield f"[{name}] goes by the rows of frames, so none may be left out; give it frame"
            local = one.position is None or one.position.form != "wgs84"
            if one.attitude.yaw_from_bearing is not None and (one.time is not None or local):
                yield f"[{name}] has no frames or no latitude for yaw_from_bearing; give a yaw"
        gnss = {} if self.gnss is None else {"gnss": self.gnss}
        placed: dict[str, Any] = {**poses, **truth, **gnss, **detections}
        for name, each in placed.items():
            if each.position and each.position.form != "wgs84" and self.origin is None:
                yield f"[{name}] has local positions and no origin; add [origin]"


def read_recipe(path: Path) -> Recipe:
    """Read a recipe.

    Parameters
    ----------
    path
        Of the TOML file.

    Returns
    -------
    Recipe

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.

    Examples
    --------
    >>> from wildlab.paths import DATA
    >>> read_recipe(DATA / "recipes" / "openathena.toml").name
    'openathena'
    """
    return check_model(Recipe, read_toml(path, "a recipe"), path)
