"""Text files of rows and columns, as they come: all cells stay text until someone asks for numbers.

They are read block by block and kept packed. As Python's own strings, ten hours of an inertial sensor would
take ten times their size on disk.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute
from numpy.typing import NDArray

from wildlab.errors import WildlabError

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
        for rows, ends in _blocks(reader, len(header), path):
            lines.append(np.array(ends, np.int64))
            for chunks, column in zip(packed, zip(*rows, strict=True), strict=True):
                chunks.append(pyarrow.compute.utf8_trim_whitespace(pa.array(column, pa.string())))
    except csv.Error as error:
        raise WildlabError(f"line {reader.line_num}: {error}", "mend that line", file=path) from None
    except UnicodeDecodeError:
        line = data[: _first_undecodable(data)].count(b"\n") + 1
        raise WildlabError(f"line {line} is not UTF-8 text", "save the file as UTF-8", file=path) from None
    if not lines and not (may_be_empty and any(header)):
        raise WildlabError("there are no rows in it", "give it a line of column names and rows", file=path)
    cells = {name: pa.chunked_array(chunks, pa.string()) for name, chunks in zip(header, packed, strict=True)}
    return header, cells, np.concatenate([np.empty(0, np.int64), *lines])


def packed(words: Iterable[str]) -> Any:
    """Text as a pyarrow.ChunkedArray."""
    return pa.chunked_array([pa.array(words, pa.string())])


def is_packed(column: Any) -> bool:
    """Whether a column is packed text, and not an array of numbers."""
    return isinstance(column, pa.ChunkedArray)


def _blocks(reader: Any, width: int, path: Path) -> Iterator[tuple[list[list[str]], list[int]]]:
    """Rows that are not blank, with the line each ends on, a block at a time."""
    numbered = ((row, reader.line_num) for row in reader if row)
    while block := list(islice(numbered, BLOCK)):
        for row, line in block:
            if len(row) != width:
                raise WildlabError(
                    f"line {line} has {len(row)} cells, and the first line has {width}",
                    "mend that line, or check the separator in the recipe",
                    file=path,
                )
        rows, ends = zip(*block, strict=True)
        yield list(rows), list(ends)


def _first_undecodable(data: bytes) -> int:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start
    return len(data)
