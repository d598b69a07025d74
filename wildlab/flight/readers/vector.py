"""Areas and surveyed points out of KML, GeoJSON (RFC 7946) and tables that people write.

Positions are longitude and latitude of WGS84; the member ``crs`` of GeoJSON's older draft is taken where it
says the same. Of KML, points and polygons of placemarks are read, and nothing that a file could ask for.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.log import Decoded, Readings, holding
from wildlab.flight.readers.text import (
    Field,
    finite,
    header_of,
    parse_json,
    parse_xml,
    plain,
    read_text_table,
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

# -- KML

#: Longitude and latitude in degrees, altitude in m or NaN.
Place = tuple[float, float, float]


class Placemark(NamedTuple):
    """A point or a polygon of a placemark.

    `rings` of places, the outer one first; of a point one with a single place. `mode`: KML's altitudeMode.
    """

    name: str
    rings: list[list[Place]]
    mode: str = ""


class Kml(NamedTuple):
    """Polygons and points of a KML file, and how many geometries it has that are no points."""

    polygons: list[Placemark]
    points: list[Placemark]
    others: int


def read_kml(data: bytes, path: Path) -> Kml:
    """Polygons and points of a KML file; `path` is for messages.

    Raises
    ------
    WildlabError
        Where it is not KML, declares a document type or entities, or has coordinates that are none.
    """
    root = parse_xml(data, path, "KML")
    if root.tag != "kml":
        raise WildlabError("is XML, and no KML", "export it as KML or GeoJSON", file=path)

    def places(of: Element, where: str) -> list[list[Place]]:
        return [_places(one.text or "", path) for one in of.iterfind(f"{where}coordinates")]

    found = Kml([], [], sum(len(list(root.iter(one))) for one in ("LineString", "Track", "Model", "Polygon")))
    rings = len(list(root.iter("LinearRing"))) - len(root.findall(".//Polygon//LinearRing"))
    for mark in root.iter("Placemark"):
        name = (mark.findtext("name") or "")[:MOST_LETTERS]
        for one in mark.iter("Point"):
            mode = (one.findtext("altitudeMode") or "clampToGround").strip()[:MOST_LETTERS]
            found.points.extend(Placemark(name, [ring[:1]], mode) for ring in places(one, "") if ring)
        for one in mark.iter("Polygon"):
            outer = places(one, "outerBoundaryIs//")
            if not outer:
                raise WildlabError("a polygon has no outline", "export it anew", file=path)
            found.polygons.append(Placemark(name, [outer[0], *places(one, "innerBoundaryIs//")]))
    return found._replace(others=found.others + rings)


def _places(words: str, path: Path) -> list[Place]:
    places = []
    for word in words.split():
        parts = word.split(",")
        try:
            high = float(parts[2]) if len(parts) > 2 and parts[2] else math.nan
            places.append((float(parts[0]), float(parts[1]), high))
        except (ValueError, IndexError):
            fix = "give longitude,latitude with a comma and without blanks between them"
            raise WildlabError(
                f"{printable(word)[:40]!r} is no coordinate", fix, file=path, field="coordinates"
            ) from None
    return places


# -- GeoJSON

#: What the older member `crs` may say.
WGS84 = re.compile(r"(urn:ogc:def:crs:)?(OGC:(1\.3)?:?CRS84|EPSG:([\d.]*:)?(4326|4979))", re.IGNORECASE)
#: Properties that name a feature, in this order, without regard to capitals.
PROPERTIES = ("name", "id", "label", "title", "point", "target", "target_id", "code")


class Feature(NamedTuple):
    """A feature of GeoJSON, or a geometry by itself: its properties, its name, and its geometries."""

    properties: dict[str, Any]
    name: str
    geometries: list[Field]


def _features(found: Field, depth: int = 0) -> Iterator[Feature]:
    """All features, collections of geometries taken apart."""
    kind, crs = found.member("type").value, found.member("crs")
    if crs.value is not None:
        about = crs.value.get("properties") if isinstance(crs.value, dict) else None
        name = about.get("name") if isinstance(about, dict) else None
        if not isinstance(name, str) or not WGS84.fullmatch(name.strip().replace("::", ":")):
            raise crs._replace(value=crs.value if name is None else name).fail(
                "WGS84 is wanted", "write longitude and latitude in degrees (EPSG:4326)"
            )
    if kind == "FeatureCollection" and depth == 0:
        for one in found.member("features").items():
            yield from _features(one, 1)
        return
    given = found.member("properties").value
    own = given if isinstance(given, dict) else {}
    about = {str(key).lower(): value for key, value in own.items()}
    named = (*(about.get(one) for one in PROPERTIES), found.value.get("id"))
    name = next((str(one) for one in named if one not in (None, "") and isinstance(one, str | int)), "")
    yield Feature(own, name, list(_geometries(found.member("geometry") if kind == "Feature" else found)))


def _geometries(found: Field, depth: int = 0) -> Iterator[Field]:
    if isinstance(found.value, dict) and found.value.get("type") == "GeometryCollection" and depth < 5:
        for one in found.member("geometries").items():
            yield from _geometries(one, depth + 1)
    else:
        yield found


def _parts(geometry: Field, kind: str) -> list[Field] | None:
    """Coordinates of a geometry of a kind or of several such; None where it is of another kind."""
    own, given = geometry.member("type").value, geometry.member("coordinates")
    return [given] if own == kind else given.items() if own == f"Multi{kind}" else None


# -- areas

#: The most bytes of a file that are read.
MOST_BYTES = 20_000_000
MOST_AREAS = 500
#: The most letters of an area's name.
MOST_OF_NAME = 60
#: Metres from the middle of all areas beyond which they are no one place to be flown over.
FURTHEST = 50_000.0


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


class Outline(NamedTuple):
    """What a file has of an area: rings of (longitude, latitude) in degrees, the outer one first."""

    name: str
    rings: list[list[tuple[float, float]]]
    animals: float = math.nan


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
    start = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
    if start[:1] == b"<":
        found = [
            Outline(one.name, [[place[:2] for place in ring] for ring in one.rings])
            for one in read_kml(data, path).polygons
        ]
    elif start[:4] == b"PK\x03\x04":
        raise WildlabError("is a zip, as KMZ is", "unpack it, and give the KML inside", file=path)
    else:
        found = list(_outlines(parse_json(data, path, "GeoJSON")))
    if not found:
        raise WildlabError("has no polygon", "draw the outline of each area as a polygon", file=path)
    if len(found) > MOST_AREAS:
        raise WildlabError(
            f"has {len(found):,} polygons, and {MOST_AREAS} are the most",
            "keep those to be searched",
            file=path,
        )
    names = _names([one.name for one in found])
    file = str(path)
    rings = [
        [checked_ring(ring, _what(name, number), file) for number, ring in enumerate(one.rings)]
        for name, one in zip(names, found, strict=True)
    ]
    origin = _middle(np.concatenate([ring for each in rings for ring in each]))
    areas = []
    for name, one, each in zip(names, found, rings, strict=True):
        local = [_local(ring, origin) for ring in each]
        for number, (ring, given) in enumerate(zip(local, each, strict=True)):
            _near(ring, given, _what(name, number), file)
            check_shape(ring, _what(name, number), file)
        areas.append(Area(name, local[0], tuple(local[1:]), one.animals))
        if areas[-1].size <= 0:
            raise WildlabError(
                f"the holes of {name} are larger than it is", "check which ring is the outer one", file=path
            )
    return Areas(tuple(areas), origin)


def _what(name: str, ring: int) -> str:
    return f"the outline of {name}" if ring == 0 else f"hole {ring} of {name}"


def _local(ring: Array, origin: Origin) -> Array:
    lon, lat = np.radians(ring).T
    return np.asarray(geodetic_to_ned(lat, lon, 0.0, origin)[:, :2])


def _near(ring: Array, given: Array, what: str, file: str) -> None:
    far = np.hypot(*ring.T)
    if far.max() > FURTHEST:
        raise WildlabError(
            f"{what} lies {far.max() / 1000:,.0f} km from the middle of all areas",
            "check signs and order of its coordinates, or plan far areas by themselves",
            file=file,
        )


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


_KIND = "give a Polygon, a MultiPolygon, a Feature or a FeatureCollection of them"


def _outlines(found: Field) -> Iterator[Outline]:
    """Outlines of the polygons of GeoJSON; the parts of a feature cannot share its animals: sizes are not
    known yet."""
    for one in _features(found):
        count = one.properties.get("animals")
        fail = partial(WildlabError, file=found.path, field="animals")
        if count is not None and not 0 <= finite(count) < 1e9:
            problem = f"an area has {printable(str(count))[:40]!r} animals"
            raise fail(problem, "give a number from 0 on, or take the property out")
        parts: list[Field] = []
        for geometry in one.geometries:
            more = _parts(geometry, "Polygon")
            if more is None:
                raise geometry.member("type").fail("polygons are wanted", _KIND)
            parts += more
        if len(parts) > 1 and count is not None:
            problem = f"{one.name or 'an area'} has {count:g} animals in {len(parts)} polygons together"
            raise fail(problem, "say for each polygon how many, as a Feature of its own")
        animals = math.nan if count is None else float(count)
        yield from (Outline(one.name, _rings(part, one.name), animals) for part in parts)


def _rings(found: Field, name: str) -> list[list[tuple[float, float]]]:
    rings = []
    for ring, given in enumerate(found.items()):
        what = printable(_what(name[:MOST_OF_NAME] or "an area", ring))
        points = []
        for point in given.items():
            pair: Any = (
                point.value if isinstance(point.value, list) and 2 <= len(point.value) <= 4 else [None]
            )
            if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in pair):
                raise point.fail(
                    f"longitude and latitude of a point of {what} are wanted", "give two numbers"
                )
            # Also of whole numbers that are too large for one.
            lon, lat = (float(x) if abs(x) < 1e300 else math.inf for x in pair[:2])
            points.append((lon, lat))
        if points and points[0] != points[-1]:
            raise WildlabError(
                f"{what} is not closed: its last point is not its first",
                "repeat the first point at the end",
                file=found.path,
                field=given.where,
            )
        rings.append(points)
    if not rings:
        raise found.fail("a polygon has no ring", _KIND)
    return rings


# -- rings

#: The most points of a ring; a surveyor's fence has hundreds.
MOST_POINTS = 5_000
#: Square metres below which a ring is a slip of the pen.
LEAST_AREA = 1.0
#: Sine of the angle below which a side that turns back lies on the one before it.
STRAIGHT = 1e-9


def checked_ring(points: list[tuple[float, float]], what: str, file: str) -> Array:
    """Longitude and latitude of a ring, looked at as numbers on the Earth.

    Parameters
    ----------
    points
        Longitude and latitude, degrees; the last may repeat the first.
    what
        Whose ring it is, for messages.
    file
        Where it was found.

    Returns
    -------
    (K, 2) longitude, latitude, degrees; not closed, no point twice in a row.

    Raises
    ------
    WildlabError
        Where there are too few or too many points, or they are not degrees of one place.
    """
    if len(points) > MOST_POINTS + 1:
        raise WildlabError(
            f"{what} has {len(points):,} points, and {MOST_POINTS:,} are the most",
            "simplify the outline",
            file=file,
        )
    ring = np.array(points, float).reshape(-1, 2)
    if not np.isfinite(ring).all():
        at = int(np.flatnonzero(~np.isfinite(ring).all(axis=1))[0])
        raise WildlabError(f"point {at + 1} of {what} is no finite number", "give degrees", file=file)
    _on_the_earth(ring, what, file)
    if len(ring) > 1 and (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    if len(ring) > 1:
        ring = ring[~(ring == np.roll(ring, 1, axis=0)).all(axis=1)]
    if len(ring) < 3:
        raise WildlabError(
            f"{what} has {len(ring)} different point{'' if len(ring) == 1 else 's'}",
            "an outline needs three corners at least",
            file=file,
        )
    if np.ptp(ring[:, 0]) > 180:
        raise WildlabError(
            f"the longitudes of {what} span {np.ptp(ring[:, 0]):.0f} degrees",
            "split an area that crosses the antimeridian into a polygon on each side",
            file=file,
        )
    return ring


def _on_the_earth(ring: Array, what: str, file: str) -> None:
    most = np.abs(ring).max(axis=0) if len(ring) else np.zeros(2)
    if (most > 180).any():
        raise WildlabError(
            f"{what} has a coordinate of {most.max():g}, which is no degree",
            "give longitude and latitude in degrees of WGS84 (EPSG:4326), not metres of a map projection",
            file=file,
        )
    if most[1] > 90:
        if most[0] <= 90:
            raise WildlabError(
                f"{what} has a latitude of {most[1]:g} degrees: its coordinates are swapped",
                "give longitude first, then latitude",
                file=file,
            )
        raise WildlabError(
            f"{what} has a latitude of {most[1]:g} degrees", "give one of at most 90", file=file
        )


def check_shape(ring: Array, what: str, file: str) -> None:
    """Refuse a ring that bounds nothing, or that is not sure what it bounds.

    Parameters
    ----------
    ring
        (K, 2) metres, not closed.
    what, file
        As for `checked_ring`.

    Raises
    ------
    WildlabError
        Where its area is next to nothing, or it crosses or touches itself.
    """
    met = crossing(ring)
    if met is not None:
        one, other = met
        raise WildlabError(
            f"{what} crosses itself: the side after point {one + 1} meets the side after point {other + 1}",
            "put its points in their order along the fence",
            file=file,
        )
    if ring_area(ring) < LEAST_AREA:
        raise WildlabError(
            f"{what} bounds {ring_area(ring):.2g} square metres", "check its coordinates", file=file
        )


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
    begins, ends = ring, np.roll(ring, -1, axis=0)
    for one in range(n):
        others = np.arange(one + 1, n)
        # Neighbours share a corner; they meet beyond it only where the second one turns straight back.
        apart = others[(others != one + 1) & ~((one == 0) & (others == n - 1))]
        met = _segments_meet(begins[one], ends[one], begins[apart], ends[apart])
        if met.any():
            return one, int(apart[np.argmax(met)])
        follows = (one + 1) % n
        ahead, back = ends[one] - begins[one], ends[follows] - begins[follows]
        lengths = float(np.hypot(*ahead) * np.hypot(*back))
        if abs(float(_cross(ahead, back))) <= STRAIGHT * lengths and float(ahead @ back) < 0:
            return min(one, follows), max(one, follows)
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


def kml_sniff(head: bytes) -> bool:
    """Whether a file is KML, by its first element."""
    return head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"<" and b"<kml" in head


def kml_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
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
        "longitude_deg": longitude,
        "latitude_deg": latitude,
        "height_sea_m": np.where(absolute, height, np.nan),
    }
    ground = int((~absolute & (height != 0) & np.isfinite(height)).sum())
    notes = {
        f"{ground} of {count} heights are not used: their altitudeMode is not absolute": ground > 0,
        f"{int((~absolute).sum())} of {count} points have no height above sea level: write "
        "<altitudeMode>absolute</altitudeMode> before <coordinates>, or give a table": not absolute.all(),
    }
    lost = [(found.others, "geometry", "besides: only points are marks")]
    return _decoded(columns, range(1, count + 1), "point", lost, holding(notes))


def geojson_sniff(head: bytes) -> bool:
    """Whether a file is GeoJSON, by the words that it begins with."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    bare = head.translate(None, b" \n\r\t")
    kinds = (b'"FeatureCollection"', b'"type":"Feature"', b'"type":"Point"', b'"type":"MultiPoint"')
    return start == b"{" and any(one in bare for one in kinds)


