"""Frames of a MAVLink telemetry log: where they are, whose they are, and their fields as arrays.

Each frame stands behind its time of receipt, eight bytes, big end first, us since 1970. Which messages there
are, their fields and what goes into their checksums is pymavlink's knowledge (dialect ardupilotmega 2.0,
which holds the common messages); walking and decoding is done here, because decoding each message into an
object takes several times longer.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: 1990 and 2100, in us since 1970: no telemetry log is of another time.
EARLIEST_US, LATEST_US = 631_152_000_000_000, 4_102_444_800_000_000
VERSIONS = (0xFE, 0xFD)
_SIGNED, _SIGNATURE = 0x01, 13
#: A stamp begins with 0 for two thousand years yet, and the ninth byte begins a frame.
_BEGINNING = re.compile(rb"\x00(?=[\x00-\xff]{7}[\xfd\xfe])", re.DOTALL)

_TYPES = {
    **{f"{kind}{bits}_t": f"<{kind[0]}{bits // 8}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    **{"float": "<f4", "double": "<f8", "char": "S1"},
}


class MavlinkFrames(NamedTuple):
    """Sound frames of known messages in the order of the file, (N,) each; `data` is the whole file.

    `received_s`: s since 1970. `number`: which frame of the file it is, from 1. `at`, `size`: of the payload.
    `damaged`: frames with a wrong checksum. `unknown`: message -> frames of it. `skipped`: bytes between
    frames, in so many `places`. `rest`: bytes of a last frame that is cut.
    """

    data: bytes
    received_s: NDArray[np.float64]
    number: NDArray[np.int64]
    message: NDArray[np.int64]
    system: NDArray[np.int64]
    component: NDArray[np.int64]
    at: NDArray[np.int64]
    size: NDArray[np.int64]
    damaged: int
    unknown: dict[int, int]
    skipped: int
    places: int
    rest: int


def _dialect() -> Any:
    # Takes a tenth of a second, and only these logs need it.
    from pymavlink.dialects.v20 import ardupilotmega

    return ardupilotmega


def may_hold(head: bytes) -> bool:
    """Whether a frame may begin anywhere in bytes: quick, before `walk` looks."""
    return any(_plausible(head, one.start()) for one in _BEGINNING.finditer(head))


def _plausible(data: bytes, at: int) -> bool:
    return EARLIEST_US < int.from_bytes(data[at : at + 8], "big") < LATEST_US


def names(enumeration: str, value: int) -> str:
    """What MAVLink calls a value, in small letters: ``names("MAV_TYPE", 1)`` is ``"fixed wing"``."""
    entry = _dialect().enums.get(enumeration, {}).get(value)
    return "" if entry is None else entry.name.removeprefix(enumeration + "_").replace("_", " ").lower()


def walk(data: bytes) -> MavlinkFrames:
    """All frames of a telemetry log.

    Parameters
    ----------
    data
        The file, or its beginning.

    Returns
    -------
    Frames
        Without any where it is no such log.
    """
    dialect = _dialect()
    checksum = dialect.x25crc
    extra = {key: bytes([one.crc_extra]) for key, one in dialect.mavlink_map.items()}
    rows: list[tuple[int, int, int, int, int, int, int]] = []
    unknown: Counter[int] = Counter()
    damaged = skipped = places = number = pos = covered = 0
    length = len(data)
    while pos + 16 <= length:
        end, message, system, component, payload = _header(data, pos)
        whole = 0 < end <= length and _plausible(data, pos)
        known = message in extra
        sound = False
        if whole and known:
            tail = data[pos + 9] + payload
            found = checksum(data[pos + 9 : tail] + extra[message]).crc
            sound = found == data[tail] | data[tail + 1] << 8
        if not sound and not (whole and _begins(data, end)):
            next_ = _BEGINNING.search(data, pos + 1)
            if next_ is None:
                break
            pos = next_.start()
            continue
        number += 1
        if sound:
            stamp = int.from_bytes(data[pos : pos + 8], "big")
            rows.append((stamp, number, message, system, component, payload, data[pos + 9]))
        elif known:
            damaged += 1
        else:
            unknown[message] += 1
        if pos > covered:
            skipped, places = skipped + pos - covered, places + 1
        pos = covered = end
    received, *table = np.array(rows, dtype=np.int64).reshape(-1, 7).T
    numbers, kinds, systems, components, at, sizes = table
    lost = (damaged, dict(unknown), skipped, places, length - covered)
    return MavlinkFrames(data, received / 1e6, numbers, kinds, systems, components, at, sizes, *lost)


def _begins(data: bytes, at: int) -> bool:
    """Whether a frame seems to begin, or the file ends before that can be seen."""
    return len(data) - at <= 8 or (data[at] == 0 and data[at + 8] in VERSIONS)


def _header(data: bytes, pos: int) -> tuple[int, int, int, int, int]:
    """End of the frame (0: none is here), message, system, component, start of the payload."""
    size = data[pos + 9]
    if data[pos + 8] == VERSIONS[0]:
        return pos + 16 + size, data[pos + 13], data[pos + 11], data[pos + 12], pos + 14
    if data[pos + 8] == VERSIONS[1] and pos + 18 <= len(data) and not data[pos + 10] & ~_SIGNED:
        signature = _SIGNATURE if data[pos + 10] & _SIGNED else 0
        message = data[pos + 15] | data[pos + 16] << 8 | data[pos + 17] << 16
        return pos + 20 + size + signature, message, data[pos + 13], data[pos + 14], pos + 18
    return 0, -1, 0, 0, pos


@dataclass(frozen=True)
class Messages:
    """All messages of one kind that a component sent, or of several: fields (N,) by name, and whence."""

    fields: dict[str, NDArray[Any]]
    received_s: NDArray[np.float64]
    number: NDArray[np.int64]
    system: NDArray[np.int64]
    component: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.number)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A field (N,) as float64; NaN where the dialect has none of this name."""
        if name not in self.fields:
            return np.full(len(self), np.nan)
        with np.errstate(invalid="ignore"):
            return self.fields[name].astype(np.float64)

    def texts(self, name: str) -> list[str]:
        """A field of characters, as text without what follows its end."""
        table = self.fields.get(name)
        if table is None:
            return []
        return [row.tobytes().split(b"\0")[0].decode("latin-1").strip() for row in table]

    def only(self, chosen: NDArray[np.bool_]) -> Messages:
        """Those rows alone."""
        kept = {name: values[chosen] for name, values in self.fields.items()}
        received, number = self.received_s[chosen], self.number[chosen]
        return Messages(kept, received, number, self.system[chosen], self.component[chosen])


