"""Plain tables as they come, text or MATLAB's: numbers with units, times. Read once, hashed, never written.

Every error names the file, the column, the line, and the part of the recipe that asked. Text is read block
by block and kept packed until someone asks for numbers: as Python's own strings, ten hours of an inertial
sensor would take ten times their size on disk. Of MATLAB only the format of version 5 (``save -v7`` and
``-v6``) is read, which holds nothing that runs; the later one is HDF5.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.compute
import scipy.io
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import TriggerMatch, find_zone, match_triggers
from wildlab.flight.files import did_you_mean, inside, printable, read_regular
from wildlab.flight.readers import FOLDERS, read_folder, read_log
from wildlab.flight.readers.autoferry import Part, read_part
from wildlab.flight.readers.log import RawLog, Stream
from wildlab.flight.readers.photos import of_camera
from wildlab.flight.recipes import Decimal, LogTable, MatlabTable, Quantity, Series, Stamp
from wildlab.flight.schema import Dimension, factor
from wildlab.names import match_names

_WHOLE = re.compile(r"[-+]?\d+", re.ASCII)
#: Rows that are Python strings at a time.
BLOCK = 50_000

# pyarrow has no types that mypy could read.
pa: Any = pyarrow


def read_delimited(
    path: Path, data: bytes, separator: str, *, may_be_empty: bool = False
) -> tuple[tuple[str, ...], dict[str, Any], NDArray[np.int64]]:
    """A file of text whose first line has the names of the columns.

    Parameters
    ----------
    path
        For messages.
    data
        What is in it.
    separator
        Between the cells of a row.
    may_be_empty
        Whether the names of the columns may be all there is, as where nothing was detected.

    Returns
    -------
    tuple
        Names of the columns; the cells of each without blanks at both ends, packed (a pyarrow.ChunkedArray of
        text, length N); and for each row the line it ends on, (N,).

    Raises
    ------
    WildlabError
        Where it is not UTF-8, has no rows, or a row has more or fewer cells than the first line.
    """
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline="")
    reader = csv.reader(text, delimiter=separator, skipinitialspace=True)
    lines: list[NDArray[np.int64]] = []
    try:
        header = tuple(name.strip() for name in next(reader, []))
        packed: list[list[Any]] = [[] for _ in header]
        for rows, ends in _blocks(reader, header, path):
            lines.append(np.array(ends, np.int64))
            for chunks, column in zip(packed, zip(*rows, strict=True), strict=True):
                chunks.append(pyarrow.compute.utf8_trim_whitespace(pa.array(column, pa.string())))
    except csv.Error as error:
        raise WildlabError(f"line {reader.line_num}: {error}", "mend that line", file=path) from None
    except UnicodeDecodeError:
        line = data[: _first_undecodable(data)].count(b"\n") + 1
        raise WildlabError(f"line {line} is not UTF-8 text", "save the file as UTF-8", file=path) from None
    if not lines and not (may_be_empty and any(header)):
        raise WildlabError("there are no rows in it", "add column names and rows", file=path)
    cells = {name: pa.chunked_array(chunks, pa.string()) for name, chunks in zip(header, packed, strict=True)}
    return header, cells, np.concatenate([np.empty(0, np.int64), *lines])


def packed(words: Iterable[str]) -> Any:
    """Text as a pyarrow.ChunkedArray."""
    return pa.chunked_array([pa.array(words, pa.string())])


def is_packed(column: Any) -> bool:
    """Whether a column is packed text, and not an array of numbers."""
    return isinstance(column, pa.ChunkedArray)


def _blocks(reader: Any, header: tuple[str, ...], path: Path) -> Iterator[tuple[list[list[str]], list[int]]]:
    """Rows that are not blank, with the line each ends on, a block at a time."""
    numbered = ((row, reader.line_num) for row in reader if row)
    while block := list(islice(numbered, BLOCK)):
        for row, line in block:
            if len(row) != len(header):
                raise _uneven(row, line, header, path)
        rows, ends = zip(*block, strict=True)
        yield list(rows), list(ends)


def _uneven(row: list[str], line: int, header: tuple[str, ...], path: Path) -> WildlabError:
    """Of a row with more or fewer cells than there are columns, perhaps for its decimal commas."""
    problem = f"line {line} has {len(row)} cells, and the first line has {len(header)}"
    for name, whole, part in zip(header, row, row[1:], strict=False):
        if len(row) > len(header) and _WHOLE.fullmatch(whole) and part.isdecimal():
            problem += f": {whole},{part} is read as two cells: a decimal comma?"
            return WildlabError(problem, "write it with a decimal point", file=path, field=name)
    return WildlabError(problem, "mend that line, or the separator", file=path)


def _first_undecodable(data: bytes) -> int:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start
    return len(data)


# -- MATLAB


# Its types know files by name only.
reader: Any = scipy.io

#: A file may not hold more than this once it is unpacked: a few kilobytes can claim to be terabytes.
MOST_BYTES = 1 << 30
_HEADER = 128
_COMPRESSED = 15
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_matlab(path: Path, data: bytes) -> dict[str, Any]:
    """The variables of a file: arrays, text, and structs as mappings. `path` is only for messages.

    Raises
    ------
    WildlabError
        Where it is of another format, damaged, or too large.
    """
    remedy = "save it in MATLAB with -v7"
    if data[:8] == _HDF5 or data[512:520] == _HDF5 or data[:10] == b"MATLAB 7.3":
        raise WildlabError("is of version 7.3 (HDF5), which is not read", remedy, file=path)
    if data[:10] != b"MATLAB 5.0" or len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise WildlabError("is no MATLAB file of version 5 to 7", remedy, file=path)
    try:
        size = _unpacked(data)
    except (zlib.error, struct.error) as error:
        raise _damaged(path, error) from None
    if size > MOST_BYTES:
        problem = f"holds more than {MOST_BYTES >> 20} MiB once it is unpacked"
        raise WildlabError(problem, "save only what the recipe needs", file=path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            shapes = [math.prod(shape) for _, shape, _ in reader.whosmat(io.BytesIO(data))]
            if max(shapes, default=0) > MOST_BYTES // 8:
                raise ValueError("a variable has too many values")
            return dict(reader.loadmat(io.BytesIO(data), simplify_cells=True))
    except Exception as error:  # whatever a file made to mislead the reader brings about
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> WildlabError:
    first = (str(error).strip() or type(error).__name__).splitlines()[0]
    problem = f"is a damaged MATLAB file ({printable(first[:120])})"
    return WildlabError(problem, "copy or save it again", file=path)


def _unpacked(data: bytes) -> int:
    """Bytes of all variables unpacked, as far as the limit: nothing is kept."""
    order = "<" if data[126:128] == b"IM" else ">"
    total, at = 0, _HEADER
    while at + 8 <= len(data) and total <= MOST_BYTES:
        kind, size = struct.unpack_from(f"{order}II", data, at)
        at += 8
        if kind == _COMPRESSED:
            unpacker, rest = zlib.decompressobj(), data[at : at + size]
            while rest and total <= MOST_BYTES and not unpacker.eof:
                total += len(unpacker.decompress(rest, 1 << 20))
                rest = unpacker.unconsumed_tail
        else:
            total += size
        at += size
    return total


def table_of(variables: dict[str, Any], block: MatlabTable, path: Path, part: str) -> dict[str, NDArray[Any]]:
    """The columns of a table, (N,) each: float64, or text as objects.

    Raises
    ------
    WildlabError
        Where something is missing, not of numbers or text, not of one length, or has more columns than names.
    """
    here: Any = {name: one for name, one in variables.items() if not name.startswith("__")}
    gone: list[str] = []
    for name in block.struct.split(".") if block.struct else ():
        here = _member(here, name, gone, path, part)
        gone.append(name)
    if block.matrix is None:
        columns = {
            name: _matlab_column(_member(here, name, gone, path, part), name, path, part)
            for name in block.fields
        }
    else:
        matrix = np.asarray(_member(here, block.matrix, gone, path, part))
        names = block.columns
        if block.labels is not None:
            labels = np.atleast_1d(np.asarray(_member(here, block.labels, gone, path, part), dtype=object))
            names = tuple(str(one).strip() for one in labels.ravel())
        matrix = matrix[None] if matrix.ndim == 1 else matrix
        if matrix.ndim != 2 or matrix.shape[1] != len(names) or len(set(names)) != len(names):
            shape = " x ".join(str(n) for n in matrix.shape)
            raise WildlabError(
                f"the matrix {block.matrix!r} is {shape}, and there are {len(set(names))} names of columns",
                "name each column once, in order",
                file=path,
                field=f"{printable(block.matrix)} (in [{part}])",
            )
        columns = {name: _matlab_column(matrix[:, i], name, path, part) for i, name in enumerate(names)}
    lengths = {name: len(column) for name, column in columns.items()}
    first, length = next(iter(lengths.items()))
    odd = next((name for name, other in lengths.items() if other != length), None)
    if odd is not None or length == 0:
        raise WildlabError(
            "there are no rows in it"
            if odd is None
            else f"has {lengths[odd]} values, and {first!r} has {length}",
            "make a table of each length",
            file=path,
            field=f"{printable(odd or first)} (in [{part}])",
        )
    return columns


def _member(here: Any, name: str, gone: list[str], path: Path, part: str) -> Any:
    if isinstance(here, dict) and name in here:
        return here[name]
    where = ".".join(gone)
    if not isinstance(here, dict):
        problem, fix = f"{where!r} is not a struct", "mend the path"
    else:
        problem = f"there is no {name!r} in " + (f"the struct {where!r}" if where else "this file")
        fix = did_you_mean(name, here)
    raise WildlabError(problem, fix, file=path, field=f"{printable(name)} (in [{part}])")


def _matlab_column(value: Any, name: str, path: Path, part: str) -> NDArray[Any]:
    column = np.atleast_1d(np.asarray(value))
    if column.ndim == 2 and 1 in column.shape:
        column = column.ravel()
    if column.ndim == 1 and column.dtype.kind in "iufb":
        return column.astype(np.float64)
    if column.ndim == 1 and column.dtype.kind in "UO" and all(isinstance(one, str) for one in column):
        return np.array([str(one).strip() for one in column], dtype=object)
    shape = " x ".join(str(n) for n in column.shape)
    raise WildlabError(
        f"is {shape} of {column.dtype}, and a column is real numbers or text",
        "name a vector, or a matrix and its columns",
        file=path,
        field=f"{printable(name)} (in [{part}])",
    )


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


#: Of a table that is no text: its file, columns, where each row stands, and what that counts.
_Cells = tuple[Path, dict[str, Any], NDArray[np.int64], str]


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
                "check its name, and name its folder with --source",
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
        stated = self._of_log if name in self.logs else self._of_matlab if name in self.matlab else None
        key = (name,) if stated else (name, separator, decimal)
        if key not in self._tables:
            if stated is not None:
                path, cells, rows, counted_in = stated(name)
                self._tables[key] = RawTable(path, tuple(cells), cells, rows, counted_in)
                return self._tables[key]
            path = self.folder / name
            found = read_delimited(path, self.read(name, part), separator, may_be_empty=may_be_empty)
            table = RawTable(path, *found, decimal=decimal)
            if not len(table):
                return table  # kept, it would pass where rows are asked for
            self._tables[key] = table
        return self._tables[key]

    def _of_matlab(self, name: str) -> _Cells:
        block, part = self.matlab[name], f"tables.{name}"
        path = self.folder / block.file
        if block.file not in self._variables:
            self._variables[block.file] = read_matlab(path, self.read(block.file, part))
        cells = table_of(self._variables[block.file], block, path, part)
        return path, cells, np.arange(1, len(next(iter(cells.values()))) + 1), "row"

    def _of_log(self, name: str) -> _Cells:
        block = self.logs[name]
        path = self.folder / block.file
        if block.format == "autoferry":
            cells, frames = read_part(path, self.read(block.file, f"logs.{name}"), cast(Part, block.part))
            return path, cells, frames, "frame"
        stream = log_part(self._log(block, f"logs.{name}"), block, path)
        if block.triggers is not None:
            stream = stamped_by(stream, self._other(block.triggers, f"{name}.triggers", False), path)
        if block.images is not None:
            stream = of_images(stream, self._other(block.images, f"{name}.images", True))
        return path, stream.columns, stream.rows, stream.counted_in

    def _other(self, name: str, asked: str, photos: bool) -> Stream:
        """Another log of the recipe: triggers that images have their times from, or the images of pixels."""
        other = self.logs.get(name)
        if other is None or other.format == "autoferry" or (photos and other.part != "photos"):
            problem = f"{name!r} is no such log of this recipe"
            fix = did_you_mean(name, self.logs)
            raise WildlabError(problem, fix, file=self.recipe, field=f"logs.{asked}")
        if photos:
            table = self.table(name, "", asked)
            return Stream(table.cells, table.lines, table.counted_in)
        return log_part(self._log(other, f"logs.{name}"), other, self.folder / other.file)

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
        problem, fix = "is not a finite number", "mend the cell, or take the row out"
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
    """Pixels by the names of their images, those marked as not used that are of no image with a time."""
    there = np.ones(len(images), bool)
    times = images.columns.get("time_s")
    if times is not None and np.isfinite(times).any():
        there = np.isfinite(times)
    rows = {str(one): row for row, one in enumerate(images.columns["file"])}
    match = match_names(rows)
    found = {one: rows.get(match(str(one)) or "", -1) for one in dict.fromkeys(pixels.columns["image"])}
    row = np.array([found[one] for one in pixels.columns["image"]], int)
    strange = (row < 0) | ~there[row]
    use, why = pixels.columns["use"].copy(), pixels.columns["why"].copy()
    why[strange & (use == 1.0)] = "its image is not there"
    use[strange] = 0.0
    columns = {**pixels.columns, "use": use, "why": why}
    for name, of in (("image", "file"), ("stem", "stem")):
        columns[name] = np.where(row < 0, pixels.columns[name], np.asarray(images.columns[of], object)[row])
    return Stream(columns, pixels.rows, pixels.counted_in)


def match_images(images: Stream, of_record: Array) -> TriggerMatch | None:
    """Which image is of which record (N,) of a trigger; None where that is not certain.

    By the pattern of their stamps; of images without any, by their number and order.
    """
    stamps = images.columns.get("time_log_s", images.columns.get("time_s"))
    if stamps is None or not np.isfinite(stamps).any():
        known = np.flatnonzero(np.isfinite(of_record))
        return TriggerMatch(known, 0, 0, True) if len(known) == len(images) else None
    try:
        match = match_triggers(stamps, of_record)
    except WildlabError:
        return None
    return match if match.certain else None


def stamped_by(images: Stream, triggers: Stream, path: Path) -> Stream:
    """Images with the times of the records of their triggers; those without a record have none. Images
    without any stamp have those of as many records, in the order of both.

    Raises
    ------
    WildlabError
        Where no record has a time, or no image belongs to a record for certain.
    """
    times = triggers.columns.get("time_s")
    if times is None:
        raise WildlabError("the triggers have no times", "take out triggers", file=path, field="triggers")
    of_record = np.where(triggers.used, times, np.nan)
    match = match_images(images, of_record)
    if match is None:
        raise WildlabError(
            "images and triggers do not fit for certain",
            "give camera_offset_s in [clocks] instead",
            file=path,
            field="triggers",
        )
    taken = np.where(match.trigger >= 0, of_record[np.maximum(match.trigger, 0)], np.nan)
    return _by_time(Stream({**images.columns, "time_s": taken}, images.rows, images.counted_in))
