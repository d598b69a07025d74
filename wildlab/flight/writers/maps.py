"""A plan as a map of its own: GeoJSON (RFC 7946) and KML 2.2, with areas, ways and way points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from wildlab.flight.writers.mission import Mission
from wildlab.geometry.frames import Array

#: A name and its rings of (latitude, longitude), degrees, the outer one first; not closed.
Outlined = tuple[str, Sequence[Array]]


def plan_geojson(areas: Sequence[Outlined], missions: Sequence[Mission]) -> dict[str, Any]:
    """A plan as a FeatureCollection.

    Parameters
    ----------
    areas
        That are searched.
    missions
        Of the plan.

    Returns
    -------
    dict
        For JSON. Polygons have the property ``kind`` "area", lines "way", points "way point" with their
        heights in metres: the third coordinate of GeoJSON is above the ellipsoid, which a flight is not
        planned by, so there is none.
    """
    features = [
        _feature(
            {"kind": "area", "name": name},
            "Polygon",
            [_positions(_closed(_right_hand(ring, outer=k == 0))) for k, ring in enumerate(rings)],
        )
        for name, rings in areas
    ]
    for one in missions:
        way = np.stack([one.latitude, one.longitude], axis=1)
        home = np.array([one.home[:2]])
        about = {"kind": "way", "name": one.name, "speed_m_s": one.speed}
        features.append(_feature(about, "LineString", _positions(np.concatenate([home, way, home]))))
        for number, point in enumerate(_positions(way), start=1):
            about = {
                "kind": "way point",
                "name": f"{one.name}, {number}",
                "number": number,
                "height_above_take_off_m": round(float(one.above_home[number - 1]), 3),
                "height_above_ground_m": round(float(one.above_ground[number - 1]), 3),
            }
            features.append(_feature(about, "Point", point))
    return {"type": "FeatureCollection", "features": features}


def plan_kml(name: str, areas: Sequence[Outlined], missions: Sequence[Mission]) -> str:
    """A plan as KML.

    Parameters
    ----------
    name
        Of the document.
    areas, missions
        As for `plan_geojson`.

    Returns
    -------
    str
        Ways are above the ground of whoever shows them (``relativeToGround``): KML knows no height above a
        take-off point.
    """
    parts = []
    for title, rings in areas:
        borders = []
        for k, ring in enumerate(rings):
            tag = "outerBoundaryIs" if k == 0 else "innerBoundaryIs"
            corners = _words(_closed(ring))
            borders.append(f"<{tag}><LinearRing><coordinates>{corners}</coordinates></LinearRing></{tag}>")
        polygon = f"<Polygon>{''.join(borders)}</Polygon>"
        parts.append(f"<Placemark><name>{escape(title)}</name>{polygon}</Placemark>")
    for one in missions:
        way = np.stack([one.latitude, one.longitude], axis=1)
        line = (
            "<LineString><altitudeMode>relativeToGround</altitudeMode>"
            f"<coordinates>{_words(way, one.above_ground)}</coordinates></LineString>"
        )
        parts.append(f"<Placemark><name>{escape(one.name)}</name>{line}</Placemark>")
    body = "\n".join(parts)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"<name>{escape(name)}</name>\n{body}\n</Document></kml>\n"
    )


def _feature(about: dict[str, Any], kind: str, coordinates: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": about,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _positions(points: Array) -> list[list[float]]:
    return [[round(float(lon), 8), round(float(lat), 8)] for lat, lon in points]


def _words(points: Array, heights: Array | None = None) -> str:
    above = [""] * len(points) if heights is None else [f",{one:.3f}" for one in heights]
    return " ".join(f"{lon:.8f},{lat:.8f}{height}" for (lat, lon), height in zip(points, above, strict=True))


def _closed(ring: Array) -> Array:
    return np.concatenate([ring, ring[:1]])


def _right_hand(ring: Array, *, outer: bool) -> Array:
    """Counter-clockwise outer rings and clockwise holes, as RFC 7946 wants them."""
    following = np.roll(ring, -1, axis=0)
    clockwise = (ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]).sum() > 0
    return ring[::-1] if clockwise == outer else ring
