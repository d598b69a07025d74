"""What a recipe converts: frames, units, signs, times, groups; against numbers from elsewhere."""

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine
from scipy.spatial.transform import Rotation

from tests.flight.recipe.comparing import near
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.clocks import covariances
from wildlab.flight.schema import UNITS, factor
from wildlab.flight.store import Flight, accept_changes, load_flight
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.runner.evaluate import track_many

ORIGIN = "latitude_deg = 63.44\nlongitude_deg = 10.4\nheight_m = 40.0"


def _position(flight: Flight) -> np.ndarray:
    return flight.nav["log"][["north_m", "east_m", "down_m"]].to_numpy()


def _rotations(flight: Flight) -> np.ndarray:
    return quaternion_to_matrix(flight.nav["log"][["q_w", "q_x", "q_y", "q_z"]].to_numpy())


def again(raw: Any, dotted: str, value: Any) -> Flight:
    """The flight of a changed recipe, in a folder of its own."""
    raw.folder = raw.folder / "again"
    raw.folder.mkdir()
    raw.set(dotted, value)
    return raw.run()


def test_decimal_commas_are_stated(raw):
    """As Excel writes tables in Norwegian; points beside them are refused, and so are commas unstated."""
    points, plain = raw.tables["nav.csv"], _position(raw.run())
    commas = re.sub(r"(?<=\d)\.(?=\d)", ",", points.replace(",", ";"))
    commas = re.sub(r"(:\d\d),(\d+Z)", r"\1.\2", commas)  # a time is no number
    raw.tables["nav.csv"] = commas
    raw.set("poses.log.separator", ";")
    assert np.array_equal(_position(again(raw, "poses.log.decimal", ",")), plain)
    with pytest.raises(WildlabError, match="decimal = ','"):
        again(raw, "poses.log.decimal", ".")
    raw.tables["nav.csv"] = points.replace(",", ";")
    with pytest.raises(WildlabError, match="not a finite number"):
        again(raw, "poses.log.decimal", ",")


def test_local_positions_both_ways(raw):
    raw.tables["nav.csv"] = "time,a,b,c,roll,pitch,yaw\n0,100,2,-3000,10,-20,30\n4,300,2,-3000,10,-20,30\n"
    raw.set("origin", ORIGIN)
    raw.set("poses.log.time.format", "elapsed")
    raw.set("poses.log.attitude", """
        roll = {column = "roll", unit = "deg"}
        pitch = {column = "pitch", unit = "deg", negate = true}
        yaw = {column = "yaw", unit = "deg"}
    """)  # fmt: skip
    raw.set("poses.log.position", """
        north = {column = "a", unit = "ft"}
        east = {column = "b", unit = "km"}
        down = {column = "c", unit = "cm"}
    """)  # fmt: skip
    flight = raw.run()
    near(_position(flight)[0], [30.48, 2000, -30])
    near(np.degrees(matrix_to_euler(_rotations(flight))), [[10, 20, 30]] * 2)
    turned = """
        east = {column = "a", unit = "ft"}
        north = {column = "b", unit = "km"}
        up = {column = "c", unit = "cm", negate = true}
    """
    near(_position(again(raw, "poses.log.position", turned))[0], [2000, 30.48, -30])


@pytest.mark.parametrize("turn", [[0.3, -0.2, 2.5], [-1.1, 2.0, 0.4], [0.0, 0.0, -3.0]])
def test_attitudes_in_other_axes(raw, turn):
    """The same body, described forward-left-up in east-north-up."""
    R = Rotation.from_rotvec(turn)
    nose, right, belly = R.as_matrix().T  # in n: north, east, down

    def ned_to_enu(v: np.ndarray) -> np.ndarray:
        return np.array([v[1], v[0], -v[2]])

    columns = np.column_stack([ned_to_enu(nose), -ned_to_enu(right), -ned_to_enu(belly)])
    cells = ",".join(map(repr, Rotation.from_matrix(columns).as_quat(scalar_first=True).tolist()))
    raw.tables["nav.csv"] = raw.tables["nav.csv"].replace(",1,0,0,0", f",{cells}")
    raw.set("poses.log.attitude.axes", "flu-enu")
    near(_rotations(raw.run()), [R.as_matrix()] * 5, atol=1e-12)


