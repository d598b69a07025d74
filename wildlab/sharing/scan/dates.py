"""Dates and times: when it was, finer than may be said."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import UTC, date, datetime, timedelta
from itertools import islice, product

import numpy as np

from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.numbers import Bytes, Ints, Numbers, Runs, is_one_of
from wildlab.sharing.scan.secrets import MayStay, Secrets

#: Months by number, as English, German, Norwegian, Swedish and Danish begin to write them.
MONTHS = (
    ("jan",), ("feb",), ("mar", "mär", "mrz"), ("apr",), ("mai", "may", "maj"), ("jun",), ("jul",),
    ("aug",), ("sep",), ("oct", "okt"), ("nov",), ("dec", "dez", "des"),
)  # fmt: skip
#: A date elsewhere on Earth may be the day before or after the one in UTC.
BEHIND, AHEAD = timedelta(hours=12), timedelta(hours=14)
#: So many namings of one month are looked at.
MOST_NAMES = 20_000
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
    (datetime(1, 1, 1, tzinfo=UTC), 366.0, "days as in Matlab"),
)


def days_of(moments: Iterable[datetime]) -> set[date]:
    """The days on which moments fall, anywhere on Earth."""
    return {(moment + shift).date() for moment in moments for shift in (-BEHIND, timedelta(0), AHEAD)}


def dates_in(data: Bytes, text: str, runs: Runs, numbers: Numbers, secrets: Secrets) -> list[Hit]:
    """Where one of the days, months or moments is written.

    Parameters
    ----------
    data, text
        The same text, as bytes (one per character) and as it is.
    runs, numbers
        What `wildlab.sharing.scan.numbers` read in it.
    secrets
        Whose moments are looked for.
    """
    if not secrets.moments or secrets.may_stay == "all":
        return []
    days = days_of(secrets.moments)
    hits: list[Hit] = []
    if secrets.may_stay != "day":
        hits += _numeric(data, runs, days) + _compact(runs, days) + _named(text, days, secrets)
    hits += _clock_times(data, runs, secrets.moments)
    hits += _counted(numbers, secrets.moments) + _gps(numbers, secrets.moments)
    if secrets.may_stay in ("nothing", "year"):
        hits += _months(data, runs, days)
    if secrets.may_stay == "nothing":
        hits += _years(runs, days)
    return hits


def _apart(data: Bytes, runs: Runs, i: Ints, signs: bytes) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether one sign, the same, stands between each of three runs."""
    last = len(data) - 1
    one, two = data[np.minimum(runs.end[i], last)], data[np.minimum(runs.end[i + 1], last)]
    close = (runs.start[i + 1] - runs.end[i] == 1) & (runs.start[i + 2] - runs.end[i + 1] == 1)
    return np.asarray(close & is_one_of(one, signs) & (one == two))


def _numeric(data: Bytes, runs: Runs, days: set[date]) -> list[Hit]:
    """2026-05-01, 01.05.2026, 5/1/26, 2026:05:01 and 2026_05_01."""
    n = len(runs.start) - 2
    if n <= 0:
        return []
    i = np.flatnonzero((runs.length[:n] <= 4) & (runs.length[1 : n + 1] <= 2) & (runs.length[2:] >= 1))
    a, b, c = (runs.value[i + k] for k in range(3))
    apart = _apart(data, runs, i, b"-/.:_ ")
    hits = []
    for day in sorted(days):
        y, m, d = day.year, day.month, day.day
        # A year of two digits needs the others written with two: 1.5.26 is a version as well.
        short = (runs.length[i] == 2) & (runs.length[i + 1] == 2) & (runs.length[i + 2] == 2)
        fits = (a == y) & (b == m) & ((c == d) & (runs.length[i + 2] <= 2))
        fits |= (c == y) & ((a == d) & (b == m) | (a == m) & (b == d))
        fits |= short & ((a == y % 100) & (b == m) & (c == d) | (a == d) & (b == m) & (c == y % 100))
        hits += [
            Hit(int(runs.start[k]), int(runs.end[k + 2]), "date", "a day as numbers") for k in i[fits & apart]
        ]
    return hits


def _compact(runs: Runs, days: set[date]) -> list[Hit]:
    """20260501, 01052026, and either with the time behind it: 20260501063000."""
    hits = []
    for long in (8, 10, 12, 14, 17):
        which = np.flatnonzero(runs.length == long)
        value = runs.value[which] // 10 ** (long - 8)
        wanted = [
            written
            for day in days
            for written in (
                day.year * 10_000 + day.month * 100 + day.day,
                day.day * 1_000_000 + day.month * 10_000 + day.year,
                day.month * 1_000_000 + day.day * 10_000 + day.year,
            )
        ]
        hits += [
            Hit(int(runs.start[k]), int(runs.end[k]), "date", "a day as one number")
            for k in which[np.isin(value, wanted)]
        ]
    return hits


def _named(text: str, days: set[date], secrets: Secrets) -> list[Hit]:
    """1 May 2026, May 1st, 2026, 1. mai 2026; the month and the year alone where not even that may stay."""
    hits = []
    for year, month in sorted({(day.year, day.month) for day in days}):
        name = rf"(?:{'|'.join(MONTHS[month - 1])})[^\W\d_]{{0,8}}"
        spelt = re.compile("|".join(_spellings(name, year, month, days, secrets.may_stay)), re.IGNORECASE)
        begins = re.finditer(rf"(?<![^\W\d_]){name}", text, re.IGNORECASE)
        for begin in islice(begins, MOST_NAMES):
            # A long text is looked at only where the month is named.
            match = spelt.search(text[max(begin.start() - 16, 0) : begin.end() + 16])
            if match:
                start = max(begin.start() - 16, 0) + match.start()
                end = start + len(match[0])
                hits.append(Hit(start, end, "date", "a date with the month in letters"))
    return hits


