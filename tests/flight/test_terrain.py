"""Elevation maps under flights: what is read, how it comes into n, and every kind of map that is refused."""

import math
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rasterio
from pyproj import Transformer
from rasterio.transform import Affine
from rasterio.windows import Window

from wildlab.errors import WildlabError
from wildlab.flight.manifest import TerrainSays, make_manifest, replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.flight.terrain import lay_terrain
from wildlab.geometry.frames import geodetic_to_ned

#: Where the made flights are: 46.8 north, 14.6 east, in zone 33, 700 m above the ellipsoid.
LATITUDE, LONGITUDE, HEIGHT = 46.8, 14.6, 700.0
UTM = 32633
#: Places in n to compare terrains at, metres.
AT = np.random.default_rng(0).uniform(-100, 100, (100, 2))


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights above the ellipsoid by longitude and latitude: smooth, 620 to 680 m within the maps below."""
    return 650 + 20 * np.sin(2000 * (x - LONGITUDE)) + 10 * np.cos(3000 * (y - LATITUDE))


def write_map(
    path: Path,
    *,
    crs: Any = UTM,
    cell: float = 4.0,
    side: int = 400,
    turn: float = 0.0,
    height: Callable[[np.ndarray, np.ndarray], np.ndarray] = hills,
    **more: Any,
) -> Path:
    """A map of `height` about the place, cells of ``cell`` units of its CRS, turned by degrees."""
    there = Transformer.from_crs(4326, crs, always_xy=True)
    x0, y0 = there.transform(LONGITUDE, LATITUDE)
    transform = (
        Affine.translation(x0, y0)
        @ Affine.rotation(turn)
        @ Affine(cell, 0.0, -cell * side / 2, 0.0, -cell, cell * side / 2)
    )
    columns, rows = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    x = transform.a * columns + transform.b * rows + transform.c
    y = transform.d * columns + transform.e * rows + transform.f
    longitude, latitude = there.transform(x, y, direction="INVERSE")
    values = height(np.asarray(longitude), np.asarray(latitude))
    units, stated = more.pop("units", None), more.pop("stated", crs)
    given = {"crs": stated, "transform": transform, "dtype": "float32", "count": 1} | more
    with rasterio.open(path, "w", driver="GTiff", width=side, height=side, **given) as data:
        for band in range(given["count"]):
            data.write(values.astype(given["dtype"]), band + 1)
        if units:
            data.units = (units,) * given["count"]
    return path


@pytest.fixture
def flown() -> Callable[..., Flight]:
    """``flown(height_m=..., latitude_deg=...)``: level flight over 400 m, 50 m above its origin."""

    def make(**origin: float) -> Flight:
        n = 30
        nav = pd.DataFrame({"time_s": np.arange(n), "north_m": np.linspace(-200, 200, n), "east_m": 20.0})
        nav = nav.assign(down_m=-50.0, q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0)
        place = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, "height_m": HEIGHT} | origin
        parts = {"origin": place, "platform": {"name": "kite"}, "time": {"kind": "sequence"}}
        return Flight(make_manifest({"name": "lake", "kind": "logged"} | parts), {"logged": nav})

    return make


def lay(flight: Flight, path: Path, **says: Any) -> Flight:
    given = {"file": "map", "heights": "ellipsoid", "margin_m": 150.0} | says
    return lay_terrain(flight, path, TerrainSays(**given))


@pytest.mark.parametrize(("crs", "cell", "turn"), [(UTM, 4.0, 30.0), (4326, 4e-5, 0.0), (3857, 6.0, 180.0)])
def test_the_surface_in_n_is_the_surface_on_the_earth(tmp_path, flown, crs, cell, turn):
    """Points of the formula, taken to n by themselves, lie on the terrain: whatever the CRS and its turn."""
    flight = lay(flown(), write_map(tmp_path / "dem.tif", crs=crs, cell=cell, turn=turn))
    rng = np.random.default_rng(0)
    longitude, latitude = LONGITUDE + rng.uniform(-1e-3, 1e-3, 500), LATITUDE + rng.uniform(-3e-3, 3e-3, 500)
    p = geodetic_to_ned(
        np.radians(latitude), np.radians(longitude), hills(longitude, latitude),
        flight.manifest.origin_tuple(),
    )  # fmt: skip
    off = -p[:, 2] - flight.terrain.heights_at(p[:, :2])
    assert np.isfinite(off).all()
    # Bilinear patches of 4 m cut the crests of waves of 240 m and 235 m by up to 0.05 m.
    assert np.abs(off).max() < 0.08
    record = flight.manifest.terrain
    assert record.error_rms_m < 0.02
    assert np.abs(off).mean() < record.error_max_m + 0.05


def test_curvature_is_taken_off(tmp_path, flown):
    """Level ground falls by d^2 / 2R. (That grid north is not true north, the test above sees.)"""
    level = lay(
        flown(),
        write_map(tmp_path / "level.tif", cell=100.0, height=lambda x, y: np.full(x.shape, 600.0)),
        margin_m=12_000.0,
        step_m=100.0,
    )
    d = np.array([[0.0, 0.0], [10_000.0, 0.0], [0.0, 10_000.0]])
    fall = -100.0 - level.terrain.heights_at(d)
    np.testing.assert_allclose(fall, [0.0, 7.85, 7.83], atol=0.03)


def test_holes_stay_holes_and_are_counted(tmp_path, flown):
    def holed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((x > LONGITUDE) & (y > LATITUDE), -9999.0, hills(x, y))

    path = write_map(tmp_path / "dem.tif", height=holed, nodata=-9999.0)
    flight = lay(flown(), path)
    north, east = np.array([100.0, -100.0, 100.0]), np.array([100.0, 100.0, -100.0])
    heights = flight.terrain.heights_at(np.column_stack([north, east]))
    np.testing.assert_array_equal(np.isnan(heights), [True, False, False])
    assert flight.manifest.terrain.holes == np.isnan(flight.terrain.height).sum() > 0
    undeclared = write_map(tmp_path / "bare.tif", height=holed)
    with pytest.raises(WildlabError, match="heights of -9999"):
        lay(flown(), undeclared)
    again = lay(flown(), undeclared, nodata=-9999.0)
    np.testing.assert_array_equal(again.terrain.height, flight.terrain.height)


@pytest.mark.parametrize(
    ("written", "said"),
    [({"units": "ft"}, {}), ({}, {"unit": "ft"}), ({"crs": "EPSG:32633+6360"}, {"heights": 0.0})],
)
def test_feet_are_feet(tmp_path, flown, written, said):
    """By the band's unit, by the vertical CRS (EPSG:6360, US feet), or by what the user says."""
    foot = 1200 / 3937 if "crs" in written else 0.3048
    metres = lay(flown(), write_map(tmp_path / "m.tif"))
    feet = lay(
        flown(), write_map(tmp_path / "ft.tif", height=lambda x, y: hills(x, y) / foot, **written), **said
    )
    np.testing.assert_allclose(feet.terrain.height, metres.terrain.height, atol=2e-4)


