"""What satellite receivers write, NMEA 0183 and u-blox UBX: `gnss`, and `poses` where one knows its attitude.

Sentences of NMEA are found wherever they stand in a line, so that stamps of a logger before them do no harm.
They are joined into epochs by the time that they carry; days come from RMC and ZDA, and are carried to the
sentences that have none, over midnight too. Heights are above sea level, with the undulation that the
receiver knows. Facts of the sentences: NMEA 0183, as `pynmea2` has it.

Of UBX, NAV-PVT says all of a position; older receivers say it in NAV-POSLLH, NAV-VELNED and NAV-TIMEGPS or
NAV-SOL of one time of week. NAV-HPPOSLLH adds digits. Receivers with dead reckoning say HNR-PVT and HNR-ATT
often. UTC is the receiver's own; where it has none it comes from weeks and the table of leap seconds.
Messages of a kind are taken all at once, some 50 times as fast as `pyubx2` makes an object of each. Facts of
the protocol: u-blox interface descriptions of series 6 to 9, as `pyubx2` has them.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import fit_clock
from wildlab.flight.readers.log import VELOCITY, Array, Clock, Decoded, Mask, Readings, any_of
from wildlab.flight.readers.text import calendar_s, number, plural
from wildlab.flight.time_scales import WEEK_S, week_to_utc
from wildlab.geometry.attitude_uncertainty import tilt_from_roll_pitch

# -- NMEA 0183


#: Talker, kind, fields, checksum.
_SENTENCE = re.compile(rb"\$([A-Z][A-Z0-9])([A-Z]{3})(,[^$!*\r\n]{0,400})(?:\*([0-9A-Fa-f]{2}))?")
#: Sentences with a position, best first (GGA and GNS have the height), and where the latitude begins.
POSITIONS = {"GGA": 2, "GNS": 2, "RMC": 3, "GLL": 1}
#: Where the time stands.
_TIME_AT = {"GGA": 1, "GNS": 1, "RMC": 1, "GLL": 5, "ZDA": 1, "GST": 1}
#: What is made use of; the rest is counted.
_USED = frozenset({*_TIME_AT, "VTG"})
#: Talkers that are satellite receivers, not plotters that repeat one.
_RECEIVERS = frozenset({"GP", "GN", "GL", "GA", "GB", "BD", "GQ", "QZ", "GI", "IR"})
#: Quality of GGA, and the letters of GNS, RMC and GLL, as kinds of fix: 3 in space, 4 differential, 5 float,
#: 6 fixed; 0 none. Estimated, typed in and simulated are none.
_QUALITY = {"1": 3.0, "2": 4.0, "3": 3.0, "4": 6.0, "5": 5.0, "9": 4.0}
_MODE = {"A": 3.0, "D": 4.0, "P": 3.0, "F": 5.0, "R": 6.0}
_KNOT_M_S = 1852.0 / 3600.0
_DAY_S = 86400.0


class Sentence(NamedTuple):
    """A sentence of use, and the line that it stands in; fields as the standard counts them, from 1."""

    talker: str
    kind: str
    fields: list[str]
    line: int

    def field(self, at: int) -> str:
        """One field, empty where it is not there."""
        return self.fields[at].strip() if at < len(self.fields) else ""

    def value(self, at: int) -> float:
        """One field as a number, NaN where it is none."""
        return number(self.field(at))


class Sentences(NamedTuple):
    """Sentences of use whose checksum holds, how many others had none or a wrong one, and how many more are
    of other kinds."""

    found: list[Sentence]
    bad: int
    unread: int


def nmea_sniff(head: bytes) -> bool:
    """Whether a file begins with sentences."""
    found = sentences(head)
    return bool(found.found) or found.unread >= 3


def nmea_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """A log of sentences; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where no sentence has a position.
    """
    found = sentences(data)
    made = track(found)
    if made is None:
        seen = len(found.found) + found.unread
        problem = f"{plural(seen, 'sentence')} of NMEA 0183, and none with a position"
        raise WildlabError(problem, "log RMC, GGA, GNS or GLL of the receiver", file=path)
    return made


def track(given: Sentences) -> Decoded | None:
    """What sentences say, None where none of them has a position."""
    found, notes = _one_receiver(given.found)
    time, log = _times(given.found)
    epochs = _epochs(found, log)
    if not epochs:
        return None
    places = [next(epoch[name] for name in POSITIONS if name in epoch) for epoch in epochs]
    columns, no_fix, estimated = _columns([{k: given.found[i] for k, i in one.items()} for one in epochs])
    columns |= {"time_s": time[places], "time_log_s": log[places]}
    timed = int(np.isfinite(columns["time_s"]).sum())
    if not timed:
        notes.append("no sentence carries a date (RMC, ZDA): times are of a day that is not known")
    unusable = {"no fix": no_fix, "estimated, not measured": estimated}
    return Decoded(
        {"gnss": Readings(columns, [given.found[i].line for i in places], "line", unusable)},
        clock=Clock("UTC of the log", pairs=timed) if timed else None,
        lost=[(given.bad, "sentence", "with a wrong or missing checksum")],
        notes=notes,
    )


def sentences(data: bytes) -> Sentences:
    """Every sentence of a file whose checksum holds; all, where none of them has a checksum."""
    raw = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(raw == ord("\n"))
    matches = list(_SENTENCE.finditer(data))
    lines = np.searchsorted(ends, np.array([one.start() for one in matches], np.int64)) + 1
    # What stands in a comment is none.
    begins = np.r_[0, ends + 1][lines - 1].tolist()
    told = [
        (one, line)
        for one, line, begin in zip(matches, lines.tolist(), begins, strict=True)
        if data[begin] != ord("#")
    ]
    checked = any(one[4] for one, _ in told)
    spans = np.array([(one.start() + 1, one.end(3)) for one, _ in told], np.int64)
    # One more byte, so that a stop at the end of the file is an index, too.
    whole = np.frombuffer(data + b"\x00", np.uint8)
    sums = np.bitwise_xor.reduceat(whole, spans.ravel())[::2].tolist() if len(told) else []
    good = [
        (one, line)
        for (one, line), found in zip(told, sums, strict=True)
        if not checked or (one[4] and int(one[4], 16) == found)
    ]
    kinds = [one[2].decode() for one, _ in good]
    read = [
        Sentence(one[1].decode(), kind, one[3].decode("latin-1").split(","), line)
        for (one, line), kind in zip(good, kinds, strict=True)
        if kind in _USED
    ]
    return Sentences(read, len(told) - len(good), len(kinds) - len(read))


def _one_receiver(found: list[Sentence]) -> tuple[list[tuple[int, Sentence]], list[str]]:
    """Sentences to be used, numbered: of satellite receivers where there are any, and of one talker at a
    time.

    A receiver changes its talker with the satellites in use (GP, GN), so that talkers are not told apart
    where they take turns; where two repeat each other, the one with more sentences counts.
    """
    positions = Counter(one.talker for one in found if one.kind in POSITIONS)
    # Sentences without positions come from any receiver.
    best = {name for name, _ in positions.most_common(1)}
    allowed = _RECEIVERS if _RECEIVERS & set(positions) else best
    left = sorted(set(positions) - allowed)
    count = plural(sum(positions[name] for name in left), "position")
    notes = [f"{count} of other talkers ({', '.join(left)}) left aside"] if left else []
    return [(i, one) for i, one in enumerate(found) if one.talker in allowed], notes


def _epochs(found: list[tuple[int, Sentence]], log: Array) -> list[dict[str, int]]:
    """By its kind the number of each sentence of one time, for each time that has a position."""
    rows: list[dict[str, int]] = []
    known: dict[tuple[float, int], int] = {}
    seen: Counter[tuple[float, str]] = Counter()
    row = -1
    for i, one in found:
        if one.kind == "VTG":
            # It carries no time, and belongs to what came before it.
            if row >= 0:
                rows[row].setdefault("VTG", i)
            continue
        # A second sentence of a kind at the same time is another row, and later found to be a repetition.
        at = log[i] if math.isfinite(log[i]) else -1.0 - i
        row = known.setdefault((at, seen[at, one.kind]), len(rows))
        seen[at, one.kind] += 1
        if row == len(rows):
            rows.append({})
        rows[row][one.kind] = i
    return [one for one in rows if POSITIONS.keys() & one]


def _seconds_of_day(text: str) -> float:
    """Of ``hhmmss.sss``, NaN where it is none."""
    value = number(text)
    if not math.isfinite(value) or len(text.partition(".")[0]) != 6 or value < 0:
        return math.nan
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), number(text[4:])
    if hours > 23 or minutes > 59 or not seconds < 61:
        return math.nan
    return hours * 3600.0 + minutes * 60.0 + seconds


def _day(one: Sentence) -> float:
    """s since 1970 of the beginning of the day that RMC or ZDA names, else NaN."""
    date = one.field(9)
    if one.kind == "RMC" and one.field(2) == "A" and len(date) == 6:
        day, month, year = date[:2], date[2:4], date[4:]
    elif one.kind == "ZDA":
        day, month, year = one.field(2), one.field(3), one.field(4)
    else:
        return math.nan
    if not (day + month + year).isdecimal():
        return math.nan
    count = int(year) + ((1900 if int(year) >= 80 else 2000) if len(year) == 2 else 0)
    return calendar_s(count, month, day) if 1980 <= count < 2100 else math.nan


def _times(found: list[Sentence]) -> tuple[Array, Array]:
    """(N,) UTC, and the log's own stamps: where no date is known, s of an unknown day, and no UTC."""
    of_day = np.array([_seconds_of_day(one.field(_TIME_AT.get(one.kind, 99))) for one in found], float)
    day = np.array([_day(one) for one in found], float)
    timed = np.flatnonzero(np.isfinite(of_day))
    dated = np.isfinite(day[timed])
    stamps = np.full(len(found), np.nan)
    none = np.full(len(found), np.nan)
    if not dated.any():
        # Each is within half a day of the one before it.
        if len(timed):
            steps = _within_a_day(np.diff(of_day[timed], prepend=of_day[timed[:1]]))
            stamps[timed] = np.round(of_day[timed[0]] + np.cumsum(steps), 4)
        return none, stamps
    # A sentence without a date is within half a day of the last one that has a date, or of the first.
    places = np.flatnonzero(dated)
    last = np.searchsorted(places, np.arange(len(timed)), side="right") - 1
    anchor = timed[places[np.maximum(last, 0)]]
    steps = _within_a_day(of_day[timed] - of_day[anchor])
    # Equal texts are equal stamps, whichever day they were counted from.
    stamps[timed] = np.round(day[anchor] + of_day[anchor] + steps, 4)
    return stamps, stamps


