"""TIFF, which is also what EXIF is: every tag of every directory."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np

from wildlab.sharing.scan.parts import Budget, Part

#: Bytes per value by the kind of it, and how numpy calls it; others are bytes.
_SIZES = {
    1: 1,
    2: 1,
    3: 2,
    4: 4,
    5: 8,
    6: 1,
    7: 1,
    8: 2,
    9: 4,
    10: 8,
    11: 4,
    12: 8,
    13: 4,
    16: 8,
    17: 8,
    18: 8,
}
_KINDS = {3: "u2", 4: "u4", 8: "i2", 9: "i4", 11: "f4", 12: "f8", 13: "u4", 16: "u8", 17: "i8", 18: "u8"}
#: Tags that hold where another directory begins.
_BELOW = {0x8769, 0x8825, 0xA005, 0x014A}
#: Where the picture itself lies (strips, tiles), and how long its pieces are.
_PIECES = {0x0111: 0x0117, 0x0144: 0x0145, 0x0201: 0x0202}
#: No camera writes more.
MOST_TAGS, MOST_DIRECTORIES = 4000, 64


def tiff(data: bytes, budget: Budget) -> Iterator[Part]:
    """The tags as numbers, fractions and text; all else as it is, without the picture's own bytes.

    Parameters
    ----------
    data
        Beginning with ``II`` or ``MM``.
    budget
        Not spent: nothing is unpacked.

    Raises
    ------
    ValueError
        Where it is damaged.
    """
    order = "<" if data[:2] == b"II" else ">"
    (version,) = struct.unpack_from(order + "H", data, 2)
    big = version == 43
    head = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)[0]
    seen: set[int] = set()
    todo, said, columns, pieces, boxes = [head], [], [], [], []
    while todo and len(seen) < MOST_DIRECTORIES:
        at = todo.pop()
        if at in seen or not at:
            continue
        seen.add(at)
        entries, following = _directory(data, at, order, big)
        todo.append(following)
        held: dict[int, np.ndarray] = {}
        for tag, kind, raw in entries:
            values = _values(raw, kind, order)
            if values is None:
                said.append(raw)
                continue
            held[tag] = values
            if tag in _BELOW:
                todo += [int(value) for value in values[:8]]
            elif tag not in _PIECES and tag not in _PIECES.values():
                columns.append((f"tag {tag:#06x}", values.astype(float)))
                said.append(_written(values, kind, raw, order))
        boxes += _boxes(held)
        for starts, lengths in _PIECES.items():
            if starts in held and lengths in held:
                pieces += list(zip(held[starts].tolist(), held[lengths].tolist(), strict=False))
    yield Part("tags", b"\n".join(said), columns=tuple(columns), boxes=tuple(boxes), whole=True)
    around, pictures = _around(data, pieces)
    yield Part("around the picture", around, whole=True)
    for number, picture in enumerate(pictures):
        # A small picture inside is a JPEG of its own, with tags of its own.
        if picture.startswith(b"\xff\xd8\xff"):
            yield Part(f"picture {number + 1}", picture)


def _boxes(held: dict[int, np.ndarray]) -> list[tuple[float, float, float, float, bool]]:
    """What the map reaches over, as GeoTIFF says it: a corner and the size of a pixel, or a matrix."""
    if not {0x0100, 0x0101} <= held.keys():
        return []
    width, height = float(held[0x0100][0]), float(held[0x0101][0])
    keys = held.get(0x87AF, np.zeros(0)).astype(int)[4:]
    model = {int(keys[k]): int(keys[k + 3]) for k in range(0, len(keys) - 3, 4)}.get(1024, 0)
    scale, tie, matrix = held.get(0x830E), held.get(0x8482), held.get(0x85D8)
    if matrix is not None and len(matrix) >= 8:
        a, b, _, c, d, e, _, f = (float(value) for value in matrix[:8])
    elif scale is not None and tie is not None and len(scale) >= 2 and len(tie) >= 6:
        a, b, d, e = float(scale[0]), 0.0, 0.0, -float(scale[1])
        c, f = float(tie[3] - tie[0] * a), float(tie[4] - tie[1] * e)
    else:
        return []
    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)])
    x, y = a * corners[:, 0] + b * corners[:, 1] + c, d * corners[:, 0] + e * corners[:, 1] + f
    return [(float(x.min()), float(x.max()), float(y.min()), float(y.max()), model == 2)]


def _directory(data: bytes, at: int, order: str, big: bool) -> tuple[list[tuple[int, int, bytes]], int]:
    """The tags of one directory: number, kind, bytes; and where the next begins."""
    count_as, entry_as, size = ("Q", "HHQ8s", 20) if big else ("H", "HHI4s", 12)
    try:
        (count,) = struct.unpack_from(order + count_as, data, at)
        at += struct.calcsize(order + count_as)
        if count > MOST_TAGS:
            raise ValueError("a directory with more tags than any file has")
        entries = []
        for number in range(count):
            tag, kind, n, inline = struct.unpack_from(order + entry_as, data, at + number * size)
            length = _SIZES.get(kind, 1) * n
            if length > len(inline):
                (begin,) = struct.unpack(order + ("Q" if big else "I"), inline)
                inline = data[begin : begin + length]
            entries.append((tag, kind, inline[:length]))
        (following,) = struct.unpack_from(order + ("Q" if big else "I"), data, at + count * size)
    except struct.error as error:
        raise ValueError("a directory of tags that is cut off") from error
    return entries, int(following)


def _values(raw: bytes, kind: int, order: str) -> np.ndarray | None:
    """The numbers of a tag; of fractions, what they come to."""
    if kind in (5, 10):
        pairs = np.frombuffer(raw[: len(raw) // 8 * 8], order + ("u4" if kind == 5 else "i4")).reshape(-1, 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(pairs[:, 0] / pairs[:, 1].astype(float))
    if kind not in _KINDS:
        return None
    size = _SIZES[kind]
    return np.frombuffer(raw[: len(raw) // size * size], order + _KINDS[kind])


def _written(values: np.ndarray, kind: int, raw: bytes, order: str) -> bytes:
    """Numbers as text, so that degrees, minutes and seconds are read as such."""
    some = values[:64]
    if kind in (5, 10):
        parts = np.frombuffer(raw[: len(some) * 8], order + ("u4" if kind == 5 else "i4")).reshape(-1, 2)
        return ", ".join(f"{a}/{b}" for a, b in parts.tolist()).encode("ascii")
    return ", ".join(repr(value) for value in some.tolist()).encode("ascii")


def _around(data: bytes, pieces: list[tuple[int, int]]) -> tuple[bytes, list[bytes]]:
    """What is not the picture, and the picture's pieces."""
    kept, end, pictures = [], 0, []
    for start, length in sorted(pieces):
        pictures.append(data[start : start + length])
        kept.append(data[end : max(start, end)])
        end = max(end, start + length)
    return b"".join([*kept, data[end:]]), pictures
