"""MATLAB files as hostile input: what is in them becomes plain arrays of numbers or text, or an error.

Only the format of MATLAB 5 (``save -v7`` and ``-v6``), which holds nothing that runs. The later one is HDF5.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import did_you_mean, printable
from wildlab.flight.recipe.parts import MatlabTable

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
            "is a MATLAB file of version 7.3 (HDF5), which is not read",
            "load it in MATLAB and save it again with the option -v7",
            file=path,
        )
    if data[:10] != b"MATLAB 5.0" or len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise WildlabError(
            "is not a MATLAB file of version 5 to 7", "save it in MATLAB with the option -v7", file=path
        )
    try:
        size = _unpacked(data)
    except (zlib.error, struct.error) as error:
        raise _damaged(path, error) from None
    if size > MOST_BYTES:
        raise WildlabError(
            f"holds more than {MOST_BYTES >> 20} MiB once it is unpacked",
            "save the variables that the recipe needs in a file of their own",
            file=path,
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            shapes = [math.prod(shape) for _, shape, _ in reader.whosmat(io.BytesIO(data))]
            if max(shapes, default=0) > MOST_BYTES // 8:
                raise ValueError("a variable claims to have more values than any log")
            return dict(reader.loadmat(io.BytesIO(data), simplify_cells=True))
    except Exception as error:  # whatever a file made to mislead the reader brings about
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> WildlabError:
    first = (str(error).strip() or type(error).__name__).splitlines()[0]
    problem = f"is a damaged MATLAB file ({printable(first[:120])})"
    return WildlabError(problem, "copy it again from where it came, or save it again in MATLAB", file=path)


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
                "name each of its columns once, in order",
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
            "put fields of one length into one table, those of another length into another",
            file=path,
            field=f"{printable(odd or first)} (in [{part}])",
        )
    return columns


def _member(here: Any, name: str, gone: list[str], path: Path, part: str) -> Any:
    if isinstance(here, dict) and name in here:
        return here[name]
    where = ".".join(gone)
    if not isinstance(here, dict):
        problem, fix = f"{where!r} is not a struct", "mend the path in the recipe"
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
        f"is {shape} of {column.dtype}, and a column is one row of real numbers or of text",
        "name a field that is a vector, or a matrix with the names of its columns",
        file=path,
        field=f"{printable(name)} (in [{part}])",
    )
