"""Public elevation maps under flights made over them, and a map larger than memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pandas as pd
import pytest
import rasterio
from pyproj import Transformer
from rasterio.transform import Affine
from rasterio.windows import Window

from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight
from wildlab.flight.terrain.laying import lay_terrain
from wildlab.flight.terrain_model import TerrainSays
from wildlab.geometry.frames import geodetic_to_ned

MAPS = {
    ("bambi146_1m", "146_matched_dem.tif"): "EPSG:32633",
    ("jancaha_dsm_1m", "dsm.tif"): "EPSG:8353",
    ("terra_examples", "elev.tif"): "EPSG:4326",
    ("terra_examples", "elev_vinschgau.tif"): "EPSG:32632",
}


def flown(place: dict[str, float], north: float, down: float) -> Flight:
    """Level, over so many metres south and north of a place."""
    parts = {"origin": place, "platform": {"name": "kite"}, "time": {"kind": "sequence"}}
    nav = pd.DataFrame({"time_s": [0.0, 1.0], "north_m": [-north, north], "east_m": 0.0, "down_m": down})
    nav = nav.assign(q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0)
    return Flight(make_manifest({"name": "made", "kind": "logged"} | parts), {"made": nav})


@pytest.mark.parametrize("parts", MAPS, ids=lambda parts: parts[1])
def test_a_public_map_keeps_its_heights_in_n(shared_data, parts):
    """Nodes of the map, taken to n by themselves, lie on the terrain but for its stated error."""
    path = shared_data("dem", *parts)
    with rasterio.open(path) as data:
        there = Transformer.from_crs(data.crs, 4326, always_xy=True)
        heights = data.read(1, masked=True).astype(float).filled(np.nan)
        rows, columns = np.where(np.isfinite(heights))
        a = data.transform
    x, y = a.a * (columns + 0.5) + a.c, a.e * (rows + 0.5) + a.f
    longitude, latitude = there.transform(x, y)
    values = heights[rows, columns]
    middle = np.argmin((columns - columns.mean()) ** 2 + (rows - rows.mean()) ** 2)
    place = {"latitude_deg": latitude[middle], "longitude_deg": longitude[middle], "height_m": 0.0}
    flight = flown(place, north=20.0, down=-(values.max() + 110.0))
    says = TerrainSays(file=path.name, heights=30.0, margin_m=3000.0)
    laid = lay_terrain(flight, path, says)
    assert laid.terrain is not None and laid.manifest.terrain is not None
    record = laid.manifest.terrain
    assert record.crs == MAPS[parts]
    origin = flight.manifest.origin_tuple()
    p = geodetic_to_ned(np.radians(latitude), np.radians(longitude), values + 30.0, origin)
    near = np.abs(p[:, :2]).max(axis=1) < 2900
    off = -p[near, 2] - laid.terrain.heights_at(p[near, :2])
    known = np.isfinite(off)
    # Nodes along holes and borders have no whole patch about them.
    assert known.mean() > (0.9 if record.averaged == 1 else 0.5)
    assert np.sqrt((off[known] ** 2).mean()) < 1.3 * record.error_rms_m + 1e-3
    assert np.abs(np.median(off[known])) < 0.3 * record.error_rms_m + 1e-3


@pytest.mark.slow
def test_of_a_map_larger_than_memory_only_the_part_about_the_flight_is_read(tmp_path):
    """20 000 x 20 000 cells are 1.6 GB."""
    side = 20_000
    x, y = Transformer.from_crs(4326, 32633, always_xy=True).transform(14.6, 46.8)
    given = {"width": side, "height": side, "count": 1, "dtype": "float32", "crs": 32633, "nodata": -9999.0}
    transform = Affine(1, 0, x - side / 2, 0, -1, y + side / 2)
    with rasterio.open(
        tmp_path / "big.tif", "w", driver="GTiff", transform=transform, tiled=True, blockxsize=512,
        blockysize=512, compress="deflate", zlevel=1, SPARSE_OK=True, **given,
    ) as data:  # fmt: skip
        at = np.arange(2048)
        hills = (650 + 30 * np.sin(at / 300)[:, None] + 20 * np.cos(at / 200)).astype(np.float32)
        data.write(hills, 1, window=Window(9216, 9216, 2048, 2048))
    place = {"latitude_deg": 46.8, "longitude_deg": 14.6, "height_m": 700.0}
    flight = flown(place, north=300.0, down=-100.0)
    tracemalloc.start()
    laid = lay_terrain(flight, tmp_path / "big.tif", TerrainSays(file="big.tif", heights=0.0, margin_m=250.0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 400e6
    rows, columns = laid.terrain.height.shape
    assert rows > 1000 and columns > 490
