"""What the ground of a flight is, points on it as files for maps, and what a level plane would have given.

A GeoPackage (OGC 12-128r17, *GeoPackage Encoding Standard* 1.3.0) is an SQLite file that maps open as it is:
the tables of clauses 1.1 and 2.1, the header of geometries of clause 2.1.3; the geometries themselves are
well-known binary (OGC 06-103r4, ISO for z).
"""

from __future__ import annotations

import json
import math
import os
import sqlite3
import struct
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis import Fact, fact
from wildlab.analysis.georeference import Observations, covariances_of
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import ellipse_axes
from wildlab.geometry.frames import Array, ned_to_geodetic
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.terrain import Terrain
from wildlab.paths import DATA


class Shift(NamedTuple):
    """How far points on terrain lie from those on a level plane, metres, horizontally.

    Attributes
    ----------
    n
        How many points are on both.
    median, largest
        Of the distances; NaN where there is none.
    """

    n: int
    median: float
    largest: float


def level_of(observations: Observations) -> Array:
    """Down coordinate (N,) of the plane that would serve without terrain: as stated, else under the lens."""
    ground: Terrain | None = observations.terrain
    if ground is None or observations.level is None:
        return observations.plane_down
    p_nc = np.broadcast_to(observations.poses.p_nc, (len(observations.uv), 3))
    under = -ground.heights_at(p_nc[:, :2])
    return np.where(np.isfinite(observations.level), observations.level, under)


def on_level(observations: Observations) -> Observations:
    """The same observations as they would be without terrain."""
    return replace(observations, plane_down=level_of(observations), terrain=None, level=None)


def shift_from_level(observations: Observations, points: pd.DataFrame) -> Shift:
    """How far points lie from where a level plane would have put them.

    Parameters
    ----------
    observations
        Of a flight with terrain.
    points
        From `wildlab.analysis.georeference.georeference`, of these.

    Returns
    -------
    Shift
    """
    level = georeference_pixels(observations.poses, observations.uv, level_of(observations))[:, :2]
    off = np.linalg.norm(points[["north_m", "east_m"]].to_numpy(float) - level, axis=1)
    off = off[np.isfinite(off)]
    if not len(off):
        return Shift(0, float("nan"), float("nan"))
    return Shift(len(off), float(np.median(off)), float(off.max()))


def ground_facts(observations: Observations, points: pd.DataFrame) -> list[Fact]:
    """What the points lie on, what became of the rays, and what a plane would have given.

    Parameters
    ----------
    observations, points
        As for `shift_from_level`; without terrain there is less to say.

    Returns
    -------
    list of Fact
        Of ``data/messages/en/terminal.toml``.
    """
    placed, of = int(points["north_m"].notna().sum()), len(points)
    if observations.terrain is None:
        return [fact("ground-level", placed=placed, of=of)]
    became = "; ".join(f"{n} {words}" for words, n in points["ray"].value_counts().items())
    found = [fact("ground-terrain", of=of, became=became or "none")]
    shift = shift_from_level(observations, points)
    if shift.n:
        median, largest = f"{shift.median:.2f}", f"{shift.largest:.2f}"
        found.append(fact("ground-shift", n=shift.n, median=median, largest=largest))
    kinds = points["ellipse"].value_counts()
    sampled, split, unbounded = (int(kinds.get(name, 0)) for name in ("sampled", "split", "unbounded"))
    if sampled + split:
        key = "ground-split" if split else "ground-sampled"
        found.append(fact(key, sampled=sampled + split, split=split, placed=placed))
    if unbounded:
        found.append(fact("ground-unbounded", unbounded=unbounded, placed=placed))
    return found


#: What is written, by the end of the name.
SUFFIXES = (".csv", ".geojson", ".gpkg")
#: Share of the truth that the ellipses are to hold, and corners of one as a polygon.
LEVEL, CORNERS = 0.9, 72
#: What heights on a map count from.
ELLIPSOID = "height above the WGS 84 ellipsoid"


def with_axes(points: pd.DataFrame) -> pd.DataFrame:
    """The points with half axes (m) and bearing (deg) of their 90 % ellipses.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        With ``long_90_m``, ``short_90_m`` and ``bearing_deg``.
    """
    long, short, bearing = ellipse_axes(covariances_of(points))
    return points.assign(long_90_m=long, short_90_m=short, bearing_deg=np.degrees(bearing) % 180)


