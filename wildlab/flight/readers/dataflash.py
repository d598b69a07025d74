"""ArduPilot DataFlash logs, binary (``.bin``) and as text (``.log``), of all three generations of field
names.

In the binary form a message is ``A3 95``, a byte for its kind, and a body; messages FMT (kind 128) say how
long each kind is and what stands in it. Boundaries are found by all heads in the file at once; only where a
head is not followed by the next one does anything go message by message. All of one kind are decoded at
once. In the text form a line is a message, its values already in their units.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wildlab.flight.readers.autopilot import Columns, Messages
from wildlab.flight.readers.log import Array, Mask
from wildlab.flight.readers.text import percent

Bytes = NDArray[np.uint8]
Index = NDArray[np.int64]

HEAD = b"\xa3\x95"
#: Kind and length of messages that define the others.
FMT_KIND, FMT_BYTES = 128, 89
#: Definitions of one name that are believed: a log that changes them more often is damaged.
MOST_LAYOUTS = 8
#: numpy's type of each format character.
TYPES: dict[str, str | tuple[str, int]] = {
    "a": ("<i2", 32),
    "b": "i1",
    "B": "u1",
    "g": "<f2",
    "h": "<i2",
    "H": "<u2",
    "i": "<i4",
    "I": "<u4",
    "f": "<f4",
    "d": "<f8",
    "n": "S4",
    "N": "S16",
    "Z": "S64",
    "c": "<i2",
    "C": "<u2",
    "e": "<i4",
    "E": "<u4",
    "L": "<i4",
    "M": "i1",
    "q": "<i8",
    "Q": "<u8",
}
#: What a raw value is divided by, by its format character; others stand as they are.
DIVISORS = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}
#: Format characters of text, and of what is no number.
TEXTS, NO_NUMBER = "nNZ", "nNZa"
_SIZES = {character: np.dtype(kind).itemsize for character, kind in TYPES.items()}
_NAME = re.compile(rb"[A-Za-z0-9_]{1,4}\0*")
_FMT_LINE = re.compile(rb"^\s*FMT\s*,\s*\d+\s*,\s*\d+\s*,\s*\w+\s*,\s*\w*\s*,", re.MULTILINE)
_LINE = re.compile(r"\s*([A-Z][A-Z0-9_]{0,3})\s*,")


class Definition(NamedTuple):
    """What a message FMT says: the number of a kind, its bytes with the head, name, characters and fields."""

    kind: int
    length: int
    name: str
    characters: str
    fields: tuple[str, ...]


FMT = Definition(FMT_KIND, FMT_BYTES, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


@dataclass(frozen=True, eq=False)
class MessageTable(Messages):
    """All messages of one name, values divided as their format characters say.

    Attributes
    ----------
    characters
        Format character of each field.
    """

    characters: Mapping[str, str] = field(default_factory=dict)

    def get(self, *names: str) -> Array:
        """As `Messages.get`; fields of text are none."""
        return super().get(*(one for one in names if self.characters.get(one, "a") not in NO_NUMBER))

    def instances(self) -> list[MessageTable]:
        """One table per sensor, in their order; itself where messages do not say which."""
        for name in ("I", "C", "Instance"):
            if name in self.fields and len(self):
                which = self.get(name)
                return [self.take(which == one) for one in np.unique(which)]
        return [self] if len(self) else []


class Records(NamedTuple):
    """Messages of a binary log by name, bytes of no message, and in how many stretches these
    lie."""

    tables: dict[str, MessageTable]
    lost_bytes: int
    places: int


def sniff(head: bytes) -> bool:
    """Whether a file has a message among its first bytes that defines another."""
    mark = HEAD + bytes([FMT_KIND])
    places = (one.end() for one in re.finditer(re.escape(mark), head))
    return any(definition(head[at : at + FMT_BYTES - 3]) is not None for at in places)


def definition(body: bytes) -> Definition | None:
    """What the 86 bytes behind the head of a message FMT say; None where they cannot be true."""
    if len(body) < FMT_BYTES - 3 or _NAME.fullmatch(body[2:6]) is None:
        return None
    kind, length = body[0], body[1]
    characters = body[6:22].split(b"\0")[0].decode("latin-1")
    sizes = [_SIZES.get(one, -1) for one in characters]
    if min(sizes, default=0) < 0 or sum(sizes) + 3 != length:
        return None
    text = body[22:].split(b"\0")[0].decode("latin-1")
    fields = tuple(one.strip() for one in text.split(","))[: len(characters)]
    return Definition(kind, length, body[2:6].rstrip(b"\0").decode(), characters, fields)


def read_records(data: bytes) -> Records:
    """All messages of a binary log."""
    raw = np.frombuffer(data, np.uint8)
    heads = np.flatnonzero((raw[:-2] == HEAD[0]) & (raw[1:-1] == HEAD[1])).astype(np.int64)
    known, which = _definitions(data, raw, heads)
    heads, which = heads[which >= 0], which[which >= 0]
    ends = heads + np.array([one.length for one in known], np.int64)[which]
    begins = _boundaries(heads, ends, len(raw))
    heads, which, ends = heads[begins], which[begins], ends[begins]
    lost, places = _left_over(raw, heads, ends)
    return Records(_tables(raw, known, heads, which), lost, places)


def _definitions(data: bytes, raw: Bytes, heads: Index) -> tuple[list[Definition], Index]:
    """Definitions, and which holds for each head (-1: none): the last before it, or else the first."""
    known: list[Definition] = [FMT]
    since: dict[int, list[tuple[int, int]]] = {FMT_KIND: [(0, 0)]}
    numbered: dict[Definition, int] = {FMT: 0}
    seen: dict[bytes, Definition | None] = {}
    of_name: Counter[str] = Counter()
    for head in heads[raw[heads + 2] == FMT_KIND].tolist():
        body = data[head + 3 : head + FMT_BYTES]
        if body not in seen:
            seen[body] = definition(body)
        found = seen[body]
        if found is None or found.kind == FMT_KIND:
            continue
        if found not in numbered:
            of_name[found.name] += 1
            believed = of_name[found.name] <= MOST_LAYOUTS
            numbered[found] = len(known) if believed else -1
            known += [found] if believed else []
        of_kind = since.setdefault(found.kind, [])
        if not of_kind or of_kind[-1][1] != numbered[found]:
            of_kind.append((head, numbered[found]))
    kinds = raw[heads + 2]
    which = np.full(len(heads), -1, np.int64)
    for kind, versions in since.items():
        rows = np.flatnonzero(kinds == kind)
        begun = np.searchsorted([at for at, _ in versions], heads[rows], side="right") - 1
        which[rows] = np.array([version for _, version in versions])[np.maximum(begun, 0)]
    return known, which


def _boundaries(heads: Index, ends: Index, size: int) -> Mask:
    """(N,) heads that begin a message; the others are bytes of a message that look like one.

    A head is sure where another head, or the end of the file, follows its message. One that is not is
    believed unless a sure one lies within its message: then its length is wrong.
    """
    count = len(heads)
    begins = np.zeros(count, bool)
    if not count:
        return begins
    # Where the message of each head ends: the head there, or the first one after.
    follows = np.arange(1, count + 1)
    sure = np.zeros(count, bool)
    sure[:-1] = ends[:-1] == heads[1:]
    odd = np.flatnonzero(~sure)
    follows[odd] = np.searchsorted(heads, ends[odd])
    next_heads = heads[np.minimum(follows[odd], count - 1)]
    sure[odd] = (ends[odd] == size) | ((follows[odd] < count) & (next_heads == ends[odd]))
    at = 0
    breaks = iter(odd.tolist())
    stop = next(breaks)
    while at < count:
        while stop < at:
            stop = next(breaks, count)
        # The last head is always a break: nothing follows it.
        begins[at : stop + 1] = True
        after = int(follows[stop])
        if not sure[stop]:
            within = np.flatnonzero(sure[stop + 1 : after])
            if ends[stop] > size or len(within):
                begins[stop] = False
                after = stop + 1 + (int(within[0]) if len(within) else 0)
        at = after
    return begins


def _left_over(raw: Bytes, heads: Index, ends: Index) -> tuple[int, int]:
    """Bytes between messages, and in how many stretches they lie; filling at the end is none."""
    starts, stops = np.concatenate([[0], ends]), np.concatenate([heads, [len(raw)]])
    gaps = stops - starts
    rest = raw[starts[-1] :]
    if len(rest) and rest[0] in (0, 255) and (rest == rest[0]).all():
        gaps[-1] = 0
    return int(gaps.sum()), int((gaps > 0).sum())


def _tables(raw: Bytes, known: list[Definition], heads: Index, which: Index) -> dict[str, MessageTable]:
    by_kind = np.argsort(which, kind="stable")
    cuts = np.searchsorted(which[by_kind], np.arange(len(known) + 1))
    parts: dict[str, list[MessageTable]] = {}
    for version, one in enumerate(known):
        rows = by_kind[cuts[version] : cuts[version + 1]]
        if len(rows):
            parts.setdefault(one.name, []).append(_table(raw, one, heads[rows], rows + 1))
    return {name: merge(tables) for name, tables in parts.items()}


def _table(raw: Bytes, one: Definition, heads: Index, rows: Index) -> MessageTable:
    layout: list[Any] = [("head", "V3")]
    layout += [(str(i), TYPES[character]) for i, character in enumerate(one.characters)]
    made: list[NDArray[Any]] = []

    def column(name: str) -> Any:
        if not made:
            made.append(sliding_window_view(raw, one.length)[heads].view(np.dtype(layout))[:, 0])
        at = one.fields.index(name)
        raw_values = made[0][str(at)]
        return raw_values / DIVISORS[one.characters[at]] if one.characters[at] in DIVISORS else raw_values

    return MessageTable(one.name, Columns(one.fields, column), rows, _characters(one))


def _characters(one: Definition) -> dict[str, str]:
    """Format characters by field; of a name that stands there twice the first counts."""
    return dict(zip(reversed(one.fields), reversed(one.characters[: len(one.fields)]), strict=True))


def merge(tables: Sequence[MessageTable]) -> MessageTable:
    """Messages of one name whose columns differ, as one table: NaN or "" where one has no such field."""
    if len(tables) == 1:
        return tables[0]
    characters = {name: kind for table in reversed(tables) for name, kind in table.characters.items()}
    names = dict.fromkeys(name for table in tables for name in table.fields)
    rows = np.concatenate([table.rows for table in tables])
    order = np.argsort(rows, kind="stable")

    def column(name: str) -> Any:
        if characters[name] in NO_NUMBER:
            parts = [np.array(table.texts(name) or [""] * len(table), object) for table in tables]
        else:
            parts = [table.get(name) for table in tables]
        return np.concatenate(parts)[order]

    return MessageTable(tables[0].name, Columns(names, column), rows[order], characters)


# -- as text


def text_sniff(head: bytes) -> bool:
    """Whether a line among the first bytes of a file defines a message."""
    return _FMT_LINE.search(head) is not None


def read_lines(data: bytes) -> tuple[dict[str, MessageTable], list[tuple[int, str, str]], str]:
    """Messages of a log as text by name, their rows counted in lines; what was lost; and its title."""
    lines = data.decode("utf-8", errors="replace").split("\n")
    lines = lines if lines[-1].strip() else lines[:-1]
    known = _line_definitions(lines)
    at: dict[str, list[int]] = {}
    undefined: Counter[str] = Counter()
    strange = 0
    for line, text in enumerate(lines):
        match = _LINE.match(text)
        if match is None:
            # Empty lines and the words before the first definition are no messages.
            strange += bool(text.strip()) and bool(at)
        elif match[1] in known:
            at.setdefault(match[1], []).append(line)
        else:
            undefined[match[1]] += 1
    made = {name: _line_table(lines, known[name], rows) for name, rows in at.items()}
    tables = {name: table for name, table in made.items() if len(table)}
    names = ", ".join([*list(undefined)[:3], *(["..."] if len(undefined) > 3 else [])])
    short = sum(map(len, at.values())) - sum(map(len, tables.values()))
    lost = [
        (count, "line", f"of {len(lines)} ({percent(count, len(lines))}) {what}")
        for count, what in (
            (undefined.total(), f"without a line FMT that says what they hold: {names}"),
            (short, "with more or fewer values than their FMT says"),
            (strange, "that are no messages"),
        )
    ]
    title = next((line for line in lines[:20] if "V" in line and "," not in line), "")
    return tables, lost, title


def _line_definitions(lines: list[str]) -> dict[str, Definition]:
    """What its lines FMT say, by the name of the message; the first that can be true."""
    known: dict[str, Definition] = {}
    for line in lines:
        if not line.lstrip().startswith("FMT"):
            continue
        values = [one.strip() for one in line.split(",")]
        if len(values) < 5 or not values[1].isdecimal() or len(values[1]) > 3:
            continue
        fields = tuple(one for one in values[5:] if one)
        if len(values[4]) == len(fields):
            known.setdefault(values[3], Definition(int(values[1]), 0, values[3], values[4], fields))
    return known | {"FMT": FMT}


def _line_table(lines: list[str], one: Definition, at: list[int]) -> MessageTable:
    """The messages of one name from those of their lines that have as many values as there are fields."""
    count = len(one.fields)
    # Commas in a text at the end are its own.
    most = count if one.characters[-1:] and one.characters[-1] in TEXTS else -1
    split = [(line + 1, lines[line].split(",", most)[1:]) for line in at]
    kept = [(line, values) for line, values in split if len(values) == count]

    def column(name: str) -> Any:
        i = one.fields.index(name)
        words = [values[i] for _, values in kept]
        if one.characters[i] in NO_NUMBER + "M":
            return np.array([word.strip() for word in words], dtype=object)
        try:
            return np.array(words, dtype=np.float64)
        except ValueError:
            return np.array([_float(word) for word in words], dtype=np.float64)

    rows = np.array([line for line, _ in kept], np.int64)
    return MessageTable(one.name, Columns(one.fields, column), rows, _characters(one))


def _float(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan
