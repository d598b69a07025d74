"""ArduPilot DataFlash logs, binary (``.bin``) and as text (``.log``), of all three generations of field
names: times, motion, sensors, images.

In the binary form a message is ``A3 95``, a byte for its kind, and a body; messages FMT (kind 128) say how
long each kind is and what stands in it. Boundaries are found by all heads in the file at once; only where a
head is not followed by the next one does anything go message by message. All of one kind are decoded at
once. In the text form a line is a message, its values already in their units.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import ClockFit, fit_steady, week_to_utc
from wildlab.flight.readers.log import (
    ANGLES,
    CUT_OFF,
    FIX_PLANE,
    FIX_SPACE,
    WORLD,
    Columns,
    Messages,
    RawLog,
    Stream,
    any_of,
    at_times,
    holding,
    in_order,
    level_velocity,
    named,
    placed,
    usable,
)
from wildlab.flight.readers.text import plural, told
from wildlab.flight.schema import BOUNDS, FIELD, FORCE, QUATERNION, RATE, VELOCITY
from wildlab.geometry.frames import Array, Indices, Mask

Bytes = NDArray[np.uint8]

HEAD = b"\xa3\x95"
#: Kind and length of messages that define the others.
FMT_KIND, FMT_BYTES = 128, 89
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
    """Messages of a binary log by name, bytes of no message, in how many stretches these lie, and whether the
    log ends within a message."""

    tables: dict[str, MessageTable]
    lost_bytes: int
    places: int
    cut: bool


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
    """All messages of a binary log; of several definitions of a kind the first holds."""
    raw = np.frombuffer(data, np.uint8)
    heads = np.flatnonzero((raw[:-2] == HEAD[0]) & (raw[1:-1] == HEAD[1])).astype(np.int64)
    known = {FMT_KIND: FMT}
    for head in heads[raw[heads + 2] == FMT_KIND].tolist():
        if found := definition(data[head + 3 : head + FMT_BYTES]):
            known.setdefault(found.kind, found)
    lengths = np.zeros(256, np.int64)
    lengths[list(known)] = [one.length for one in known.values()]
    heads = heads[lengths[raw[heads + 2]] > 0]
    heads = heads[_boundaries(heads, heads + lengths[raw[heads + 2]], len(raw))]
    kinds = raw[heads + 2]
    tables = {
        one.name: _table(raw, one, heads[rows], rows + 1)
        for kind, one in known.items()
        if len(rows := np.flatnonzero(kinds == kind))
    }
    return Records(tables, *_left_over(raw, heads, heads + lengths[kinds]))


def _boundaries(heads: Indices, ends: Indices, size: int) -> list[int]:
    """Those of the heads that begin a message; the others are bytes of a message that look like one.

    A head is sure where its message ends at another head, or the file does. Where it does not, and a sure one
    lies within its message, it was damaged, and costs itself.
    """
    follows = np.searchsorted(heads, ends)
    sure = (ends == size) | (heads[np.minimum(follows, len(heads) - 1)] == ends)
    begins: list[int] = []
    at = 0
    while at < len(heads):
        after = int(follows[at])
        if sure[at] or (ends[at] <= size and not sure[at + 1 : after].any()):
            begins.append(at)
        else:
            within = np.flatnonzero(sure[at + 1 : after])
            after = at + 1 + (int(within[0]) if len(within) else 0)
        at = after
    return begins


def _left_over(raw: Bytes, heads: Indices, ends: Indices) -> tuple[int, int, bool]:
    """Bytes between messages, in how many stretches they lie, and whether some are at the end, where filling
    is none."""
    starts, stops = np.concatenate([[0], ends]), np.concatenate([heads, [len(raw)]])
    gaps = stops - starts
    rest = raw[starts[-1] :]
    if len(rest) and rest[0] in (0, 255) and (rest == rest[0]).all():
        gaps[-1] = 0
    return int(gaps.sum()), int((gaps > 0).sum()), bool(gaps[-1] > 0)


def _table(raw: Bytes, one: Definition, heads: Indices, rows: Indices) -> MessageTable:
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


# -- as text


def text_sniff(head: bytes) -> bool:
    """Whether a line among the first bytes of a file defines a message."""
    return len(_line_definitions(head.decode("latin-1").split("\n"))) > 1


def read_lines(data: bytes) -> tuple[dict[str, MessageTable], list[tuple[int, str, str]], str]:
    """Messages of a log as text by name, their rows counted in lines; what was lost; and its title."""
    lines = data.decode("utf-8", errors="replace").split("\n")
    known = _line_definitions(lines)
    at: dict[str, list[int]] = {}
    for line, text in enumerate(lines):
        match = _LINE.match(text)
        if match is not None and match[1] in known:
            at.setdefault(match[1], []).append(line)
    made = {name: _line_table(lines, known[name], rows) for name, rows in at.items()}
    tables = {name: table for name, table in made.items() if len(table)}
    # Empty lines and the words before the first definition are no messages.
    first = min(map(min, at.values()), default=0)
    told = sum(1 for one in lines[first:] if one.strip())
    bad = told - sum(map(len, tables.values()))
    title = next((line for line in lines[:20] if "V" in line and "," not in line), "")
    return tables, [(bad, "line", f"of {len(lines)} that no FMT fits")], title


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
        words = [values[i].strip() for _, values in kept]
        if one.characters[i] in NO_NUMBER + "M":
            return np.array(words, dtype=object)
        return np.asarray(pd.to_numeric(pd.Series(words, dtype=object), errors="coerce"), np.float64)

    rows = np.array([line for line, _ in kept], np.int64)
    return MessageTable(one.name, Columns(one.fields, column), rows, _characters(one))


# -- what messages say

#: Fixes are written down by a loop that runs so often, s, at its slowest.
LOOP_S = 0.02
#: No fix is written down later than this, s.
LATEST_S = 5.0
#: So many messages on both sides of a step back make it one of the board, not of a damaged stamp.
_SURE_ROWS = 5
#: Messages that say something of the whole log.
_LASTING = frozenset({"FMT", "FMTU", "UNIT", "MULT", "PARM", "VER", "MSG"})
#: Spreads of this and more are what 16 bits hold, not what a receiver found; no undulation is so large.
WORST_SPREAD_M, WORST_UNDULATION_M = 655.0, 200.0
#: What an autopilot of this family calls itself, with its version.
_VEHICLE = re.compile(
    r"\b(?:Ardu\w+|APM:?\w+|AntennaTracker|Blimp|Rover|Sub)\s+V?\d[\w.()-]*(?: \([0-9a-f]+\))?"
)
#: Columns of a place -> fields of messages that have it.
PLACE = {
    "latitude_deg": "Lat",
    "longitude_deg": "Lng",
    "height_sea_m": "Alt",
    "height_home_m": "RelHomeAlt RelAlt",
}
_PLACE = tuple(PLACE)
#: The same of messages GPS, and of GPA beside them.
GNSS = {
    "latitude_deg": "Lat",
    "longitude_deg": "Lng",
    "height_sea_m": "Alt",
    "v_down_m_s": "VZ",
    "satellites": "NSats",
    "fix": "Status",
    "hdop": "HDop",
}
GPA = named(
    ("sd_horizontal_m", "sd_vertical_m", "sd_velocity_m_s", "undulation_m"), ("HAcc", "VAcc", "SAcc", "Und")
)


class ArdupilotLog(NamedTuple):
    """Messages of a log by name, and how its stamps become UTC.

    Attributes
    ----------
    tables
        By name.
    counted_in
        What their rows count.
    receiver
        Messages of the satellite receiver that is used; None where there are none.
    rows, stamps
        (N,) where stamped messages stand in the file, and their stamps in s: for those that carry none.
    clock
        None where nothing in the log is stamped; without a base where UTC is not known.
    """

    tables: dict[str, MessageTable]
    counted_in: str
    receiver: MessageTable | None
    rows: Indices
    stamps: Array
    fit: ClockFit | None

    def sensors(self, *names: str) -> list[MessageTable]:
        """One table per sensor, of messages by these names, in their order."""
        return [one for name in names if name in self.tables for one in self.tables[name].instances()]

    def first(self, names: Sequence[str], *fields: str) -> MessageTable | None:
        """Messages of the first sensor that has these fields."""
        return next((one for one in self.sensors(*names) if one.has(*fields)), None)

    def of(self, table: MessageTable) -> Array:
        """(N,) s since the board was switched on; by their place in the file for messages without stamps."""
        own = own_stamps(table)
        if own is not None:
            return own
        if not len(self.rows):
            return np.full(len(table), np.nan)
        return np.interp(table.rows, self.rows, self.stamps, left=np.nan, right=np.nan)

    def utc(self, stamps: Array) -> Array:
        """(N,) s since 1970 of stamps; NaN where UTC is not known."""
        return np.full(len(stamps), np.nan) if self.fit is None else self.fit.to_reference(stamps)

    def readings(
        self, table: MessageTable, columns: dict[str, Array], unusable: dict[str, Mask] | None = None
    ) -> Stream:
        """Columns of messages with their times; all rows count, with a place or without."""
        stamps = self.of(table)
        times = {"time_s": self.utc(stamps), "time_log_s": stamps}
        return Stream(times | columns, table.rows, self.counted_in, unusable or {}, anywhere=True)


def decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A DataFlash log, its rows counted in messages.

    Raises
    ------
    WildlabError
        Where no message of it can be read or tells of motion or images, or PX4 wrote it.
    """
    found = read_records(data)
    where = plural(found.places, "place")
    lost = [(found.lost_bytes, "byte", f"of {len(data)} in {where} belong to no message")]
    made = _decoded(path, found.tables, "message", lost, "")
    return replace(made, notes=[*made.notes, *holding({CUT_OFF: found.cut})])