def write_points(flight: Flight, points: pd.DataFrame, path: Path, source: str = "") -> None:
    """Write points as CSV (metres from the flight's origin), or as GeoJSON or GeoPackage (WGS84 longitude,
    latitude, height above the ellipsoid).

    Parameters
    ----------
    flight
        Whose they are.
    points
        From `wildlab.analysis.georeference.georeference`; those without a place are in the CSV alone.
    path
        Ends with one of `SUFFIXES`.
    source
        The poses that they come from.

    Raises
    ------
    WildlabError
        Where it ends otherwise.
    """
    vertical = "down from the flight's origin" if path.suffix == ".csv" else ELLIPSOID
    table = _described(flight, points, vertical, source)
    if path.suffix == ".csv":
        write_csv(path, table, "%.3f")
    elif path.suffix == ".geojson":
        write_atomic(path, points_geojson(flight, points, source))
    elif path.suffix == ".gpkg":
        write_geopackage(path, _layers(flight, table))
    else:
        raise WildlabError(
            f"nobody knows how to write {path.suffix!r}", f"end it with {' or '.join(SUFFIXES)}", file=path
        )


def points_geojson(flight: Flight, points: pd.DataFrame, source: str = "") -> str:
    """Points as the text of a GeoJSON file, as `write_points` writes it: exact places.

    Parameters
    ----------
    flight, points, source
        As for `write_points`.

    Returns
    -------
    str
        One feature for each point that has a place.
    """
    table = _described(flight, points, ELLIPSOID, source)
    return json.dumps(_geojson(flight, table), allow_nan=False, separators=(",", ":"))


def _described(flight: Flight, points: pd.DataFrame, vertical: str, source: str) -> pd.DataFrame:
    return with_axes(points).assign(
        level=LEVEL,
        method=_methods(flight, points),
        vertical_reference=vertical,
        source=source,
        flight=flight.name,
    )


def _methods(flight: Flight, points: pd.DataFrame) -> list[str]:
    """Of each point: what it lies on, and how its ellipse was found."""
    ground = "level ground" if flight.terrain is None else "terrain"
    return [f"{ground}, ellipse {kind}" if kind else ground for kind in points["ellipse"].fillna("")]


#: What goes along with a point into a map, and its type there.
PROPERTIES = {
    "detection_id": "TEXT",
    "frame_id": "TEXT",
    "target_id": "TEXT",
    "time_s": "REAL",
    "long_90_m": "REAL",
    "short_90_m": "REAL",
    "bearing_deg": "REAL",
    "level": "REAL",
    "ellipse": "TEXT",
    "method": "TEXT",
    "vertical_reference": "TEXT",
    "source": "TEXT",
    "flight": "TEXT",
}


def _placed(flight: Flight, table: pd.DataFrame) -> tuple[pd.DataFrame, Array]:
    """The points with a place, and (N, 3) longitude, latitude (degrees), height above the ellipsoid (m)."""
    placed = table[table["north_m"].notna() & table["down_m"].notna()]
    return placed, _degrees(flight, placed[["north_m", "east_m", "down_m"]].to_numpy(float))


def _degrees(flight: Flight, place: Array) -> Array:
    llh = ned_to_geodetic(place, flight.manifest.origin_tuple())
    return np.stack([np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2]], axis=1)


def _layers(flight: Flight, table: pd.DataFrame) -> list[Layer]:
    placed, degrees = _placed(flight, table)

    def columns(rows: pd.DataFrame) -> dict[str, tuple[str, list[object]]]:
        return {name: (kind, rows[name].tolist()) for name, kind in PROPERTIES.items() if name in rows}

    known = placed[placed["long_90_m"].notna() & placed["short_90_m"].notna()]
    shapes = [_degrees(flight, ring)[:, :2] for ring in _rings(known)]
    about = f"Where the detections of {flight.name} lie on the ground."
    return [
        Layer("detections", "Detections", about, "POINT", list(degrees), columns(placed)),
        Layer(
            "ellipses",
            f"Ellipses ({100 * LEVEL:.0f} %)",
            f"Each is to hold the true place in {100 * LEVEL:.0f} % of all cases.",
            "POLYGON",
            shapes,
            columns(known),
        ),
    ]


def _rings(placed: pd.DataFrame) -> Array:
    """(N, CORNERS, 3) m in n, the ellipses at the heights of their points."""
    turn = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    along = placed["long_90_m"].to_numpy(float)[:, None] * np.cos(turn)
    across = placed["short_90_m"].to_numpy(float)[:, None] * np.sin(turn)
    bearing = np.radians(placed["bearing_deg"].to_numpy(float))[:, None]
    north = along * np.cos(bearing) - across * np.sin(bearing)
    east = along * np.sin(bearing) + across * np.cos(bearing)
    middle = placed[["north_m", "east_m", "down_m"]].to_numpy(float)[:, None, :]
    return np.asarray(middle + np.stack([north, east, np.zeros_like(north)], axis=2))


def _geojson(flight: Flight, table: pd.DataFrame) -> dict[str, object]:
    placed, degrees = _placed(flight, table)
    kept = [name for name in PROPERTIES if name in placed]
    features = []
    for (longitude, latitude, height), row in zip(degrees, placed[kept].to_dict("records"), strict=True):
        properties = {
            key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()
        }
        place = [round(float(longitude), 8), round(float(latitude), 8), round(float(height), 3)]
        features.append(
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": place}, "properties": properties}
        )
    return {"type": "FeatureCollection", "features": features}


