"""Messages of UBX, the binary protocol of u-blox: where they are in a stream of bytes, and their fields.

Messages of a kind are taken all at once, some 100 times as fast as `pyubx2` makes an object of each.
Facts of the protocol: u-blox interface descriptions of series 6 to 9, as `pyubx2` has them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[Any]

_SYNC = (0xB5, 0x62)
#: Sync, class, number, length; then the payload and two bytes of checksum.
_HEADER, _CHECK = 6, 2

_DATE = [("year", "<u2"), *((name, "u1") for name in ("month", "day", "hour", "minute", "second"))]
_PLACE = [("lon", "<i4"), ("lat", "<i4"), ("height", "<i4"), ("sea", "<i4")]
_ATTITUDE = [
    *[("itow", "<u4"), ("version", "u1"), ("_0", "u1", 3), ("roll", "<i4"), ("pitch", "<i4")],
    *[("heading", "<i4"), ("roll_acc", "<u4"), ("pitch_acc", "<u4"), ("heading_acc", "<u4")],
]

#: Class and number -> fields, as far as they are used. Newer versions are longer, never otherwise.
LAYOUTS: dict[tuple[int, int], Any] = {
    (0x01, 0x07): [
        *[("itow", "<u4"), *_DATE, ("valid", "u1"), ("time_acc", "<u4"), ("nano", "<i4"), ("fix", "u1")],
        *[("flags", "u1"), ("flags2", "u1"), ("satellites", "u1"), *_PLACE, ("h_acc", "<u4")],
        *[("v_acc", "<u4"), ("vel_n", "<i4"), ("vel_e", "<i4"), ("vel_d", "<i4"), ("speed", "<i4")],
        *[("course", "<i4"), ("s_acc", "<u4"), ("course_acc", "<u4"), ("pdop", "<u2"), ("flags3", "u1")],
    ],
    (0x01, 0x02): [("itow", "<u4"), *_PLACE, ("h_acc", "<u4"), ("v_acc", "<u4")],
    (0x01, 0x14): [
        *[("version", "u1"), ("_0", "u1", 2), ("flags", "u1"), ("itow", "<u4"), *_PLACE],
        *[("lon_hp", "i1"), ("lat_hp", "i1"), ("height_hp", "i1"), ("sea_hp", "i1")],
        *[("h_acc", "<u4"), ("v_acc", "<u4")],
    ],
    (0x01, 0x12): [
        *[("itow", "<u4"), ("vel_n", "<i4"), ("vel_e", "<i4"), ("vel_d", "<i4")],
        *[("speed_3d", "<u4"), ("speed", "<u4"), ("course", "<i4"), ("s_acc", "<u4")],
    ],
    (0x01, 0x20): [
        *[("itow", "<u4"), ("ftow", "<i4"), ("week", "<i2"), ("leap", "i1"), ("valid", "u1")],
    ],
    (0x01, 0x21): [
        *[("itow", "<u4"), ("time_acc", "<u4"), ("nano", "<i4"), *_DATE, ("valid", "u1")],
    ],
    (0x01, 0x06): [
        *[("itow", "<u4"), ("ftow", "<i4"), ("week", "<i2"), ("fix", "u1"), ("flags", "u1")],
        *[("_0", "u1", 35), ("satellites", "u1")],
    ],
    (0x01, 0x03): [("itow", "<u4"), ("fix", "u1"), ("flags", "u1")],
    (0x01, 0x04): [("itow", "<u4"), ("_0", "u1", 8), ("hdop", "<u2")],
    (0x01, 0x05): _ATTITUDE,
    (0x28, 0x01): _ATTITUDE,
    (0x28, 0x00): [
        *[("itow", "<u4"), *_DATE, ("valid", "u1"), ("nano", "<i4"), ("fix", "u1"), ("flags", "u1")],
        *[("_0", "u1", 2), *_PLACE, ("speed", "<i4"), ("speed_3d", "<i4"), ("course", "<i4")],
        *[("heading", "<i4"), ("h_acc", "<u4"), ("v_acc", "<u4"), ("s_acc", "<u4")],
    ],
}
#: Classes that the interface descriptions have; others are chance.
CLASSES = (*(0x01, 0x02, 0x04, 0x05, 0x06, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x10), *(0x13, 0x21, 0x27, 0x28))


class UbxFrames(NamedTuple):
    """Messages whose checksum holds, in the order of the file.

    Attributes
    ----------
    start, stop
        (M,) bytes of each, its header and checksum among them.
    kind
        (M,) class times 256 plus number.
    broken
        How many others begin as messages of a known class, outside these.
    """

    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    kind: NDArray[np.int64]
    broken: int


def frames(data: bytes) -> UbxFrames:
    """Messages in any stream of bytes, whatever else is in it. A length that lies costs one message.

    Sums of all bytes before each place give the checksum of any stretch at once, so that no stretch is read
    twice; both run modulo 256, as the checksum itself.
    """
    raw = np.frombuffer(data, np.uint8)
    at = np.flatnonzero((raw[:-1] == _SYNC[0]) & (raw[1:] == _SYNC[1])) if len(raw) > 1 else np.empty(0, int)
    at = at[at + _HEADER + _CHECK <= len(raw)]
    length = raw[at + 4].astype(np.int64) + 256 * raw[at + 5].astype(np.int64)
    known = np.isin(raw[at + 2], CLASSES)
    whole = at + _HEADER + length + _CHECK <= len(raw)
    first = np.zeros(len(raw) + 1, np.uint8)
    np.cumsum(raw, dtype=np.uint8, out=first[1:])
    second = np.zeros(len(raw) + 1, np.uint8)
    np.cumsum(first[1:], dtype=np.uint8, out=second[1:])
    begin = at + 2
    end = np.where(whole, at + _HEADER + length, begin)
    sum_a = first[end] - first[begin]
    sum_b = second[end] - second[begin] - (end - begin).astype(np.uint8) * first[begin]
    last = np.minimum(end, max(len(raw) - 2, 0))
    good = known & whole & (raw[last] == sum_a) & (raw[last + 1] == sum_b) if len(at) else known
    start: list[int] = []
    stop: list[int] = []
    free = 0
    for i, j in zip(at[good].tolist(), (end[good] + _CHECK).tolist(), strict=True):
        if i >= free:
            start.append(i)
            stop.append(j)
            free = j
    starts, stops = np.array(start, np.int64), np.array(stop, np.int64)
    bad = at[known & ~good]
    place = np.searchsorted(starts, bad, side="right") - 1
    inside = (place >= 0) & (bad < stops[np.maximum(place, 0)]) if len(starts) else np.zeros(len(bad), bool)
    kind = raw[starts + 2].astype(np.int64) * 256 + raw[starts + 3] if len(starts) else starts
    return UbxFrames(starts, stops, kind, int((~inside).sum()))


def rows(data: bytes, found: UbxFrames, kind: tuple[int, int]) -> tuple[Rows, NDArray[np.int64]]:
    """Fields of all messages of a kind (structured, (N,)), and which of the file's they are, from 1."""
    layout = np.dtype(LAYOUTS[kind])
    size = found.stop - found.start - _HEADER - _CHECK
    which = np.flatnonzero((found.kind == 256 * kind[0] + kind[1]) & (size >= layout.itemsize))
    raw = np.frombuffer(data, np.uint8)
    bytes_ = raw[(found.start[which] + _HEADER)[:, None] + np.arange(layout.itemsize)]
    return np.ascontiguousarray(bytes_).view(layout).reshape(-1), which + 1


def between(data: bytes, found: UbxFrames) -> bytes:
    """What is not in any message, in order."""
    ends = np.r_[0, found.stop]
    begins = np.r_[found.start, len(data)]
    return b"".join(data[i:j] for i, j in zip(ends.tolist(), begins.tolist(), strict=True))
