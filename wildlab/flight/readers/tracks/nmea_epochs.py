"""Sentences of NMEA 0183 that belong together: one row for each time that has a position."""

from __future__ import annotations

import math
from collections import Counter
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.logs.log import Array
from wildlab.flight.readers.tracks.judging import Mask, number, plural

#: Sentences with a position, best first: GGA and GNS have the height.
POSITIONS = ("GGA", "GNS", "RMC", "GLL")
#: Talkers that are satellite receivers, not plotters that repeat one.
_RECEIVERS = frozenset({"GP", "GN", "GL", "GA", "GB", "BD", "GQ", "QZ", "GI", "IR"})
#: Where the time stands.
_TIME_AT = {"GGA": 1, "GNS": 1, "RMC": 1, "GLL": 5, "ZDA": 1, "GST": 1}
#: Quality of GGA, and the letters of GNS, RMC and GLL, as kinds of fix: 3 in space, 4 differential, 5 float,
#: 6 fixed; 0 none. Estimated, typed in and simulated are none.
_QUALITY = {"1": 3.0, "2": 4.0, "3": 3.0, "4": 6.0, "5": 5.0, "9": 4.0}
_MODE = {"A": 3.0, "D": 4.0, "P": 3.0, "F": 5.0, "R": 6.0}
_KNOT_M_S = 1852.0 / 3600.0
_DAY_S = 86400.0

Fields = list[str]


def epochs(
    talker: list[str], kind: list[str], fields: list[Fields], line: NDArray[np.int64]
) -> tuple[dict[str, Array], NDArray[np.int64], dict[str, Mask], list[str]]:
    """Columns of `gnss`, the line of each row, what is not usable by the sentences' own word, and notes.

    Parameters
    ----------
    talker, kind, fields
        Of each sentence; fields as they are counted in the standard, from 1.
    line
        (N,) where each stands in the file.
    """
    chosen, notes = _one_receiver(talker, kind)
    time, log, dated = _times(kind, fields)
    rows: list[dict[str, int]] = []
    known: dict[tuple[float, int], int] = {}
    seen: Counter[tuple[float, str]] = Counter()
    row = -1
    for i in chosen:
        name = kind[i]
        if name == "VTG":
            # It carries no time, and belongs to what came before it.
            if row >= 0:
                rows[row].setdefault("VTG", i)
            continue
        # A second sentence of a kind at the same time is another row, and later found to be a repetition.
        at = log[i] if math.isfinite(log[i]) else -1.0 - i
        nth = seen[at, name]
        seen[at, name] += 1
        row = known.setdefault((at, nth), len(rows))
        if row == len(rows):
            rows.append({})
        rows[row][name] = i
    rows = [one for one in rows if any(name in one for name in POSITIONS)]
    first = [next(one[name] for name in POSITIONS if name in one) for one in rows]
    columns, no_fix, estimated = _columns(rows, fields)
    at = np.array(first, np.int64)
    columns["time_s"], columns["time_log_s"] = time[at], log[at]
    if not dated:
        columns["time_s"] = np.full(len(rows), np.nan)
    unusable = {"no fix": no_fix, "estimated, not measured": estimated}
    return columns, line[at] if len(at) else np.empty(0, np.int64), unusable, notes


def _one_receiver(talker: list[str], kind: list[str]) -> tuple[list[int], list[str]]:
    """Sentences to be used: of satellite receivers where there are any, and of one talker at one time.

    A receiver changes its talker with the satellites in use (GP, GN), so that talkers are not told apart
    where they take turns; where two repeat each other, the one with more sentences counts.
    """
    positions = Counter(talker[i] for i in range(len(kind)) if kind[i] in POSITIONS)
    receivers = [name for name in positions if name in _RECEIVERS]
    allowed = set(receivers or positions)
    left = sorted(set(positions) - allowed)
    notes = []
    if len(allowed) > 1 and not receivers:
        best = positions.most_common(1)[0][0]
        left = sorted(allowed - {best})
        allowed = {best}
    if left:
        count = sum(positions[name] for name in left)
        notes.append(f"{plural(count, 'position')} of other talkers ({', '.join(left)}) left aside")
    # Sentences without positions come from any receiver.
    allowed |= _RECEIVERS if receivers else set()
    return [i for i in range(len(kind)) if talker[i] in allowed], notes


def _field(fields: Fields, at: int) -> str:
    return fields[at].strip() if at < len(fields) else ""


def _seconds_of_day(text: str) -> float:
    """Of ``hhmmss.sss``, NaN where it is none."""
    value = number(text)
    if not math.isfinite(value) or len(text.partition(".")[0]) != 6 or value < 0:
        return math.nan
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), number(text[4:])
    if hours > 23 or minutes > 59 or not seconds < 61:
        return math.nan
    return hours * 3600.0 + minutes * 60.0 + seconds


def _day(day: str, month: str, year: str) -> float:
    """s since 1970 of the day's beginning, NaN where it is none."""
    try:
        count = int(year)
        count += (1900 if count >= 80 else 2000) if len(year) == 2 else 0
        at = datetime(count, int(month), int(day), tzinfo=UTC).timestamp()
    except (ValueError, OverflowError):
        return math.nan
    return at if 1980 <= count < 2100 else math.nan


