"""Units a recipe may name, in radians, metres, seconds, pixels, microtesla; time zones and scales of time."""

from __future__ import annotations

import math
import re
import zoneinfo
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.gravity import STANDARD_GRAVITY

Dimension = Literal["angle", "length", "speed", "acceleration", "rate", "pixel", "time", "field"]

UNITS: dict[Dimension, dict[str, float]] = {
    "angle": {"deg": math.radians(1), "rad": 1.0, "deg-e7": math.radians(1e-7)},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "km/h": 1 / 3.6, "ft/s": 0.3048, "kn": 1852 / 3600},
    "acceleration": {"m/s2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ft/s2": 0.3048},
    "rate": {"rad/s": 1.0, "deg/s": math.radians(1), "mrad/s": 1e-3, "deg/h": math.radians(1) / 3600},
    # A proportion counts from 0 at the left or upper edge to 1 at the other.
    "pixel": {"px": 1.0, "proportion-of-width": math.nan, "proportion-of-height": math.nan},
    # To microtesla.
    "field": {"uT": 1.0, "nT": 1e-3, "T": 1e6, "G": 100.0, "mG": 0.1},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}


def other_units(dimension: Dimension) -> dict[str, float]:
    """The units of a dimension that are not the one that is used inside, with what takes a value to that one.

    Examples
    --------
    >>> sorted(other_units("rate"))
    ['deg/h', 'deg/s', 'mrad/s']
    """
    return {unit: to for unit, to in UNITS[dimension].items() if to != 1}


def factor(unit: str, dimension: Dimension, width_px: float = math.nan, height_px: float = math.nan) -> float:
    """What to multiply by; the size of the image is only needed for proportions of it.

    Raises
    ------
    ValueError
        ``"problem; fix"`` where the unit is not one, or not one of this dimension.
    """
    if unit not in UNITS[dimension]:
        known = ", ".join(UNITS[dimension])
        elsewhere = [name for name, units in UNITS.items() if unit in units]
        what = (
            f"{unit!r} is a unit of {elsewhere[0]}, not of {dimension}"
            if elsewhere
            else f"{unit!r} is not a unit"
        )
        raise ValueError(f"{what}; use one of {known}")
    if unit == "proportion-of-width":
        return width_px
    if unit == "proportion-of-height":
        return height_px
    return UNITS[dimension][unit]


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
