"""`wildlab terrain`, `wildlab import --terrain` and `wildlab georeference`, through the real command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyproj import Transformer

from tests.analysis.survey_twin import Survey, simulate
from tests.commands import refuse, succeed
from tests.test_cli_plan import write_map
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import load_flight, save_flight
from wildlab.geometry.frames import ned_to_geodetic

UTM = 25833


def write_slope(path: Path, latitude: float, longitude: float, height: float, rise: float) -> Path:
    """A slope that rises by so much a metre to the east, as high as said at the place; cells of 5 m."""
    x, y = Transformer.from_crs(4326, UTM, always_xy=True).transform(longitude, latitude)
    columns = np.arange(400) - 199.5
    heights = np.tile(height + rise * 5.0 * columns, (400, 1)).astype(np.float32)
    return write_map(path, heights, (x - 1000.0, y + 1000.0), UTM)


@pytest.fixture
def surveyed(tmp_path: Path) -> tuple[Path, Path]:
    """A flight over marks on level ground, and a map of level ground as high as these, tilted by a tenth."""
    flight = simulate(Survey(images=8))
    flight.manifest = replace_in_manifest(
        flight.manifest, {"origin": {"latitude_deg": 61.0, "longitude_deg": 15.0, "height_m": 300.0}}
    )
    down = float(flight.table("truth")["down_m"].median())
    save_flight(flight, tmp_path / "flight")
    return tmp_path / "flight", write_slope(tmp_path / "dem.tif", 61.0, 15.0, 300.0 - down, 0.1)


def test_a_map_is_laid_under_a_flight_and_its_points_lie_on_it(surveyed, tmp_path):
    folder, dem = surveyed
    succeed("georeference", folder, "--out", tmp_path / "level.csv")
    succeed("terrain", folder, dem, "--heights", "ellipsoid", "--sd", "0.3")
    flight = load_flight(folder)
    assert flight.terrain is not None and flight.manifest.terrain is not None
    assert flight.manifest.terrain.crs == "EPSG:25833"
    succeed("georeference", folder, "--out", tmp_path / "slope.csv")
    level, slope = pd.read_csv(tmp_path / "level.csv"), pd.read_csv(tmp_path / "slope.csv")
    # On the slope, convergence of the grid aside: it leans to the east.
    rise = -(slope["down_m"] - level["down_m"])
    np.testing.assert_allclose(rise, 0.1 * slope["east_m"], atol=0.1)
    succeed("check", folder)


def test_a_geojson_has_the_places(surveyed, tmp_path):
    folder, _ = surveyed
    succeed("georeference", folder, "--out", tmp_path / "p.csv")
    succeed("georeference", folder, "--out", tmp_path / "p.geojson")
    points = pd.read_csv(tmp_path / "p.csv")
    every = json.loads((tmp_path / "p.geojson").read_text())["features"]
    found = [one for one in every if one["geometry"]["type"] == "Point"]
    origin = load_flight(folder).manifest.origin_tuple()
    llh = ned_to_geodetic(points[["north_m", "east_m", "down_m"]].to_numpy(), origin)
    places = np.array([one["geometry"]["coordinates"] for one in found])
    np.testing.assert_allclose(places[:, 0], np.degrees(llh[:, 1]), atol=2e-8)
    np.testing.assert_allclose(places[:, 1], np.degrees(llh[:, 0]), atol=2e-8)
    assert [one["properties"]["detection_id"] for one in found] == list(points["detection_id"])
    assert "--overwrite" in refuse("georeference", folder, "--out", tmp_path / "p.csv")
    assert ".geojson" in refuse("georeference", folder, "--out", tmp_path / "p.shp")