def test_order_and_inverse_of_quaternions(raw):
    q = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    cells = ",".join(map(repr, q.inv().as_quat().tolist()))
    raw.tables["nav.csv"] = raw.tables["nav.csv"].replace(",1,0,0,0", f",{cells}")
    raw.set("poses.log.attitude.order", "xyzw")
    raw.set("poses.log.attitude.inverse", True)
    near(_rotations(raw.run()), [q.as_matrix()] * 5, atol=1e-12)


@pytest.mark.parametrize(
    ("stated", "tilt", "heading"),
    [("tilt = 1.5, heading = 4.0", 1.5, 4.0), ("roll = 1.0, pitch = 7.0, yaw = 4.0", 5.0, 4.0)],
)
def test_velocity_and_spreads(raw, stated, tilt, heading):
    angles = re.sub(r"(\w+) = ([\d.]+),? ?", r'\1 = {value = \2, unit = "deg"}\n', stated)
    metres = 'horizontal = {value = 2.0, unit = "m"}\nvertical = {value = 3.0, unit = "m"}\n'
    raw.set("poses.log.spreads", metres + angles)
    knots = "".join(f'{one} = {{value = 10.0, unit = "kn"}}\n' for one in ("north", "east", "up"))
    raw.set("poses.log.velocity", knots)
    nav = raw.run().nav["log"]
    near(nav, [[5.14444, -5.14444]] * 5, "v_north_m_s", "v_down_m_s", atol=1e-5)
    near(np.sqrt(np.diag(covariances(nav)[0])), [2, 2, 3, *np.radians([tilt, tilt, heading])])


def test_the_vertical_correction_is_taken_off_what_is_named(raw):
    raw.set("origin", ORIGIN)
    before = raw.run()
    vertical = 'reference = "geoid"\ncorrection_m = -39.5\ntaken_off = ["poses", "truth"]\nnote = "why"'
    after = again(raw, "vertical", vertical)
    near(_position(before)[:, 2] - _position(after)[:, 2], 39.5)
    near(before.table("truth")["down_m"] - after.table("truth")["down_m"], 39.5)
    near(before.table("detections")["plane_down_m"], after.table("detections")["plane_down_m"])
    assert after.manifest.vertical.correction_m == -39.5


RADAR = """
    file = "clicks.csv"
    azimuth = {value = 90.0, unit = "deg"}
    elevation = {value = -5.0, unit = "deg"}
"""


def test_proportions_are_of_the_image(raw):
    raw.tables["clicks.csv"] = "photo,x,y,what\nA,0.25,0.5,\n"
    raw.set("detections.0.pixel.u.unit", "proportion-of-width")
    raw.set("detections.0.pixel.v.unit", "proportion-of-height")
    assert list(raw.run().table("detections")[["u_px", "v_px"]].iloc[0]) == [160.0, 256.0]
    assert all(len(set(units)) == len(units) for units in UNITS.values())


def test_other_kinds_of_detections(raw):
    for more in ('source = "radar"\nrange = {value = 2.0, unit = "km"}', 'source = "microphone"'):
        raw.recipe["detections"].append(tomllib.loads(RADAR + more))
    detections = raw.run().table("detections")
    assert list(detections["kind"]) == ["pixel"] * 3 + ["range-bearing"] * 3 + ["bearing"] * 3
    assert list(detections["detection_id"]) == ["0", "1", "2"] * 3
    found = [[math.pi / 2, 2000.0]] * 3 + [[math.pi / 2, np.nan]] * 3
    near(detections.iloc[3:], found, "azimuth_rad", "range_m")
    assert list(detections["frame_id"].iloc[3:]) == [""] * 6


def test_a_night_in_which_nothing_was_detected_is_imported(raw):
    raw.tables["clicks.csv"] = "photo,x,y,what\n"
    flight = raw.run()
    assert len(flight.table("detections")) == 0 and len(flight.table("frames")) == 3
    assert [one.level for one in check_flight(flight) if one.table == "detections"] == ["warning"]
    with pytest.raises(WildlabError, match="no detections"):
        track_many(flight.folder)


