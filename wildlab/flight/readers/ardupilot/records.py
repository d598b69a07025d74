"""Binary DataFlash: where its messages begin, what they are, and all of one kind decoded at once.

A message is ``A3 95``, a byte for its kind, and a body; messages FMT (kind 128) say how long each kind is and
what stands in it. Boundaries are found by all heads in the file at once; only where a head is not followed
by the next one does anything go message by message.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wildlab.flight.readers.ardupilot.messages import DIVISORS, TEXT_CHARACTERS, Table, merge, with_units

Bytes = NDArray[np.uint8]
Index = NDArray[np.int64]

HEAD = b"\xa3\x95"
#: Kind and length of messages that define the others.
FMT_KIND, FMT_BYTES = 128, 89
#: Definitions of one name that are believed: a log that changes them more often is damaged.
MOST_LAYOUTS = 8
#: numpy's type of each format character.
TYPES: dict[str, str | tuple[str, int]] = {
    **{"a": ("<i2", 32), "b": "i1", "B": "u1", "g": "<f2", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"},
    **{"f": "<f4", "d": "<f8", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4"},
    **{"E": "<u4", "L": "<i4", "M": "i1", "q": "<i8", "Q": "<u8"},
}
_SIZES = {character: np.dtype(kind).itemsize for character, kind in TYPES.items()}
_NAME = re.compile(rb"[A-Za-z0-9_]{1,4}\0*")


class Definition(NamedTuple):
    """What a message FMT says: the number of a kind, its bytes with the head, name, characters and fields."""

    kind: int
    length: int
    name: str
    characters: str
    fields: tuple[str, ...]


class Records(NamedTuple):
    """Messages of a binary log.

    Attributes
    ----------
    tables
        By name.
    messages
        How many were found.
    lost_bytes, places
        Bytes that belong to no message, and in how many stretches they lie. Filling at the end is none.
    """

    tables: dict[str, Table]
    messages: int
    lost_bytes: int
    places: int


def definition(body: bytes) -> Definition | None:
    """What the 86 bytes behind the head of a message FMT say; None where they cannot be true."""
    kind, length = body[0], body[1]
    if _NAME.fullmatch(body[2:6]) is None:
        return None
    characters = body[6:22].split(b"\0")[0].decode("latin-1")
    sizes = [_SIZES.get(one, -1) for one in characters]
    if min(sizes, default=0) < 0 or sum(sizes) + 3 != length:
        return None
    text = body[22:].split(b"\0")[0].decode("latin-1")
    fields = tuple(one.strip() for one in text.split(","))[: len(characters)]
    return Definition(kind, length, body[2:6].rstrip(b"\0").decode(), characters, fields)


def read_records(data: bytes) -> Records:
    """All messages of a binary log.

    Parameters
    ----------
    data
        The whole file.

    Returns
    -------
    Records
    """
    raw = np.frombuffer(data, np.uint8)
    heads = np.flatnonzero((raw[:-2] == HEAD[0]) & (raw[1:-1] == HEAD[1])).astype(np.int64)
    known, which = _definitions(data, raw, heads)
    heads, which = heads[which >= 0], which[which >= 0]
    lengths = np.array([one.length for one in known], np.int64)[which]
    begins = _boundaries(heads, heads + lengths, len(raw))
    heads, which, ends = heads[begins], which[begins], (heads + lengths)[begins]
    lost, places = _left_over(raw, heads, ends)
    return Records(_tables(raw, known, heads, which), len(heads), lost, places)


def _definitions(data: bytes, raw: Bytes, heads: Index) -> tuple[list[Definition], Index]:
    """Definitions, and which holds for each head (-1: none): the last before it, or else the first."""
    own = Definition(FMT_KIND, FMT_BYTES, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
    known: list[Definition] = [own]
    since: dict[int, list[tuple[int, int]]] = {FMT_KIND: [(0, 0)]}
    numbered: dict[Definition, int] = {own: 0}
    seen: dict[bytes, Definition | None] = {}
    of_name: dict[str, int] = {}
    for head in heads[raw[heads + 2] == FMT_KIND].tolist():
        body = data[head + 3 : head + FMT_BYTES]
        if len(body) < FMT_BYTES - 3:
            break
        if body not in seen:
            seen[body] = definition(body)
        found = seen[body]
        if found is None or found.kind == FMT_KIND:
            continue
        if found not in numbered:
            of_name[found.name] = of_name.get(found.name, 0) + 1
            believed = of_name[found.name] <= MOST_LAYOUTS
            numbered[found] = len(known) if believed else -1
            known += [found] if believed else []
        of_kind = since.setdefault(found.kind, [])
        if not of_kind or of_kind[-1][1] != numbered[found]:
            of_kind.append((head, numbered[found]))
    simple = np.full(256, -1, np.int64)
    for kind, versions in since.items():
        simple[kind] = versions[0][1]
    kinds = raw[heads + 2]
    which = simple[kinds]
    for kind, versions in since.items():
        if len(versions) > 1:
            rows = np.flatnonzero(kinds == kind)
            begun = np.searchsorted([at for at, _ in versions], heads[rows], side="right") - 1
            which[rows] = np.array([number for _, number in versions])[np.maximum(begun, 0)]
    return known, which


def _boundaries(heads: Index, ends: Index, size: int) -> NDArray[np.bool_]:
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
    regular = np.zeros(count, bool)
    regular[:-1] = ends[:-1] == heads[1:]
    odd = np.flatnonzero(~regular)
    follows[odd] = np.searchsorted(heads, ends[odd])
    sure = regular.copy()
    sure[odd] = (ends[odd] == size) | (
        (follows[odd] < count) & (heads[np.minimum(follows[odd], count - 1)] == ends[odd])
    )
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


def _tables(raw: Bytes, known: list[Definition], heads: Index, which: Index) -> dict[str, Table]:
    by_kind = np.argsort(which, kind="stable")
    cuts = np.searchsorted(which[by_kind], np.arange(len(known) + 1))
    parts: dict[str, list[Table]] = {}
    kinds: dict[str, int] = {}
    for number, one in enumerate(known):
        rows = by_kind[cuts[number] : cuts[number + 1]]
        if len(rows):
            parts.setdefault(one.name, []).append(_table(raw, one, heads[rows], rows + 1))
            kinds[one.name] = one.kind
    return with_units({name: merge(tables) for name, tables in parts.items()}, kinds)


def _table(raw: Bytes, one: Definition, heads: Index, rows: Index) -> Table:
    made: list[NDArray[Any]] = []
    layout: list[Any] = [("head", "V3")]
    layout += [(str(i), TYPES[character]) for i, character in enumerate(one.characters)]

    def column(at: int) -> NDArray[Any]:
        if not made:
            made.append(sliding_window_view(raw, one.length)[heads].view(np.dtype(layout))[:, 0])
        values = made[0][str(at)]
        character = one.characters[at]
        if character in TEXT_CHARACTERS:
            return np.array([_text(text) for text in values.tolist()], dtype=object)
        return values / DIVISORS[character] if character in DIVISORS else values

    return Table(one.name, one.fields, one.characters, rows, column)


def _text(raw: bytes) -> str:
    ended = raw.split(b"\0")[0]
    try:
        return ended.decode("utf-8")
    except UnicodeDecodeError:
        return ended.decode("latin-1")
