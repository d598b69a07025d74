"""Maps of points as a GeoPackage, read back by the rules of the standard with nothing of ours."""

from __future__ import annotations

import csv
import json
import math
import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.refused import refused
from wildlab.analysis.georeference import covariances_of, georeference, observe
from wildlab.analysis.ground import CORNERS, Layer, write_geopackage, write_points
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned
from wildlab.simulation.twins import simulate_twin


def parse(blob: bytes) -> tuple[int, list[float], int, np.ndarray]:
    """System, bounds, type and coordinates of a geometry: OGC 12-128r17, 2.1.3; OGC 06-103r4."""
    assert blob[:2] == b"GP" and blob[2] == 0
    flags = blob[3]
    order = "<" if flags & 1 else ">"
    assert not flags & 0b110000, "neither empty nor extended"
    (system,) = struct.unpack_from(f"{order}i", blob, 4)
    doubles = {0: 0, 1: 4, 2: 6, 3: 6, 4: 8}[flags >> 1 & 7]
    bounds = list(struct.unpack_from(f"{order}{doubles}d", blob, 8))
    body = blob[8 + 8 * doubles :]
    order = "<" if body[0] else ">"
    (kind,) = struct.unpack_from(f"{order}I", body, 1)
    if kind == 1001:
        assert len(body) == 5 + 24
        return system, bounds, kind, np.array(struct.unpack_from(f"{order}3d", body, 5))
    assert kind == 3
    rings, count = struct.unpack_from(f"{order}II", body, 5)
    assert rings == 1 and len(body) == 13 + 16 * count
    return system, bounds, kind, np.array(struct.unpack_from(f"{order}{2 * count}d", body, 13)).reshape(-1, 2)


def rows_of(base: sqlite3.Connection, query: str) -> list[Any]:
    return pd.read_sql_query(query, base).to_dict("records")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Flight, Any, Path]:
    flight = simulate_twin("large-ship", 1)
    seen = observe(flight, "autopilot")
    points = georeference(seen, np.random.default_rng(1))
    points.loc[3, ["north_m", "east_m", "down_m"]] = np.nan
    path = tmp_path_factory.mktemp("map") / "points.gpkg"
    write_points(flight, points, path, "autopilot")
    return flight, points, path


def test_the_file_is_what_the_standard_asks_for(made):
    base = sqlite3.connect(made[2])
    assert made[2].read_bytes()[:16] == b"SQLite format 3\0"
    assert base.execute("PRAGMA application_id").fetchone() == (int.from_bytes(b"GPKG", "big"),)
    assert base.execute("PRAGMA user_version").fetchone() == (10300,)
    assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert base.execute("PRAGMA foreign_key_check").fetchall() == []
    systems = {row["srs_id"]: row for row in rows_of(base, "SELECT * FROM gpkg_spatial_ref_sys")}
    assert {-1, 0, 4326} <= set(systems)
    assert systems[4326]["organization"] == "EPSG" and systems[4326]["organization_coordsys_id"] == 4326
    contents = {row["table_name"]: row for row in rows_of(base, "SELECT * FROM gpkg_contents")}
    geometry = {row["table_name"]: row for row in rows_of(base, "SELECT * FROM gpkg_geometry_columns")}
    assert set(contents) == set(geometry) == {"detections", "ellipses"}
    assert geometry["detections"]["geometry_type_name"] == "POINT" and geometry["detections"]["z"] == 1
    assert geometry["ellipses"]["geometry_type_name"] == "POLYGON" and geometry["ellipses"]["z"] == 0
    for name, row in contents.items():
        assert row["data_type"] == "features" and row["srs_id"] == geometry[name]["srs_id"] == 4326
        key = rows_of(base, f"PRAGMA table_info({name})")[0]
        assert key["name"] == "fid" and key["pk"] == 1 and key["type"] == "INTEGER"
        shapes = [parse(one["geom"]) for one in rows_of(base, f"SELECT geom FROM {name}")]  # noqa: S608
        every = np.concatenate([np.atleast_2d(shape[3])[:, :2] for shape in shapes])
        bounds = [row["min_x"], row["min_y"], row["max_x"], row["max_y"]]
        assert bounds == pytest.approx([*every.min(axis=0), *every.max(axis=0)])
        for system, envelope, _, place in shapes:
            assert system == 4326
            if envelope:
                (left, low), (right, high) = place.min(axis=0), place.max(axis=0)
                assert envelope == pytest.approx([left, right, low, high])


def test_pyproj_reads_its_reference_system(made):
    from pyproj import CRS

    with closing(sqlite3.connect(made[2])) as base:
        [(definition,)] = base.execute("SELECT definition FROM gpkg_spatial_ref_sys WHERE srs_id = 4326")
    assert CRS.from_wkt(definition).to_epsg() == 4326