def _spellings(name: str, year: int, month: int, days: set[date], may_stay: MayStay) -> list[str]:
    """Patterns of the days of a month."""
    numbers = "|".join(rf"0?{day.day}" for day in sorted(days) if (day.year, day.month) == (year, month))
    day, gap = rf"(?<!\d)(?:{numbers})(?!\d)(?:st|nd|rd|th|\.)?", r"[\s,._/-]{0,3}(?:of |de )?"
    years = rf"(?:{year}|'?{year % 100:02d}(?!\d))"
    spelt = [rf"{day}{gap}{name}", rf"{name}{gap}{day}{gap}{years}", rf"{years}{gap}{name}{gap}{day}"]
    return spelt + ([rf"{name}{gap}{years}"] if may_stay in ("nothing", "year") else [])


def _clock_times(data: Bytes, runs: Runs, moments: Sequence[datetime]) -> list[Hit]:
    """06:30:12, to the second."""
    n = len(runs.start) - 2
    if n <= 0:
        return []
    i = np.flatnonzero((runs.length[:n] <= 2) & (runs.length[1 : n + 1] == 2) & (runs.length[2:] == 2))
    apart = _apart(data, runs, i, b":")
    clock = runs.value[i] * 3600 + runs.value[i + 1] * 60 + runs.value[i + 2]
    hits = []
    for moment in moments:
        utc = moment.astimezone(UTC)
        true = utc.hour * 3600 + utc.minute * 60 + utc.second
        # 00:00:00 is no time of day but the lack of one.
        fits = (clock == true) & (true != 0) & apart
        hits += [
            Hit(int(runs.start[k]), int(runs.end[k + 2]), "date", "a time of day, to the second")
            for k in i[fits]
        ]
    return hits


def _counted(numbers: Numbers, moments: Sequence[datetime]) -> list[Hit]:
    """Seconds, ms, us, ns since 1970 or since GPS began, and days since other beginnings."""
    hits = []
    for moment in moments:
        unix, gps = moment.timestamp(), (moment - GPS_EPOCH).total_seconds()
        ways = [
            (count * scale, DAY_S * scale, 0, f"{unit} since {since}")
            for (count, since), (scale, unit) in product(
                ((unix, "1970"), (gps, "GPS began")), ((1, "seconds"), (1e3, "ms"), (1e6, "us"), (1e9, "ns"))
            )
        ]
        for zero, add, name in DAY_ZEROS:
            days = (moment - zero).total_seconds() / DAY_S + add
            ways.append((days, 0.6, 3, name))
        for true, tolerance, decimals, name in ways:
            fits = (np.abs(numbers.value - true) <= tolerance) & (numbers.decimals >= decimals)
            fits &= numbers.half < tolerance
            hits += [
                Hit(int(s), int(e), "date", f"time as {name}")
                for s, e in zip(numbers.start[fits], numbers.end[fits], strict=True)
            ]
    return hits


def _gps(numbers: Numbers, moments: Sequence[datetime]) -> list[Hit]:
    """A GPS week and seconds (or ms) of it close by."""
    hits = []
    for moment in moments:
        seconds = (moment - GPS_EPOCH).total_seconds()
        week, of_week = int(seconds // (7 * DAY_S)), seconds % (7 * DAY_S)
        weeks = np.flatnonzero((numbers.value == week) & (numbers.decimals == 0))
        if not len(weeks):
            continue
        for scale, unit in ((1.0, "seconds"), (1e3, "ms")):
            fits = np.abs(numbers.value - of_week * scale) <= (600 + LEAP_S) * scale
            near = np.flatnonzero(fits & (numbers.digits >= DIGITS))
            for k in near:
                beside = weeks[np.abs(numbers.start[weeks] - numbers.start[k]) <= BESIDE]
                beside = beside[numbers.start[beside] != numbers.start[k]]
                if len(beside):
                    start, end = numbers.start[beside[0]], numbers.end[beside[0]]
                    hits.append(
                        Hit(
                            int(min(start, numbers.start[k])), int(max(end, numbers.end[k])),
                            "date", f"GPS week and {unit} of it",
                        )
                    )  # fmt: skip
    return hits


def _months(data: Bytes, runs: Runs, days: set[date]) -> list[Hit]:
    """2026-05 and 05/2026."""
    n = len(runs.start) - 1
    if n <= 0:
        return []
    i = np.arange(n)
    sign = data[np.minimum(runs.end[:n], len(data) - 1)]
    apart = (runs.start[1:] - runs.end[:-1] == 1) & is_one_of(sign, b"-/.:_")
    a, b, two = runs.value[:-1], runs.value[1:], (runs.length[:-1] == 2, runs.length[1:] == 2)
    hits = []
    for year, month in sorted({(day.year, day.month) for day in days}):
        fits = apart & ((a == year) & (b == month) & two[1] | (a == month) & (b == year) & two[0])
        hits += [Hit(int(runs.start[k]), int(runs.end[k + 1]), "date", "a month as numbers") for k in i[fits]]
    return hits


def _years(runs: Runs, days: set[date]) -> list[Hit]:
    """2026, alone."""
    fits = (runs.length == 4) & np.isin(runs.value, sorted({day.year for day in days}))
    return [
        Hit(int(s), int(e), "date", "a year") for s, e in zip(runs.start[fits], runs.end[fits], strict=True)
    ]