def _within_a_day(steps: Array) -> Array:
    return np.asarray(steps - np.round(steps / _DAY_S) * _DAY_S)


def _degrees(one: Sentence, at: int) -> float:
    """Of ``dddmm.mmmm`` and its letter, NaN where it is none."""
    value, side = one.value(at), one.field(at + 1)
    if not math.isfinite(value) or value < 0 or side not in ("N", "S", "E", "W"):
        return math.nan
    whole = math.floor(value / 100.0)
    minutes = value - 100.0 * whole
    return (-1.0 if side in "SW" else 1.0) * (whole + minutes / 60.0) if minutes < 60.0 else math.nan


def _fix(one: Sentence) -> tuple[float, bool]:
    """Kind of fix by one sentence, NaN where it does not say; and whether it was estimated or made up."""
    if one.kind == "GGA":
        quality = one.field(6)
        return _QUALITY.get(quality, 0.0), quality in ("6", "7", "8")
    if one.kind == "GNS":
        best = max((_MODE.get(letter, 0.0) for letter in one.field(6)), default=0.0)
        return best, best == 0.0 and any(letter in "EMS" for letter in one.field(6))
    valid = one.field(2 if one.kind == "RMC" else 6) == "A"
    mode = one.field(12 if one.kind == "RMC" else 7)
    if valid and not mode:
        return math.nan, False
    return (_MODE.get(mode, 0.0) if valid else 0.0), mode in ("E", "M", "S")


