"""Numbers as computers keep them, at every byte: whichever begins there, in both orders of bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.sharing.scan.encodings import Encoding
from wildlab.sharing.scan.findings import Kind
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.near import MOST, merged, within
from wildlab.sharing.scan.numbers import Ints
from wildlab.sharing.scan.secrets import Array

#: Kinds of numbers: how numpy calls them, and what they are called.
TYPES = (
    (">f8", "a 64-bit float"), ("<f8", "a 64-bit float"),
    (">f4", "a 32-bit float"), ("<f4", "a 32-bit float"),
    (">i4", "a 32-bit integer"), ("<i4", "a 32-bit integer"),
    (">i8", "a 64-bit integer"), ("<i8", "a 64-bit integer"),
)  # fmt: skip
#: A place is looked for to this, m, at most: beyond, four bytes agree by chance too often.
CLOSE_M = 200.0
#: Of whole numbers of four bytes, which have no exponent that must agree as well, to this, m.
CLOSE_WHOLE_M = 50.0
#: Two numbers of one place are no further apart than this, bytes.
TOGETHER = 64
#: A single number of eight bytes must agree to this, m (of a kind that alone says enough); a time to this, s.
ALONE_M, ALONE_S = 0.55, 5.0
#: Kinds of which one float of 64 bits is enough: of all together, one would come by chance.
SURE = ("decimal degrees", "radians")
#: 32-bit floats are no finer than this share of themselves.
FLOAT32 = 6e-8
#: Pieces, so that memory stays bounded.
PIECE = 4_000_000


class Needle(NamedTuple):
    """Ranges that one number may lie in.

    Attributes
    ----------
    name
        ``"latitude, decimal degrees"``.
    low, high
        (N,) without signs, in order, apart.
    group, part
        Which encoding, and which of its axes; single numbers have a group of their own.
    kind
        What one of them is found as, where one is enough.
    """

    name: str
    low: Array
    high: Array
    group: int
    part: int
    kind: Kind | None


class Binary:
    """What is looked for among bytes, prepared once."""

    def __init__(
        self,
        encodings: Sequence[Encoding],
        near_m: float,
        numbers: Sequence[float],
        moments: Sequence[datetime],
    ) -> None:
        self.needles: dict[str, list[Needle]] = {}
        self.tables: dict[str, NDArray[np.bool_]] = {}
        self.ranges: dict[str, tuple[Array, Array]] = {}
        close = min(near_m, CLOSE_M)
        for kind, _ in TYPES:
            needles = list(_places(kind, encodings, close)) + list(_single(kind, encodings, numbers, moments))
            self.needles[kind] = needles
            self.tables[kind] = _table(kind, needles)
            ends = [np.concatenate([getattr(one, end) for one in needles] or [[]]) for end in ("low", "high")]
            self.ranges[kind] = merged(ends[0], ends[1])

    def found_in(self, data: bytes) -> list[Hit]:
        """Where a place, a time or a number that locates stands among bytes.

        Parameters
        ----------
        data
            Any bytes.
        """
        hits: list[Hit] = []
        for begin in range(0, len(data), PIECE):
            piece = data[begin : begin + PIECE + TOGETHER + 8]
            hits += [hit._replace(start=hit.start + begin, end=hit.end + begin) for hit in self._found(piece)]
        return list(dict.fromkeys(hits))

    def _found(self, data: bytes) -> Iterator[Hit]:
        if len(data) < 4:
            return
        raw = np.frombuffer(data, np.uint8)
        words = raw[:-1].astype(np.uint16) << 8 | raw[1:]  # the first two bytes of a number, at each place
        for kind, name in TYPES:
            needles = self.needles[kind]
            size = int(kind[2])
            if not needles or len(data) < size:
                continue
            n = len(data) - size + 1
            if kind[0] == ">":
                maybe = self.tables[kind][words[:n]]
            else:  # the last two bytes, the other way around
                maybe = self.tables[kind][words[size - 2 : size - 2 + n].byteswap()]
            at = np.flatnonzero(maybe)
            if not len(at):
                continue
            bytes_of = raw[at[:, None] + np.arange(size)]
            values = np.abs(np.ascontiguousarray(bytes_of).view(kind).reshape(-1).astype(float))
            some = within(values, *self.ranges[kind])
            yield from _judged(at[some], values[some], needles, size, name)


def _judged(at: Ints, values: Array, needles: list[Needle], size: int, name: str) -> Iterator[Hit]:
    found: dict[tuple[int, int], Ints] = {}
    for needle in needles:
        inside = within(values, needle.low, needle.high)
        if not inside.any():
            continue
        places = at[inside]
        if needle.kind:
            for place in places[:MOST].tolist():
                yield Hit(place, place + size, needle.kind, f"{needle.name}, as {name}")
        else:
            found[needle.group, needle.part] = places
    names = {(needle.group, needle.part): needle.name for needle in needles}
    for (group, part), first in found.items():
        for (other, another), second in found.items():
            if group != other or part >= another:
                continue
            nearest = np.searchsorted(second, first)
            for shift in (-1, 0):
                index = np.clip(nearest + shift, 0, len(second) - 1)
                gap = np.abs(first - second[index])
                # At a whole number of steps from each other: they stand in one row.
                good = (gap >= size) & (gap <= TOGETHER) & (gap % 4 == 0)
                for a, b in zip(
                    first[good][:MOST].tolist(), second[index][good][:MOST].tolist(), strict=True
                ):
                    what = f"{names[group, part]} and {names[other, another].partition(',')[0]}, as {name}s"
                    yield Hit(min(a, b), max(a, b) + size, "place", what)


def _places(kind: str, encodings: Sequence[Encoding], close_m: float) -> Iterator[Needle]:
    """Two numbers of one place."""
    close_m = min(close_m, CLOSE_WHOLE_M) if kind[1:] == "i4" else close_m
    for group, encoding in enumerate(encodings):
        unit = encoding.axes[0].per_metre.max()
        if (kind[1] == "i") != (unit >= 10):  # whole numbers need a fine unit
            continue
        for part, axis in enumerate(encoding.axes):
            tolerance = close_m * axis.per_metre
            if kind[1:] == "f4":
                tolerance = tolerance + axis.values * FLOAT32
            yield _needle(f"{axis.name}, {encoding.name}", axis.values, tolerance, group, part, None)


def _single(
    kind: str, encodings: Sequence[Encoding], numbers: Sequence[float], moments: Sequence[datetime]
) -> Iterator[Needle]:
    """Numbers of which one is enough: only of eight bytes, four agree by chance."""
    if kind[1:] == "f8":
        for encoding in encodings:
            for axis in encoding.axes:
                if axis.decimals is not None and encoding.name in SURE:
                    yield _needle(
                        f"{axis.name}, {encoding.name}", axis.values, ALONE_M * axis.per_metre, -1, 0, "place"
                    )
        true = np.abs([one for one in numbers if np.isfinite(one) and one])
        # Whole numbers and halves stand everywhere.
        true = true[np.abs(true * 2 - np.round(true * 2)) > 1e-9]
        yield _needle("a number that locates", true, true * 1e-9, -1, 0, "number")
    if kind[2] == "8":
        stamps = np.array([moment.timestamp() for moment in moments])
        for unit, scale in (("seconds", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
            if kind[1] == "f" or scale > 1:
                tolerance = np.full(len(stamps), ALONE_S * scale)
                yield _needle(f"time as {unit} since 1970", stamps * scale, tolerance, -1, 0, "date")


def _needle(name: str, values: Array, tolerance: Array, group: int, part: int, kind: Kind | None) -> Needle:
    good = np.isfinite(values)
    # Next to zero everything agrees.
    good &= values > 20 * tolerance
    low, high = merged(values[good] - tolerance[good], values[good] + tolerance[good])
    return Needle(name, low, high, group, part, kind)


def _table(kind: str, needles: list[Needle]) -> NDArray[np.bool_]:
    """(65 536,) whether a number whose first two bytes are these may be in any range."""
    table = np.zeros(65_536, bool)
    big = ">" + kind[1:]
    for needle in needles:
        for sign in (1, -1):
            ends = [
                np.asarray(sign * end, big if kind[1] == "f" else float) for end in (needle.low, needle.high)
            ]
            if kind[1] == "i":
                limit = 2.0 ** (8 * int(kind[2]) - 1) - 1024
                ends = [np.clip(end, -limit, limit).astype(big) for end in ends]
            first, last = (
                np.frombuffer(np.ascontiguousarray(end).tobytes(), f">u{kind[2]}") >> (8 * int(kind[2]) - 16)
                for end in ends
            )
            for a, b in zip(first.tolist(), last.tolist(), strict=True):
                table[min(a, b) : max(a, b) + 1] = True
    return table
