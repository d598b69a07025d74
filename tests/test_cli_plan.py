"""`wildlab plan`, through the real command: files for the pilot, a page that tells no place, sentences."""

import json
import re
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import rasterio

from tests import commands
from tests.analysis.test_plan import FIELD
from tests.flight.test_area import LAT, LON, collection, feature, polygon
from tests.flight.test_mission_writers import check_plan, read_wpl
from wildlab.flight.calibration_files import CameraFile, write_calibration
from wildlab.flight.manifest import CameraPart
from wildlab.reporting.plan import roomiest_place

call, succeed, refuse = (partial(one, "plan") for one in (commands.call, commands.succeed, commands.refuse))
SHEET = ("--image", "640x512", "--view", "45")


@pytest.fixture
def area(tmp_path):
    path = tmp_path / "fence.geojson"
    path.write_text(json.dumps(collection(feature(polygon(FIELD), name="Wolf <script>"))), encoding="utf-8")
    return path


def test_a_plan_leaves_files_and_a_page_that_tells_no_place(area, tmp_path):
    into = tmp_path / "out"
    out = succeed(area, *SHEET, "--height", 60, "--battery", 9, "--out", into)
    names = sorted(one.name for one in into.iterdir())
    flights = [one for one in names if one.endswith(".waypoints")]
    assert names == sorted(["plan.geojson", "plan.kml", "report.html", "result.json", *flights,
                            *(one.replace(".waypoints", ".plan") for one in flights)])  # fmt: skip
    for one in flights:
        rows = read_wpl((into / one).read_text())
        items = check_plan(json.loads((into / one.replace(".waypoints", ".plan")).read_text()))
        assert len(rows) == len(items) + 1
        points = rows[rows[:, 3] == 16][1:]
        assert abs(points[:, 8] - LAT).max() < 0.006 and abs(points[:, 9] - LON).max() < 0.006
    said = json.loads((into / "result.json").read_text())
    assert said["height_m"] == 60 and sorted(said["places"]) == sorted(
        set(names) - {"report.html", "result.json"}
    )
    page = (into / "report.html").read_text()
    for hidden in (page, (into / "result.json").read_text(), out):
        text = re.sub(r"data:image/png;base64,[^\"]+", "", hidden)
        assert "58.6" not in text and "16.4" not in text and str(tmp_path) not in text.replace(str(into), "")
    assert "Wolf" not in page + out + (into / "result.json").read_text() and "withheld" in page
    assert "area 1" in page and "Wolf" in (into / "plan.kml").read_text()
    code, _, err = call(area, *SHEET, "--height", 60, "--names", "--out", tmp_path / "named")
    named = (tmp_path / "named" / "report.html").read_text()
    assert code == 0 and "Wolf &lt;script&gt;" in named and "withheld" in named
    assert all(one in err for one in flights)


def test_the_page_tells_the_place_where_it_may(area, tmp_path):
    code, _, err = call(area, *SHEET, "--out", tmp_path / "out", "--exact")
    assert "Wolf &lt;script&gt;" in (tmp_path / "out" / "report.html").read_text()
    assert code == 0 and "report.html" in err
    assert "58.66" in (tmp_path / "out" / "report.html").read_text()


def test_a_folder_is_replaced_only_when_asked(area, tmp_path):
    into = tmp_path / "out"
    succeed(area, *SHEET, "--battery", 5, "--height", 40, "--out", into)
    before = len(list(into.glob("*.plan")))
    refuse(area, *SHEET, "--out", into)
    assert len(list(into.glob("*.plan"))) == before > 1
    (into / "mine.txt").write_text("kept")
    succeed(area, *SHEET, "--out", into, "--overwrite")
    assert len(list(into.glob("*.plan"))) == 1 and (into / "mine.txt").read_text() == "kept"
    other = tmp_path / "other"
    other.mkdir()
    (other / "photo.jpg").write_text("x")
    assert "photo.jpg" in refuse(area, *SHEET, "--out", other, "--overwrite")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--image", "640x512"), "nothing says"),
        (("--image", "640", "--view", "45"), "640x512"),
        ((*SHEET, "--camera", "x.toml"), "twice"),
        ((*SHEET, "--height", "-5"), "--height"),
        (("--image", "640x512", "--focal", "13"), "--focal"),
    ],
)
def test_wrong_use_leaves_nothing(area, tmp_path, given, said):
    assert said.lower() in refuse(area, *given, "--out", tmp_path / "out").lower()
    assert not (tmp_path / "out").exists()