def messages(
    frames: MavlinkFrames, name: str, system: int | None = None, component: int | None = None
) -> Messages:
    """Messages of one kind.

    Parameters
    ----------
    frames
        Of `walk`.
    name
        As MAVLink calls it: ``"ATTITUDE"``.
    system, component
        From whom; None: from all.

    Returns
    -------
    Messages
        Fields that the sender left away (zeros at the end, extensions) are zero, as the format wants it.
    """
    kind = next((one for one in _dialect().mavlink_map.values() if one.msgname == name), None)
    chosen = frames.message == (-1 if kind is None else kind.id)
    if system is not None:
        chosen &= frames.system == system
    if component is not None:
        chosen &= frames.component == component
    rows = np.flatnonzero(chosen)
    fields: dict[str, NDArray[Any]] = {}
    if kind is not None:
        types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
        counts = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
        dtype = np.dtype([(one, _TYPES[types[one]], (n,) if n else ()) for one, n in counts])
        width, data = dtype.itemsize, frames.data
        spans = zip(frames.at[rows].tolist(), frames.size[rows].tolist(), strict=True)
        joined = b"".join([data[a : a + min(n, width)].ljust(width, b"\0") for a, n in spans])
        table = np.frombuffer(joined, dtype)
        fields = {one: table[one] for one in dtype.names or ()}
    whence = (frames.received_s[rows], frames.number[rows], frames.system[rows], frames.component[rows])
    return Messages(fields, *whence)
