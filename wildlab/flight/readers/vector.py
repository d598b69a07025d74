"""Areas and surveyed points out of KML, GeoJSON (RFC 7946) and tables that people write.

Positions are longitude and latitude of WGS84; the member ``crs`` of GeoJSON's older draft is taken where it
says the same. Of KML, points and polygons of placemarks are read, and nothing that a file could ask for; a
height counts from sea level, and only where its mode is ``absolute``. Those of GeoJSON count from the
ellipsoid.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from pydantic import BaseModel, Field

from wildlab.errors import WildlabError
from wildlab.flight.files import check_model, printable, read_regular
from wildlab.flight.readers.log import RawLog, Stream, holding
from wildlab.flight.readers.text import (
    Loss,
    Real,
    Several,
    header_of,
    parse_json,
    parse_xml,
    plain,
    read_text_table,
    told,
)
from wildlab.geometry.frames import (
    Array,
    Origin,
    ecef_to_geodetic,
    geodetic_to_ecef,
    geodetic_to_ned,
    ned_to_geodetic,
)
from wildlab.paths import DATA

#: Letters of a name that are kept.
MOST_LETTERS = 200


class Place(NamedTuple):
    """A point or a polygon.

    `rings`: (K, 3) longitude and latitude in degrees, height in m or NaN; the outer one first, of a point one
    with a single row. `row`: which feature of the file it is of, from 1. `properties`: of the feature.
    """

    name: str
    is_point: bool
    rings: list[Array]
    row: int
    properties: dict[str, Any]


def read_places(data: bytes, path: Path) -> tuple[list[Place], int]:
    """Points and polygons of a KML or GeoJSON file, and how many geometries it has besides.

    Raises
    ------
    WildlabError
        Where it is neither, or something in it is wrong; `path` is for messages.
    """
    start = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
    if start[:4] == b"PK\x03\x04":
        raise WildlabError("is a zip, as KMZ is", "unpack it, and give the KML inside", file=path)
    return _kml(data, path) if start[:1] == b"<" else _geojson(data, path)


def _kml(data: bytes, path: Path) -> tuple[list[Place], int]:
    root = parse_xml(data, path, "KML")
    if root.tag != "kml":
        raise WildlabError("is XML, and no KML", "export it as KML or GeoJSON", file=path)
    found: list[Place] = []
    for row, mark in enumerate(root.iter("Placemark"), 1):
        name = (mark.findtext("name") or "")[:MOST_LETTERS]
        for kind in ("Point", "Polygon"):
            for one in mark.iter(kind):
                holes = [each for hole in one.iter("innerBoundaryIs") for each in hole.iter("coordinates")]
                outline = [each for each in one.iter("coordinates") if each not in holes][:1]
                rings = [_ring(each.text or "", path) for each in (*outline, *holes)]
                if not outline or not len(rings[0]):
                    raise WildlabError(f"a {kind} has no coordinates", "export it anew", file=path)
                if (one.findtext("altitudeMode") or "").strip() != "absolute":
                    rings[0][:, 2] = np.nan
                found.append(Place(name, kind == "Point", rings, row, {}))
    return found, sum(1 for one in root.iter() if one.tag in ("LineString", "Track", "Model"))


def _ring(words: str, path: Path) -> Array:
    """(K, 3) of the text of an element ``coordinates``; a height that is not there is NaN."""
    places = []
    for word in words.split():
        parts = word.split(",")
        try:
            high = float(parts[2]) if len(parts) > 2 and parts[2] else math.nan
            places.append((float(parts[0]), float(parts[1]), high))
        except (ValueError, IndexError):
            problem = f"{printable(word)[:40]!r} is no coordinate"
            fix = "give longitude,latitude without blanks"
            raise WildlabError(problem, fix, file=path, field="coordinates") from None
    return np.array(places, float).reshape(-1, 3)


# -- GeoJSON

#: What the older member `crs` may say.
WGS84 = re.compile(r"(urn:ogc:def:crs:)?(OGC:(1\.3)?:?CRS84|EPSG:([\d.]*:)?(4326|4979))", re.IGNORECASE)
#: Properties that name a feature, in this order, without regard to capitals.
PROPERTIES = ("name", "id", "label", "title", "point", "target", "target_id", "code")
Position = Annotated[Several[Real], Field(min_length=2, max_length=4)]
Rings = Annotated[Several[Several[Position]], Field(min_length=1)]


class Point(BaseModel):
    """One place."""

    type: Literal["Point"]
    coordinates: Position


class MultiPoint(BaseModel):
    """Places."""

    type: Literal["MultiPoint"]
    coordinates: Several[Position]


class Polygon(BaseModel):
    """One polygon."""

    type: Literal["Polygon"]
    coordinates: Rings


class MultiPolygon(BaseModel):
    """Polygons."""

    type: Literal["MultiPolygon"]
    coordinates: Several[Rings]


class Lines(BaseModel):
    """What is not read."""

    type: Literal["LineString", "MultiLineString"]


class Geometries(BaseModel):
    """Geometries together."""

    type: Literal["GeometryCollection"]
    geometries: Several[Geometry]


Geometry = Annotated[
    Point | MultiPoint | Polygon | MultiPolygon | Lines | Geometries, Field(discriminator="type")
]


class Feature(BaseModel):
    """A geometry with its properties."""

    geometry: Geometry | None
    properties: dict[str, Any] | None = None
    id: Any = None


class CrsName(BaseModel):
    """Of the older draft."""

    name: str


class NamedCrs(BaseModel):
    """Of the older draft."""

    properties: CrsName


class Features(BaseModel):
    """A FeatureCollection."""

    features: Several[Feature]
    crs: NamedCrs | None = None


def _geojson(data: bytes, path: Path) -> tuple[list[Place], int]:
    content = parse_json(data, path, "GeoJSON")
    kind = content.get("type") if isinstance(content, dict) else None
    if kind != "FeatureCollection":
        feature = content if kind == "Feature" else {"geometry": content}
        content = {"features": [feature], "crs": content.get("crs") if kind else None}
    given = check_model(Features, content, path)
    if given.crs and not WGS84.fullmatch(given.crs.properties.name.strip().replace("::", ":")):
        problem = f"is in {printable(given.crs.properties.name)[:60]}, and WGS84 is wanted"
        fix = "convert it to EPSG:4326"
        raise WildlabError(problem, fix, file=path, field="crs")
    found: list[Place] = []
    others = 0
    for row, one in enumerate(given.features, 1):
        own = one.properties or {}
        about = {key.lower(): value for key, value in own.items()}
        named = (*(about.get(key) for key in PROPERTIES), one.id)
        name = next(
            (str(word) for word in named if word not in (None, "") and isinstance(word, str | int)), ""
        )
        for each in _taken_apart(one.geometry):
            if isinstance(each, Lines):
                others += 1
                continue
            several = each.coordinates if each.type.startswith("Multi") else [each.coordinates]
            is_point = each.type.endswith("Point")
            for part in several:
                rings: Any = [[part]] if is_point else part
                found.append(Place(name, is_point, [_positions(ring) for ring in rings], row, own))
    return found, others


def _taken_apart(given: Any) -> Iterator[Any]:
    if isinstance(given, Geometries):
        for one in given.geometries:
            yield from _taken_apart(one)
    elif given is not None:
        yield given


def _positions(ring: list[list[float]]) -> Array:
    return np.array([[*one, np.nan][:3] for one in ring], float).reshape(-1, 3)


# -- areas

#: The most bytes of a file that are read.
MOST_BYTES = 20_000_000
MOST_AREAS = 500
#: The most letters of an area's name.
MOST_OF_NAME = 60
#: Metres from the middle of all areas beyond which they are no one place to be flown over.
FURTHEST = 50_000.0
#: The most points of a ring; a surveyor's fence has hundreds.
MOST_POINTS = 5_000
#: Square metres below which a ring is a slip of the pen.
LEAST_AREA = 1.0
#: Sine of the angle below which a side that turns back lies on the one before it.
STRAIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class Area:
    """An area to be searched.

    Attributes
    ----------
    name
        Printable, and of no other area of the file.
    outline
        (K, 2) metres north and east in n, not closed.
    holes
        Of the same kind: what lies in them is not searched.
    animals
        How many live there, where the file says so (property ``animals``); NaN where it does not.
    """

    name: str
    outline: Array
    holes: tuple[Array, ...] = ()
    animals: float = math.nan

    @property
    def size(self) -> float:
        """Square metres, without the holes."""
        return ring_area(self.outline) - sum(ring_area(hole) for hole in self.holes)


class Areas(NamedTuple):
    """All areas of a file, and where n begins.

    Attributes
    ----------
    areas
        In the order of the file.
    origin
        Latitude, longitude (radians), height above the ellipsoid (zero, metres).
    """

    areas: tuple[Area, ...]
    origin: Origin


def read_areas(path: Path) -> Areas:
    """Areas of a GeoJSON or KML file.

    Parameters
    ----------
    path
        The kind is known by the content.

    Returns
    -------
    Areas
        In frame n about their middle.

    Raises
    ------
    WildlabError
        Where the file cannot be read or an outline cannot be planned with; the message names the area.
    """
    try:
        data = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    return parse_areas(data, path)


def parse_areas(data: bytes, path: Path) -> Areas:
    """The same from the content of a file; `path` is only for messages.

    Raises
    ------
    WildlabError
        As `read_areas`.
    """
    found = [one for one in read_places(data, path)[0] if not one.is_point]
    if not 0 < len(found) <= MOST_AREAS:
        fix = "draw each area as a polygon"
        many = f"{len(found):,} polygons, and {MOST_AREAS} are the most" if found else "no polygon"
        raise WildlabError(f"has {many}", fix, file=path)
    names = _names([one.name for one in found])
    animals = [_animals(one, found, path) for one in found]
    rings = [
        [checked_ring(ring[:, :2], _what(name, number), path) for number, ring in enumerate(one.rings)]
        for name, one in zip(names, found, strict=True)
    ]
    origin = _middle(np.concatenate([ring for each in rings for ring in each]))
    areas = []
    for name, count, each in zip(names, animals, rings, strict=True):
        local = []
        for number, ring in enumerate(each):
            lon, lat = np.radians(ring).T
            local.append(np.asarray(geodetic_to_ned(lat, lon, 0.0, origin)[:, :2]))
            _check_shape(local[-1], _what(name, number), path)
        areas.append(Area(name, local[0], tuple(local[1:]), count))
        _refuse(areas[-1].size <= 0, f"the holes of {name} are larger than it is", "check the rings", path)
    return Areas(tuple(areas), origin)


def _refuse(wrong: Any, problem: str, fix: str, path: Path) -> None:
    if wrong:
        raise WildlabError(problem, fix, file=path)


def _what(name: str, ring: int) -> str:
    return f"the outline of {name}" if ring == 0 else f"hole {ring} of {name}"


def _animals(one: Place, every: list[Place], path: Path) -> float:
    """How many live there; parts of a feature cannot share them: sizes are not known yet."""
    count = one.properties.get("animals")
    if count is None:
        return math.nan
    parts = sum(other.row == one.row for other in every)
    if parts > 1:
        problem = (
            f"{printable(one.name)} has {printable(str(count))[:40]} animals in {parts} polygons together"
        )
        raise WildlabError(problem, "make each polygon a Feature of its own", file=path, field="animals")
    if isinstance(count, bool) or not isinstance(count, int | float) or not 0 <= count < 1e9:
        problem = f"an area has {printable(str(count))[:40]!r} animals"
        raise WildlabError(problem, "give a number from 0 on, or take it out", file=path, field="animals")
    return float(count)


def _middle(points: Array) -> Origin:
    """The middle of points on the Earth, also on both sides of the antimeridian."""
    lon, lat = np.radians(points).T
    xyz = geodetic_to_ecef(lat, lon, np.zeros(len(lat)))
    latitude, longitude, _ = ecef_to_geodetic((xyz.min(axis=0) + xyz.max(axis=0)) / 2)
    # The middle of a box along the axes of e is near; seen from there, the middle of what lies about it is.
    local = geodetic_to_ned(lat, lon, 0.0, (float(latitude), float(longitude), 0.0))
    if np.abs(local[:, :2]).max() <= FURTHEST:
        box = (local.min(axis=0) + local.max(axis=0)) / 2
        latitude, longitude, _ = ned_to_geodetic(box, (float(latitude), float(longitude), 0.0))
    return float(latitude), float(longitude), 0.0


def _names(given: list[str]) -> list[str]:
    """Names that a page, a terminal and a file may show; the same one twice gets a number."""
    taken: set[str] = set()
    names = []
    for number, name in enumerate(given, start=1):
        clean = " ".join("".join(c if c.isprintable() else " " for c in name).split())[:MOST_OF_NAME].strip()
        wanted = clean or f"area {number}"
        other, again = wanted, 2
        while other in taken:
            other, again = f"{wanted} ({again})", again + 1
        taken.add(other)
        names.append(other)
    return names


# -- rings


def checked_ring(ring: Array, what: str, path: Path) -> Array:
    """Longitude and latitude of a ring, looked at as numbers on the Earth.

    Parameters
    ----------
    ring
        (K, 2) longitude and latitude, degrees; the last may repeat the first.
    what
        Whose ring it is, for messages.
    path
        Where it was found.

    Returns
    -------
    (K, 2) longitude, latitude, degrees; not closed, no point twice in a row.

    Raises
    ------
    WildlabError
        Where there are too few or too many points, or they are not degrees of one place.
    """
    many = f"{what} has {len(ring):,} points, and {MOST_POINTS:,} are the most"
    _refuse(len(ring) > MOST_POINTS + 1, many, "simplify the outline", path)
    ring = ring[~(ring == np.roll(ring, -1, axis=0)).all(axis=1)]
    few = f"{what} has {len(ring)} different points"
    _refuse(len(ring) < 3, few, "an outline needs three corners at least", path)
    _refuse(not np.isfinite(ring).all(), f"a point of {what} is no finite number", "give degrees", path)
    east, north = np.abs(ring).max(axis=0)
    degrees = f"{what} has a coordinate of {max(east, north):g}, which is no degree"
    fix = "give longitude and latitude in degrees of WGS84 (EPSG:4326)"
    _refuse(max(east, north) > 180, degrees, fix, path)
    swapped = ": its coordinates are swapped" if east <= 90 else ""
    latitude = f"{what} has a latitude of {north:g} degrees{swapped}"
    _refuse(north > 90, latitude, "give longitude first, then latitude", path)
    span = float(np.ptp(ring[:, 0]))
    fix = "split it at the antimeridian"
    _refuse(span > 180, f"the longitudes of {what} span {span:.0f} degrees", fix, path)
    return ring


def _check_shape(ring: Array, what: str, path: Path) -> None:
    """Refuse a ring (K, 2) in metres that is far away, bounds nothing, or is not sure what it bounds."""
    far = float(np.hypot(*ring.T).max()) / 1000
    away = f"{what} lies {far:,.0f} km from the middle of all areas"
    _refuse(far > FURTHEST / 1000, away, "plan far areas by themselves", path)
    met = crossing(ring)
    sides = [f"the side after point {one + 1}" for one in met or ()]
    crosses = f"{what} crosses itself: {' meets '.join(sides)}"
    _refuse(met, crosses, "put its points in order", path)
    size = ring_area(ring)
    _refuse(size < LEAST_AREA, f"{what} bounds {size:.2g} square metres", "check its coordinates", path)


def ring_area(ring: Array) -> float:
    """Area within a ring (K, 2) that does not cross itself, square metres.

    Examples
    --------
    >>> ring_area(np.array([[0.0, 0.0], [0.0, 20.0], [10.0, 20.0], [10.0, 0.0]]))
    200.0
    """
    p, q = ring, np.roll(ring, -1, axis=0)
    return float(abs(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])) / 2)


def crossing(ring: Array) -> tuple[int, int] | None:
    """Two sides of a ring (K, 2) that meet, but for the corner that neighbours share; None where none do.

    Returns
    -------
    Numbers of the sides, by the points that they begin at; or None.

    Examples
    --------
    >>> crossing(np.array([[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]]))
    (0, 2)
    >>> crossing(np.array([[0.0, 0.0], [0.0, 10.0], [10.0, 10.0]]))
    """
    n = len(ring)
    ends = np.roll(ring, -1, axis=0)
    ahead = ends - ring
    after = np.roll(ahead, -1, axis=0)
    lengths = np.hypot(*ahead.T) * np.hypot(*after.T)
    # Neighbours meet beyond their corner only where the second one turns straight back.
    back = (np.abs(_cross(ahead, after)) <= STRAIGHT * lengths) & ((ahead * after).sum(axis=1) < 0)
    for one in np.flatnonzero(back).tolist():
        first, second = sorted((one, (one + 1) % n))
        return first, second
    for one in range(n):
        apart = np.arange(one + 2, n - (one == 0))
        met = _segments_meet(ring[one], ends[one], ring[apart], ends[apart])
        if met.any():
            return one, int(apart[np.argmax(met)])
    return None


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _segments_meet(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Whether the segment a-b meets each of the segments c-d, touching included."""
    side_c, side_d = _cross(b - a, c - a), _cross(b - a, d - a)
    side_a, side_b = _cross(d - c, a - c), _cross(d - c, b - c)
    straddle = (side_c * side_d <= 0) & (side_a * side_b <= 0)
    # On one line, the products are all zero, and the boxes about the segments decide.
    low, high = np.minimum(a, b), np.maximum(a, b)
    boxes = ((np.minimum(c, d) <= high) & (np.maximum(c, d) >= low)).all(axis=-1)
    return np.asarray(straddle & boxes)


