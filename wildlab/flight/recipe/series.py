"""What may stand in a recipe about logs over time: which rows of a table count, and the sensors on board."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self, get_args

from pydantic import Field, field_validator, model_validator

from wildlab.flight.files import Strict, did_you_mean, is_safe_name, leaves_folder
from wildlab.flight.manifest_parts import GnssPart, ImuPart, MagnetometerPart
from wildlab.flight.readers.autoferry import Part
from wildlab.flight.readers.formats import FOLDERS, FORMATS
from wildlab.flight.readers.log import PARTS
from wildlab.flight.recipe.parts import (
    Acceleration,
    Angle,
    Length,
    MagneticField,
    Position,
    Rate,
    Speed,
    Stamp,
    Velocity,
    Zone,
)

Separator = Annotated[str, Field(min_length=1, max_length=1)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class Block(Strict):
    """What every part that reads a table has: the name of its file below the source folder and its separator,
    or the name of one of the `tables`."""

    file: str
    separator: Separator = ","


class Condition(Strict):
    """Which rows count, by a column of numbers. Several limits have to hold all at once."""

    column: str
    equals: float | None = None
    differs: float | None = None
    above: float | None = None
    below: float | None = None

    @model_validator(mode="after")
    def _some_limit(self) -> Self:
        if all(one is None for one in (self.equals, self.differs, self.above, self.below)):
            raise ValueError("a condition says nothing; give it equals, differs, above or below")
        return self


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


class MatlabTable(Strict):
    """A table out of a MATLAB file: `fields` of equal length, or a `matrix` whose columns have names.

    `struct` is the dotted path of the struct that holds them, empty for variables of the file itself.
    `labels` names a cell array with the names of the columns; or `columns` are these names.
    """

    file: str
    struct: str = ""
    fields: tuple[Name, ...] = ()
    matrix: Name | None = None
    columns: tuple[Name, ...] = ()
    labels: Name | None = None

    @field_validator("file")
    @classmethod
    def _stays(cls, value: str) -> str:
        return _below(value)

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        named = bool(self.columns) + (self.labels is not None)
        if bool(self.fields) == (self.matrix is not None) or named != (self.matrix is not None):
            raise ValueError(
                "a table is made of fields, or of a matrix with columns or labels; give one of these"
            )
        return self


class LogTable(Strict):
    """A table out of a log of a known format: one of the parts that its reader tells apart.

    ``height`` makes a column ``height_m`` of the heights that count from there, with ``add_m`` added;
    ``offset_s`` is added to ``time_s``, and makes it of ``time_log_s`` where the log does not know UTC;
    ``zone`` is that of a wall clock without one. ``triggers`` names another log, whose records of triggers
    give images their times; ``camera`` takes the images of one camera; ``images`` names the log of the images
    that pixels have to be of, to be used.
    """

    file: str
    format: str
    part: str
    height: Literal["ellipsoid", "sea", "home"] | None = None
    add_m: float = 0.0
    offset_s: float = 0.0
    zone: Zone | None = None
    triggers: str | None = None
    camera: str | None = None
    images: str | None = None

    @field_validator("file")
    @classmethod
    def _stays(cls, value: str) -> str:
        return _below(value)

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
            raise ValueError("add_m is added to heights, and height does not say which; add height")
        return self


def _below(value: str) -> str:
    if leaves_folder(value):
        raise ValueError(f"the path {value!r} leaves its folder; name a file below the source folder")
    return value


def check_table_names(tables: Mapping[str, MatlabTable | LogTable]) -> None:
    """Raise where a name could be taken for a file.

    Raises
    ------
    ValueError
        ``"problem; fix"``.
    """
    for name in tables:
        if not is_safe_name(name):
            raise ValueError(f"{name!r} cannot name a table; use letters, digits, - and _ only")
