"""Time scales and zones: GPS time, UTC and wall clocks."""

from __future__ import annotations

import re
import zoneinfo
from datetime import UTC, datetime, timedelta, timezone, tzinfo

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]

#: 1980-01-06, when both were alike, in s since 1970.
GPS_START_S = 315964800.0
WEEK_S = 604800.0
#: First days on which UTC was one second further behind GPS time (IERS Bulletin C); none is announced since.
LEAP_DAYS = (
    *("1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01"),
    *("1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01"),
    *("2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"),
)
#: The same in s since 1970, UTC.
_STARTS = np.array([datetime.fromisoformat(day).replace(tzinfo=UTC).timestamp() for day in LEAP_DAYS])


def gps_to_utc(gps_s: ArrayLike) -> Array:
    """UTC in s since 1970 of GPS time (...) in s since 6 January 1980.

    Parameters
    ----------
    gps_s
        (...) s: weeks times 604800, and the time of week.

    Returns
    -------
    (...) s since 1970

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> datetime.fromtimestamp(float(gps_to_utc(1867 * 604800 + 16)), UTC).isoformat()
    '2015-10-17T23:59:59+00:00'
    """
    counted = np.asarray(gps_s, float) + GPS_START_S
    # A leap second begins where GPS time, too, is ahead by it.
    behind = np.searchsorted(_STARTS + np.arange(1, len(_STARTS) + 1), counted, side="right")
    return np.where(np.isnan(counted), np.nan, counted - behind)


def week_to_utc(week: ArrayLike, time_of_week_s: ArrayLike) -> Array:
    """UTC in s since 1970 of a GPS week (...) and the s since it began (...)."""
    return gps_to_utc(np.asarray(week, float) * WEEK_S + np.asarray(time_of_week_s, float))


def find_zone(text: str, field: str = "zone") -> tzinfo:
    """A time zone by its IANA name, or as a fixed offset such as ``+02:00``.

    Parameters
    ----------
    text
        As a person gives it.
    field
        Who asks, for messages.

    Returns
    -------
    tzinfo

    Raises
    ------
    WildlabError
        Where it is neither.

    Examples
    --------
    >>> find_zone("-03:30").utcoffset(None)
    datetime.timedelta(days=-1, seconds=73800)
    """
    fixed = re.fullmatch(r"([+-])(0[0-9]|1[0-4]):([0-5][0-9])", text)
    if fixed:
        size = timedelta(hours=int(fixed[2]), minutes=int(fixed[3]))
        return timezone(-size if fixed[1] == "-" else size)
    try:
        return zoneinfo.ZoneInfo(text)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise WildlabError(
            f"{text[:60]!r} is not a time zone",
            "write UTC, Europe/Oslo, or +02:00",
            field=field,
        ) from None


def wall_to_utc(wall_s: ArrayLike, zone: str) -> NDArray[np.float64]:
    """UTC of wall clocks, s since 1970.

    Parameters
    ----------
    wall_s
        (...) what the clock showed, in s since 1970 as if it were UTC; NaN stays NaN. Of an hour that a zone
        has twice, the first is taken.
    zone
        As of `find_zone`.

    Returns
    -------
    (...)

    Raises
    ------
    WildlabError
        Where the zone is none.

    Examples
    --------
    >>> float(wall_to_utc(1718191800.0, "Europe/Oslo"))
    1718184600.0
    """
    found = find_zone(zone)
    wall = np.asarray(wall_s, float)

    def shift(one: float) -> float:
        if not np.isfinite(one):
            return np.nan
        try:
            there = datetime.fromtimestamp(one, UTC).replace(tzinfo=found)
            return (there.utcoffset() or timedelta()).total_seconds()
        except (ValueError, OverflowError, OSError):
            return np.nan

    ahead = np.array([shift(float(one)) for one in wall.ravel()]).reshape(wall.shape)
    return np.asarray(wall - ahead)


#: First and last stamp, s.
Span = tuple[float, float]