def _head_up(raw: Any, yaws_deg: list[float], bearings: list[float]) -> None:
    """A radar whose bearings are relative to the bow, on a platform that leans and turns."""
    nav = "time,lat,lon,height,qx,qy,qz,qw\n"
    for second, yaw in enumerate(yaws_deg):
        q = ",".join(map(repr, Rotation.from_euler("ZYX", [yaw, 7.0, -4.0], degrees=True).as_quat().tolist()))
        nav += f"2024-06-12T09:30:0{second}Z,63.44,10.4,140,{q}\n"
    raw.tables["nav.csv"] = nav
    photos = zip("ABC", bearings, strict=True)
    raw.tables["hits.csv"] = "photo,bearing\n" + "".join(f"{one},{bearing}\n" for one, bearing in photos)
    raw.set("detections.0", """
        source = "radar"
        file = "hits.csv"
        frame = "photo"
        azimuth = {column = "bearing", unit = "deg"}
        range = {value = 2.0, unit = "km"}
        counts_from = "bow"
    """)  # fmt: skip


def test_bearings_from_the_bow_have_the_yaw_added(raw):
    # Photos at 1.5, 2 and 3 s; the shortest turn goes through north.
    _head_up(raw, [300, 350, 10, 100, 100], [10.0, -30.0, 170.0])
    azimuth = np.degrees(raw.run().table("detections")["azimuth_rad"])
    near(azimuth.iloc[1:], [-20.0, -90.0], atol=1e-9)
    # Half way between two attitudes that lean alike the yaw is half way too, but for a second-order rest.
    assert azimuth.iloc[0] == pytest.approx(10.0, abs=0.2)


def test_groups_by_edges(raw):
    raw.tables["photos.csv"] = "photo,time,h\n" + "".join(
        f"{name},2024-06-12T09:30:0{at}Z,{h}\n" for name, at, h in (("A", 1, 10), ("B", 2, 30), ("C", 3, 52))
    )
    raw.set("frames.group", """
        column = "h"
        edges = [20.0, 40.0]
        labels = ["low", "mid", "high"]
        clear = 10.0
    """)  # fmt: skip
    assert list(raw.run().table("frames")["group"]) == ["low", "mid", "high"]
    raw.replace("photos.csv", ",30", ",31")
    with pytest.raises(WildlabError, match="line 3: 31 is closer"):
        again(raw, "frames.group.clear", 10.0)
    raw.set("frames.group.labels", ["low", "high"])
    with pytest.raises(WildlabError, match="2 edges make 3"):
        raw.run()


def test_frames_made_of_rows_that_agree(raw):
    """Poses, frames and clicks in one file: a frame is a unique time, and its rows have to say the same."""
    raw.tables = {
        "all.csv": "time,h,yaw,x\n2024-01-01T00:00:05Z,100,0.1,1\n2024-01-01T00:00:05Z,100,0.1,2\n"
        "2024-01-01T00:00:09Z,101,0.2,3\n",
        "buoy.csv": raw.tables["buoy.csv"],
    }
    raw.set("time.epoch", None)
    raw.set("clocks.camera_offset_s", 2.5)
    raw.set("frames", 'file = "all.csv"\nunique = ["time"]\nprefix = "F"\ntime = {column = "time"}')
    raw.set("poses.log", """
        file = "all.csv"
        position.latitude = {value = 63.44, unit = "deg"}
        position.longitude = {value = 10.4, unit = "deg"}
        position.height = {column = "h", unit = "m"}
        attitude.roll = {value = 0.0, unit = "deg"}
        attitude.pitch = {value = 0.0, unit = "deg"}
        attitude.yaw = {column = "yaw", unit = "rad"}
    """)  # fmt: skip
    raw.set("detections.0", """
        source = "click"
        file = "all.csv"
        pixel.u = {column = "x", unit = "px"}
        pixel.v = {column = "x", unit = "px"}
    """)  # fmt: skip
    raw.recipe["truth"].pop()
    flight = raw.run()
    assert list(flight.nav["log"]["frame_id"]) == ["F0", "F1"]
    near(flight.nav["log"]["time_s"], [2.5, 6.5])
    near(flight.table("frames")["time_s"], [0.0, 4.0])
    assert list(flight.table("detections")["frame_id"]) == ["F0", "F0", "F1"]
    raw.replace("all.csv", "0.1,2", "0.3,2")
    with pytest.raises(WildlabError, match="says something else"):
        again(raw, "description", "")
    assert not raw.into.exists()


