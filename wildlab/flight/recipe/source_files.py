"""Files of strangers as plain columns: text of rows and columns, and MATLAB's.

Text is read block by block and kept packed, and stays text until someone asks for numbers: as Python's own
strings, ten hours of an inertial sensor would take ten times their size on disk. Of MATLAB only the format of
version 5 (``save -v7`` and ``-v6``) is read, which holds nothing that runs; the later one is HDF5.
"""

from __future__ import annotations

import csv
import io
import math
import re
import struct
import warnings
import zlib
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute
import scipy.io
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import did_you_mean, printable
from wildlab.flight.recipe.quantities import MatlabTable

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
    if data[:8] == _HDF5 or data[512:520] == _HDF5 or data[:10] == b"MATLAB 7.3":
        raise WildlabError(
            "is of version 7.3 (HDF5), which is not read",
            "save it in MATLAB with -v7",
            file=path,
        )
    if data[:10] != b"MATLAB 5.0" or len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise WildlabError("is no MATLAB file of version 5 to 7", "save it in MATLAB with -v7", file=path)
    try:
        size = _unpacked(data)
    except (zlib.error, struct.error) as error:
        raise _damaged(path, error) from None
    if size > MOST_BYTES:
        raise WildlabError(
            f"holds more than {MOST_BYTES >> 20} MiB once it is unpacked",
            "save only what the recipe needs",
            file=path,
        )
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
            name: _column(_member(here, name, gone, path, part), name, path, part) for name in block.fields
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
        columns = {name: _column(matrix[:, i], name, path, part) for i, name in enumerate(names)}
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


def _column(value: Any, name: str, path: Path, part: str) -> NDArray[Any]:
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