def text_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """A DataFlash log as text, its rows counted in lines; errors as of `decode`."""
    tables, lost, title = read_lines(data)
    return _decoded(path, tables, "line", lost, title)


# Damaged values may be anything: they are marked, not warned of.
@np.errstate(all="ignore")
def _decoded(
    path: Path,
    tables: dict[str, MessageTable],
    counted_in: str,
    lost: Sequence[tuple[int, str, str]],
    title: str,
) -> RawLog:
    """A log of messages; `title` is what the file says of the vehicle outside of them."""
    if not set(tables) - {"FMT"}:
        problem = "holds no message of ArduPilot"
        raise WildlabError(problem, "copy it from the card again", file=path)
    if any(name in tables and tables[name].has(one) for name, one in (("ATT", "qw"), ("TIME", "StartTime"))):
        problem = "is a log of PX4's old format sdlog2"
        raise WildlabError(problem, "log with a newer PX4, as .ulg", file=path)
    tables, left_out = longest_run(tables)
    log, receivers = _clocked(tables, counted_in)
    gnss = None if log.receiver is None else _gnss(log, log.receiver)
    place = next((one for name in ("POS", "AHR2") if (one := _place_of(name, log))), None)
    if place is None and gnss is not None and log.receiver is not None:
        place = _place_of_gnss(gnss, log.receiver, log)
    found = {
        "gnss": gnss,
        "poses": _poses(log, place),
        "imu": _imu(log),
        **{name: _sensor(log, name) for name in SENSORS},
    }
    parts = {name: part for name, part in found.items() if part is not None and len(part.columns["time_s"])}
    if not parts:
        problem = "holds no attitude, position, sensors or images"
        raise WildlabError(problem, "log these messages (LOG_BITMASK of the autopilot)", file=path)
    said = [text for name, field in (("VER", "FWS"), ("MSG", "Message")) if name in tables
            for text in tables[name].texts(field)]  # fmt: skip
    vehicle = next((match.group() for text in (*said, title) if (match := _VEHICLE.search(text))), "")
    clock = "GPS weeks" if log.fit else ""
    return RawLog(parts, vehicle, clock, told(*lost, *left_out), _notes(log, parts, receivers, place))