@pytest.mark.parametrize(
    ("stamp", "zone", "cell"),
    [
        ({}, None, "2024-06-12T11:30:05.250+02:00"),
        ({}, "Europe/Oslo", "2024-06-12T11:30:05.25"),
        ({"zone": "+05:30"}, "Europe/Oslo", "2024-06-12T15:00:05.25"),
        ({"format": "%d/%m/%y %I:%M:%S.%f %p"}, "UTC", "12/06/24 09:30:05.250 AM"),
        ({"format": "%m/%d/%Y %H:%M:%S.%f MST"}, "America/Phoenix", "06/12/2024 02:30:05.250 MST"),
        ({"format": "unix"}, None, "1718184605.25"),
        ({"format": "unix", "unit": "ms"}, None, "1718184605250"),
        ({"format": "elapsed", "unit": "us"}, None, "5250000"),
    ],
)
def test_ways_to_write_one_time(raw, stamp, zone, cell):
    raw.tables["photos.csv"] = f"photo,time\nA,{cell}\n"
    raw.tables["clicks.csv"] = "photo,x,y,what\nA,10,20,boat\n"
    raw.set("frames.time", {"column": "time", **stamp})
    if zone is not None:
        raw.set("time.zone", zone)
    # until the poses, whose stamps are UTC by themselves, end before it
    raw.replace("nav.csv", "09:30:04Z", "09:30:14Z")
    raw.replace("boat.csv", "\n4,", "\n14,")
    assert raw.run().table("frames")["time_s"].iloc[0] == pytest.approx(5.25, abs=1e-6)


@pytest.mark.parametrize(
    ("unit", "dimension", "found"),
    [
        ("ft", "length", 0.3048),
        ("kn", "speed", 1852 / 3600),
        ("deg-e7", "angle", math.radians(1e-7)),
        ("km/h", "speed", 1 / 3.6),
    ],
)
def test_units_against_their_definitions(unit, dimension, found):
    assert factor(unit, dimension) == pytest.approx(found, rel=1e-12)


def write_map(path: Path, height: float) -> Path:
    """Level ground about the flight of `raw`, heights above the geoid."""
    path.parent.mkdir(exist_ok=True)
    transform = Affine(1e-4, 0, 10.39, 0, -5e-5, 63.445)
    given = {"width": 200, "height": 200, "count": 1, "dtype": "float32", "crs": 4326, "transform": transform}
    with rasterio.open(path, "w", driver="GTiff", **given) as data:
        data.write(np.full((200, 200), height, np.float32), 1)
    return path


def test_a_recipe_may_name_a_map(raw):
    write_map(raw.folder / "raw" / "dem.tif", 1.5)
    raw.set("terrain", {"file": "dem.tif", "heights": 39.5, "sd_m": 0.4})
    raw.run()
    flight = load_flight(raw.into)
    assert flight.terrain is not None and flight.manifest.terrain is not None
    # 41 m above the ellipsoid, where the origin is the first pose, 140 m up.
    assert flight.terrain.heights_at([[0.0, 0.0]])[0] == pytest.approx(41.0 - 140.0, abs=1e-3)
    record = flight.manifest.terrain
    assert (record.source, record.heights, record.added_m, record.sd_m) == ("dem.tif", "geoid", 39.5, 0.4)
    assert record.crs == "EPSG:4326" and flight.terrain.sd == pytest.approx(0.4, abs=1e-3)
    # A byte that changes by itself is found, one that was changed on purpose is accepted.
    path = raw.into / "terrain.tif"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(WildlabError, match="SHA-256"):
        load_flight(raw.into)
    assert accept_changes(raw.into) == ["terrain.tif"]