def _columns(epochs: list[dict[str, Sentence]]) -> tuple[dict[str, Array], Mask, Mask]:
    """Columns (E,) of epochs; rows without a fix, and those that were estimated."""
    places = [next(one[name] for name in POSITIONS if name in one) for one in epochs]

    def each(of: Callable[[Sentence], float], kinds: tuple[str, ...] = tuple(POSITIONS)) -> Array:
        return np.array([of(one) if one.kind in kinds else math.nan for one in places])

    high = ("GGA", "GNS")
    motion = np.array([_velocity(one) for one in epochs])
    kinds = [[_fix(one[name]) for name in POSITIONS if name in one] for one in epochs]
    gst = [one.get("GST", Sentence("", "", [], 0)) for one in epochs]
    columns = {
        "latitude_deg": each(lambda one: _degrees(one, POSITIONS[one.kind])),
        "longitude_deg": each(lambda one: _degrees(one, POSITIONS[one.kind] + 2)),
        "height_sea_m": each(lambda one: one.value(9), high),
        "undulation_m": each(lambda one: one.value(11 if one.kind == "GGA" else 10), high),
        "v_north_m_s": motion[:, 0],
        "v_east_m_s": motion[:, 1],
        # The root of the mean of both variances.
        "sd_horizontal_m": np.array([math.sqrt((s.value(6) ** 2 + s.value(7) ** 2) / 2.0) for s in gst]),
        "sd_vertical_m": np.array([one.value(8) for one in gst]),
        "satellites": each(lambda one: one.value(7), high),
        "fix": np.array([one[0][0] for one in kinds]),
        "hdop": each(lambda one: one.value(8), high),
    }
    # One sentence without a fix is enough.
    no_fix = np.array([any(kind == 0.0 and not guessed for kind, guessed in one) for one in kinds])
    return columns, no_fix, np.array([one[0][1] for one in kinds])