def test_points_lie_where_they_are_and_say_what_they_come_from(made):
    flight, points, path = made
    rows = rows_of(sqlite3.connect(path), "SELECT * FROM detections")
    placed = points[points["north_m"].notna()]
    assert [row["detection_id"] for row in rows] == placed["detection_id"].tolist()
    places = np.array([parse(row["geom"])[3] for row in rows])
    back = geodetic_to_ned(
        np.radians(places[:, 1]), np.radians(places[:, 0]), places[:, 2], flight.manifest.origin_tuple()
    )
    assert back == pytest.approx(placed[["north_m", "east_m", "down_m"]].to_numpy(), abs=1e-5)
    first = rows[0]
    assert first["level"] == 0.9 and first["source"] == "autopilot" and first["flight"] == flight.name
    assert "ellipsoid" in first["vertical_reference"]


def test_polygons_are_the_ellipses_of_ninety_per_cent(made):
    """Each corner is as far away, by the covariance, as a normal distribution asks for."""
    flight, points, path = made
    rows = rows_of(sqlite3.connect(path), "SELECT * FROM ellipses")
    table = points.set_index("detection_id")
    assert rows
    for row in rows[:40]:
        ring = parse(row["geom"])[3]
        assert len(ring) == CORNERS + 1 and (ring[0] == ring[-1]).all()
        own = table.loc[[row["detection_id"]]].reset_index()
        height = float(flight.manifest.origin.height_m - own["down_m"].iloc[0])
        metres = geodetic_to_ned(
            np.radians(ring[:, 1]), np.radians(ring[:, 0]), height, flight.manifest.origin_tuple()
        )
        off = metres[:, :2] - own[["north_m", "east_m"]].to_numpy()
        C = covariances_of(own)[0]
        distance = np.einsum("ni,ij,nj->n", off, np.linalg.inv(C), off)
        # Two degrees of freedom: 1 - exp(-d / 2) is the share within.
        assert 1 - np.exp(-distance / 2) == pytest.approx(np.full(len(ring), 0.9), abs=2e-3)
        widest = max(math.hypot(*one) for one in off)
        assert widest == pytest.approx(row["long_90_m"], rel=5e-3)


def test_the_other_files_say_the_same(made, tmp_path):
    flight, points, path = made
    write_points(flight, points, tmp_path / "p.geojson", "autopilot")
    features = json.loads((tmp_path / "p.geojson").read_text())["features"]
    rows = rows_of(sqlite3.connect(path), "SELECT * FROM detections")
    for feature, row in zip(features, rows, strict=True):
        assert feature["geometry"]["coordinates"] == pytest.approx(parse(row["geom"])[3], abs=1e-3)
        assert feature["properties"]["long_90_m"] == pytest.approx(row["long_90_m"])
        assert feature["properties"]["source"] == "autopilot" and feature["properties"]["level"] == 0.9
    write_points(flight, points, tmp_path / "p.csv", "autopilot")
    with (tmp_path / "p.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(points)
    assert "origin" in table[0]["vertical_reference"]


def test_hostile_names_and_values_are_only_text(tmp_path):
    nasty = '\'; DROP TABLE gpkg_contents; -- "x" \0<b>'
    layer = Layer(
        "a", nasty, nasty, "POINT", [np.array([1.0, 2.0, 3.0])],
        {nasty.replace("\0", ""): ("TEXT", [nasty]), "n": ("REAL", [math.nan]), "m": ("REAL", [math.inf])},
    )  # fmt: skip
    write_geopackage(tmp_path / "x.gpkg", [layer])
    base = sqlite3.connect(tmp_path / "x.gpkg")
    (row,) = rows_of(base, "SELECT * FROM a")
    assert row[nasty.replace("\0", "")] == nasty and row["n"] is None and row["m"] is None
    assert len(rows_of(base, "SELECT * FROM gpkg_contents")) == 1


def test_a_map_without_a_point_is_still_a_map(tmp_path):
    write_geopackage(tmp_path / "none.gpkg", [Layer("a", "A", "", "POINT", [], {"x": ("TEXT", [])})])
    (row,) = rows_of(sqlite3.connect(tmp_path / "none.gpkg"), "SELECT * FROM gpkg_contents")
    assert row["min_x"] is None
    assert [one.name for one in tmp_path.iterdir()] == ["none.gpkg"]


def test_an_ending_that_nobody_knows_is_refused(made, tmp_path):
    with refused(r"'\.shp'"):
        write_points(made[0], made[1], tmp_path / "p.shp")
