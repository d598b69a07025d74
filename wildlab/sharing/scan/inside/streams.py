"""Compressed streams, unpacked no further than allowed."""

from __future__ import annotations

import bz2
import io
import lzma
import zlib
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Any

import pyarrow

from wildlab.sharing.scan.parts import Budget, Part, TooMuch

arrow: Any = pyarrow

#: Bytes unpacked between two looks at how much it has become.
STEP = 1 << 23


def inflate(data: bytes, budget: Budget, bits: int = zlib.MAX_WBITS) -> tuple[bytes, bytes]:
    """What a zlib, gzip or raw deflate stream unpacks to, and what stands behind its end.

    Parameters
    ----------
    data
        Beginning with the stream.
    budget
        How much may come out; it is spent.
    bits
        As `zlib.decompressobj` has it.

    Raises
    ------
    TooMuch
        Where more comes out.
    zlib.error
        Where it is damaged, or cut off.
    """
    unpacker = zlib.decompressobj(bits)
    out, size, rest = [], 0, data
    while not unpacker.eof:
        some = unpacker.decompress(rest, STEP)
        rest = unpacker.unconsumed_tail
        out.append(some)
        size += len(some)
        if size > budget.most:
            raise TooMuch
        if not some and not rest and not unpacker.eof:
            raise zlib.error("it is cut off")
    return budget.spend(b"".join(out)), unpacker.unused_data


def gzipped(data: bytes, budget: Budget) -> Iterator[Part]:
    """gzip: its names, times and comments, and what it unpacks to; several behind one another too."""
    rest, number = data, 0
    while rest[:2] == b"\x1f\x8b" and len(rest) >= 18:
        number += 1
        stamp = int.from_bytes(rest[4:8], "little")
        moments = (
            ((datetime.fromtimestamp(stamp, UTC), "the time in the head of a gzip file"),) if stamp else ()
        )
        yield Part("head", _gzip_head(rest), whole=True, moments=moments)
        inner, rest = inflate(rest, budget, 31)
        yield Part("unpacked", inner)
    if rest.strip(b"\x00"):
        yield Part("behind its end", rest)


def _gzip_head(data: bytes) -> bytes:
    """The optional fields: extra, name, comment."""
    flags, at = data[3], 10
    if flags & 4:
        at += 2 + int.from_bytes(data[10:12], "little")
    for bit in (8, 16):
        if flags & bit:
            at = data.find(b"\x00", at) + 1 or len(data)
    return data[10:at]


def zlibbed(data: bytes, budget: Budget) -> Iterator[Part]:
    """A zlib stream."""
    inner, rest = inflate(data, budget)
    yield Part("unpacked", inner)
    if rest:
        yield Part("behind its end", rest)


def bzipped(data: bytes, budget: Budget) -> Iterator[Part]:
    """bzip2."""
    yield Part("unpacked", _stepwise(bz2.BZ2File(io.BytesIO(data)).read, budget))


def xzipped(data: bytes, budget: Budget) -> Iterator[Part]:
    """xz and lzma."""
    with lzma.LZMAFile(io.BytesIO(data)) as file:
        yield Part("unpacked", _stepwise(file.read, budget))


def zstandard(data: bytes, budget: Budget) -> Iterator[Part]:
    """Zstandard."""
    yield Part("unpacked", _by_arrow(data, "zstd", budget))


def lz4(data: bytes, budget: Budget) -> Iterator[Part]:
    """LZ4 with frames."""
    yield Part("unpacked", _by_arrow(data, "lz4", budget))


def _by_arrow(data: bytes, name: str, budget: Budget) -> bytes:
    stream = arrow.CompressedInputStream(arrow.BufferReader(data), name)
    return _stepwise(stream.read, budget)


def _stepwise(read: Callable[[int], bytes], budget: Budget) -> bytes:
    out, size = [], 0
    while some := read(STEP):
        out.append(some)
        size += len(some)
        if size > budget.most:
            raise TooMuch
    return budget.spend(b"".join(out))
