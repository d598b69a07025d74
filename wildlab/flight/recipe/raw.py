"""Plain tables as they come: text, numbers with units, times. Read once, hashed, never written.

Every error names the file, the column, the line, and the part of the recipe that asked.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import did_you_mean, inside, printable, read_regular
from wildlab.flight.readers.autoferry import Part, read_part
from wildlab.flight.readers.formats import FOLDERS, read_folder, read_log
from wildlab.flight.readers.log import RawLog, Stream
from wildlab.flight.readers.photos import of_camera
from wildlab.flight.recipe.quantities import Decimal, LogTable, MatlabTable, Quantity, Series, Stamp
from wildlab.flight.recipe.source_files import is_packed, packed, read_delimited, read_matlab, table_of
from wildlab.flight.time_scales import find_zone
from wildlab.flight.trigger_matching import match_triggers
from wildlab.flight.units import Dimension, factor

Array = NDArray[np.float64]
Text = NDArray[np.object_]
Nanoseconds = NDArray[np.int64]

#: Decimal commas as points; beside them, a point would part thousands, and is no number.
_POINTS = {ord(","): ".", ord("."): "?"}
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+", re.ASCII)
#: Stamps that end so carry their own zone.
_ZONED = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d.*(?:[Zz]|[+-]\d\d(?::?\d\d)?)")
#: The most bytes of a raw file that are read: ten hours of 250 a second are one gigabyte of text.
RAW_LIMIT = 4 << 30
#: Nanoseconds since 1970 fit 64 bits from 1678 to 2262.
_LATEST_S = 9.2e9


@dataclass(frozen=True)
class RawTable:
    """One table: its columns, packed text (`read_delimited`) or (from a MATLAB file) arrays, and for each row
    the line it ends on, or its number."""

    path: Path
    header: tuple[str, ...]
    cells: dict[str, Any]
    lines: NDArray[np.int64]
    counted_in: str = "line"
    decimal: Decimal = "."

    def __len__(self) -> int:
        return len(self.lines)

    def rows(self, chosen: NDArray[np.intp]) -> RawTable:
        """Some of the rows."""
        cells = {
            name: column.take(pyarrow.array(chosen)) if is_packed(column) else column[chosen]
            for name, column in self.cells.items()
        }
        return replace(self, cells=cells, lines=self.lines[chosen])

    def cell(self, column: str, row: int) -> str:
        """One cell as text."""
        found = self.cells[column][row]
        return str(found.as_py() if is_packed(self.cells[column]) else found)

    def fail(self, problem: str, fix: str, column: str, part: str, row: int | None = None) -> WildlabError:
        """An error about this table, to be raised."""
        where = "" if row is None else f"{self.counted_in} {self.lines[row]}: "
        return WildlabError(where + problem, fix, file=self.path, field=f"{printable(column)} (in [{part}])")

    def refuse(
        self, bad: NDArray[np.bool_], problem: str | Callable[[int], str], fix: str, column: str, part: str
    ) -> None:
        """Raise about the first of the rows (N,) that are bad, where there is one."""
        if bad.any():
            row = int(np.argmax(bad))
            raise self.fail(problem if isinstance(problem, str) else problem(row), fix, column, part, row)


@dataclass
class RawFiles:
    """The files below a source folder that a recipe has asked for, each read and hashed once."""

    folder: Path
    recipe: Path
    matlab: dict[str, MatlabTable] = field(default_factory=dict)
    logs: dict[str, LogTable] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)
    _tables: dict[tuple[str, ...], RawTable] = field(default_factory=dict)
    _variables: dict[str, dict[str, Any]] = field(default_factory=dict)
    _logs: dict[tuple[str, str, str | None], RawLog] = field(default_factory=dict)

    def read(self, name: str, part: str, limit: int = RAW_LIMIT) -> bytes:
        """The bytes of a file, of at most so many.

        Raises
        ------
        WildlabError
            Where the name leaves the folder, there is no such file, or it is no regular file or too large.
        """
        path = inside(self.folder, name, file=self.recipe, field=f"{part}.file")
        try:
            data = read_regular(path, limit, f"{part}.file")
        except FileNotFoundError:
            raise WildlabError(
                f"there is no such file, and [{part}] of {self.recipe.name} asks for it",
                "check its name and the source folder",
                file=path,
                field=f"{part}.file",
            ) from None
        self.hashes[name] = hashlib.sha256(data).hexdigest()
        return data

    def table(
        self, name: str, separator: str, part: str, *, may_be_empty: bool = False, decimal: Decimal = "."
    ) -> RawTable:
        """A file as a table of text, its first line the names of the columns (and all there is, where it may
        be empty); or one of the tables that the recipe makes of MATLAB files and logs.

        Raises
        ------
        WildlabError
            Where it cannot be read, is not UTF-8, is empty, or a row has more or fewer cells than the first;
            or where it is no MATLAB file or log of that format, or does not hold what the recipe says.
        """
        if name in self.logs:
            return self._log_table(name)
        if name in self.matlab:
            return self._matlab_table(name)
        key = name, separator, decimal
        if key not in self._tables:
            data = self.read(name, part)
            header, cells, lines = read_delimited(
                self.folder / name, data, separator, may_be_empty=may_be_empty
            )
            table = RawTable(self.folder / name, header, cells, lines, decimal=decimal)
            if not len(table):
                return table  # kept, it would pass where rows are asked for
            self._tables[key] = table
        return self._tables[key]

    def _matlab_table(self, name: str) -> RawTable:
        block, part = self.matlab[name], f"tables.{name}"
        if (name, "") not in self._tables:
            path = self.folder / block.file
            if block.file not in self._variables:
                self._variables[block.file] = read_matlab(path, self.read(block.file, part))
            cells = table_of(self._variables[block.file], block, path, part)
            count = len(next(iter(cells.values())))
            self._tables[name, ""] = RawTable(path, tuple(cells), cells, np.arange(1, count + 1), "row")
        return self._tables[name, ""]

    def _log_table(self, name: str) -> RawTable:
        block = self.logs[name]
        if (name, "") not in self._tables:
            path = self.folder / block.file
            if block.format == "autoferry":
                data = self.read(block.file, f"logs.{name}")
                cells, frames = read_part(path, data, cast(Part, block.part))
                self._tables[name, ""] = RawTable(path, tuple(cells), cells, frames, "frame")
            else:
                stream = log_part(self._log(block, f"logs.{name}"), block, path)
                if block.triggers is not None:
                    stream = stamped_by(stream, self._triggers(block.triggers, name), path)
                if block.images is not None:
                    stream = of_images(stream, self._images(block.images, name))
                cells = stream.columns
                self._tables[name, ""] = RawTable(path, tuple(cells), cells, stream.rows, stream.counted_in)
        return self._tables[name, ""]

    def _triggers(self, triggers: str, images: str) -> Stream:
        """The records that the images of a table have their times from."""
        other = self.logs.get(triggers)
        if other is None or other.format == "autoferry":
            raise WildlabError(
                f"{triggers!r} is no log of this recipe",
                did_you_mean(triggers, self.logs),
                file=self.recipe,
                field=f"logs.{images}.triggers",
            )
        return log_part(self._log(other, f"logs.{triggers}"), other, self.folder / other.file)

    def _images(self, images: str, pixels: str) -> Stream:
        """The images that pixels have to be of."""
        if images not in self.logs or self.logs[images].part != "photos":
            raise WildlabError(
                f"{images!r} is no log of images of this recipe",
                did_you_mean(images, self.logs),
                file=self.recipe,
                field=f"logs.{pixels}.images",
            )
        table = self._log_table(images)
        return Stream(table.cells, table.lines, table.counted_in)

    def _log(self, block: LogTable, part: str) -> RawLog:
        key = (block.file, block.format, block.zone)
        if key not in self._logs:
            if block.format in FOLDERS:
                path = inside(self.folder, block.file, file=self.recipe, field=f"{part}.file")
                self._logs[key], self.hashes[block.file] = read_folder(path, block.format, block.zone)
            else:
                data = self.read(block.file, part)
                self._logs[key] = read_log(self.folder / block.file, data, block.format, block.zone)
        return self._logs[key]

    def series(self, block: Series, part: str, *, may_be_empty: bool = False) -> RawTable:
        """The rows of a table that count; none of a text file without rows, where it may be empty.

        Raises
        ------
        WildlabError
            As `table`; and where a column of a condition is missing or not of numbers, or no row counts.
        """
        table = self.table(
            block.file, block.separator, part, may_be_empty=may_be_empty, decimal=block.decimal
        )
        if not len(table) or (not block.changed and not block.where):
            return table
        counts = np.ones(len(table), bool)
        if block.changed:
            columns = [texts(table, one, f"{part}.changed", may_be_empty=True) for one in block.changed]
            counts[1:] = np.any([column[1:] != column[:-1] for column in columns], axis=0)
        for i, one in enumerate(block.where):
            value = plain_numbers(table, one.column, f"{part}.where[{i}]", may_be_empty=True)
            if one.equals is not None:
                counts &= value == one.equals
            if one.differs is not None:
                counts &= (value != one.differs) & ~np.isnan(value)
            if one.above is not None:
                counts &= value > one.above
            if one.below is not None:
                counts &= value < one.below
        if not counts.any():
            problem = f"none of the {len(table)} rows counts"
            columns_named = ", ".join([*block.changed, *(one.column for one in block.where)])
            raise table.fail(problem, "check where and changed", columns_named, part)
        return table.rows(np.flatnonzero(counts))


def texts(table: RawTable, column: str, part: str, *, may_be_empty: bool = False) -> Text:
    """A column as text, blanks at both ends removed. (N,)

    Raises
    ------
    WildlabError
        Where there is no such column, or a cell is empty that may not be.
    """
    found = _column(table, column, part)
    if is_packed(found):
        cells = np.asarray(found.to_numpy(), dtype=object)
    else:  # numbers, as a name or a label: without a needless fraction
        cells = np.array(["" if np.isnan(one) else f"{one:.15g}" for one in found], dtype=object)
    if not may_be_empty:
        table.refuse(cells == "", *_EMPTY, column, part)
    return cells


def _column(table: RawTable, column: str, part: str) -> Any:
    """A column as it is kept: packed text, or an array of numbers."""
    if column not in table.header:
        fix = did_you_mean(column, table.header)
        if len(table.header) == 1:
            fix = "the first line is a single name: check the separator"
        raise table.fail("this column is missing", fix, column, part)
    if table.header.count(column) > 1:
        raise table.fail("two columns have this name", "rename one of them", column, part)
    found = table.cells[column]
    return packed(found) if not is_packed(found) and found.dtype == object else found


#: Problem and remedy.
_EMPTY = "this cell is empty", "fill it or take the row out"


def numbers(
    table: RawTable,
    quantity: Quantity,
    dimension: Dimension,
    part: str,
    *,
    may_be_empty: bool = False,
    image: tuple[float, float] = (math.nan, math.nan),
) -> Array:
    """A quantity in radians, metres, seconds or pixels. (N,); NaN where a cell is empty and may be.

    Raises
    ------
    WildlabError
        Where there is no such column, or a cell is not a finite number.
    """
    scale = factor(quantity.unit, dimension, *image) * (-1 if quantity.negate else 1)
    if quantity.column is None:
        return np.full(len(table), scale * (quantity.value or 0.0))
    found = plain_numbers(table, quantity.column, part, may_be_empty=may_be_empty)
    if quantity.plus is not None:
        found = found + plain_numbers(table, quantity.plus, f"{part}.plus", may_be_empty=may_be_empty)
    if dimension == "angle" and quantity.unit == "rad":
        _refuse_degrees(found, table, quantity.column, part)
    return scale * found


def _refuse_degrees(found: Array, table: RawTable, column: str, part: str) -> None:
    """Refuse what is said to be in radians and cannot be.

    An angle that is counted on over whole turns may be large, but it begins within one and never leaps by
    one; and nothing rolls or pitches by more than a turn.
    """
    beyond = np.abs(found) > 2 * np.pi
    if not beyond.any():
        return
    known = found[np.isfinite(found)]
    leaps = np.abs(np.diff(known)) > 2 * np.pi
    if part.rsplit(".", 1)[-1] in ("roll", "pitch") or np.abs(known[0]) > 2 * np.pi or leaps.any():
        problem = f"angles from {known.min():.4g} to {known.max():.4g} are not in radians"
        table.refuse(beyond, problem, 'write unit = "deg"', column, part)


def plain_numbers(table: RawTable, column: str, part: str, *, may_be_empty: bool = False) -> Array:
    """A column as numbers, whatever their unit. (N,)

    Raises
    ------
    WildlabError
        Where there is no such column, or a cell is not a finite number.
    """
    cells = _column(table, column, part)
    if is_packed(cells):
        found, empty = np.empty(len(table)), np.empty(len(table), bool)
        start = 0
        for chunk in cells.iterchunks():  # a block at a time are Python's own strings
            block = slice(start, start := start + len(chunk))
            words = pd.Series(chunk.to_numpy(zero_copy_only=False))
            if table.decimal == ",":
                words = words.str.translate(_POINTS)
            found[block] = pd.to_numeric(words, errors="coerce").to_numpy(dtype=float)
            empty[block] = words == ""
        if not may_be_empty:
            table.refuse(empty, *_EMPTY, column, part)
        bad = ~np.isfinite(found) & ~empty
    else:
        found = np.asarray(cells, float)
        bad = np.isinf(found) if may_be_empty else ~np.isfinite(found)
    if bad.any():
        row = int(np.argmax(bad))
        cell = table.cell(column, row)
        problem, fix = (
            "is not a finite number",
            "mend the cell, or take the row out",
        )
        if _DECIMAL_COMMA.fullmatch(cell):
            problem, fix = "has a decimal comma", "write `decimal = ','` beside file"
        raise table.fail(f"{_short(cell)} {problem}", fix, column, part, row)
    return found


def times(table: RawTable, stamp: Stamp, part: str, zone: str | None, epoch: datetime | None) -> Nanoseconds:
    """Stamps as nanoseconds since 1970 in UTC. (N,)

    `zone` is that of stamps which carry none, unless `stamp` names its own; `epoch` is for elapsed times.

    Raises
    ------
    WildlabError
        Where there is no such column, a cell is not a time, or no zone is known.
    """
    if stamp.format in ("unix", "elapsed"):
        return _counted(table, stamp, part, epoch)
    name = " + ".join(stamp.names)
    columns = [texts(table, column, part) for column in stamp.names]
    cells = np.array([" ".join(parts) for parts in zip(*columns, strict=True)], dtype=object)

    def refuse(lost: NDArray[np.bool_], problem: str, fix: str) -> None:
        table.refuse(lost, lambda row: problem.replace("{}", _short(cells[row]), 1), fix, name, part)

    own = "%z" in stamp.format
    if stamp.format == "iso":
        zoned = np.array([bool(_ZONED.fullmatch(cell)) for cell in cells])
        own = bool(zoned.all())
        if zoned.any():
            problem = "{} has no time zone, and others have"
            refuse(~zoned, problem, "write all of them alike")
    pattern = "ISO8601" if stamp.format == "iso" else stamp.format
    try:
        found = pd.DatetimeIndex(pd.to_datetime(cells, format=pattern, errors="coerce", utc=own))
    except ValueError as error:
        raise table.fail(f"the format {pattern!r} cannot be used ({error})", "mend it", name, part) from None
    problem = f"{{}} is not a time of the format {stamp.format!r}"
    refuse(pd.isna(found), problem, "mend the cell or the format")
    if not own:
        zone = stamp.zone or zone
        if zone is None:
            problem = f"{_short(cells[0])} has no time zone"
            fix = 'add zone = "UTC" or "Europe/Oslo" to [time]'
            raise table.fail(problem, fix, name, part, 0)
        found = found.tz_localize(find_zone(zone), ambiguous="NaT", nonexistent="NaT")
        problem = f"{{}} does not exist or exists twice in {zone}"
        refuse(pd.isna(found), problem, "write the zone as +02:00")
    return found.tz_convert(None).to_numpy("datetime64[ns]").astype(np.int64)


def _counted(table: RawTable, stamp: Stamp, part: str, epoch: datetime | None) -> Nanoseconds:
    name = stamp.names[0]
    if len(stamp.names) > 1:
        raise table.fail("counted times are one column", "name it", " + ".join(stamp.names), part)
    seconds = plain_numbers(table, name, part) * factor(stamp.unit, "time")
    start = 0 if stamp.format == "unix" or epoch is None else nanoseconds(epoch)
    far = np.abs(seconds) + abs(start) / 1e9 > _LATEST_S
    table.refuse(
        far,
        lambda row: f"{_short(table.cell(name, row))} {stamp.unit} is centuries away",
        "check the unit (s, ms or us)",
        name,
        part,
    )
    return start + np.round(seconds * 1e9).astype(np.int64)


def nanoseconds(when: datetime) -> int:
    """Nanoseconds since 1970 of a time that has a zone."""
    return int(pd.Timestamp(when).as_unit("ns").value)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


# -- parts of logs


def log_part(log: RawLog, wanted: LogTable, path: Path) -> Stream:
    """The part, with the columns ``height_m`` and ``stem`` (of ``file`` or ``image``) where they make sense.

    Parameters
    ----------
    log
        Read.
    wanted
        The part, what heights count from and what is added to them, what is added to stamps.
    path
        Only for messages.

    Returns
    -------
    Stream
        Rows without a stamp or a height that the recipe asked for are marked as not used.

    Raises
    ------
    WildlabError
        Where the log has no such part or no such heights.
    """
    if wanted.part not in log.parts:
        there = ", ".join(log.parts) or "nothing that can be used"
        raise WildlabError(
            f"this log has no {wanted.part}", f"use what it has: {there}", file=path, field="part"
        )
    if wanted.camera is not None and "photos" in log.parts:
        log = of_camera(log, wanted.camera)
    stream = log.parts[wanted.part]
    columns = dict(stream.columns)
    use, why = columns["use"].copy(), columns["why"].copy()
    if "time_s" in columns or "time_log_s" in columns:
        known = columns.get("time_s", np.full(len(stream), np.nan))
        # The log's own stamps, where the recipe says what they count from; those of images may stand alone.
        stated = wanted.offset_s or wanted.part == "photos"
        if stated and not np.isfinite(known).any() and "time_log_s" in columns:
            known = columns["time_log_s"]
        columns["time_s"] = known + wanted.offset_s
    if wanted.height is not None:
        name = f"height_{wanted.height}_m"
        if name not in columns:
            there = ", ".join(one for one in columns if one.startswith("height_")) or "none"
            problem = f"its {wanted.part} have no heights of the kind {wanted.height!r}"
            raise WildlabError(problem, f"there are {there}", file=path, field="height")
        columns["height_m"] = columns[name] + wanted.add_m
        lost = (use == 1.0) & ~np.isfinite(columns["height_m"])
        use[lost], why[lost] = 0.0, "no height"
    for name in ("file", "image"):
        if name in columns:
            columns["stem"] = np.array([Path(str(one)).stem for one in columns[name]], dtype=object)
    done = Stream({**columns, "use": use, "why": why}, stream.rows, stream.counted_in)
    return _by_time(done) if wanted.part == "photos" else done


def _by_time(stream: Stream) -> Stream:
    """Images in the order of their stamps: counters begin again, and copies have names of their own."""
    times = stream.columns.get("time_s")
    if times is None or not np.isfinite(times).any():
        return stream
    return stream.take(np.argsort(times, kind="stable"))


def of_images(pixels: Stream, images: Stream) -> Stream:
    """Pixels, those marked as not used that are of no image with a time.

    Parameters
    ----------
    pixels
        With ``image`` and ``stem``.
    images
        With ``file`` and ``stem``.

    Returns
    -------
    Stream
    """
    there = np.ones(len(images), bool)
    times = images.columns.get("time_s")
    if times is not None and np.isfinite(times).any():
        there = np.isfinite(times)
    known = {str(one) for name in ("file", "stem") for one in images.columns[name][there]}
    strange = np.array(
        [
            str(a) not in known and str(b) not in known
            for a, b in zip(pixels.columns["image"], pixels.columns["stem"], strict=True)
        ],
        bool,
    )
    use, why = pixels.columns["use"].copy(), pixels.columns["why"].copy()
    why[strange & (use == 1.0)] = "its image is not there"
    use[strange] = 0.0
    return Stream({**pixels.columns, "use": use, "why": why}, pixels.rows, pixels.counted_in)


def stamped_by(images: Stream, triggers: Stream, path: Path) -> Stream:
    """Images with the times of the records of their triggers; those without a record have none.

    Parameters
    ----------
    images
        With ``time_s`` or ``time_log_s``, by the camera's clock.
    triggers
        With ``time_s``.
    path
        Only for messages.

    Returns
    -------
    Stream

    Raises
    ------
    WildlabError
        Where neither has times, or no image belongs to a record for certain.
    """
    stamps = images.columns.get("time_log_s", images.columns.get("time_s"))
    times = triggers.columns.get("time_s")
    if stamps is None or times is None:
        problem = "the images or triggers have no times"
        raise WildlabError(problem, "take out triggers", file=path, field="triggers")
    of_record = np.where(triggers.used, times, np.nan)
    match = match_triggers(stamps, of_record)
    if not match.certain:
        raise WildlabError(
            "images and triggers do not fit for certain",
            "give camera_offset_s in [clocks] instead",
            file=path,
            field="triggers",
        )
    taken = np.where(match.trigger >= 0, of_record[np.maximum(match.trigger, 0)], np.nan)
    return _by_time(Stream({**images.columns, "time_s": taken}, images.rows, images.counted_in))
