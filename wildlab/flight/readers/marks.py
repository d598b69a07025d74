"""Surveyed points: out of KML, GeoJSON (RFC 7946), and tables that people write."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.documents import number, parse_json, read_kml, shown
from wildlab.flight.readers.log import Decoded, Readings
from wildlab.flight.readers.text import header_of, plain, read_text_table
from wildlab.paths import DATA

#: Letters of a name that are kept.
MOST_LETTERS = 200


def _decoded(
    columns: dict[str, Any],
    rows: Sequence[int],
    counted_in: str,
    lost: Sequence[tuple[int, str, str]],
    notes: Sequence[str],
) -> Decoded:
    """A log of nothing but marks: what has no place, no height or a name twice says so."""
    latitude, longitude = (np.asarray(columns[f"{one}_deg"], float) for one in ("latitude", "longitude"))
    heights = [np.asarray(columns[one], float) for one in columns if one.startswith("height_")]
    names = [printable(str(one).strip()[:MOST_LETTERS]) for one in columns["name"]]
    # Marks are counted where nothing names them.
    names = [name or str(at) for at, name in enumerate(names, 1)]
    with np.errstate(invalid="ignore"):
        unusable = {
            "no position": ~np.isfinite(latitude + longitude),
            "position that is none on Earth": (np.abs(latitude) > 90) | (np.abs(longitude) > 180),
            "placeholder of a position": (latitude == 0) & (longitude == 0),
            "a name that stands there twice": pd.Series(names, dtype=object).duplicated().to_numpy(),
            "no height": ~np.isfinite(heights).any(axis=0),
        }
    part = Readings({**columns, "name": names}, rows, counted_in, unusable)
    return Decoded({"marks": part}, lost=lost, notes=notes)


# -- KML


def kml_sniff(head: bytes, name: str) -> bool:
    """Whether a file is KML, by its first element."""
    return head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"<" and b"<kml" in head


def kml_decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """Points of placemarks; a height counts from sea level, and only where its mode is ``absolute``.

    Raises
    ------
    WildlabError
        Where it is no KML, or has no point.
    """
    found = read_kml(data, path)
    if not found.points:
        what = f"has {found.others} lines or areas and no point" if found.others else "has no point"
        raise WildlabError(what, "give placemarks with a point for each mark", file=path)
    count = len(found.points)
    longitude, latitude, height = np.array([one.rings[0][0] for one in found.points], float).T
    absolute = np.array([one.mode == "absolute" for one in found.points], bool)
    columns = {
        "name": [one.name for one in found.points],
        **{"longitude_deg": longitude, "latitude_deg": latitude},
        "height_sea_m": np.where(absolute, height, np.nan),
    }
    ground = int((~absolute & (height != 0) & np.isfinite(height)).sum())
    notes = {
        f"{ground} of {count} heights are not used: their altitudeMode is not absolute, so that they count "
        "from the ground, or not at all": ground > 0,
        f"{int((~absolute).sum())} of {count} points have no height above sea level: where theirs count from "
        "sea level, write <altitudeMode>absolute</altitudeMode> before <coordinates>; or give a table with "
        "the columns name, latitude, longitude and height_sea": not absolute.all(),
    }
    lost = [(found.others, "geometry", "besides: only points are marks")]
    return _decoded(columns, range(1, count + 1), "point", lost, [said for said in notes if notes[said]])


# -- GeoJSON

#: Properties that name a point, in this order, without regard to capitals.
PROPERTIES = ("name", "id", "label", "title", "point", "target", "target_id", "code")
#: Coordinate systems of the older standard that are the one of the newer.
SAME = ("CRS84", "EPSG:4326", "EPSG::4326", "EPSG:4979", "EPSG::4979")


def geojson_sniff(head: bytes, name: str) -> bool:
    """Whether a file is GeoJSON, by the words that it begins with."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    bare = head.translate(None, b" \n\r\t")
    kinds = (b'"FeatureCollection"', b'"type":"Feature"', b'"type":"Point"', b'"type":"MultiPoint"')
    return start == b"{" and any(one in bare for one in kinds)


def geojson_decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """Points of features: longitude, latitude and height above the ellipsoid of WGS 84.

    Raises
    ------
    WildlabError
        Where it is no GeoJSON, in another coordinate system, or has no point.
    """
    found = parse_json(data, path, plain=False).value
    own = found if isinstance(found, dict) else {}
    crs = own.get("crs")
    if crs is not None and not any(one in json.dumps(crs)[:2000] for one in SAME):
        raise WildlabError(
            f"is in another coordinate system: {shown(crs)}",
            "export it in WGS 84 (EPSG:4326), as the standard has it",
            file=path,
            field="crs",
        )
    listed = own.get("features", [own])
    rows: list[tuple[str, list[float], int]] = []
    others = broken = 0
    for at, one in enumerate(listed if isinstance(listed, list) else [], 1):
        feature = one if isinstance(one, dict) else {}
        geometry = feature.get("geometry") if feature.get("type") == "Feature" else feature
        for place in _points(geometry):
            others += place is None
            broken += place == []
            rows += [(_name(feature), place, at)] if place else []
    if not rows:
        what = f"has {others} other geometries and no point" if others else "has no point"
        raise WildlabError(what, "give a feature with a point for each mark", file=path)
    longitude, latitude, height = np.array([place for _, place, _ in rows], float).T
    columns = {
        "name": [name for name, _, _ in rows],
        **{"longitude_deg": longitude, "latitude_deg": latitude, "height_ellipsoid_m": height},
    }
    lost = [
        (others, "geometry", "besides: only points are marks"),
        (broken, "feature", "without a geometry that can be read"),
    ]
    said = ["heights count from the ellipsoid, as the standard of GeoJSON has them"]
    return _decoded(
        columns, [at for _, _, at in rows], "feature", lost, said if np.isfinite(height).any() else []
    )