def test_heights_count_from_what_is_said(tmp_path, flown):
    path = write_map(tmp_path / "dem.tif")
    plain, above = lay(flown(), path, step_m=4.0), lay(flown(), path, step_m=4.0, heights=20.0)
    np.testing.assert_allclose(above.terrain.heights_at(AT) - plain.terrain.heights_at(AT), 20.0, atol=1e-3)
    found = above.manifest.terrain
    assert (found.heights, found.added_m) == ("geoid", 20.0)
    assert found.error_rms_m == pytest.approx(plain.manifest.terrain.error_rms_m, abs=1e-4)
    recorded = flown()
    vertical = {"vertical": {"reference": "barometer", "correction_m": -30.0}}
    recorded.manifest = replace_in_manifest(recorded.manifest, vertical)
    same = lay(recorded, path, step_m=4.0, heights="flight")
    np.testing.assert_allclose(same.terrain.heights_at(AT) - plain.terrain.heights_at(AT), 30.0, atol=1e-3)
    egm = write_map(tmp_path / "egm.tif", crs="EPSG:32633+5773")
    for file, says, words in (
        (path, {"heights": None}, "heights count from"),
        (egm, {}, "EGM96 height"),
        (egm, {"heights": None}, "whose grid"),
    ):
        with pytest.raises(WildlabError, match=words):
            lay(flown(), file, **says)
    three = write_map(tmp_path / "three.tif", crs=4979, cell=4e-5)
    assert lay(flown(), three, heights=None).manifest.terrain.heights == "ellipsoid"


def test_standard_deviations_add_up(tmp_path, flown):
    flight = lay(flown(), write_map(tmp_path / "dem.tif", cell=20.0), sd_m=0.4)
    assert flight.terrain.sd == math.hypot(0.4, flight.manifest.terrain.error_rms_m) > 0.4
    assert math.isnan(lay(flown(), write_map(tmp_path / "b.tif")).terrain.sd)


def test_a_picture_as_f_has_it(tmp_path, flown):
    """Equation 6.1: PNG = 5 (M - 71)."""
    grey = np.random.default_rng(0).integers(100, 110, (300, 300)).astype(np.uint8)
    path = tmp_path / "map.png"
    with rasterio.open(path, "w", driver="PNG", width=300, height=300, count=1, dtype="uint8") as data:
        data.write(grey, 1)
    x, y = Transformer.from_crs(4326, UTM, always_xy=True).transform(LONGITUDE, LATITUDE)
    says = {"crs": f"EPSG:{UTM}", "cell_m": 3.0, "corner": (x - 450.0, y + 450.0)}
    flight = lay(flown(height_m=100.0), path, heights=0.0, **says)
    known = flight.terrain.height[np.isfinite(flight.terrain.height)]
    assert known.min() >= 71 + 100 / 5 - 100 - 0.1 and known.max() <= 71 + 109 / 5 - 100 + 0.01
    with pytest.raises(WildlabError, match="where its cells"):
        lay(flown(height_m=100.0), path, crs=f"EPSG:{UTM}")
    with pytest.raises(WildlabError, match="states no CRS"):
        lay(flown(height_m=100.0), path, cell_m=3.0, corner=(x, y))