# -- times


def own_stamps(table: MessageTable) -> Array | None:
    """(N,) s since the board was switched on, of messages that carry them; NaN: 0, which is none."""
    if table.has("SampleUS"):
        # When the sensor was read, not when that was written down.
        stamps = table.get("SampleUS") / 1e6
        if (stamps > 0).any():
            return np.where(stamps > 0, stamps, np.nan)
    if table.has("TimeUS"):
        return table.get("TimeUS") / 1e6
    # The first generation calls milliseconds of the week TimeMS, and its stamp T.
    name = "T" if _week_in_ms(table) else "TimeMS"
    return table.get(name) / 1e3 if table.has(name) else None


def gps_utc(table: MessageTable) -> Array:
    """(N,) s since 1970 by week and ms of the week of GPS or CAM messages; NaN where the week is 0."""
    week = table.get("GWk", "Week", "GPSWeek")
    ms = table.get("GMS", "TimeMS" if _week_in_ms(table) else "GMS", "GPSTime")
    known = (week > 0) & (ms >= 0) & (ms < 7 * 86400e3)
    return week_to_utc(np.where(known, week, np.nan), np.where(known, ms / 1e3, np.nan))


def _week_in_ms(table: MessageTable) -> bool:
    return table.has("TimeMS", "Week") and not table.has("GMS")