def test_a_camera_file_in_millimetres_is_named(area, tmp_path):
    camera = {"name": "a", "width_px": 640, "height_px": 512, "cx_px": 320.0, "cy_px": 256.0}
    for name, focal in (("mm", 50.0), ("px", 764.0)):
        file = CameraFile(camera=CameraPart(**camera, fx_px=focal, fy_px=focal))
        write_calibration(file, tmp_path / f"{name}.toml")
    assert "fx_px" in refuse(area, "--camera", tmp_path / "mm.toml", "--out", tmp_path / "out")
    succeed(area, "--camera", tmp_path / "px.toml", "--out", tmp_path / "out")


# -- over a map of heights


def write_map(path, heights, north_west, crs="EPSG:32633", cell=5.0):
    transform = rasterio.Affine(cell, 0, north_west[0], 0, -cell, north_west[1])
    rows, columns = heights.shape
    given = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": crs, "transform": transform}
    with rasterio.open(path, "w", height=rows, width=columns, **given) as out:
        out.write(heights, 1)
    return path


@pytest.fixture(scope="module")
def over_map(tmp_path_factory):
    """An area of 200 m by 400 m in the middle of a map of 1 km by 1 km, in UTM zone 33, with a ridge."""
    from pyproj import Transformer

    folder = tmp_path_factory.mktemp("map")
    east, north = Transformer.from_crs(4326, 32633, always_xy=True).transform(LON, LAT)
    x = np.arange(200) * 5.0
    ridge = 40 * np.exp(-(((x - 500) / 60) ** 2)) + 300
    heights = np.tile(ridge.astype(np.float32), (200, 1))
    dem = write_map(folder / "dem.tif", heights, (east - 400, north + 700))
    area = folder / "fence.geojson"
    area.write_text(json.dumps(collection(feature(polygon(FIELD), name="Wolf", animals=6))), encoding="utf-8")
    return folder, area, dem, heights, (east - 400, north + 700)


def test_heights_follow_a_map(over_map, tmp_path):
    _, area, dem, _, _ = over_map
    into = tmp_path / "out"
    succeed(area, *SHEET, "--terrain", dem, "--height", 60, "--direction", 90, "--out", into)
    rows = read_wpl((into / "sortie-1.waypoints").read_text())
    points = rows[rows[:, 3] == 16][1:]
    # Over the ridge and back down, row after row: 60 m above the ground, counted from the take-off's.
    assert np.ptp(points[:, 10]) == pytest.approx(40, abs=6)
    assert rows[0, 10] == pytest.approx(300, abs=12)  # what the map says of the take-off point
    said = json.loads((into / "result.json").read_text())
    one = said["sorties"][0]
    assert 54.9 <= one["least_above_ground_m"] <= 60 <= one["most_above_ground_m"] <= 65.1
    page = (into / "report.html").read_text()
    assert "dem.tif" not in page
    assert "58.6" not in re.sub(r"data:image/png;base64,[^\"]+", "", page)


def test_maps_that_do_not_fit_are_refused(over_map, tmp_path):
    folder, area, dem, heights, corner = over_map
    into = ("--out", tmp_path / "out")

    def refused(path, area=area):
        return refuse(area, *SHEET, "--height", 60, "--terrain", path, *into)

    # The same map, 300 m further north: it holds a part of the area.
    part = write_map(folder / "part.tif", heights, (corner[0], corner[1] + 500))
    assert re.search(r"\d\d % of Wolf", refused(part))
    turned = folder / "turned.geojson"
    ring = [[b, a] for a, b in polygon(FIELD)["coordinates"][0]]
    turned.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    assert "exchanged" in refused(dem, area=turned)
    # Without a map, a take-off point tells it.
    assert "exchanged" in refuse(turned, *SHEET, "--height", 60, "--home", f"{LAT},{LON}", *into)
    holes = heights.copy()
    holes[:, 80:] = np.nan
    assert "% of Wolf" in refused(write_map(folder / "holes.tif", holes, corner))
    assert "no map" in refuse(area, *SHEET, "--terrain-crs", "EPSG:32633", *into)
    assert not (tmp_path / "out").exists()


def test_the_name_of_an_area_stands_in_the_area_and_not_in_its_hole():
    inside = np.ones((21, 41), bool)
    inside[4:17, 12:30] = False
    cells = SimpleNamespace(inside=inside, north=-100.0, east=300.0, step=10.0)
    north, east = roomiest_place(cells)
    # To the west and the north of the hole there are 12 and 4 columns and rows, to the east 11.
    row, column = int((north + 100) / 10), int((east - 300) / 10)
    assert inside[row, column] and 4 <= column <= 7 and 4 <= row <= 16