def _times(kind: list[str], fields: list[Fields]) -> tuple[Array, Array, bool]:
    """(N,) UTC, the log's own stamps (where no date is known, s of an unknown day), and whether one is."""
    count = len(kind)
    of_day, day = np.full(count, np.nan), np.full(count, np.nan)
    for i in range(count):
        name, row = kind[i], fields[i]
        if name in _TIME_AT:
            of_day[i] = _seconds_of_day(_field(row, _TIME_AT[name]))
        if name == "RMC" and _field(row, 2) == "A":
            text = _field(row, 9)
            day[i] = _day(text[:2], text[2:4], text[4:]) if len(text) == 6 else math.nan
        elif name == "ZDA":
            day[i] = _day(_field(row, 2), _field(row, 3), _field(row, 4))
    timed = np.flatnonzero(np.isfinite(of_day))
    dated = np.isfinite(day[timed])
    stamps = np.full(count, np.nan)
    if not dated.any():
        # Each is within half a day of the one before it.
        steps = np.diff(of_day[timed], prepend=of_day[timed[:1]])
        steps -= np.round(steps / _DAY_S) * _DAY_S
        if len(timed):
            stamps[timed] = np.round(of_day[timed[0]] + np.cumsum(steps), 4)
        return np.full(count, np.nan), stamps, False
    # A sentence without a date is within half a day of the last one that has a date, or of the first.
    places = np.flatnonzero(dated)
    last = np.searchsorted(places, np.arange(len(timed)), side="right") - 1
    anchor = timed[places[np.maximum(last, 0)]]
    steps = of_day[timed] - of_day[anchor]
    steps -= np.round(steps / _DAY_S) * _DAY_S
    # Equal texts are equal stamps, whichever day they were counted from.
    stamps[timed] = np.round(day[anchor] + of_day[anchor] + steps, 4)
    return stamps, stamps, True


def _degrees(text: str, side: str) -> float:
    """Of ``dddmm.mmmm`` and its letter, NaN where it is none."""
    value = number(text)
    if not math.isfinite(value) or value < 0 or side not in ("N", "S", "E", "W"):
        return math.nan
    whole = math.floor(value / 100.0)
    minutes = value - 100.0 * whole
    if minutes >= 60.0:
        return math.nan
    return (-1.0 if side in "SW" else 1.0) * (whole + minutes / 60.0)


#: Kind -> where the latitude begins.
_PLACE_AT = {"GGA": 2, "GNS": 2, "RMC": 3, "GLL": 1}


def _fix(name: str, row: Fields) -> tuple[float, bool]:
    """Kind of fix by one sentence, NaN where it does not say; and whether it was estimated or made up."""
    if name == "GGA":
        quality = _field(row, 6)
        return _QUALITY.get(quality, 0.0), quality in ("6", "7", "8")
    if name == "GNS":
        modes = _field(row, 6)
        best = max((_MODE.get(letter, 0.0) for letter in modes), default=0.0)
        return best, best == 0.0 and any(letter in "EMS" for letter in modes)
    valid = _field(row, 2 if name == "RMC" else 6) == "A"
    mode = _field(row, 12 if name == "RMC" else 7)
    if valid and not mode:
        return math.nan, False
    return (_MODE.get(mode, 0.0) if valid else 0.0), mode in ("E", "M", "S")


def _columns(rows: list[dict[str, int]], fields: list[Fields]) -> tuple[dict[str, Array], Mask, Mask]:
    names = (
        *("latitude_deg", "longitude_deg", "height_sea_m", "undulation_m", "v_north_m_s", "v_east_m_s"),
        *("sd_horizontal_m", "sd_vertical_m", "satellites", "fix", "hdop"),
    )
    values = np.full((len(rows), len(names)), np.nan)
    no_fix, estimated = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
    for k, row in enumerate(rows):
        said = {name: fields[i] for name, i in row.items()}
        place = next(name for name in POSITIONS if name in said)
        at, one = _PLACE_AT[place], said[place]
        latitude = _degrees(_field(one, at), _field(one, at + 1))
        longitude = _degrees(_field(one, at + 2), _field(one, at + 3))
        height = undulation = satellites = hdop = math.nan
        if place in ("GGA", "GNS"):
            height = number(_field(one, 9))
            undulation = number(_field(one, 11 if place == "GGA" else 10))
            satellites, hdop = number(_field(one, 7)), number(_field(one, 8))
        kinds = [_fix(name, said[name]) for name in POSITIONS if name in said]
        fix, estimated[k] = kinds[0]
        # One sentence without a fix is enough.
        no_fix[k] = any(kind == 0.0 and not guessed for kind, guessed in kinds)
        north, east = _velocity(said)
        spread, spread_up = _spreads(said.get("GST", []))
        values[k] = (
            *(latitude, longitude, height, undulation, north, east),
            *(spread, spread_up, satellites, fix, hdop),
        )
    columns = {
        name: values[:, n]
        for n, name in enumerate(names)
        if name.endswith("_deg") or np.isfinite(values[:, n]).any()
    }
    return columns, no_fix, estimated


def _velocity(said: dict[str, Fields]) -> tuple[float, float]:
    """Towards north and east, m/s; at rest without a course, too."""
    speed = course = math.nan
    if "RMC" in said:
        speed, course = number(_field(said["RMC"], 7)) * _KNOT_M_S, number(_field(said["RMC"], 8))
    if "VTG" in said and not math.isfinite(speed):
        row = said["VTG"]
        # Before NMEA 2.3 there were no letters between the numbers.
        lettered = len(row) > 8 or _field(row, 2) == "T"
        speed = number(_field(row, 5 if lettered else 3)) * _KNOT_M_S
        course = number(_field(row, 1))
        if not math.isfinite(speed):
            speed = number(_field(row, 7 if lettered else 4)) / 3.6
    if speed == 0.0:
        return 0.0, 0.0
    angle = math.radians(course)
    return speed * math.cos(angle), speed * math.sin(angle)


def _spreads(row: Fields) -> tuple[float, float]:
    """Standard deviations, level (root of the mean of both variances) and upwards, m."""
    north, east = number(_field(row, 6)), number(_field(row, 7))
    return math.sqrt((north**2 + east**2) / 2.0), number(_field(row, 8))