def _true_fix(table: MessageTable) -> Mask:
    """(N,) GPS messages with a fix in space, at a place, in a week."""
    fixed = table.get("Status") >= FIX_SPACE
    return np.asarray(fixed & placed(table.get("Lat"), table.get("Lng")) & np.isfinite(gps_utc(table)))


def _clocked(tables: dict[str, MessageTable], counted_in: str) -> tuple[ArdupilotLog, list[MessageTable]]:
    """A log with its clock by the true fixes of a receiver, and all receivers."""
    anchor = _stamped(tables)
    rows, stamps = np.empty(0, np.int64), np.empty(0)
    if anchor is not None:
        kept = in_order(anchor[1])
        rows, stamps = anchor[0].rows[kept], anchor[1][kept]
    log = ArdupilotLog(tables, counted_in, None, rows, stamps, None)
    receivers = [one for one in log.sensors("GPS", "GPS2", "GPS3") if one.has("Lat", "Lng")]
    if not receivers:
        return log, receivers
    receiver = next((one for one in receivers if _true_fix(one).any()), receivers[0])
    own, utc, fixed = log.of(receiver), gps_utc(receiver), _true_fix(receiver)
    pairs = in_order(own, fixed) & in_order(utc, fixed)
    fit = fit_steady(own[pairs], utc[pairs], resolution_s=LOOP_S) if pairs.any() else None
    return log._replace(receiver=receiver, fit=fit), receivers


def longest_run(
    tables: dict[str, MessageTable],
) -> tuple[dict[str, MessageTable], list[tuple[int, str, str]]]:
    """The messages of the longest time that the board was on, and what is lost of others.

    Stamps begin again where it was switched on again within a log. A few wrong stamps make no new time.
    """
    anchor = _stamped(tables)
    if anchor is None or len(anchor[1]) < 2 * _SURE_ROWS:
        return tables, []
    rows, stamps = anchor[0].rows, anchor[1]
    backwards = 1 + np.flatnonzero(np.diff(stamps) < -1.0)
    begins = [
        int(at)
        for at in backwards
        if np.median(stamps[at : at + _SURE_ROWS]) < np.median(stamps[max(at - _SURE_ROWS, 0) : at]) - 1.0
    ]
    if not begins:
        return tables, []
    # What stands before the first stamp of a time, as an origin or a version, belongs to it.
    edges = rows[np.array(begins) - 1] + 1
    every = np.concatenate([table.rows for table in tables.values()])
    counts = np.bincount(np.searchsorted(edges, every, side="right"), minlength=len(edges) + 1)
    best = int(np.argmax(counts))
    kept = {
        name: table
        if name in _LASTING
        else table.take(np.searchsorted(edges, table.rows, side="right") == best)
        for name, table in tables.items()
    }
    left_out = int(counts.sum() - counts[best])
    said = (
        f"of {counts.sum()}: the board was switched on again, and the longest of {len(counts)} runs is used"
    )
    return {name: table for name, table in kept.items() if len(table)}, [(left_out, "message", said)]


def _stamped(tables: dict[str, MessageTable]) -> tuple[MessageTable, Array] | None:
    """The most frequent messages with stamps, and these."""
    for table in sorted(tables.values(), key=len, reverse=True):
        if (own := own_stamps(table)) is not None:
            return table, own
    return None


# -- places


class PlaceTrack(NamedTuple):
    """Positions by one kind of message: stamps (N,) s, columns (N,), and rows that are true but for order."""

    name: str
    stamps: Array
    columns: dict[str, Array]

    def at(self, stamps: Array) -> dict[str, Array]:
        """Columns at other stamps (T,), s."""
        high = any_of([np.isfinite(self.columns[one]) for one in _PLACE[2:]], len(self.stamps))
        return at_times(self.stamps, self.columns, stamps, f"messages {self.name}", ~high)