@pytest.mark.slow
def test_a_fine_map_of_a_wide_place_is_averaged(tmp_path, flown):
    path = write_map(tmp_path / "dem.tif", cell=2.0, side=900)
    fine, coarse = lay(flown(), path), lay(flown(), path, step_m=11.0)
    assert coarse.manifest.terrain.averaged == 5
    np.testing.assert_allclose(coarse.terrain.heights_at(AT), fine.terrain.heights_at(AT), atol=0.7)
    assert coarse.manifest.terrain.error_rms_m > fine.manifest.terrain.error_rms_m


@pytest.mark.parametrize(
    ("origin", "written", "words"),
    [
        # A map of elsewhere.
        ({"latitude_deg": 47.8}, {}, r"nearest cell is 110\."),
        ({"height_m": 400.0}, {}, "below the ground"),
        # No map of heights.
        ({}, {"stated": None}, "states no CRS"),
        ({}, {"stated": 'LOCAL_CS["site",UNIT["metre",1]]'}, "places on Earth"),
        ({}, {"count": 2}, "2 bands"),
        ({}, {"height": lambda x, y: 1e5 + x}, r"heights of 100\d"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(tmp_path, flown, origin, written, words):
    with pytest.raises(WildlabError, match=words):
        lay(flown(**origin), write_map(tmp_path / "dem.tif", **written))


def test_what_is_no_file_or_damaged_is_refused(tmp_path, flown):
    path = write_map(tmp_path / "dem.tif", compress="deflate", tiled=True, blockxsize=64, blockysize=64)
    cut, whole = tmp_path / "cut.tif", path.read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    damaged = "is not a GeoTIFF or PNG that can be read|breaks off or is damaged"
    for file, says, words in (
        (tmp_path / "gone.tif", {}, "no such file"),
        (cut, {}, damaged),
        (path, {"crs": "nonsense"}, "CRS nonsense"),
        (path, {"crs": "EPSG:32634"}, "zone 33N"),
    ):
        with pytest.raises(WildlabError, match=words):
            lay(flown(), file, **says)


def test_a_claim_beyond_belief_is_refused(tmp_path, flown):
    """A small file that claims blocks of a gigabyte: one of them would have to be unpacked as a whole."""
    x, y = Transformer.from_crs(4326, UTM, always_xy=True).transform(LONGITUDE, LATITUDE)
    given = {"crs": UTM, "count": 1, "dtype": "float32", "SPARSE_OK": True, "tiled": True}
    side, block = 100_000, 16_384
    transform = Affine(0.02, 0, x - 1000, 0, -0.02, y + 1000)
    with rasterio.open(
        tmp_path / "bomb.tif", "w", driver="GTiff", width=side, height=side, transform=transform,
        blockxsize=block, blockysize=block, **given,
    ):  # fmt: skip
        pass
    assert (tmp_path / "bomb.tif").stat().st_size < 10_000
    words = r"claims 100,000 x 100,000 cells in blocks of 1,073,741,824 bytes"
    with pytest.raises(WildlabError, match=words):
        lay(flown(), tmp_path / "bomb.tif")


MAPS = {
    ("bambi146_1m", "146_matched_dem.tif"): "EPSG:32633",
    ("jancaha_dsm_1m", "dsm.tif"): "EPSG:8353",
    ("terra_examples", "elev.tif"): "EPSG:4326",
    ("terra_examples", "elev_vinschgau.tif"): "EPSG:32632",
}


def over(place: dict[str, float], north: float, down: float) -> Flight:
    """Level, over so many metres south and north of a place."""
    parts = {"origin": place, "platform": {"name": "kite"}, "time": {"kind": "sequence"}}
    nav = pd.DataFrame({"time_s": [0.0, 1.0], "north_m": [-north, north], "east_m": 0.0, "down_m": down})
    nav = nav.assign(q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0)
    return Flight(make_manifest({"name": "made", "kind": "logged"} | parts), {"made": nav})


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "parts",
    [pytest.param(one, marks=[] if one[0] == "terra_examples" else [SLOW], id=one[1]) for one in MAPS],
)
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
    flight = over(place, north=20.0, down=-(values.max() + 110.0))
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
    flight = over(place, north=300.0, down=-100.0)
    tracemalloc.start()
    laid = lay_terrain(flight, tmp_path / "big.tif", TerrainSays(file="big.tif", heights=0.0, margin_m=250.0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 400e6
    rows, columns = laid.terrain.height.shape
    assert rows > 1000 and columns > 490
