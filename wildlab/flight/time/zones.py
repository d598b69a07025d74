"""Wall clocks without a zone: which zone a person means, and the UTC of local times."""

from __future__ import annotations

import re
import zoneinfo
from datetime import UTC, datetime, timedelta, timezone, tzinfo

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError


def find_zone(text: str) -> tzinfo:
    """A time zone by its IANA name, or as a fixed offset such as ``+02:00``.

    Parameters
    ----------
    text
        As a person gives it.

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
            "give UTC, a name as Europe/Oslo, or an offset as +02:00",
            field="zone",
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
