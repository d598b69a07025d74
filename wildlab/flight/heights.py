"""What heights count from, and how those of several logs are brought to one reference, never by a guess."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import Stream
from wildlab.geometry.frames import Array
from wildlab.names import listed

#: Heights above the geoid of EGM96, and what to do where PROJ's grid of it is not there.
EGM96 = "EPSG:4326+5773"
NO_GRID = "no grid of EGM96 is installed (`projsync --file us_nga_egm96_15`)"
#: The geoid is nowhere further from the ellipsoid than this, m.
FARTHEST_M = 110.0
#: A column of heights is there where so large a share of the rows used has it.
MOST = 0.9

_COUNTED = {
    "height_ellipsoid_m": "the ellipsoid",
    "height_sea_m": "sea level",
    "height_home_m": "take-off",
}


class HeightUse(NamedTuple):
    """Which heights of a stream are used: the column, m to add to each, and why, in a clause."""

    column: str
    add_m: float
    reason: str


class HeightPlan(NamedTuple):
    """One reference for the heights of a flight.

    Attributes
    ----------
    reference
        What they all count from then.
    uses
        By the streams' names.
    without
        Names of streams that have places and no heights.
    """

    reference: str
    uses: dict[str, HeightUse]
    without: tuple[str, ...] = ()


def undulation(latitude_deg: float, longitude_deg: float, heights: Any = EGM96) -> float | None:
    """How far that which heights count from is above the ellipsoid of WGS84 at a place, by a grid of PROJ.

    Parameters
    ----------
    latitude_deg, longitude_deg
        Of WGS84.
    heights
        A CRS with heights.

    Returns
    -------
    m; None where no grid is installed, or it does not reach there. Nothing is fetched.
    """
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    crs = CRS.from_user_input(heights)
    try:
        flat = Transformer.from_crs(CRS.from_epsg(4326), crs.to_2d(), always_xy=True)
        up = Transformer.from_crs(crs, CRS.from_epsg(4979), always_xy=True, allow_ballpark=False)
        found = float(up.transform(*flat.transform(longitude_deg, latitude_deg), 0.0)[2])
    except ProjError:  # no grid, or a file that is none
        return None
    return found if np.isfinite(found) and abs(found) <= FARTHEST_M else None


def choose_reference(
    streams: Mapping[str, Stream],
    own: Collection[str] = (),
    geoid_m: float | None = None,
    home_sea_m: float | None = None,
) -> HeightPlan:
    """One reference for heights: the ellipsoid where all streams can get there, else sea level, else refused.

    From sea level to the ellipsoid leads the geoid's height: as stated, else as a receiver of these streams
    logged it (the stream's own first), else PROJ's grid. From take-off to sea level leads the first used fix
    of the own flight, or what is stated.

    Parameters
    ----------
    streams
        By a name for messages; those without places and heights are passed over.
    own
        Names of the streams of one vehicle: heights above take-off are tied by these alone.
    geoid_m
        Height of the geoid above the ellipsoid there, stated, m.
    home_sea_m
        Height of the take-off above sea level, stated, m.

    Returns
    -------
    HeightPlan
        No sentence in it says how high the geoid is: that tells of a place.

    Raises
    ------
    WildlabError
        Where there is no one reference for all; it names streams, and what to state.
    """
    there = {name: _columns(stream) for name, stream in streams.items()}
    placed = [name for name, stream in streams.items() if "latitude_deg" in stream.columns]
    names = [name for name in streams if there[name]]
    without = tuple(name for name in placed if not there[name])
    ways: dict[str, dict[str, HeightUse]] = {name: {} for name in names}
    for name in names:
        for kind in ("ellipsoid", "sea"):
            column = f"height_{kind}_m"
            if column in there[name]:
                ways[name][kind] = HeightUse(column, 0.0, f"counts from {_COUNTED[column]}")
    for name in names:
        if not ways[name]:
            tied = _tie(name, streams, there, [one for one in own if one in names], home_sea_m)
            if name in own and tied is not None:
                ways[name][tied[0]] = tied[1]
    homeless = [name for name in names if not ways[name]]
    if homeless:
        raise WildlabError(
            f"the heights of {listed(homeless)} count from take-off of unknown height",
            "state the take-off's height above sea level",
            field="heights",
        )
    geoid = {name: _geoid(name, streams, geoid_m) for name in names}
    for name in names:
        found = geoid[name]
        if found is None:
            continue
        way = ways[name]
        for has, lacks, sign, done in (
            ("sea", "ellipsoid", 1, "added"),
            ("ellipsoid", "sea", -1, "taken off"),
        ):
            if lacks not in way:
                reason = f"{way[has].reason}, and the geoid's height {found[1]} is {done}"
                way[lacks] = way[has]._replace(add_m=way[has].add_m + sign * found[0], reason=reason)
    for reference in ("ellipsoid", "sea"):
        if all(reference in ways[name] for name in names):
            return HeightPlan(reference, {name: ways[name][reference] for name in names}, without)
    low = [name for name in names if "ellipsoid" not in ways[name]]
    high = [name for name in names if "sea" not in ways[name]]
    raise WildlabError(
        f"the heights of {listed(low)} count from sea level, those of {listed(high)} from the ellipsoid",
        f"state the geoid's height above the ellipsoid; {NO_GRID}",
        field="heights",
    )


def _columns(stream: Stream) -> list[str]:
    """Columns of heights that most of the rows used have, or of all rows where none is used."""
    rows = stream.used if stream.used.any() else np.ones(len(stream), bool)
    return [
        name
        for name in _COUNTED
        if name in stream.columns and len(stream) and np.isfinite(_of(stream, name)[rows]).mean() >= MOST
    ]


def _of(stream: Stream, column: str) -> Array:
    return np.asarray(stream.columns[column], float)


def _geoid(name: str, streams: Mapping[str, Stream], stated: float | None) -> tuple[float, str] | None:
    """The geoid's height for a stream, and where it is from."""
    if stated is not None:
        return stated, "as stated"
    for other in sorted(streams, key=lambda one: one != name):
        logged = _logged(streams[other])
        if logged is not None:
            return logged, f"as {'its own receiver' if other == name else other} has it"
    stream = streams[name]
    if {"latitude_deg", "longitude_deg"} <= stream.columns.keys():
        rows = stream.used
        latitude, longitude = (_of(stream, f"{axis}_deg")[rows] for axis in ("latitude", "longitude"))
        good = np.isfinite(latitude) & np.isfinite(longitude)
        if good.any():
            grid = undulation(float(np.median(latitude[good])), float(np.median(longitude[good])))
            return None if grid is None else (grid, "of EGM96")
    return None


def _logged(stream: Stream) -> float | None:
    """The geoid's height as a receiver has it; None where it has none, or a placeholder."""
    rows, columns = stream.used, stream.columns
    if "undulation_m" in columns:
        values = _of(stream, "undulation_m")[rows]
        values = values[np.isfinite(values) & (np.abs(values) <= FARTHEST_M) & (values != 0)]
        if len(values):
            return float(np.median(values))
    if {"height_ellipsoid_m", "height_sea_m"} <= columns.keys():
        apart = (_of(stream, "height_ellipsoid_m") - _of(stream, "height_sea_m"))[rows]
        apart = apart[np.isfinite(apart) & (np.abs(apart) <= FARTHEST_M)]
        # Two columns of the very same numbers are one reference written down twice.
        if len(apart) and (apart != 0).any():
            return float(np.median(apart))
    return None


def _tie(
    name: str,
    streams: Mapping[str, Stream],
    there: Mapping[str, list[str]],
    own: list[str],
    stated: float | None,
) -> tuple[str, HeightUse] | None:
    """What leads from heights above take-off to another reference."""
    column = "height_home_m"
    if stated is not None:
        use = HeightUse(column, stated, "counts from take-off, as stated")
        return "sea", use
    home = streams[name]
    for reference in ("sea", "ellipsoid"):
        fixed = f"height_{reference}_m"
        # A column that is there in too few rows to be used may still have the first fix.
        for other in [name, *(one for one in own if one != name)]:
            if fixed not in streams[other].columns or (other != name and fixed not in there[other]):
                continue
            apart = _first_fix(home, streams[other], fixed)
            if apart is not None:
                at = "its own first used fix" if other == name else f"the first used fix of {other}"
                counted = _COUNTED[fixed]
                return reference, HeightUse(column, apart, f"counts from take-off, tied to {counted} by {at}")
    return None


def _first_fix(home: Stream, fixes: Stream, fixed: str) -> float | None:
    """Height of the fix minus that above take-off, at the first used fix that both know."""
    above = np.where(home.used, _of(home, "height_home_m"), np.nan)
    height = np.where(fixes.used, _of(fixes, fixed), np.nan)
    if home is not fixes:
        clocks = [
            one for one in ("time_s", "time_log_s") if {one} <= home.columns.keys() & fixes.columns.keys()
        ]
        clock = next((one for one in clocks if np.isfinite(_of(home, one)[home.used]).any()), None)
        if clock is None:
            return None
        known = np.isfinite(above) & np.isfinite(_of(home, clock))
        stamps = _of(home, clock)[known]
        above = np.interp(_of(fixes, clock), stamps, above[known], left=np.nan, right=np.nan)
    both = np.flatnonzero(np.isfinite(above) & np.isfinite(height))
    return float(height[both[0]] - above[both[0]]) if len(both) else None
