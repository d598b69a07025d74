"""Surveyed points out of a table: names, latitudes and longitudes in degrees, and heights."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.logs.log import RawLog
from wildlab.flight.readers.marks.marks import marks_log, marks_part
from wildlab.flight.readers.marks.text_table import (
    header_of,
    plain,
    read_text_table,
    said_of_short,
    to_number,
)
from wildlab.paths import DATA

#: Headings by what they mean, as `plain` has them: data/headings.toml.
HEADINGS: dict[str, list[str]] = tomllib.loads((DATA / "headings.toml").read_text("utf-8"))
NAMES, LATITUDES, LONGITUDES = (tuple(HEADINGS[one]) for one in ("name", "latitude", "longitude"))
#: Words in a height's name, and what it then counts from.
ELLIPSOID, SEA, HIGH = (frozenset(HEADINGS[one]) for one in ("ellipsoid", "sea", "height"))
METRES = frozenset(HEADINGS["metres"])
#: What a table of marks has none of: it is over time.
TIMES = frozenset(
    {"time", "date", "datetime", "timestamp", "stamp", "utc", "gpst", "tow", "epoch", "millisecond"}
)
_DEG = ("", "_deg", "_degrees", "_dd", "_wgs84", "_decimal", "_decimal_degrees", "_decimaldegree")


def _find(names: list[str], known: tuple[str, ...]) -> int | None:
    every = [f"{one}{end}" for one in known for end in _DEG]
    return next((names.index(one) for one in every if one in names), None)


def _over_time(names: list[str]) -> bool:
    return any(TIMES & set(one.split("_")) for one in names)


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is a table without times that has latitudes and longitudes, or names points and has
    metres of a projection, which `read` refuses with what to do."""
    names = header_of(head)
    places = _find(names, LATITUDES) is not None and _find(names, LONGITUDES) is not None
    return (places or _projected(names)) and not _over_time(names)


def _projected(names: list[str]) -> bool:
    """Whether points have names and two coordinates in metres; nothing says which projection they are of."""
    return len(METRES & {_bare(one) for one in names}) == 2 and bool(set(NAMES) & set(names))


def _bare(name: str) -> str:
    return name.removesuffix("_m")


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Rows of a table as marks.

    Raises
    ------
    WildlabError
        Where a column for the latitude or longitude is missing, or none says what heights count from.
    """
    table = read_text_table(data, path)
    names = [plain(one) for one in table.header]
    there = printable(", ".join(table.header[:12]))[:200]
    north, east = _find(names, LATITUDES), _find(names, LONGITUDES)
    if north is None or east is None:
        fix = "name two columns latitude and longitude, in degrees of WGS 84"
        if METRES & {_bare(one) for one in names}:
            raise WildlabError(
                f"has eastings and northings and no degrees: {there}",
                f"convert them (nothing here says which projection they are of), and {fix}",
                file=path,
            )
        raise WildlabError(f"has no latitude and longitude: {there}", fix, file=path)
    high, kind = _height(names, table.header, {north, east}, path, there)

    def values(column: int) -> list[float]:
        return [to_number(row[column], table.comma) for row in table.rows]

    who = next((names.index(one) for one in NAMES if one in names), None)
    columns = {
        "name": ["" if who is None else row[who] for row in table.rows],
        "latitude_deg": values(north),
        "longitude_deg": values(east),
        kind: values(high),
    }
    for spread in ("sd_horizontal", "sd_vertical"):
        at = next((names.index(one) for one in (f"{spread}_m", spread) if one in names), None)
        if at is not None:
            own = np.array(values(at))
            columns[f"{spread}_m"] = np.where(own > 0, own, np.nan)
    part = marks_part(columns, table.lines, "line")
    from_ = "the ellipsoid" if kind == "height_ellipsoid_m" else "sea level"
    notes = [f"heights count from {from_}, by the column {printable(table.header[high])!r}"]
    return marks_log("marks-csv", part, said_of_short(table), notes)


def _height(names: list[str], header: list[str], others: set[int], path: Path, there: str) -> tuple[int, str]:
    """Column of the heights, and the one of the part that they belong to."""
    words = {at: set(name.split("_")) for at, name in enumerate(names) if at not in others}
    for at, own in words.items():
        if own & ELLIPSOID and own & HIGH:
            return at, "height_ellipsoid_m"
    for at, own in words.items():
        if own & SEA and own & (HIGH | SEA):
            return at, "height_sea_m"
    plain_one = next((printable(header[at]) for at, own in words.items() if own & HIGH), None)
    raise WildlabError(
        f"the column {plain_one!r} does not say what its heights count from, as height_ellipsoid does"
        if plain_one
        else f"has no column of heights: {there}",
        "name it height_ellipsoid or height_sea, in metres",
        file=path,
        field=plain_one,
    )