# -- surveyed points


def _decoded(
    columns: dict[str, Any],
    rows: Sequence[int],
    counted_in: str,
    lost: Loss,
    notes: Sequence[str],
) -> RawLog:
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
    part = Stream({**columns, "name": names}, rows, counted_in, unusable)
    return RawLog({"marks": part}, lost=told(lost), notes=notes)


def kml_sniff(head: bytes) -> bool:
    """Whether a file is KML, by its first element."""
    return head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"<" and b"<kml" in head


def geojson_sniff(head: bytes) -> bool:
    """Whether a file is GeoJSON, by the words that it begins with."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    bare = head.translate(None, b" \n\r\t")
    kinds = (b'"FeatureCollection"', b'"type":"Feature"', b'"type":"Point"', b'"type":"MultiPoint"')
    return start == b"{" and any(one in bare for one in kinds)


def kml_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Points of placemarks; errors as of `read_places`, and where there is no point."""
    return _marks(path, data, "height_sea_m")


def geojson_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Points of features; errors as of `kml_decode`."""
    return _marks(path, data, "height_ellipsoid_m")


def _marks(path: Path, data: bytes, height: str) -> RawLog:
    found, others = read_places(data, path)
    points = [one for one in found if one.is_point]
    others += len(found) - len(points)
    if not points:
        problem = f"has no point, and {others} lines or areas"
        raise WildlabError(problem, "give a point for each mark", file=path)
    longitude, latitude, high = np.array([one.rings[0][0] for one in points]).T
    columns = {"name": [one.name for one in points], "longitude_deg": longitude, "latitude_deg": latitude}
    known = np.isfinite(high)
    notes = {
        "heights count from the ellipsoid": (height == "height_ellipsoid_m" and known.any()),
        f"{int((~known).sum())} of {len(known)} points have no height: altitudeMode is not absolute": (
            height == "height_sea_m" and not known.all()
        ),
    }
    lost = (others, "geometry", "besides: only points are marks")
    return _decoded(columns | {height: high}, [one.row for one in points], "feature", lost, holding(notes))


#: Headings by what they mean, as `plain` has them: data/headings.toml.
HEADINGS: dict[str, list[str]] = tomllib.loads((DATA / "headings.toml").read_text("utf-8"))
#: Words in a height's name, and what it then counts from.
ELLIPSOID, SEA, HIGH = (frozenset(HEADINGS[one]) for one in ("ellipsoid", "sea", "height"))
#: What a table of marks has none of: it is over time.
TIMES = frozenset(
    {"time", "date", "datetime", "timestamp", "stamp", "utc", "gpst", "tow", "epoch", "millisecond"}
)
_DEG = ("", "_deg", "_degrees", "_dd", "_wgs84", "_decimal", "_decimal_degrees", "_decimaldegree")


def _find(names: list[str], meaning: str, endings: Sequence[str] = _DEG) -> int | None:
    every = [f"{one}{end}" for one in HEADINGS.get(meaning, [meaning]) for end in endings]
    return next((names.index(one) for one in every if one in names), None)


def table_sniff(head: bytes) -> bool:
    """Whether a file is a table without times that has latitudes and longitudes."""
    names = header_of(head)
    places = _find(names, "latitude") is not None and _find(names, "longitude") is not None
    return places and not any(TIMES & set(one.split("_")) for one in names)


def table_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
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
        fix = "name two columns latitude and longitude (deg)"
        what = f"has no latitude and longitude: {there}"
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