def _velocity(epoch: dict[str, Sentence]) -> tuple[float, float]:
    """Towards north and east, m/s; at rest without a course, too."""
    speed = course = math.nan
    if "RMC" in epoch:
        speed, course = epoch["RMC"].value(7) * _KNOT_M_S, epoch["RMC"].value(8)
    if "VTG" in epoch and not math.isfinite(speed):
        one = epoch["VTG"]
        # Before NMEA 2.3 there were no letters between the numbers.
        lettered = len(one.fields) > 8 or one.field(2) == "T"
        speed, course = one.value(5 if lettered else 3) * _KNOT_M_S, one.value(1)
        if not math.isfinite(speed):
            speed = one.value(7 if lettered else 4) / 3.6
    if speed == 0.0:
        return 0.0, 0.0
    angle = math.radians(course)
    return speed * math.cos(angle), speed * math.sin(angle)


# -- u-blox UBX


Rows = NDArray[Any]

#: Class and number of messages.
PVT, POSLLH, HPPOSLLH, VELNED = (0x01, 0x07), (0x01, 0x02), (0x01, 0x14), (0x01, 0x12)
TIMEGPS, TIMEUTC, SOL, STATUS, DOP = (0x01, 0x20), (0x01, 0x21), (0x01, 0x06), (0x01, 0x03), (0x01, 0x04)
NAV_ATT, HNR_ATT, HNR_PVT = (0x01, 0x05), (0x28, 0x01), (0x28, 0x00)
#: Sync, class, number, length; then the payload and two bytes of checksum.
_SYNC, _HEADER, _CHECK = (0xB5, 0x62), 6, 2
#: Kinds of fix: none, dead reckoning alone, plane, space, both together, time alone.
_FIXES = np.array([0.0, 1.0, 2.0, 3.0, 3.0, 0.0])
_TEXT = bytes(range(32, 127)) + b"\t\r\n"


def _fields(text: str) -> list[Any]:
    """Names with their types, ``itow:u4``; groups of names by one type, ``lon lat:i4``; ``+n`` bytes
    unused."""
    made: list[Any] = []
    for group in text.split(", "):
        names, _, kind = group.partition(":")
        made += [
            (f"_{len(made) + at}", "u1", int(name[1:])) if name[0] == "+" else (name, f"<{kind}")
            for at, name in enumerate(names.split())
        ]
    return made


