"""All numbers that a text can be read as, and which of them tell a day or a moment of a flight."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from datetime import UTC, date, datetime, timedelta
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_POWER = r"(?:[eE](?P<power>[+-]?\d{1,2})(?!\d))?"
#: Whole numbers, decimals with point or comma, and thousands apart; each with what may follow it.
_READINGS = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?<!\d)(?<!\d\.)(?P<whole>\d{1,20})(?!\d)(?P<rest>)" + _POWER,
        r"(?<!\d)(?=(?P<whole>\d{1,20})[.,](?P<rest>\d+)" + _POWER + ")",
        r"(?<!\d)(?<!\d{3}[ ,'_])(?=(?P<whole>\d{1,3}(?P<gap>[ ,'_])\d{3}(?:(?P=gap)\d{3})?)(?!\d)"
        r"(?:[.,](?P<rest>\d+))?(?P<power>))",
    )
)
_GAPS = str.maketrans("", "", " ,'_")
#: What stands behind degrees: their sign, d, or what it becomes where signs are lost.
_MARK = re.compile(r" ?[\xb0\xbadD?*\xc2]")


class Hit(NamedTuple):
    """Something found in a text: ``start``, ``end`` (characters), what kind of secret, how it is written."""

    start: int
    end: int
    kind: str
    written: str


class Numbers(NamedTuple):
    """Numbers as they can be read, (N,) each, by where they begin; one place may be read in several ways.

    Attributes
    ----------
    start, end
        Characters.
    value
        Without its sign: a minus or an S before a latitude makes no difference here.
    decimals
        Digits behind the point, less the exponent; below zero where last digits are left off.
    half
        Half of what the last digit counts, in the unit of the value.
    """

    start: Ints
    end: Ints
    value: Array
    decimals: Ints
    half: Array

    @property
    def digits(self) -> Ints:
        """How many digits count: leading zeros do not."""
        size = np.floor(np.log10(np.maximum(self.value, 1e-300)) + 1e-12).astype(np.int64) + 1
        return np.maximum(np.where(self.value > 0, size, 1) + self.decimals, 1)

    def take(self, which: NDArray[np.bool_] | Ints) -> Numbers:
        return Numbers(
            self.start[which], self.end[which], self.value[which], self.decimals[which], self.half[which]
        )


def numbers_of(text: str) -> Numbers:
    """Every number in a text, in every reading."""
    rows = []
    for reading in _READINGS:
        for match in reading.finditer(text):
            whole, rest, power = match["whole"].translate(_GAPS), match["rest"] or "", match["power"] or "0"
            end = match.end("power") if match["power"] else match.end("rest" if rest else "whole")
            rows.append((match.start("whole"), end, float(f"{whole}.{rest}e{power}"), len(rest) - int(power)))
    return _numbers(rows)


def _numbers(rows: list[tuple[int, int, float, int]]) -> Numbers:
    start, end, value, decimals = zip(*sorted(rows), strict=True) if rows else ((), (), (), ())
    places = np.array(decimals, np.int64)
    return Numbers(
        np.array(start, np.int64), np.array(end, np.int64), np.array(value, float), places,
        0.5 * 10.0 ** -places.astype(float),
    )  # fmt: skip


def angles_of(text: str, numbers: Numbers, degrees: Collection[int]) -> Iterator[tuple[str, Numbers]]:
    """What can be read as degrees with minutes, by how it is written, in degrees.

    Parameters
    ----------
    text, numbers
        A text, and the numbers in it.
    degrees
        Whole degrees that are looked for.
    """
    wanted = "|".join(str(one) for one in sorted(degrees))
    begin = rf"(?<![\d.,])0{{0,2}}(?:{wanted})(?=(?P<gap>\D{{1,12}})"
    end = r"(?P<last>\d{1,2})(?P<rest>[.,]\d+)?(?!\d))"
    for name, minutes, unit in (
        ("minutes and seconds", r"(?P<minutes>\d{1,2})\D{1,12}", 3600),
        ("minutes", "(?P<minutes>)", 60),
    ):
        rows, half = [], []
        for match in re.finditer(begin + minutes + end, text) if wanted else ():
            rest = (match["rest"] or "").replace(",", ".")
            whole, last = int(match["minutes"] or 0), int(match["last"])
            marked = _MARK.match(match["gap"]) is not None
            # 60.07 is a decimal, and two numbers with a blank between say nothing yet.
            if match["gap"] == "." or max(whole, last) >= 60 or not (unit == 3600 or marked or rest):
                continue
            fine = max(len(rest) - 1, 0)
            value = int(match[0]) + whole / 60 + float(f"{last}{rest}") / unit
            decimals = fine + (3 if unit == 3600 else 1) + marked
            # With the sign of degrees a single one counts sooner: 60 deg 07' 24" is nothing else.
            decimals = max(decimals, 5) if marked and unit == 3600 else decimals
            at = match.end("rest") if rest else match.end("last")
            rows.append((match.start(), at, value, decimals))
            half.append(0.5 * 10.0**-fine / unit)
        yield f"degrees, {name}", _numbers(rows)._replace(half=np.array(half, float))
    yield "ddmm.mmmm", _packed(text, numbers, 100.0, degrees)
    yield "ddmmss", _packed(text, numbers, 10_000.0, degrees)


def _packed(text: str, numbers: Numbers, whole: float, wanted: Collection[int]) -> Numbers:
    """Degrees, minutes (and seconds) in one number: 6007.4057, 600724.34."""
    near = np.isin(np.floor(numbers.value / whole), sorted(wanted))
    n = numbers.take(near & (numbers.value >= 1) & (numbers.decimals >= 0))
    degrees = np.floor(n.value / whole)
    rest = n.value - degrees * whole
    minutes = np.floor(rest / 100)
    if whole == 100.0:
        good, value, more = rest < 60, degrees + rest / 60, 1
    else:
        seconds = rest - minutes * 100
        good = (minutes < 60) & (seconds < 60) & (n.value >= 1000)
        value, more = degrees + minutes / 60 + seconds / 3600, 3
    # A letter behind it says what it is: 6007N 01015E.
    letter = np.array([text[end : end + 1] in tuple("NSEWnsew") for end in n.end], np.int64)
    half = n.half / (60 if whole == 100.0 else 3600)
    return n._replace(value=value, decimals=n.decimals + more + letter, half=half).take(good)


#: Months by number, as English, German, Norwegian, Swedish and Danish begin to write them.
MONTHS = (
    "jan", "feb", "mar|mär|mrz", "apr", "mai|may|maj", "jun", "jul", "aug", "sep", "oct|okt", "nov",
    "dec|dez|des",
)  # fmt: skip
#: A date elsewhere on Earth may be the day before or after the one in UTC.
BEHIND, AHEAD = timedelta(hours=12), timedelta(hours=14)
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
#: GPS runs ahead of UTC by this at most, and by nothing at first, s.
LEAP_S = 20
DAY_S = 86_400.0
#: The seconds of a GPS week need so many digits, and stand within so many characters of the week.
DIGITS, BESIDE = 5, 24
#: Where days are counted from, and what that is called.
DAY_ZEROS = (
    (datetime(1970, 1, 1, tzinfo=UTC), 0.0, "days since 1970"),
    (datetime(1899, 12, 30, tzinfo=UTC), 0.0, "days as in a spreadsheet"),
    (datetime(1858, 11, 17, tzinfo=UTC), 0.0, "modified Julian date"),
    (datetime(1858, 11, 17, tzinfo=UTC), 2_400_000.5, "Julian date"),
    (datetime(1, 1, 1, tzinfo=UTC), 367.0, "days as in Matlab"),
)
_THREE = re.compile(r"(?<!\d)(?=(\d{1,4})([-/.:_ ])(\d{1,2})\2(\d{1,4})(?!\d))")
_RUN = re.compile(r"(?<!\d)\d{6,17}(?!\d)")
_ORDINAL = re.compile(
    r"(?<!\d)(?:(?P<year>\d{4})[-/. ]?(?P<day>\d{3})|(?P<day2>\d{3})[-/. ](?P<year2>\d{4}))(?!\d)"
    r"|(?:\bday|\bdoy|\bdag|\btag)\W{0,3}(?:of\W(?:the\W)?year\W{0,3})?(?P<alone>\d{1,3})(?!\d)",
    re.IGNORECASE,
)
_WEEK = re.compile(r"(?<!\d)(\d{4})-?W(\d{2})(?!\d\d)", re.IGNORECASE)
_CLOCK = re.compile(r"(?<!\d)(\d{1,2}):(\d{2}):(\d{2})(?!\d)")


def days_of(moments: Iterable[datetime]) -> set[date]:
    """The days on which moments fall, anywhere on Earth."""
    return {(moment + shift).date() for moment in moments for shift in (-BEHIND, timedelta(0), AHEAD)}


class Dates:
    """Looks for the days of some moments (UTC, with a zone), and for the moments themselves.

    Parameters
    ----------
    moments
        When it was. The month may be said.
    """

    def __init__(self, moments: Iterable[datetime]) -> None:
        self.moments = tuple(dict.fromkeys(moment.astimezone(UTC) for moment in moments))
        days = sorted(days_of(self.moments))
        self.ordinals = {(day.year, day.timetuple().tm_yday) for day in days}
        self.weeks = {day.isocalendar()[:2] for day in days}
        #: 00:00:00 is no time of day but the lack of one.
        self.clocks = {(one.hour, one.minute, one.second) for one in self.moments} - {(0, 0, 0)}
        orders = [
            order
            for day in days
            for y, m, d in [(day.year, day.month, day.day)]
            for order in ((y, m, d), (d, m, y), (m, d, y))
        ]
        self.days = set(orders)
        self.short = {tuple(part % 100 for part in order) for order in orders}
        self.compact = {f"{a:0{4 if a > 99 else 2}d}{b:02d}{c:0{4 if c > 99 else 2}d}" for a, b, c in orders}
        self.compact_short = {f"{a:02d}{b:02d}{c:02d}" for a, b, c in self.short}
        self.named = [_named(days, *month) for month in sorted({(day.year, day.month) for day in days})]

    def found_in(self, text: str, numbers: Numbers) -> Iterator[Hit]:
        """Where one of the days or moments stands in a text, whose numbers are given."""
        if not self.moments:
            return
        for start, end, written in self._days(text):
            yield Hit(start, end, "date", written)
        for pattern in self.named:
            for match in pattern.finditer(text):
                yield Hit(match.start(), match.end(), "date", "a date with the month in letters")
        for moment in self.moments:
            yield from _counted(numbers, moment)
            yield from _gps(numbers, moment)

    def _days(self, text: str) -> Iterator[tuple[int, int, str]]:
        """2026-05-01, 01.05.2026, 5/1/26, 20260501, 2026-121, 2026-W18, and the time of day to the second."""
        for match in _THREE.finditer(text):
            parts = int(match[1]), int(match[3]), int(match[4])
            two = len(match[1]) == len(match[3]) == len(match[4]) == 2
            # With blanks or colons between them, two digits each: else they are numbers of something else.
            short = two or (match[2] in "-/." and max(len(match[1]), len(match[4])) == 2)
            if parts in self.days or (short and parts in self.short):
                yield match.start(), match.end(4), "a day as numbers"
        for match in _RUN.finditer(text):
            whole = len(match[0]) in (8, 10, 12, 14, 17) and match[0][:8] in self.compact
            if whole or (len(match[0]) == 6 and match[0] in self.compact_short):
                yield match.start(), match.end(), "a day as one number"
        for match in _ORDINAL.finditer(text):
            year, day = match["year"] or match["year2"], match["day"] or match["day2"] or match["alone"]
            if any(year in (None, str(y)) and int(day) == d for y, d in self.ordinals):
                yield match.start(), match.end(), "a day of the year"
        for match in _WEEK.finditer(text):
            if (int(match[1]), int(match[2])) in self.weeks:
                yield match.start(), match.end(), "a week of the year"
        for match in _CLOCK.finditer(text):
            if (int(match[1]), int(match[2]), int(match[3])) in self.clocks:
                yield match.start(), match.end(), "a time of day, to the second"


def _named(days: Iterable[date], year: int, month: int) -> re.Pattern[str]:
    """1 May 2026, May 1st, 2026, 1. mai 2026."""
    name = rf"(?<![^\W\d_])(?:{MONTHS[month - 1]})[^\W\d_]{{0,8}}"
    numbers = "|".join(rf"0?{day.day}" for day in days if (day.year, day.month) == (year, month))
    day, gap = rf"(?<!\d)(?:{numbers})(?!\d)(?:st|nd|rd|th|\.)?", r"[\s,._/-]{0,3}(?:of |de )?"
    years = rf"(?:{year}|'?{year % 100:02d}(?!\d))"
    spelt = (
        rf"{day}[\s,._/-]{{0,3}}(?:of |de )?{name}",
        rf"{name}{gap}{day}{gap}{years}",
        rf"{years}{gap}{name}{gap}{day}",
    )
    return re.compile("|".join(spelt), re.IGNORECASE)


def _counted(numbers: Numbers, moment: datetime) -> Iterator[Hit]:
    """Seconds, ms, us, ns since 1970 or since GPS began, and days since other beginnings."""
    since = {"1970": moment.timestamp(), "GPS began": (moment - GPS_EPOCH).total_seconds()}
    units = {"seconds": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
    ways = [
        (count * scale, DAY_S * scale, 0, f"{unit} since {zero}")
        for (zero, count), (unit, scale) in product(since.items(), units.items())
    ]
    ways += [((moment - zero).total_seconds() / DAY_S + add, 0.6, 3, name) for zero, add, name in DAY_ZEROS]
    for true, tolerance, decimals, name in ways:
        fits = (np.abs(numbers.value - true) <= tolerance) & (numbers.decimals >= decimals)
        for start, end in zip(numbers.start[fits], numbers.end[fits], strict=True):
            yield Hit(int(start), int(end), "date", f"time as {name}")


def _gps(numbers: Numbers, moment: datetime) -> Iterator[Hit]:
    """A GPS week and seconds (or ms) of it close by."""
    week, of_week = divmod((moment - GPS_EPOCH).total_seconds(), 7 * DAY_S)
    weeks = numbers.start[(numbers.value == week) & (numbers.decimals == 0)]
    for scale, unit in ((1.0, "seconds"), (1e3, "ms")):
        fits = np.abs(numbers.value - of_week * scale) <= (600 + LEAP_S) * scale
        some = numbers.take(fits & (numbers.digits >= DIGITS))
        for start, end in zip(some.start, some.end, strict=True):
            beside = weeks[(np.abs(weeks - start) <= BESIDE) & (weeks != start)]
            for at in beside[:1]:
                yield Hit(
                    int(min(at, start)), int(max(at + len(str(int(week))), end)), "date",
                    f"GPS week and {unit} of it",
                )  # fmt: skip
