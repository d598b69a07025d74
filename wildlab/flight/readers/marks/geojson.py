"""Surveyed points out of GeoJSON (RFC 7946): longitude, latitude and height above the ellipsoid of WGS 84."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.logs.log import RawLog
from wildlab.flight.readers.marked import number, shown
from wildlab.flight.readers.marks.marks import marks_log, marks_part

#: Properties that name a point, in this order, without regard to capitals.
NAMES = ("name", "id", "label", "title", "point", "target", "target_id", "code")
_Row = tuple[str, list[float], int]

#: Coordinate systems of the older standard that are the one of the newer.
SAME = ("CRS84", "EPSG:4326", "EPSG::4326", "EPSG:4979", "EPSG::4979")


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is GeoJSON, by the words that it begins with."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    plain = head.replace(b" ", b"").replace(b"\n", b"").replace(b"\r", b"").replace(b"\t", b"")
    kinds = (b'"FeatureCollection"', b'"type":"Feature"', b'"type":"Point"', b'"type":"MultiPoint"')
    return start == b"{" and any(one in plain for one in kinds)


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Points of features.

    Raises
    ------
    WildlabError
        Where it is no GeoJSON, in another coordinate system, or has no point.
    """
    try:
        found = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        said = printable(str(error))[:100]
        raise WildlabError(f"is not readable JSON ({said})", "export it anew", file=path) from None
    crs = found.get("crs") if isinstance(found, dict) else None
    if crs is not None and not any(one in json.dumps(crs)[:2000] for one in SAME):
        raise WildlabError(
            f"is in another coordinate system: {shown(crs)}",
            "export it in WGS 84 (EPSG:4326), as the standard has it",
            file=path,
            field="crs",
        )
    rows: list[_Row] = []
    lost = {"other": 0, "broken": 0}
    listed = found.get("features") if isinstance(found, dict) and "features" in found else [found]
    for at, one in enumerate(listed if isinstance(listed, list) else [], 1):
        own = one if isinstance(one, dict) else {}
        geometry = own.get("geometry") if own.get("type") == "Feature" else own
        _points(geometry, _name(own), at, rows, lost, 0)
    if not rows:
        others = f"has {lost['other']} other geometries and no point" if lost["other"] else "has no point"
        raise WildlabError(others, "give a feature with a point for each mark", file=path)
    place = np.array([one for _, one, _ in rows], float)
    part = marks_part(
        {
            "name": [one for one, _, _ in rows],
            "longitude_deg": place[:, 0],
            "latitude_deg": place[:, 1],
            "height_ellipsoid_m": place[:, 2],
        },
        [at for _, _, at in rows],
        "feature",
    )
    left = [f"{lost['other']} geometries that are no points"] if lost["other"] else []
    left += [f"{lost['broken']} features without a geometry that can be read"] if lost["broken"] else []
    notes = []
    if np.isfinite(place[:, 2]).any():
        notes.append("heights count from the ellipsoid, as the standard of GeoJSON has them")
    return marks_log("marks-geojson", part, left, notes)


def _points(
    geometry: Any,
    name: str,
    at: int,
    rows: list[_Row],
    lost: dict[str, int],
    deep: int,
) -> None:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if kind == "GeometryCollection" and isinstance(geometry.get("geometries"), list) and deep < 5:
        for one in geometry["geometries"]:
            _points(one, name, at, rows, lost, deep + 1)
    elif kind in ("Point", "MultiPoint"):
        given = geometry.get("coordinates")
        several = given if kind == "MultiPoint" and isinstance(given, list) else [given]
        for one in several:
            values = [number(part) for part in one[:3]] if isinstance(one, list) else []
            if len(values) < 2:
                lost["broken"] += 1
                continue
            rows.append((name, [*values, np.nan][:3], at))
    elif kind is None:
        lost["broken"] += 1
    else:
        lost["other"] += 1


def _name(feature: dict[str, Any]) -> str:
    properties = feature.get("properties")
    own = (
        {str(key).lower(): value for key, value in properties.items()} if isinstance(properties, dict) else {}
    )
    for value in (*(own.get(one) for one in NAMES), feature.get("id")):
        if isinstance(value, str) and value.strip():
            return value
        if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**15:
            return str(value)
    return ""
