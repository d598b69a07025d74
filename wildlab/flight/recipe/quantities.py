"""The parts of a recipe that are not about one flight: quantities, times, positions, attitudes, tables.

A part has rules: what it may not be, and what to say then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import AfterValidator, Field, field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Below, Strict, did_you_mean
from wildlab.flight.manifest_parts import GnssPart, ImuPart, MagnetometerPart
from wildlab.flight.readers.autoferry import Part
from wildlab.flight.readers.formats import FOLDERS, FORMATS
from wildlab.flight.readers.log import PARTS
from wildlab.flight.time_scales import find_zone
from wildlab.flight.units import Dimension, factor
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