def _gnss(log: ArdupilotLog, receiver: MessageTable) -> Stream:
    """Satellite positions of one receiver, with what messages GPA say of how sure it was."""
    stamps, columns = log.of(receiver), receiver.columns(GNSS)
    speed = receiver.get("Spd")
    # A fix may be written down late; its own time then says so. One far from the clock's is damaged.
    clock, own = log.utc(stamps), gps_utc(receiver)
    columns |= {
        "time_s": np.where(_true_fix(receiver) & (np.abs(own - clock) < LATEST_S), own, clock),
        "time_log_s": stamps,
        **level_velocity(speed, receiver.get("GCrs")),
        **_accuracies(receiver, log, stamps, columns["v_down_m_s"]),
    }
    unusable = {
        "no fix": ~(columns["fix"] >= FIX_PLANE),
        "a fix without height": ~(columns["fix"] >= FIX_SPACE),
        "no GPS week": np.isfinite(receiver.get("GWk", "Week")) & np.isnan(own),
        # Its parts to the north and east may each be possible.
        "impossible speed": speed > BOUNDS["speed"][1],
    }
    return Stream(columns, receiver.rows, log.counted_in, unusable)


def _accuracies(receiver: MessageTable, log: ArdupilotLog, stamps: Array, down: Array) -> dict[str, Array]:
    """Columns from the messages GPA of the same receiver, which have the stamps of its GPS messages."""
    instance = receiver.get("I")[:1]
    for table in log.sensors("GPA" + receiver.name[3:]):
        if np.isfinite(instance).any() and table.get("I")[0] != instance[0]:
            continue
        us = table.get("TimeUS") if table.has("TimeUS") else 1e3 * table.get("TimeMS")
        theirs = pd.DataFrame(table.columns(GPA | {"motion": "VV"}), np.round(us))
        found = theirs[theirs.index.notna() & ~theirs.index.duplicated()].reindex(np.round(stamps * 1e6))
        most = pd.Series(WORST_SPREAD_M, found.columns)
        most["undulation_m"] = WORST_UNDULATION_M
        made = found.where((found != 0) & (found.abs() < most)).drop(columns="motion")
        # ArduPilot has it the other way round: sea level minus ellipsoid.
        made["undulation_m"] = -made["undulation_m"]
        # A receiver that has no vertical velocity is logged with one of 0.
        moving = np.where(found["motion"] == 0, np.nan, down)
        return {name: made[name].to_numpy() for name in GPA} | {"v_down_m_s": moving}
    return {}


def _place_of(name: str, log: ArdupilotLog) -> PlaceTrack | None:
    """True positions by messages POS or AHR2; None where none is."""
    table = next(iter(log.sensors(name)), None)
    if table is None:
        return None
    columns = table.columns(PLACE)
    if table.has("RelOriginAlt"):
        # Before the filter has its origin, heights count from nothing.
        nowhere = np.isnan(table.get("RelOriginAlt"))
        columns |= {one: np.where(nowhere, np.nan, columns[one]) for one in _PLACE[2:]}
    place = PlaceTrack(name, log.of(table), columns)
    return place if np.isfinite(place.at(place.stamps)["latitude_deg"]).any() else None


def _place_of_gnss(gnss: Stream, receiver: MessageTable, log: ArdupilotLog) -> PlaceTrack | None:
    """Positions of the satellite receiver; heights above home where its messages have the autopilot's."""
    stamps = gnss.columns["time_log_s"]
    if log.fit is not None:
        stamps = (gnss.columns["time_s"] - log.fit.offset_s) / log.fit.rate
    used = usable("gnss", gnss) & np.isfinite(stamps)
    columns = {one: gnss.columns[one][used] for one in _PLACE[:3]}
    columns["height_home_m"] = receiver.get("RelAlt", "RAlt")[used]
    return PlaceTrack(receiver.name, stamps[used], columns) if used.any() else None


# -- motion

#: Parts -> messages that have them, best first; fields that they need; our columns of theirs; a factor.
SENSORS: dict[str, tuple[tuple[str, ...], str, dict[str, str], float]] = {
    # Milligauss.
    "magnetometer": (
        ("MAG", "MAG2", "MAG3"), "MagX MagY MagZ",
        named(FIELD, ("MagX", "MagY", "MagZ")), 0.1,
    ),
    # Against north and the horizon, and its yaw against the airframe.
    "gimbal": (
        ("MNT", "MNT1", "MOUNT"), "Roll Pitch",
        named((*WORLD, "pan_deg"), ("Roll", "Pitch", "YawE", "YawB")), 1.0,
    ),
    # The first generation has only GPS time, of the fix before: the messages around tell more closely.
    "triggers": (
        ("CAM", "TRIG"), "Lat Lng",
        {
            "latitude_deg": "Lat", "longitude_deg": "Lng", "number": "Img",
            **{name: f"{name[:-4].title()} {name[0].upper()}" for name in ANGLES},
            "height_sea_m": "Alt", "height_home_m": "RelAlt",
        }, 1.0,
    ),
}  # fmt: skip