def _points(geometry: Any, deep: int = 0) -> Iterator[list[float] | None]:
    """Places of a geometry; an empty one where it is broken, None where it is another geometry."""
    own = geometry if isinstance(geometry, dict) else {}
    kind, given, inner = own.get("type"), own.get("coordinates"), own.get("geometries")
    if kind == "GeometryCollection" and isinstance(inner, list) and deep < 5:
        for one in inner:
            yield from _points(one, deep + 1)
    elif kind in ("Point", "MultiPoint"):
        for one in given if kind == "MultiPoint" and isinstance(given, list) else [given]:
            place = [number(part) for part in one[:3]] if isinstance(one, list) else []
            yield [*place, np.nan][:3] if len(place) > 1 else []
    else:
        yield [] if kind is None else None


def _name(feature: dict[str, Any]) -> str:
    properties = feature.get("properties")
    own = {str(key).lower(): one for key, one in properties.items()} if isinstance(properties, dict) else {}
    for value in (*(own.get(one) for one in PROPERTIES), feature.get("id")):
        if isinstance(value, str) and value.strip():
            return value
        if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**15:
            return str(value)
    return ""


# -- tables

#: Headings by what they mean, as `plain` has them: data/headings.toml.
HEADINGS: dict[str, list[str]] = tomllib.loads((DATA / "headings.toml").read_text("utf-8"))
#: Words in a height's name, and what it then counts from.
ELLIPSOID, SEA, HIGH, METRES = (frozenset(HEADINGS[one]) for one in ("ellipsoid", "sea", "height", "metres"))
#: What a table of marks has none of: it is over time.
TIMES = frozenset(
    {"time", "date", "datetime", "timestamp", "stamp", "utc", "gpst", "tow", "epoch", "millisecond"}
)
_DEG = ("", "_deg", "_degrees", "_dd", "_wgs84", "_decimal", "_decimal_degrees", "_decimaldegree")


def _find(names: list[str], meaning: str, endings: Sequence[str] = _DEG) -> int | None:
    every = [f"{one}{end}" for one in HEADINGS.get(meaning, [meaning]) for end in endings]
    return next((names.index(one) for one in every if one in names), None)


def _metres(names: list[str]) -> int:
    """How many coordinates are in metres; nothing says which projection they are of."""
    return len(METRES & {one.removesuffix("_m") for one in names})


def table_sniff(head: bytes, name: str) -> bool:
    """Whether a file is a table without times that has latitudes and longitudes, or names points and has
    metres of a projection, which `table_decode` refuses with what to do."""
    names = header_of(head)
    places = _find(names, "latitude") is not None and _find(names, "longitude") is not None
    projected = _metres(names) == 2 and bool(set(HEADINGS["name"]) & set(names))
    return (places or projected) and not any(TIMES & set(one.split("_")) for one in names)


def table_decode(path: Path, data: bytes, zone: str | None = None) -> Decoded:
    """Rows of a table as marks: names, latitudes and longitudes in degrees, and heights.

    Raises
    ------
    WildlabError
        Where a column for the latitude or longitude is missing, or none says what heights count from.
    """
    table = read_text_table(data, path)
    names = [plain(one) for one in table.header]
    there = printable(", ".join(table.header[:12]))[:200]
    north, east = _find(names, "latitude"), _find(names, "longitude")
    if north is None or east is None:
        fix = "name two columns latitude and longitude, in degrees of WGS 84"
        what = f"has no latitude and longitude: {there}"
        if _metres(names):
            what = f"has eastings and northings and no degrees: {there}"
            fix = f"convert them (nothing here says which projection they are of), and {fix}"
        raise WildlabError(what, fix, file=path)
    words = {at: set(name.split("_")) for at, name in enumerate(names) if at not in (north, east)}
    ways = (("height_ellipsoid_m", ELLIPSOID, HIGH), ("height_sea_m", SEA, HIGH | SEA))
    found = (
        (at, kind) for kind, one, other in ways for at, own in words.items() if own & one and own & other
    )
    high, kind = next(found, (None, ""))
    if high is None:
        bare = next((printable(table.header[at]) for at, own in words.items() if own & HIGH), None)
        raise WildlabError(
            f"the column {bare!r} does not say what its heights count from, as height_ellipsoid does"
            if bare
            else f"has no column of heights: {there}",
            "name it height_ellipsoid or height_sea, in metres",
            file=path,
            field=bare,
        )
    who = _find(names, "name", [""])
    columns: dict[str, Any] = {"name": ["" if who is None else row[who] for row in table.rows]}
    columns |= {"latitude_deg": table.numbers(north), "longitude_deg": table.numbers(east)}
    columns[kind] = table.numbers(high)
    for spread in ("sd_horizontal", "sd_vertical"):
        at = _find(names, spread, ["_m", ""])
        if at is not None:
            own = table.numbers(at)
            columns[f"{spread}_m"] = np.where(own > 0, own, np.nan)
    from_ = "the ellipsoid" if kind == "height_ellipsoid_m" else "sea level"
    notes = [f"heights count from {from_}, by the column {printable(table.header[high])!r}"]
    return _decoded(columns, table.lines, "line", table.lost(), notes)