#: What every GeoPackage holds.
SCHEMA = DATA / "geopackage.sql"
WGS84 = 4326
#: Well-known binary of points with z, and of polygons without.
POINT_Z, POLYGON = 1001, 3


class Layer(NamedTuple):
    """One layer of a map.

    Attributes
    ----------
    name
        Of the table: letters, digits and _.
    title, about
        What is shown of it.
    kind
        ``POINT`` (with heights) or ``POLYGON``.
    geometries
        Of each feature, (3,) longitude, latitude (degrees) and height (m), or (K, 2) a ring.
    columns
        Type (``TEXT``, ``REAL`` or ``INTEGER``) and values of each, as many as there are geometries; what is
        not finite is written as NULL.
    """

    name: str
    title: str
    about: str
    kind: str
    geometries: Sequence[Array]
    columns: Mapping[str, tuple[str, Sequence[object]]]


def write_geopackage(path: Path, layers: Sequence[Layer]) -> None:
    """Write layers in WGS 84; the file appears whole or not at all.

    Parameters
    ----------
    path
        Replaced where it is there.
    layers
        In the order in which a map lists them.

    Raises
    ------
    WildlabError
        Where the folder cannot be written to.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    os.close(handle)
    try:
        base = sqlite3.connect(name)
        try:
            _fill(base, layers)
        finally:
            base.close()
        # As any new file: a temporary one is for its owner alone.
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except sqlite3.Error as error:
        raise WildlabError(
            f"the map cannot be written: {error}", "look at the disk and the folder", file=path
        ) from error
    finally:
        Path(name).unlink(missing_ok=True)


def _fill(base: sqlite3.Connection, layers: Sequence[Layer]) -> None:
    base.executescript(SCHEMA.read_text(encoding="utf-8"))
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S.000Z")
    for layer in layers:
        columns = "".join(f", {_quoted(name)} {kind}" for name, (kind, _) in layer.columns.items())
        table = _quoted(layer.name)
        key = "fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL"
        base.execute(f"CREATE TABLE {table} ({key}, geom {layer.kind}{columns})")
        bounds = _bounds(layer.geometries)
        base.execute(
            "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
            (layer.name, layer.title, layer.about, now, *bounds, WGS84),
        )
        base.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, ?, 0)",
            (layer.name, layer.kind, WGS84, int(layer.kind == "POINT")),
        )
        names = "".join(f", {_quoted(name)}" for name in layer.columns)
        marks = ", ?" * len(layer.columns)
        rows = zip(
            (geometry_blob(one) for one in layer.geometries),
            *([_plain(value) for value in values] for _, values in layer.columns.values()),
            strict=True,
        )
        insert = f"INSERT INTO {table} (geom{names}) VALUES (?{marks})"  # noqa: S608 - own names
        base.executemany(insert, rows)
    base.commit()


def geometry_blob(geometry: ArrayLike) -> bytes:
    """A geometry as a GeoPackage has it: its header with the bounds, then well-known binary.

    Parameters
    ----------
    geometry
        (3,) a point with its height, or (K, 2) the ring of a polygon, which is closed where it is not.

    Returns
    -------
    bytes

    Examples
    --------
    >>> geometry_blob([10.0, 63.0, 5.0])[:4], len(geometry_blob([10.0, 63.0, 5.0]))
    (b'GP\\x00\\x01', 37)
    """
    g = np.asarray(geometry, float)
    # Version 1; bit 0: little-endian, bits 1 to 3: which bounds there are (a point needs none, 1: x and y).
    if g.ndim == 1:
        body = struct.pack("<BI3d", 1, POINT_Z, *g)
        return struct.pack("<2sBBi", b"GP", 0, 1, WGS84) + body
    ring = g if (g[0] == g[-1]).all() else np.concatenate([g, g[:1]])
    (left, low), (right, high) = ring.min(axis=0), ring.max(axis=0)
    head = struct.pack("<2sBBi4d", b"GP", 0, 0b11, WGS84, left, right, low, high)
    return head + struct.pack("<BIII", 1, POLYGON, 1, len(ring)) + ring.astype("<f8").tobytes()


def _bounds(geometries: Sequence[Array]) -> tuple[float | None, ...]:
    if not geometries:
        return None, None, None, None
    places = np.concatenate([np.atleast_2d(one)[:, :2] for one in geometries])
    return (*map(float, places.min(axis=0)), *map(float, places.max(axis=0)))


def _plain(value: object) -> object:
    if isinstance(value, str):
        return value
    if value is None:
        return None
    number = float(value)  # type: ignore[arg-type]
    return number if math.isfinite(number) else None


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
