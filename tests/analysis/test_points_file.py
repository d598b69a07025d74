"""Maps of points as GeoJSON, beside the table of metres."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildlab.analysis.georeference import (
    CORNERS,
    covariances_of,
    georeference,
    observe,
    write_points,
)
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Flight, Any, Path]:
    flight = simulate_twin("large-ship", 1)
    seen = observe(flight, "autopilot")
    points = georeference(seen, np.random.default_rng(1))
    points.loc[3, ["north_m", "east_m", "down_m"]] = np.nan
    path = tmp_path_factory.mktemp("map") / "points.geojson"
    write_points(flight, points, path, "autopilot")
    return flight, points, path


def features(text: str, kind: str) -> list[Any]:
    return [one for one in json.loads(text)["features"] if one["geometry"]["type"] == kind]


def test_points_lie_where_they_are_and_say_what_they_come_from(made):
    flight, points, path = made
    found = features(path.read_text(), "Point")
    placed = points[points["north_m"].notna()]
    assert [one["properties"]["detection_id"] for one in found] == placed["detection_id"].tolist()
    lon, lat, height = np.array([one["geometry"]["coordinates"] for one in found]).T
    back = geodetic_to_ned(np.radians(lat), np.radians(lon), height, flight.manifest.origin_tuple())
    assert back == pytest.approx(placed[["north_m", "east_m", "down_m"]].to_numpy(), abs=2e-3)
    first = found[0]["properties"]
    assert (first["level"], first["source"], first["flight"]) == (0.9, "autopilot", flight.name)
    assert "ellipsoid" in first["vertical_reference"]


@pytest.mark.parametrize(("taken_off", "ellipsoid"), [(0.0, False), (-32.0, True)])
def test_heights_count_from_what_the_flight_says(made, tmp_path, taken_off, ellipsoid):
    flight, points, _ = made
    vertical = {"vertical": {"reference": "the quay", "correction_m": taken_off}}
    other = replace(flight, manifest=replace_in_manifest(flight.manifest, vertical))
    write_points(other, points, tmp_path / "points.geojson")
    features = json.loads((tmp_path / "points.geojson").read_text())["features"]
    (said,) = {one["properties"]["vertical_reference"] for one in features}
    assert ("ellipsoid" in said, "the quay" in said) == (ellipsoid, not ellipsoid)


def test_polygons_are_the_ellipses_of_ninety_per_cent(made):
    """Each corner is as far away, by the covariance, as a normal distribution asks for."""
    flight, points, path = made
    table = points.set_index("detection_id")
    found = features(path.read_text(), "Polygon")
    assert len(found) == points["north_m"].notna().sum()
    for one in found[:40]:
        (ring,) = one["geometry"]["coordinates"]
        assert len(ring) == CORNERS + 1 and ring[0] == ring[-1]
        own = table.loc[[one["properties"]["detection_id"]]].reset_index()
        height = float(flight.manifest.origin.height_m - own["down_m"].iloc[0])
        lon, lat = np.radians(ring).T
        # RFC 7946: outer rings run counterclockwise, east before north.
        east, north = np.diff(ring, axis=0).T
        assert (east[:-1] * north[1:] > north[:-1] * east[1:]).all()
        metres = geodetic_to_ned(lat, lon, height, flight.manifest.origin_tuple())
        off = metres[:, :2] - own[["north_m", "east_m"]].to_numpy()
        distance = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariances_of(own)[0]), off)
        # Two degrees of freedom: 1 - exp(-d / 2) is the share within.
        assert 1 - np.exp(-distance / 2) == pytest.approx(np.full(len(ring), 0.9), abs=2e-3)
        assert np.hypot(*off.T).max() == pytest.approx(one["properties"]["long_90_m"], rel=5e-3)
