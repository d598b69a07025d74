"""The smallest parts of a recipe: quantities with units, times, positions, attitudes."""

from __future__ import annotations

import re
import zoneinfo
from datetime import timedelta, timezone, tzinfo
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from wildlab.flight.files import Strict
from wildlab.flight.units import Dimension, factor


class Quantity(Strict):
    """A column, or one constant for all rows. `negate` turns its sign: a slant is minus the pitch.

    `plus` names a column in the same unit that is added first: what a logger had taken off, such as a bias.
    """

    column: str | None = None
    plus: str | None = None
    value: float | None = None
    unit: str
    negate: bool = False

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.column is None) == (self.value is None):
            raise ValueError(
                "a quantity has either a column or a value; name the column, or give one value for all rows"
            )
        if self.plus is not None and self.column is None:
            raise ValueError("plus is added to a column, and there is none; name the column")
        return self


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


def parse_zone(text: str) -> tzinfo:
    """A time zone by its IANA name, or as a fixed offset such as ``+02:00``.

    Raises
    ------
    ValueError
        ``"problem; fix"`` where it is neither.
    """
    fixed = re.fullmatch(r"([+-])(0[0-9]|1[0-4]):([0-5][0-9])", text)
    if fixed:
        size = timedelta(hours=int(fixed[2]), minutes=int(fixed[3]))
        return timezone(-size if fixed[1] == "-" else size)
    try:
        return zoneinfo.ZoneInfo(text)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(
            f"{text!r} is not a time zone; use UTC, a name as Europe/Oslo, or an offset as +02:00"
        ) from None


def _known_zone(text: str) -> str:
    parse_zone(text)
    return text


Zone = Annotated[str, AfterValidator(_known_zone)]


class Stamp(Strict):
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
                f"{value!r} is not a format of times; use iso, unix, elapsed, or a pattern such as "
                "%d.%m.%Y %H:%M:%S.%f"
            )
        return value

    @model_validator(mode="after")
    def _some_column(self) -> Self:
        if (self.column is None) == (not self.columns):
            raise ValueError("a time has either a column or several columns; name one of both")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        return (self.column,) if self.column is not None else self.columns


class Position(Strict):
    """Where: latitude, longitude, height (WGS84); or about the origin north, east, down or east, north, up.

    `linear`: east and north were made from WGS84 by the linear formula F (2.2)-(2.3).
    """

    latitude: Angle | None = None
    longitude: Angle | None = None
    height: Length | None = None
    north: Length | None = None
    east: Length | None = None
    down: Length | None = None
    up: Length | None = None
    linear: bool = False

    @model_validator(mode="after")
    def _one_frame(self) -> Self:
        if self.form is None:
            raise ValueError(
                "a position is latitude, longitude and height, or north, east and down, or east, north and "
                "up; give all three of one kind and none of another"
            )
        if self.linear and self.form != "enu":
            raise ValueError("linear is about east, north and up; leave it out")
        return self

    @property
    def form(self) -> Literal["wgs84", "ned", "enu"] | None:
        names = ("latitude", "longitude", "height", "north", "east", "down", "up")
        given = {name for name in names if getattr(self, name) is not None}
        if given == {"latitude", "longitude", "height"}:
            return "wgs84"
        if given == {"north", "east", "down"}:
            return "ned"
        return "enu" if given == {"east", "north", "up"} else None


class Velocity(Strict):
    """North, east, down; or east, north, up; or the speed over ground and its course, with down or up."""

    north: Speed | None = None
    east: Speed | None = None
    speed: Speed | None = None
    course: Angle | None = None
    down: Speed | None = None
    up: Speed | None = None

    @model_validator(mode="after")
    def _one_horizontal(self) -> Self:
        names = ("north", "east", "speed", "course")
        given = {name for name in names if getattr(self, name) is not None}
        if given not in ({"north", "east"}, {"speed", "course"}):
            raise ValueError(
                "a velocity has either north and east, or speed and course; give both of one kind"
            )
        return self

    @model_validator(mode="after")
    def _one_vertical(self) -> Self:
        if (self.down is None) == (self.up is None):
            raise ValueError("a velocity has either down or up; give one of both")
        return self


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


class Attitude(Strict):
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

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        yaws = (self.yaw is not None) + (self.yaw_from_bearing is not None)
        angles = (self.roll is not None) + (self.pitch is not None) + yaws
        if self.quaternion is not None:
            if angles or self.order is None:
                raise ValueError(
                    "a quaternion comes with its order and without angles; "
                    'add order = "wxyz" or "xyzw", and take out the angles'
                )
        elif self.roll is None or self.pitch is None or yaws != 1 or self.order is not None or self.inverse:
            raise ValueError(
                "an attitude is roll, pitch and one yaw, or a quaternion with its order; give all of one kind"
            )
        if self.yaw_from_bearing is not None and self.axes != "frd-ned":
            raise ValueError('a bearing counts from north to east; leave axes at "frd-ned"')
        return self


class Spreads(Strict):
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

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        names = ("tilt", "heading", "roll", "pitch", "yaw")
        given = tuple(name for name in names if getattr(self, name) is not None)
        if given not in (names[:2], names[2:]):
            raise ValueError(
                "spreads of an attitude are tilt and heading, or roll, pitch and yaw; give all of one kind"
            )
        return self
