"""Areas to be searched, out of GeoJSON or KML: hostile input, positions on the Earth, polygons in n.

GeoJSON as RFC 7946 has it: longitude first, WGS84; the member ``crs`` of the older draft is taken where it
says the same. Of KML, polygons of placemarks are read, and nothing that a file could ask for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.documents import Field, parse_json, read_kml
from wildlab.geometry.frames import (
    Array,
    Origin,
    ecef_to_geodetic,
    geodetic_to_ecef,
    geodetic_to_ned,
    ned_to_geodetic,
)

#: The most bytes of a file that are read.
MOST_BYTES = 20_000_000
MOST_AREAS = 500
#: The most letters of an area's name.
MOST_LETTERS = 60
#: Metres from the middle of all areas beyond which they are no one place to be flown over.
FURTHEST = 50_000.0
#: What the old member `crs` may say.
WGS84 = re.compile(r"(urn:ogc:def:crs:)?(OGC:(1\.3)?:?CRS84|EPSG:([\d.]*:)?4326)", re.IGNORECASE)
#: Properties that name an area, the first that there is.
NAMES = ("name", "Name", "NAME", "title", "id")


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
        found = list(_outlines(parse_json(data, path, "GeoJSON"), ""))
    if not found:
        raise WildlabError("has no polygon", "draw the outline of each area as a polygon", file=path)
    if len(found) > MOST_AREAS:
        raise WildlabError(
            f"has {len(found):,} polygons, and {MOST_AREAS} are the most that is planned with",
            "keep those that are to be searched",
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
            f"{what} lies {far.max() / 1000:,.0f} km from the middle of all areas, and a flight is of one "
            f"place, {FURTHEST / 1000:.0f} km about it at most",
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
        clean = " ".join("".join(c if c.isprintable() else " " for c in name).split())[:MOST_LETTERS].strip()
        wanted = clean or f"area {number}"
        other, again = wanted, 2
        while other in taken:
            other, again = f"{wanted} ({again})", again + 1
        taken.add(other)
        names.append(other)
    return names


# -- GeoJSON

_KIND = "give a Polygon, a MultiPolygon, a Feature or a FeatureCollection of them"


def _outlines(found: Field, name: str, depth: int = 0) -> Iterator[Outline]:
    """Outlines of an object that is so deep in others: a feature in a collection, geometries in a feature."""
    kind = found.member("type").value
    _check_crs(found.member("crs"))
    if kind == "FeatureCollection" and depth == 0:
        for one in found.member("features").items():
            yield from _outlines(one, "", 1)
    elif kind == "Feature" and depth <= 1:
        yield from _feature(found)
    elif kind == "GeometryCollection" and depth <= 2:
        for one in found.member("geometries").items():
            yield from _outlines(one, name, 3)
    elif kind == "Polygon":
        yield Outline(name, _rings(found.member("coordinates"), name))
    elif kind == "MultiPolygon":
        for one in found.member("coordinates").items():
            yield Outline(name, _rings(one, name))
    else:
        raise found.member("type").fail("polygons are wanted", _KIND)


def _feature(found: Field) -> Iterator[Outline]:
    about = found.member("properties").value
    about = about if isinstance(about, dict) else {}
    given = next((about[key] for key in NAMES if about.get(key) not in (None, "")), found.value.get("id", ""))
    name = str(given) if isinstance(given, str | int | float) else ""
    count = about.get("animals")
    if count is not None and (
        isinstance(count, bool) or not isinstance(count, int | float) or not 0 <= count < 1e9
    ):
        raise WildlabError(
            f"an area has {printable(str(count))[:40]!r} animals",
            "give a number from 0 on, or take the property out",
            file=found.path,
            field="animals",
        )
    parts = list(_outlines(found.member("geometry"), name, 2))
    # The parts of a feature share its animals by their sizes, which are not known yet: one part has them.
    if len(parts) > 1 and count is not None:
        raise WildlabError(
            f"{name or 'an area'} has {count:g} animals in {len(parts)} polygons together",
            "say for each polygon how many, as a Feature of its own",
            file=found.path,
            field="animals",
        )
    yield from (one._replace(animals=math.nan if count is None else float(count)) for one in parts)


def _check_crs(crs: Field) -> None:
    if crs.value is None:
        return
    about = crs.value.get("properties") if isinstance(crs.value, dict) else None
    name = about.get("name") if isinstance(about, dict) else None
    if not isinstance(name, str) or not WGS84.fullmatch(name.strip().replace("::", ":")):
        raise crs._replace(value=crs.value if name is None else name).fail(
            "WGS84 is wanted",
            "write it in WGS84, longitude and latitude in degrees (EPSG:4326), as GeoJSON wants it",
        )


def _rings(found: Field, name: str) -> list[list[tuple[float, float]]]:
    rings = []
    for ring, given in enumerate(found.items()):
        what = printable(_what(name[:MOST_LETTERS] or "an area", ring))
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
            f"{what} has {len(points):,} points, and {MOST_POINTS:,} are the most that is planned with",
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
            "split an area that crosses the antimeridian at 180 degrees, each part as a polygon of its own",
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
            "put its points in the order in which they follow each other along the fence",
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