def _sensor(log: ArdupilotLog, part: str) -> Stream | None:
    """A part of the first sensor of its kind, as `SENSORS` has it; None where the log has none."""
    names, needed, fields, factor = SENSORS[part]
    table = log.first(names, *needed.split())
    if table is None:
        return None
    there = {ours: theirs for ours, theirs in fields.items() if any(map(table.has, theirs.split()))}
    if part == "triggers" and not table.has("RelAlt"):
        # Without it, copters and planes meant different things by `Alt`.
        there.pop("height_sea_m", None)
    columns = {name: values * factor for name, values in table.columns(there).items()}
    return log.readings(table, columns)


def _poses(log: ArdupilotLog, place: PlaceTrack | None) -> Stream | None:
    """Attitudes with the positions at their times; None where the log has no attitude.

    Attitudes are those of messages ATT, else quaternions of XKQ or NKQ, else of AHR2.
    """
    euler = named(ANGLES, ("Roll", "Pitch", "Yaw"))
    q = named(QUATERNION, ("Q1", "Q2", "Q3", "Q4"))
    filters = ("XKQ", "XKQ1", "NKQ", "NKQ1", "XKQ2", "NKQ2")
    ways = ((("ATT",), euler), (filters, q), (("AHR2", "AHRS"), euler))
    found = ((table, one) for names, one in ways if (table := log.first(names, *one.values())) is not None)
    table, fields = next(found, (None, euler))
    if table is None:
        return None
    stamps = log.of(table)
    where = {one: np.full(len(table), np.nan) for one in _PLACE} if place is None else place.at(stamps)
    columns = table.columns(fields)
    moving = log.first(("XKF1", "NKF1", "EKF1"), "VN", "VE", "VD")
    if moving is not None:
        v = moving.columns({name: f"V{name[2].upper()}" for name in VELOCITY})
        columns |= at_times(log.of(moving), v, stamps, f"messages {moving.name}")
    high = any_of([np.isfinite(where[one]) for one in _PLACE[2:]], len(table))
    low = np.isfinite(where["latitude_deg"]) & ~high
    return replace(log.readings(table, columns | where, {"no height": low}), anywhere=False)


def _imu(log: ArdupilotLog) -> Stream | None:
    """Specific force and rates of turn of the first IMU; None where the log has none."""
    f, w = (named(names, (f"{start}{axis}" for axis in "XYZ"))
            for names, start in ((FORCE, "Acc"), (RATE, "Gyr")))  # fmt: skip
    both = log.first(("IMU", "IMU2", "IMU3"), "GyrX", "AccX")
    force = both or log.first(("ACC", "ACC1", "ACC2", "ACC3"))
    table = both or log.first(("GYR", "GYR1", "GYR2", "GYR3"))
    if table is None or force is None:
        return None
    forces = force.columns(f)
    if force is not table:
        forces = at_times(log.of(force), forces, log.of(table), f"messages {force.name}")
    return log.readings(table, forces | table.columns(w))


def _notes(
    log: ArdupilotLog, parts: dict[str, Stream], receivers: list[MessageTable], place: PlaceTrack | None
) -> list[str]:
    stamped = len(log.rows)
    receiver = next((i for i, one in enumerate(receivers, 1) if one is log.receiver), 0)
    unstamped = [
        one
        for one in ("GPS", "ATT", "IMU", "CAM", "TRIG")
        if stamped and one in log.tables and own_stamps(log.tables[one]) is None
    ]
    notes = {
        f"messages {', '.join(unstamped)} have no stamps: times are those around them": unstamped,
        "its messages have no stamps": not stamped,
        "no satellite fix tells UTC": stamped and log.fit is None,
        f"positions of poses are those of messages {place and place.name}": "poses" in parts and place,
        f"of {len(receivers)} satellite receivers number {receiver} is used": len(receivers) > 1,
        "heights of CAM are left out: nothing says what they count from": (
            "triggers" in parts and "height_sea_m" not in parts["triggers"].columns
        ),
    }
    return holding(notes)