_DATE = "year:u2, month day hour minute second:u1"
_PLACE = "lon lat height sea:i4"
_ATTITUDE = "itow:u4, +4, roll pitch heading:i4, roll_acc pitch_acc heading_acc:u4"
#: Fields of messages, as far as they are used. Newer versions are longer, never otherwise.
LAYOUTS: dict[tuple[int, int], Any] = {
    kind: _fields(text)
    for kind, text in {
        PVT: f"itow:u4, {_DATE}, valid:u1, time_acc:u4, nano:i4, fix flags flags2 satellites:u1, {_PLACE}, "
        "h_acc v_acc:u4, vel_n vel_e vel_d speed course:i4, s_acc course_acc:u4, pdop:u2, flags3:u1",
        POSLLH: f"itow:u4, {_PLACE}, h_acc v_acc:u4",
        HPPOSLLH: f"+3, flags:u1, itow:u4, {_PLACE}, lon_hp lat_hp height_hp sea_hp:i1, h_acc v_acc:u4",
        VELNED: "itow:u4, vel_n vel_e vel_d:i4, speed_3d speed:u4, course:i4, s_acc:u4",
        TIMEGPS: "itow:u4, ftow:i4, week:i2, leap:i1, valid:u1",
        TIMEUTC: f"itow time_acc:u4, nano:i4, {_DATE}, valid:u1",
        SOL: "itow:u4, ftow:i4, week:i2, fix flags:u1, +35, satellites:u1",
        STATUS: "itow:u4, fix flags:u1",
        DOP: "itow:u4, +8, hdop:u2",
        NAV_ATT: _ATTITUDE,
        HNR_ATT: _ATTITUDE,
        HNR_PVT: f"itow:u4, {_DATE}, valid:u1, nano:i4, fix flags:u1, +2, {_PLACE}, "
        "speed speed_3d course heading:i4, h_acc v_acc s_acc:u4",
    }.items()
}
#: Classes that the interface descriptions have; others are chance.
CLASSES = (0x01, 0x02, 0x04, 0x05, 0x06, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x10, 0x13, 0x21, 0x27, 0x28)


class UbxFrames(NamedTuple):
    """Messages whose checksum holds, in the order of the file.

    Attributes
    ----------
    data
        The whole file.
    start, stop
        (M,) bytes of each, its header and checksum among them.
    kind
        (M,) class times 256 plus number.
    broken
        How many others begin as messages of a known class, outside these.
    """

    data: bytes
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    kind: NDArray[np.int64]
    broken: int

    def rows(self, kind: tuple[int, int]) -> Rows:
        """Fields of all messages of a kind (structured, (N,)), and `which` of the file's they are, from 1."""
        layout = np.dtype(LAYOUTS[kind])
        size = self.stop - self.start - _HEADER - _CHECK
        which = np.flatnonzero((self.kind == 256 * kind[0] + kind[1]) & (size >= layout.itemsize))
        raw = np.frombuffer(self.data, np.uint8)
        taken = raw[(self.start[which] + _HEADER)[:, None] + np.arange(layout.itemsize)]
        found = np.empty(len(which), [*LAYOUTS[kind], ("which", "i8"), ("own_s", "f8")])
        for name in layout.names or ():
            found[name] = np.ascontiguousarray(taken).view(layout).reshape(-1)[name]
        found["which"] = which + 1
        # Time of week, going on where a week ends.
        seconds = found["itow"].astype(float) / 1000.0
        steps = np.diff(seconds, prepend=seconds[:1])
        found["own_s"] = seconds - WEEK_S * np.cumsum(np.round(steps / WEEK_S))
        return found

    def between(self) -> bytes:
        """What is not in any message, in order."""
        begins, ends = np.r_[self.start, len(self.data)].tolist(), np.r_[0, self.stop].tolist()
        return b"".join(self.data[i:j] for i, j in zip(ends, begins, strict=True))


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
    return UbxFrames(data, starts, stops, kind, int((~inside).sum()))


def ubx_sniff(head: bytes) -> bool:
    """Whether a message with the right checksum is among the first bytes."""
    return len(frames(head).start) > 0


def ubx_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """A log of a u-blox receiver; text and NMEA between the messages do no harm. Rows are messages of UBX.

    Raises
    ------
    WildlabError
        Where no message has a position, nor any sentence of NMEA.
    """
    found = frames(data)
    rest = found.between()
    lost = [
        (found.broken, "message", "with a wrong checksum or cut off"),
        (len(rest.translate(None, _TEXT)), "byte", "of no message of UBX and of no text"),
    ]
    found_text = sentences(rest)
    gnss = _of_pvt(found, PVT) or _of_old(found) or _of_pvt(found, HNR_PVT)
    if gnss is None:
        made = track(found_text)
        if made is None:
            problem = f"{plural(len(found.start), 'message')} of u-blox, and none with a position"
            raise WildlabError(problem, "log UBX-NAV-PVT of the receiver", file=path)
        notes = ["no message of UBX has a position: sentences of NMEA do, counted without them", *made.notes]
        return Decoded(made.parts, clock=made.clock, lost=[*lost, *made.lost], notes=notes)
    parts = {"gnss": gnss}
    if poses := _poses(found, gnss):
        parts["poses"] = poses
    aside = f"{plural(len(found_text.found), 'sentence')} of NMEA left aside"
    own, time = gnss.columns["time_log_s"], gnss.columns["time_s"]
    known = np.isfinite(own * time) & ~any_of(gnss.unusable.values(), len(own))
    clock = Clock.fitted("UTC of the log", fit_clock(own[known], time[known])) if known.any() else None
    return Decoded(parts, clock=clock, lost=lost, notes=[aside] if found_text.found else [])


