"""NMEA 0183: sentences of receivers and plotters, joined into epochs by the time that they carry, as `gnss`.

Sentences are found wherever they stand in a line, so that stamps of a logger before them do no harm. Heights
are above sea level, with the undulation that the receiver knows. Days come from RMC and ZDA, and are carried
to the sentences that have none, over midnight too. Damaged fields are no numbers, where `pynmea2` raises; all
checksums are taken at once, which makes the whole hardly faster. Facts of the sentences: NMEA 0183, as
`pynmea2` has it.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import Array, Clock, Decoded, Mask, Readings
from wildlab.flight.readers.text import calendar_s, number, plural

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
    """Sentences of use whose checksum holds, how many others had a wrong one, or none, and other kinds."""

    found: list[Sentence]
    bad: int
    unread: Counter[str]


def sniff(head: bytes, name: str) -> bool:
    """Whether a file begins with sentences."""
    found = sentences(head)
    return bool(found.found) or sum(found.unread.values()) >= 3


def decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """A log of sentences; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where no sentence has a position.
    """
    found = sentences(data)
    made = track(found)
    if made is None:
        seen = len(found.found) + sum(found.unread.values())
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
    if given.unread:
        kinds = ", ".join(sorted(given.unread)[:12]) + (" and others" if len(given.unread) > 12 else "")
        notes.append(f"{plural(given.unread.total(), 'sentence')} not needed for a track ({kinds})")
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
    return Sentences(read, len(told) - len(good), Counter(kind for kind in kinds if kind not in _USED))


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
        **{"v_north_m_s": motion[:, 0], "v_east_m_s": motion[:, 1]},
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
