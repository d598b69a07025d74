"""Areas to be searched, out of GeoJSON or KML: hostile input, positions on the Earth, polygons in n.

GeoJSON as RFC 7946 has it: longitude first, WGS84; the member ``crs`` of the older draft is taken where it
says the same. Of KML, polygons of placemarks are read, and nothing that a file could ask for.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.kml import read_kml
from wildlab.flight.readers.rings import check_shape, checked_ring, ring_area
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
        found = [Outline(one.name, one.rings) for one in read_kml(data, path)]
    elif start[:4] == b"PK\x03\x04":
        raise WildlabError("is a zip, as KMZ is", "unpack it, and give the KML inside", file=path)
    else:
        found = list(_outlines(_load(data, path), path, ""))
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
# ------------------------------------------------------------------------------------------------


def _load(data: bytes, path: Path) -> Any:
    def refuse(word: str) -> NoReturn:
        raise ValueError(f"it has {word}, which is no number")

    try:
        return json.loads(data.decode("utf-8-sig"), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        said = printable(str(error) or "its brackets are too deep")[:100]
        raise WildlabError(f"is not GeoJSON ({said})", "write it anew, in UTF-8", file=path) from None


def _outlines(found: Any, path: Path, name: str, depth: int = 0) -> Iterator[Outline]:
    if not isinstance(found, dict):
        raise WildlabError(f"has a {type(found).__name__} where an object is wanted", _KIND, file=path)
    _check_crs(found, path)
    kind = found.get("type")
    if kind == "FeatureCollection" and depth == 0:
        for one in _list(found.get("features"), "features", path):
            yield from _outlines(one, path, "", depth + 1)
    elif kind == "Feature" and depth <= 1:
        yield from _feature(found, path, depth)
    elif kind == "GeometryCollection" and depth <= 2:
        for one in _list(found.get("geometries"), "geometries", path):
            yield from _outlines(one, path, name, depth + 3)
    elif kind == "Polygon":
        yield Outline(name, _rings(found.get("coordinates"), path, name))
    elif kind == "MultiPolygon":
        for one in _list(found.get("coordinates"), "coordinates", path):
            yield Outline(name, _rings(one, path, name))
    else:
        shown = printable(str(kind))[:40]
        raise WildlabError(f"has a {shown}, and polygons are wanted", _KIND, file=path, field="type")


_KIND = "give a Polygon, a MultiPolygon, a Feature or a FeatureCollection of them"


def _feature(found: Mapping[str, Any], path: Path, depth: int) -> Iterator[Outline]:
    about = found.get("properties")
    about = about if isinstance(about, dict) else {}
    given = next((about[key] for key in NAMES if about.get(key) not in (None, "")), found.get("id", ""))
    name = str(given) if isinstance(given, str | int | float) else ""
    animals = about.get("animals")
    if animals is None:
        number = math.nan
    elif isinstance(animals, int | float) and not isinstance(animals, bool) and 0 <= animals < 1e9:
        number = float(animals)
    else:
        raise WildlabError(
            f"an area has {printable(str(animals))[:40]!r} animals",
            "give a number from 0 on, or take the property out",
            file=path,
            field="animals",
        )
    if found.get("geometry") is None:
        raise WildlabError("a Feature has no geometry", _KIND, file=path, field="geometry")
    parts = list(_outlines(found["geometry"], path, name, max(depth, 1) + 1))
    # The parts of a feature share its animals by their sizes, which are not known yet: one part has them.
    if len(parts) > 1 and not math.isnan(number):
        raise WildlabError(
            f"{name or 'an area'} has {number:g} animals in {len(parts)} polygons together",
            "say for each polygon how many, as a Feature of its own",
            file=path,
            field="animals",
        )
    yield from (one._replace(animals=number) for one in parts)


def _check_crs(found: Mapping[str, Any], path: Path) -> None:
    crs = found.get("crs")
    if crs is None:
        return
    about = crs.get("properties") if isinstance(crs, dict) else None
    name = about.get("name") if isinstance(about, dict) else None
    if not isinstance(name, str) or not WGS84.fullmatch(name.strip().replace("::", ":")):
        said = printable(str(name if name is not None else crs))[:60]
        raise WildlabError(
            f"its coordinates are of {said}",
            "write it in WGS84, longitude and latitude in degrees (EPSG:4326), as GeoJSON wants it",
            file=path,
            field="crs",
        )


def _list(found: Any, field: str, path: Path) -> list[Any]:
    if not isinstance(found, list):
        raise WildlabError("is no list", _KIND, file=path, field=field)
    return found


def _rings(found: Any, path: Path, name: str) -> list[list[tuple[float, float]]]:
    rings = []
    for number, ring in enumerate(_list(found, "coordinates", path)):
        what = printable(_what(name[:MOST_LETTERS] or "an area", number))
        points = []
        for at, point in enumerate(_list(ring, "coordinates", path)):
            good = isinstance(point, list) and 2 <= len(point) <= 4
            if not good or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in point):
                raise WildlabError(
                    f"point {at + 1} of {what} is {printable(str(point))[:40]}",
                    "give longitude and latitude, two numbers",
                    file=path,
                    field="coordinates",
                )
            points.append((_float(point[0]), _float(point[1])))
        if points and points[0] != points[-1]:
            raise WildlabError(
                f"{what} is not closed: its last point is not its first",
                "repeat the first point at the end",
                file=path,
                field="coordinates",
            )
        rings.append(points)
    if not rings:
        raise WildlabError("a polygon has no ring", _KIND, file=path, field="coordinates")
    return rings


def _float(value: float) -> float:
    """Also of whole numbers that are too large for one."""
    try:
        return float(value)
    except OverflowError:
        return math.inf