def _utc(row: Rows) -> Array:
    """s since 1970 of a calendar date with ns, which may be negative; NaN where it is no date."""
    month, day = row["month"].astype(int), row["day"].astype(int)
    fine = (month >= 1) & (month <= 12) & (day >= 1) & (row["hour"] < 24) & (row["minute"] < 60)
    fine &= (row["second"] <= 60) & (np.abs(row["nano"].astype(np.int64)) <= 10**9)
    months = (row["year"].astype(int) - 1970) * 12 + np.where(fine, month, 1) - 1
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(int)
    after = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(int)
    fine &= day <= after - first
    clock = row["hour"] * 3600.0 + row["minute"] * 60.0 + row["second"] + row["nano"] * 1e-9
    return np.where(fine, (first + day - 1) * 86400.0 + clock, np.nan)


def _at(own: Array, row: Rows, values: NDArray[Any]) -> Array:
    """Values of the messages of the same time of week, NaN where there is none."""
    result = np.full(len(own), np.nan)
    if len(row):
        order = np.argsort(row["own_s"], kind="stable")
        other = row["own_s"][order]
        place = np.minimum(np.searchsorted(other, own), len(other) - 1)
        same = other[place] == own
        result[same] = values[order][place][same]
    return result


def _place(found: UbxFrames, row: Rows) -> dict[str, Array]:
    """Place, heights and spreads of messages, with more digits where there are any at the same time."""
    own = row["own_s"]
    columns = {
        "latitude_deg": row["lat"] * 1e-7,
        "longitude_deg": row["lon"] * 1e-7,
        "height_ellipsoid_m": row["height"] * 1e-3,
        "height_sea_m": row["sea"] * 1e-3,
        "sd_horizontal_m": row["h_acc"] * 1e-3,
        "sd_vertical_m": row["v_acc"] * 1e-3,
    }
    more = found.rows(HPPOSLLH)
    finer = {
        "latitude_deg": more["lat"] * 1e-7 + more["lat_hp"] * 1e-9,
        "longitude_deg": more["lon"] * 1e-7 + more["lon_hp"] * 1e-9,
        "height_ellipsoid_m": more["height"] * 1e-3 + more["height_hp"] * 1e-4,
        "height_sea_m": more["sea"] * 1e-3 + more["sea_hp"] * 1e-4,
        "sd_horizontal_m": more["h_acc"] * 1e-4,
        "sd_vertical_m": more["v_acc"] * 1e-4,
    }
    for name, values in finer.items():
        fine = _at(own, more, np.where((more["flags"] & 1) == 0, values, np.nan))
        columns[name] = np.where(np.isfinite(fine), fine, columns[name])
    columns["undulation_m"] = columns["height_ellipsoid_m"] - columns["height_sea_m"]
    dop = found.rows(DOP)
    return columns | {"time_log_s": own, "hdop": _at(own, dop, dop["hdop"] * 0.01)}


def _of_pvt(found: UbxFrames, kind: tuple[int, int]) -> Readings | None:
    """`gnss` of NAV-PVT, or of HNR-PVT, which has course and speed instead of a velocity."""
    row = found.rows(kind)
    if not len(row):
        return None
    columns = {"time_s": _utc(row), **_place(found, row), "sd_velocity_m_s": row["s_acc"] * 1e-3}
    kinds = _FIXES[np.minimum(row["fix"], 5)]
    flags = row["flags"].astype(int)
    estimated = row["fix"] == 1
    reasons: dict[str, Mask] = {
        "no fix": ((kinds < 2) & ~estimated) | (flags & 1 == 0),
        "estimated, not measured": estimated,
        "time is not known to the receiver": (row["valid"] & 3) != 3,
    }
    if kind == PVT:
        columns |= {name: row[f"vel_{name[2]}"] * 1e-3 for name in VELOCITY}
        columns["satellites"] = row["satellites"].astype(float)
        carrier = flags >> 6
        better = np.select([carrier == 2, carrier == 1, flags & 2 > 0], [6.0, 5.0, 4.0], kinds)
        columns["fix"] = np.where(kinds < 3, kinds, better)
        # So the receiver says that it has no place, in what older ones left at nothing.
        reasons["no position"] = (row["flags3"] & 1) > 0
    else:
        course, speed = np.radians(row["course"] * 1e-5), row["speed"] * 1e-3
        columns |= {"v_north_m_s": speed * np.cos(course), "v_east_m_s": speed * np.sin(course)}
        columns["fix"] = np.where((kinds == 3) & (flags & 2 > 0), 4.0, kinds)
    return Readings(columns, row["which"], "message", reasons)


