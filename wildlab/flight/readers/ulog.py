"""What of a ULog of PX4 can be believed, before pyulog reads it.

pyulog stops at the first message whose size is a lie, and builds whatever a format claims. So the file is
walked first: each message is measured against its own definition, what does not hold is left out and counted,
and pyulog gets only the sound messages of the topics that are wanted.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from typing import NamedTuple

import numpy as np

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16
#: Bytes of the types of ULog's fields.
SIZES = {
    **{f"{kind}{bits}_t": bits // 8 for kind in ("int", "uint") for bits in (8, 16, 32, 64)},
    **{"float": 4, "double": 8, "bool": 1, "char": 1},
}
#: No message is longer, for its length has two bytes; no format nests deeper than this, none has more fields.
LONGEST, DEEPEST, MOST_FIELDS = 65535, 8, 2048
#: So many instances of a topic are passed on: a vehicle has at most so many sensors of a kind.
INSTANCES = 8
_FIELD = re.compile(r"([A-Za-z_]\w*)(?:\[(\d{1,5})\])? (\w+)", re.ASCII)
#: Kinds of messages, and the fewest bytes that each has.
_KINDS = dict(zip(b"BFIMPQADRSOLC", (40, 3, 3, 4, 3, 4, 4, 3, 2, 8, 2, 9, 11), strict=True))
_FORMAT, _INFO, _ADD, _DATA, _DROPOUT, _FLAGS, _SYNC = b"FIADOBS"
#: Kinds that hold a key with its value, or a text behind its level, and how many bytes stand before that.
_KEYED = {ord("I"): 0, ord("P"): 0, ord("M"): 1, ord("Q"): 1}
_TEXTS = {ord("L"): 9, ord("C"): 11}
SYNC = bytes.fromhex("2f731320250cbb12")
_KEY = re.compile(rb"(\w+)(?:\[(\d{1,5})\])? (\S+)")
_NAME = re.compile(rb"\w+")
_COLON = ord(":")
_READABLE = bytes([9, 10, 13, 27, *range(32, 127)])
_HEAD = struct.Struct("<HB")
#: Looked through at once where a message that holds is searched: little at first, for it is often near.
_FIRST_CHUNK, _CHUNK = 1 << 8, 1 << 16
#: A message of a kind that is not known is believed up to this size, as pyulog has it.
_UNKNOWN_LONGEST = 10_000


class Sound(NamedTuple):
    """What holds of a ULog.

    `data`: the same log, of sound messages alone. `skipped`: bytes between sound messages, in so many
    `places`. `rest`: bytes at the end that are no whole message. `homeless`: topic (or ``""``, not known) ->
    data messages whose definition is missing or cannot be true. `dropouts`, `dropout_s`: how often the
    logger fell behind, and how long. `flags`: incompatible ones that are not known, 0 where all are.
    """

    data: bytes
    skipped: int
    places: int
    rest: int
    homeless: dict[str, int]
    dropouts: int
    dropout_s: float
    flags: int


class _Walk:
    """A walk over a file; what was learnt on the way decides what holds next."""

    def __init__(self, data: bytes, topics: frozenset[str]) -> None:
        self.data, self.topics = data, topics
        self.formats: dict[str, list[tuple[str, int, str]]] = {}
        self.names: dict[int, str] = {}
        self.instances: Counter[str] = Counter()
        # Fewest and most bytes of a topic's data: fields that only fill up may be left away at the end.
        self.sizes: dict[int, tuple[int, int]] = {}
        # The same of topics without a definition, from the first message that seemed sound.
        self.learnt: dict[int, tuple[int, int]] = {}
        self.wanted: set[int] = set()
        self.kept: list[tuple[int, int]] = []
        self.homeless: Counter[str] = Counter()
        self.dropouts = self.dropout_ms = self.flags = 0
        self.appended: list[int] = []

    def header(self, pos: int, limit: int) -> tuple[int, int]:
        """End and kind of the message at a place, (0, 0) where none can be."""
        if pos + 3 > limit:
            return 0, 0
        size, kind = _HEAD.unpack_from(self.data, pos)
        end = pos + 3 + size
        least = _KINDS.get(kind)
        fits = size >= least if least is not None else kind > 0 and 0 < size <= _UNKNOWN_LONGEST
        return (end, kind) if fits and end <= limit else (0, 0)

    def holds(self, pos: int, limit: int) -> int:
        """End of the message at a place if it is sound, else 0."""
        end, kind = self.header(pos, limit)
        if not end:
            return 0
        sure = self.certain(kind, pos, end)
        # Where its content does not tell, what follows has to be sound beyond doubt.
        return end if (self.followed(end, limit) if sure is None else sure) else 0

    def followed(self, end: int, limit: int) -> bool:
        if end == limit:
            return True
        next_end, kind = self.header(end, limit)
        return bool(next_end and self.certain(kind, end, next_end))

    def certain(self, kind: int, pos: int, end: int) -> bool | None:
        """Whether the content of a message shows that it is one, by its kind; None where it shows nothing."""
        size = end - pos - 3
        if kind == _DATA:
            topic = self.data[pos + 3] | self.data[pos + 4] << 8
            bounds = self.sizes.get(topic) or self.learnt.get(topic)
            return None if bounds is None else bounds[0] <= size - 2 <= bounds[1]
        # What is long is looked at only where its beginning is right.
        start = pos + 3
        if kind == _FORMAT:
            begins = _NAME.match(self.data, start, start + 100)
            named = begins is not None and self.data[begins.end()] == _COLON
            return (named and self.format(start, end) is not None) or None
        if kind == _ADD:
            return (size <= 300 and _NAME.fullmatch(self.data, start + 3, end) is not None) or None
        if kind in _KEYED:
            return _informs(self.data[start + _KEYED[kind] : start + 300], size - _KEYED[kind]) or None
        if kind in _TEXTS:
            if self.data[start] not in b"01234567":
                return None
            text = self.data[start + _TEXTS[kind] : end]
            return len(text.translate(None, _READABLE)) <= len(text) / 4 or None
        if kind == _SYNC:
            return self.data[start:end] == SYNC
        return (size == 2) if kind in b"OR" else (pos == HEADER) if kind == _FLAGS else None

    def format(self, start: int, end: int) -> tuple[str, list[tuple[str, int, str]]] | None:
        """Name and fields (type, how many, name) of a definition, None where it cannot be read."""
        name, colon, fields = self.data[start:end].decode("latin-1").partition(":")
        read = []
        for one in filter(None, fields.split(";")):
            matched = _FIELD.fullmatch(one)
            if matched is None:
                return None
            read.append((matched[1], int(matched[2] or 0), matched[3]))
        return (name, read) if colon and read and re.fullmatch(r"\w+", name, re.ASCII) else None

    def measure(self, name: str) -> tuple[int, int] | None:
        """Fewest and most bytes of a topic; None where its definition cannot be true."""
        fields = self.formats.get(name, [])
        flat = self.flatten(name, 0)
        if flat is None or not 0 < flat[0] <= LONGEST or flat[1] > MOST_FIELDS:
            return None
        if ("uint64_t", 0, "timestamp") not in fields:
            return None
        most = least = flat[0]
        for kind, many, field in reversed(fields):
            if not field.startswith("_padding") or kind not in SIZES:
                break
            least -= SIZES[kind] * max(many, 1)
        return least, most

    def flatten(self, name: str, depth: int) -> tuple[int, int] | None:
        """Bytes and number of the fields of a definition with all that it holds."""
        if depth > DEEPEST or name not in self.formats:
            return None
        fields = self.formats[name]
        if len({field for _, _, field in fields}) < len(fields):
            return None
        size = count = 0
        for kind, many, _ in fields:
            inner = (SIZES[kind], 1) if kind in SIZES else self.flatten(kind, depth + 1)
            if inner is None:
                return None
            size, count = size + inner[0] * max(many, 1), count + inner[1] * max(many, 1)
            if size > LONGEST or count > MOST_FIELDS:
                return None
        return size, count

    def take(self, pos: int, end: int) -> None:
        """Learn from a sound message, and keep it where pyulog is to have it."""
        kind, body = self.data[pos + 2], self.data[pos + 3 : end]
        if kind == _DATA:
            topic = int.from_bytes(body[:2], "little")
            if topic not in self.sizes:
                self.learnt.setdefault(topic, (end - pos - 5, end - pos - 5))
                self.homeless[self.names.get(topic, "")] += 1
            elif topic in self.wanted:
                self.kept.append((pos, pos + 5 + self.sizes[topic][0]))
        elif kind == _FORMAT:
            read = self.format(pos + 3, end)
            if read is not None and read[0] not in self.formats:
                self.formats[read[0]] = read[1]
        elif kind == _ADD:
            topic, name = int.from_bytes(body[1:3], "little"), body[3:].decode("latin-1")
            if topic not in self.names:
                self.names[topic] = name
                bounds = self.measure(name)
                if bounds is not None:
                    self.sizes[topic] = bounds
                    self.instances[name] += 1
                    if name in self.topics and self.instances[name] <= INSTANCES:
                        self.wanted.add(topic)
                        self.kept.append((pos, end))
        elif kind == _INFO:
            if _informs(body, len(body)):
                self.kept.append((pos, end))
        elif kind == _DROPOUT:
            self.dropouts += 1
            self.dropout_ms += int.from_bytes(body[:2], "little")
        elif kind == _FLAGS and pos == HEADER:
            self.flags = int.from_bytes(body[8:16], "little") & ~1
            if body[8] & 1:
                offsets = struct.unpack_from("<3Q", body, 16)
                self.appended = sorted(one for one in offsets if end < one < len(self.data))

    def next_sound(self, pos: int, limit: int) -> int:
        """The next place with a message that shows that it is one; `limit` where none does."""
        chunk = _FIRST_CHUNK
        while pos + 3 <= limit:
            here = np.frombuffer(self.data, np.uint8, min(chunk + 2, limit - pos), pos).astype(np.int64)
            size, kind = here[:-2] | here[1:-1] << 8, here[2:]
            likely = np.isin(kind, list(_KINDS)) & (size > 1) & (size <= limit - pos)
            for at in (pos + np.flatnonzero(likely)).tolist():
                end, here_kind = self.header(at, limit)
                # Among many places some lead to a message by chance.
                if end and self.certain(here_kind, at, end) and (end == limit or self.holds(end, limit)):
                    return int(at)
            pos, chunk = pos + len(size), min(2 * chunk, _CHUNK)
        return limit


def sound_part(data: bytes, topics: frozenset[str]) -> Sound:
    """Walk a ULog.

    Parameters
    ----------
    data
        The whole file, which begins with `MAGIC`.
    topics
        Whose messages are wanted.

    Returns
    -------
    Sound
    """
    walk = _Walk(data, topics)
    skipped = places = 0
    pos = rest = min(HEADER, len(data))
    edges = [len(data)]
    while pos < len(data):
        limit = next(one for one in edges if one > pos)
        end = walk.holds(pos, limit)
        if end:
            walk.take(pos, end)
            if len(edges) == 1 and walk.appended:
                # What was added after a crash begins at these places, even within a message.
                edges = [*walk.appended, len(data)]
            pos = end
            continue
        found = walk.next_sound(pos + 1, limit)
        if found == len(data):
            rest = pos
            break
        skipped, places, pos = skipped + found - pos, places + 1, found
    else:
        rest = len(data)
    formats = b"".join(_written(name, fields) for name, fields in walk.formats.items())
    # What only fills up is left away: pyulog takes it for a mistake.
    kept = b"".join([_HEAD.pack(b - a - 3, data[a + 2]) + data[a + 3 : b] for a, b in walk.kept])
    return Sound(
        data[:HEADER] + formats + kept,
        skipped,
        places,
        len(data) - rest,
        dict(walk.homeless),
        walk.dropouts,
        walk.dropout_ms / 1e3,
        walk.flags,
    )


def _informs(body: bytes, size: int) -> bool:
    """Whether a key at the beginning of so many bytes says how long its value is, and it is so long."""
    matched = _KEY.fullmatch(body[1 : 1 + body[0]]) if body else None
    if matched is None or matched[1].decode() not in SIZES:
        return False
    many = 1 if matched[2] is None else int(matched[2])
    return size - 1 - body[0] == SIZES[matched[1].decode()] * many


def _written(name: str, fields: list[tuple[str, int, str]]) -> bytes:
    said = "".join(f"{kind}{f'[{many}]' if many else ''} {field};" for kind, many, field in fields)
    body = f"{name}:{said}".encode()
    return _HEAD.pack(len(body), _FORMAT) + body
