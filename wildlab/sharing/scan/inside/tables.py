"""Tables: Parquet, Arrow, SQLite (GeoPackage), rerun's recordings: every column, and what is said of it."""

from __future__ import annotations

import contextlib
import io
import sqlite3
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute
import pyarrow.ipc
import pyarrow.parquet

from wildlab.sharing.scan.parts import Budget, Part, TooMuch, begins_packed
from wildlab.sharing.scan.secrets import Array

# pyarrow carries no types.
arrow: Any = pyarrow
compute: Any = pyarrow.compute

#: Rows read at once.
ROWS = 200_000
#: Cells at least as long as this may be files of their own.
LARGE = 64
#: Steps of SQLite's machine: a view that never ends is stopped.
MOST_STEPS = 200_000_000


def parquet(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every column of a Parquet file, its metadata and its statistics."""
    file = arrow.parquet.ParquetFile(arrow.BufferReader(data))
    if sum(_unpacked_size(file, group) for group in range(file.metadata.num_row_groups)) > budget.most:
        raise TooMuch
    yield Part("names and metadata", _schema_text(file.schema_arrow, file.metadata.metadata), whole=True)
    for number, batch in enumerate(file.iter_batches(ROWS)):
        yield from table_parts(f"rows {number * ROWS + 1} on", arrow.Table.from_batches([batch]), budget)
    yield Part("", data, whole=True)


def _unpacked_size(file: Any, group: int) -> int:
    return int(file.metadata.row_group(group).total_byte_size)


def arrow_file(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every column of an Arrow (Feather) file or stream."""
    open_as = arrow.ipc.open_file if data.startswith(b"ARROW1") else arrow.ipc.open_stream
    table = open_as(arrow.BufferReader(data)).read_all()
    yield Part("names and metadata", _schema_text(table.schema, table.schema.metadata), whole=True)
    yield from table_parts("rows", table, budget)
    yield Part("", data, whole=True)


def _schema_text(schema: Any, metadata: Any) -> bytes:
    said = [str(schema).encode("utf-8", "replace")]
    for pair in (metadata or {}).items():
        said += list(pair)
    for column in schema:
        for pair in (column.metadata or {}).items():
            said += list(pair)
    return b"\n".join(said)


def table_parts(where: str, table: Any, budget: Budget) -> Iterator[Part]:
    """The columns of a table: numbers as numbers, times as times, text as text, bytes as files.

    Parameters
    ----------
    where
        What it is called.
    table
        Of Arrow, with lists and structures in any depth.
    budget
        How much may be unpacked.
    """
    columns: list[tuple[str, Array]] = []
    texts: list[str] = []
    blobs: list[bytes] = []
    moments: list[tuple[datetime, str]] = []
    for name in dict.fromkeys(table.column_names):
        for index in table.schema.get_all_field_indices(name):
            for below, flat in _leaves(name, table.column(index)):
                _sort_out(below, flat, columns, texts, blobs, moments)
    size = sum(column.nbytes for _, column in columns) + sum(map(len, texts)) + sum(map(len, blobs))
    if size > budget.most:
        raise TooMuch
    text = "\n".join(texts).encode("utf-8", "replace")
    yield Part(where, budget.spend(text), columns=tuple(columns), moments=tuple(moments))
    yield from _cells(where, blobs, budget)


def _cells(where: str, blobs: list[bytes], budget: Budget) -> Iterator[Part]:
    """Cells of bytes: all at once, and those that may be files each for itself."""
    if blobs:
        yield Part(f"{where}, cells", budget.spend(b"\n\n".join(blobs)), whole=True)
    own = (blob for blob in blobs if len(blob) >= LARGE or begins_packed(blob))
    for number, blob in enumerate(own):
        yield Part(f"{where}, cell {number + 1}", budget.spend(blob))


def _leaves(name: str, column: Any) -> Iterator[tuple[str, Any]]:
    """Columns without lists, structures and dictionaries around them."""
    kind = column.type
    types = arrow.types
    if isinstance(kind, arrow.BaseExtensionType):
        column = arrow.chunked_array([chunk.storage for chunk in getattr(column, "chunks", [column])])
        yield from _leaves(name, column)
    elif types.is_dictionary(kind):
        yield from _leaves(name, column.cast(kind.value_type))
    elif types.is_struct(kind):
        for number in range(kind.num_fields):
            yield from _leaves(f"{name}.{kind.field(number).name}", compute.struct_field(column, [number]))
    elif types.is_map(kind):
        chunks = getattr(column, "chunks", [column])
        for part in ("keys", "items"):
            yield from _leaves(f"{name}.{part}", arrow.chunked_array([getattr(c, part) for c in chunks]))
    elif types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        if arrow.types.is_uint8(kind.value_type):  # a file as a list of bytes
            yield name, column
        else:
            flat = compute.list_flatten(column)
            yield from _leaves(name, flat)
            if types.is_fixed_size_list(kind) and 1 < kind.list_size <= 16 and not column.null_count:
                # Points as lists of two or three: each coordinate a column, so that they stand row by row.
                for place in range(kind.list_size):
                    yield from _leaves(f"{name}[{place}]", compute.list_element(column, place))
    else:
        yield name, column


def _sort_out(
    name: str,
    column: Any,
    columns: list[tuple[str, Array]],
    texts: list[str],
    blobs: list[bytes],
    moments: list[tuple[datetime, str]],
) -> None:
    types, kind = arrow.types, column.type
    if types.is_null(kind) or types.is_boolean(kind):
        return
    if types.is_timestamp(kind) or types.is_date(kind):
        known = column.drop_null()
        if len(known):
            stamps = known.cast(arrow.timestamp("us"), safe=False)
            some = compute.unique(compute.floor_temporal(stamps, unit="minute")).to_pylist()[:100_000]
            moments += [(moment.replace(tzinfo=UTC), "a time in a column") for moment in some]
    elif (
        types.is_floating(kind) or types.is_integer(kind) or types.is_decimal(kind) or types.is_duration(kind)
    ):
        as_float = column.cast(arrow.int64()) if types.is_duration(kind) else column
        values = np.asarray(as_float.cast(arrow.float64(), safe=False).to_numpy(), float)
        columns.append((name, values))
    elif types.is_binary(kind) or types.is_large_binary(kind) or types.is_fixed_size_binary(kind):
        blobs += [blob for blob in column.to_pylist() if blob]
    elif types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        blobs += [bytes(cell) for cell in _bytes_of(column)]
    else:
        texts += [str(cell) for cell in column.to_pylist() if cell is not None]


def _bytes_of(column: Any) -> Iterator[bytes]:
    for chunk in getattr(column, "chunks", [column]):
        for cell in chunk:
            if cell.is_valid:
                yield cell.values.to_numpy(zero_copy_only=False).tobytes()


def sqlite(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every table of an SQLite file (a GeoPackage is one), and its bytes: deleted rows stay in them."""
    yield Part("", data, whole=True)
    with contextlib.closing(sqlite3.connect(":memory:")) as base:
        base.deserialize(data)
        base.execute("PRAGMA trusted_schema = OFF")
        base.set_progress_handler(_Steps(), 1_000_000)
        base.text_factory = bytes
        tables = base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall()
        for name, made in tables:
            if made is not None and b"VIRTUAL" in made[:40].upper():
                continue  # its rows lie in tables of its own
            quoted = name.decode("utf-8", "replace").replace('"', '""')
            cursor = base.execute(f'SELECT * FROM "{quoted}"')  # noqa: S608 - quoted
            names = [str(column[0]) for column in cursor.description]
            while rows := cursor.fetchmany(ROWS):
                yield from _rows(f"table {quoted}", names, rows, budget)


class _Steps:
    def __init__(self) -> None:
        self.left = MOST_STEPS

    def __call__(self) -> int:
        self.left -= 1_000_000
        return int(self.left < 0)


def _rows(where: str, names: list[str], rows: list[Any], budget: Budget) -> Iterator[Part]:
    columns: list[tuple[str, Array]] = []
    texts: list[bytes] = []
    blobs: list[bytes] = []
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        numbers = [cell if isinstance(cell, int | float) else np.nan for cell in cells]
        if not np.isnan(np.array(numbers, float)).all():
            columns.append((name, np.array(numbers, float)))
        for cell in cells:
            if isinstance(cell, bytes):
                (blobs if len(cell) >= LARGE or not cell.isascii() else texts).append(cell)
    yield Part(where, budget.spend(b"\n".join(texts)), columns=tuple(columns))
    yield from _cells(where, blobs, budget)


def recording(data: bytes, budget: Budget) -> Iterator[Part]:
    """A recording of rerun: every component, and the names of what it shows."""
    from rerun.chunk import RrdReader

    yield Part("", data, whole=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.rrd"
        path.write_bytes(data)
        reader = RrdReader(path)
        for store in (*reader.recordings(), *reader.blueprints()):
            yield Part("store", str(store).encode("utf-8", "replace"), whole=True)
            for number, chunk in enumerate(reader.stream(store=store)):
                table = arrow.Table.from_batches([chunk.to_record_batch()])
                where = f"chunk {number + 1} ({chunk.entity_path})"
                yield Part(where, _schema_text(table.schema, table.schema.metadata), whole=True)
                yield from table_parts(where, table, budget)


DAMAGED = (arrow.ArrowException, sqlite3.Error, OSError, ValueError, io.UnsupportedOperation)