def _of_old(found: UbxFrames) -> Readings | None:
    row = found.rows(POSLLH)
    if not len(row):
        return None
    own = row["own_s"]
    columns = {"time_s": _weeks_to_utc(found, own), **_place(found, row)}
    velocity = found.rows(VELNED)
    columns |= {name: _at(own, velocity, velocity[f"vel_{name[2]}"] * 1e-2) for name in VELOCITY}
    columns["sd_velocity_m_s"] = _at(own, velocity, velocity["s_acc"] * 1e-2)
    reasons: dict[str, Mask] = {}
    for kind in (STATUS, SOL):
        status = found.rows(kind)
        if not len(status):
            continue
        said = _at(own, status, status["fix"])
        ok = _at(own, status, (status["flags"] & 1).astype(float))
        kinds = np.where(np.isnan(said), np.nan, _FIXES[np.clip(np.nan_to_num(said), 0, 5).astype(int)])
        columns["fix"] = kinds
        reasons["no fix"] = ((kinds < 2) & (said != 1)) | (ok == 0)
        reasons["estimated, not measured"] = said == 1
        if kind == SOL:
            columns["satellites"] = _at(own, status, status["satellites"])
    return Readings(columns, row["which"], "message", reasons)


def _weeks_to_utc(found: UbxFrames, own: Array) -> Array:
    """UTC of times of week, by the nearest message that knows both."""
    row = found.rows(TIMEUTC)
    pairs = [(row["own_s"], np.where(row["valid"] & 4, _utc(row), np.nan))]
    # Both bits: the week and the time in it; they stand at different places.
    for kind, field, bits in ((TIMEGPS, "valid", 3), (SOL, "flags", 12)):
        row = found.rows(kind)
        utc = week_to_utc(row["week"], row["itow"] * 1e-3 + row["ftow"] * 1e-9)
        pairs.append((row["own_s"], np.where((row[field] & bits) == bits, utc, np.nan)))
    for stamps, utc in pairs:
        known = np.isfinite(utc)
        if not known.any():
            continue
        order = np.argsort(stamps[known], kind="stable")
        stamps, utc = stamps[known][order], utc[known][order]
        after = np.clip(np.searchsorted(stamps, own), 0, len(stamps) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(np.abs(stamps[after] - own) <= np.abs(own - stamps[before]), after, before)
        return np.asarray(utc[nearest] + own - stamps[nearest])
    return np.full(len(own), np.nan)


def _poses(found: UbxFrames, gnss: Readings) -> Readings | None:
    """Attitude of HNR-ATT at the positions of HNR-PVT, or of NAV-ATT at those of `gnss`."""
    row, place = found.rows(HNR_ATT), gnss
    if len(row):
        place = _of_pvt(found, HNR_PVT) or gnss
    else:
        row = found.rows(NAV_ATT)
    if not len(row):
        return None
    own = place.columns["time_log_s"]
    columns = {
        name: values
        for name, values in place.columns.items()
        if name not in ("satellites", "fix", "hdop", "sd_velocity_m_s")
    }
    for name, field in (("roll", "roll"), ("pitch", "pitch"), ("yaw", "heading")):
        # Without an accuracy there is no angle.
        angle = np.where(row[f"{field}_acc"] > 0, row[field] * 1e-5, np.nan)
        columns[f"{name}_deg"] = _at(own, row, angle)
    roll, pitch, heading = (row[f"{field}_acc"] * 1e-5 for field in ("roll", "pitch", "heading"))
    columns["sd_tilt_deg"] = _at(own, row, tilt_from_roll_pitch(roll, pitch))
    columns["sd_heading_deg"] = _at(own, row, heading)
    return place._replace(columns=columns)
