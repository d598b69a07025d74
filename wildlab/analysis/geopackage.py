"""Points and polygons as an OGC GeoPackage (version 1.3): an SQLite file that maps open as it is.

Source: OGC 12-128r17, *GeoPackage Encoding Standard* 1.3.0: the tables of clauses 1.1 and 2.1, the header of
geometries of clause 2.1.3; the geometries themselves are well-known binary (OGC 06-103r4, ISO for z).
"""

from __future__ import annotations

import math
import os
import sqlite3
import struct
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]

#: "GPKG", and the version 1.3.0.
APPLICATION_ID, USER_VERSION = 0x47504B47, 10300
WGS84 = 4326
#: Well-known binary of points with z, and of polygons without.
POINT_Z, POLYGON = 1001, 3

_DEFINITION = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
    'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",'
    '0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]'
)
_SCHEMA = """
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL,
  organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
"""
_SYSTEMS = (
    (
        "Undefined cartesian SRS",
        -1,
        "NONE",
        -1,
        "undefined",
        "undefined cartesian coordinate reference system",
    ),
    (
        "Undefined geographic SRS",
        0,
        "NONE",
        0,
        "undefined",
        "undefined geographic coordinate reference system",
    ),
    ("WGS 84 geodetic", WGS84, "EPSG", WGS84, _DEFINITION, "longitude and latitude in degrees on WGS 84"),
)


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
    base.executescript(_SCHEMA)
    base.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    base.execute(f"PRAGMA user_version = {USER_VERSION}")
    base.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", _SYSTEMS)
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
        base.executemany(f"INSERT INTO {table} (geom{names}) VALUES (?{marks})", rows)  # noqa: S608 - own names
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