def geojson_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """Points of features: longitude, latitude and height above the ellipsoid of WGS 84.

    Raises
    ------
    WildlabError
        Where it is no GeoJSON, in another coordinate system, or has no point.
    """
    rows: list[tuple[str, list[float], int]] = []
    others = broken = 0
    for at, one in enumerate(_features(parse_json(data, path, plain=False)), 1):
        for geometry in one.geometries:
            parts = _parts(geometry, "Point") if isinstance(geometry.value, dict) else []
            others += parts is None
            broken += parts == []
            for part in parts or ():
                given = part.value[:3] if isinstance(part.value, list) else []
                broken += len(given) < 2
                place = [*map(finite, given), np.nan][:3]
                rows += [(one.name, place, at)] if len(given) > 1 else []
    if not rows:
        what = f"has {others} other geometries and no point" if others else "has no point"
        raise WildlabError(what, "give a feature with a point for each mark", file=path)
    longitude, latitude, height = np.array([place for _, place, _ in rows], float).T
    columns = {
        "name": [name for name, _, _ in rows],
        "longitude_deg": longitude,
        "latitude_deg": latitude,
        "height_ellipsoid_m": height,
    }
    lost = [
        (others, "geometry", "besides: only points are marks"),
        (broken, "feature", "without a geometry that can be read"),
    ]
    said = ["heights count from the ellipsoid, as the standard of GeoJSON has them"]
    return _decoded(
        columns, [at for _, _, at in rows], "feature", lost, said if np.isfinite(height).any() else []
    )


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


def table_sniff(head: bytes) -> bool:
    """Whether a file is a table without times that has latitudes and longitudes, or names points and has
    metres of a projection, which `table_decode` refuses with what to do."""
    names = header_of(head)
    places = _find(names, "latitude") is not None and _find(names, "longitude") is not None
    projected = _metres(names) == 2 and bool(set(HEADINGS["name"]) & set(names))
    return (places or projected) and not any(TIMES & set(one.split("_")) for one in names)


def table_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
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
