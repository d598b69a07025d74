"""What a recipe converts: frames, units, signs, times, groups; against numbers from elsewhere."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.clocks import covariances
from wildlab.flight.recipe.parts import Attitude, parse_zone
from wildlab.flight.recipe.poses import _rotation
from wildlab.flight.store import Flight
from wildlab.flight.units import UNITS, factor
from wildlab.geometry.flodell import geodetic_to_enu_linear
from wildlab.geometry.frames import geodetic_to_ned, matrix_to_euler, quaternion_to_matrix
from wildlab.runner.track_many import track_many

ORIGIN = {"latitude_deg": 63.44, "longitude_deg": 10.4, "height_m": 40.0}


def quantity(column: str, unit: str, **more: Any) -> dict[str, Any]:
    return {"column": column, "unit": unit, **more}


def value(number: float, unit: str) -> dict[str, Any]:
    return {"value": number, "unit": unit}


ANGLES = {name: quantity(name, "deg") for name in ("roll", "pitch", "yaw")}


ELAPSED = {"column": "time", "format": "elapsed"}


def near(table: Any, expected: Any, *columns: str, atol: float = 1e-6) -> None:
    found = table[list(columns)].to_numpy() if columns else np.asarray(table)
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)


def _position(flight: Flight) -> np.ndarray:
    return flight.nav["log"][["north_m", "east_m", "down_m"]].to_numpy()


def _rotations(flight: Flight) -> np.ndarray:
    return quaternion_to_matrix(flight.nav["log"][["q_w", "q_x", "q_y", "q_z"]].to_numpy())


def again(raw: Any, **changes: Any) -> Flight:
    """The flight of a changed recipe, in a folder of its own."""
    raw.folder = raw.folder / "again"
    raw.folder.mkdir()
    for dotted, value in changes.items():
        raw.set(dotted.replace("__", "."), value)
    return raw.run()


def test_the_plain_case(raw):
    flight = raw.run()
    latitude = np.radians(63.44 + 1e-4 * np.arange(5))
    origin = (math.radians(63.44), math.radians(10.4), 140.0)  # the first pose, since the recipe names none
    near(_position(flight), geodetic_to_ned(latitude, math.radians(10.4), 140.0, origin))
    detections, truth = flight.table("detections"), flight.table("truth")
    assert list(detections["detection_id"]) == ["0", "1", "2"]
    assert list(detections["target_id"]) == ["boat", "", "buoy"]
    near(detections["plane_down_m"], 100.0, atol=1e-3)
    assert list(truth["target_id"]) == ["buoy", "boat", "boat"]
    near(truth, [[np.nan, 0.02], [0.0, np.nan], [4.0, np.nan]], "time_s", "sd_horizontal_m")
    assert flight.manifest.locations.sensitivity == "withheld"


def test_local_positions_both_ways(raw):
    raw.tables["nav.csv"] = "time,a,b,c,roll,pitch,yaw\n0,100,2,-3000,10,-20,30\n4,300,2,-3000,10,-20,30\n"
    raw.set("origin", ORIGIN)
    raw.set("poses.log.time", ELAPSED)
    raw.set("poses.log.attitude", {**ANGLES, "pitch": quantity("pitch", "deg", negate=True)})
    a, b, c = quantity("a", "ft"), quantity("b", "km"), quantity("c", "cm")
    raw.set("poses.log.position", {"north": a, "east": b, "down": c})
    flight = raw.run()
    near(_position(flight)[0], [30.48, 2000, -30])
    near(np.degrees(matrix_to_euler(_rotations(flight))), [[10, 20, 30]] * 2)
    turned = {"east": a, "north": b, "up": {**c, "negate": True}}
    near(_position(again(raw, poses__log__position=turned))[0], [2000, 30.48, -30])


def test_linear_enu_is_undone(raw):
    latitude, longitude = np.radians([63.45, 63.43]), np.radians([10.41, 10.38])
    origin = (math.radians(63.44), math.radians(10.4), 40.0)
    enu = geodetic_to_enu_linear(latitude, longitude, origin[:2]).tolist()
    raw.tables["nav.csv"] = "time,e,n,u\n" + "".join(f"{4 * i},{e},{n},60\n" for i, (e, n) in enumerate(enu))
    raw.set("origin", ORIGIN)
    raw.set("poses.log.time", ELAPSED)
    raw.set("poses.log.attitude", {name: value(0.0, "deg") for name in ANGLES})
    names = {name: quantity(name[0], "m") for name in ("east", "north", "up")}
    raw.set("poses.log.position", {"linear": True, **names})
    near(_position(raw.run()), geodetic_to_ned(latitude, longitude, 100.0, origin))


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_attitudes_in_other_axes(rotation_vector):
    """The same body, described forward-left-up in east-north-up, and by the inverse quaternion."""
    R = Rotation.from_rotvec(rotation_vector)
    nose, right = R.apply([1, 0, 0]), R.apply([0, 1, 0])  # in n: north, east, down

    def ned_to_enu(v: np.ndarray) -> np.ndarray:
        return np.array([v[1], v[0], -v[2]])

    columns = np.column_stack([ned_to_enu(nose), -ned_to_enu(right), -ned_to_enu(R.apply([0, 0, 1]))])
    q = Rotation.from_matrix(columns).as_quat(scalar_first=True)[None]
    names = ("a", "b", "c", "d")
    ros = Attitude(quaternion=names, order="wxyz", axes="flu-enu")
    np.testing.assert_allclose(_rotation(q, ros)[0], R.as_matrix(), atol=1e-12)


def test_order_and_inverse_of_quaternions(raw):
    q = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    cells = ",".join(map(repr, q.inv().as_quat().tolist()))
    raw.tables["nav.csv"] = raw.tables["nav.csv"].replace(",1,0,0,0", f",{cells}")
    raw.set("poses.log.attitude", {"quaternion": ["qw", "qx", "qy", "qz"], "order": "xyzw", "inverse": True})
    near(_rotations(raw.run()), [q.as_matrix()] * 5, atol=1e-12)


@pytest.mark.parametrize(
    ("stated", "tilt", "heading"),
    [({"tilt": 1.5, "heading": 4.0}, 1.5, 4.0), ({"roll": 1.0, "pitch": 7.0, "yaw": 4.0}, 5.0, 4.0)],
)
def test_velocity_and_spreads(raw, stated, tilt, heading):
    angles = {name: value(number, "deg") for name, number in stated.items()}
    raw.set("poses.log.spreads", {"horizontal": value(2.0, "m"), "vertical": value(3.0, "m"), **angles})
    raw.set("poses.log.velocity", dict.fromkeys(("north", "east", "up"), value(10.0, "kn")))
    nav = raw.run().nav["log"]
    near(nav, [[5.14444, -5.14444]] * 5, "v_north_m_s", "v_down_m_s", atol=1e-5)
    near(np.sqrt(np.diag(covariances(nav)[0])), [2, 2, 3, *np.radians([tilt, tilt, heading])])


def test_the_vertical_correction_is_taken_off_what_is_named(raw):
    raw.set("origin", ORIGIN)
    before = raw.run()
    vertical = {"reference": "geoid", "correction_m": -39.5, "taken_off": ["poses", "truth"], "note": "why"}
    after = again(raw, vertical=vertical)
    near(_position(before)[:, 2] - _position(after)[:, 2], 39.5)
    near(before.table("truth")["down_m"] - after.table("truth")["down_m"], 39.5)
    near(before.table("detections")["plane_down_m"], after.table("detections")["plane_down_m"])
    assert after.manifest.vertical.correction_m == -39.5


def test_proportions_are_of_the_image(raw):
    raw.tables["clicks.csv"] = "photo,x,y,what\nA,0.25,0.5,\n"
    raw.set("detections.0.pixel.u.unit", "proportion-of-width")
    raw.set("detections.0.pixel.v.unit", "proportion-of-height")
    assert list(raw.run().table("detections")[["u_px", "v_px"]].iloc[0]) == [160.0, 256.0]
    assert all(len(set(units)) == len(units) for units in UNITS.values())


def test_other_kinds_of_detections(raw):
    radar = {"source": "radar", "file": "clicks.csv"}
    radar |= {"azimuth": value(90.0, "deg"), "elevation": value(-5.0, "deg")}
    raw.recipe["detections"] += [radar | {"range": value(2.0, "km")}, {**radar, "source": "microphone"}]
    detections = raw.run().table("detections")
    assert list(detections["kind"]) == ["pixel"] * 3 + ["range-bearing"] * 3 + ["bearing"] * 3
    assert list(detections["detection_id"]) == ["0", "1", "2"] * 3
    near(
        detections.iloc[3:],
        [[math.pi / 2, 2000.0]] * 3 + [[math.pi / 2, np.nan]] * 3,
        "azimuth_rad",
        "range_m",
    )
    assert list(detections["frame_id"].iloc[3:]) == [""] * 6


def test_a_night_in_which_nothing_was_detected_is_imported(raw):
    raw.tables["clicks.csv"] = "photo,x,y,what\n"
    flight = raw.run()
    assert len(flight.table("detections")) == 0 and len(flight.table("frames")) == 3
    assert [one.level for one in check_flight(flight) if one.table == "detections"] == ["warning"]
    with pytest.raises(WildlabError, match="no detections"):
        track_many(flight.folder)


def _head_up(raw: Any, yaws_deg: list[float], bearings: list[float]) -> list[dict[str, Any]]:
    """A radar whose bearings are relative to the bow, on a platform that leans and turns."""
    nav = "time,lat,lon,height,qx,qy,qz,qw\n"
    for second, yaw in enumerate(yaws_deg):
        q = ",".join(map(repr, Rotation.from_euler("ZYX", [yaw, 7.0, -4.0], degrees=True).as_quat().tolist()))
        nav += f"2024-06-12T09:30:0{second}Z,63.44,10.4,140,{q}\n"
    raw.tables["nav.csv"] = nav
    photos = zip("ABC", bearings, strict=True)
    raw.tables["hits.csv"] = "photo,bearing\n" + "".join(f"{one},{bearing}\n" for one, bearing in photos)
    azimuth = {"azimuth": quantity("bearing", "deg"), "range": value(2.0, "km"), "counts_from": "bow"}
    return [{"source": "radar", "file": "hits.csv", "frame": "photo", **azimuth}]


def test_bearings_from_the_bow_have_the_yaw_added(raw):
    # Photos at 1.5, 2 and 3 s; the shortest turn goes through north.
    raw.recipe["detections"] = _head_up(raw, [300, 350, 10, 100, 100], [10.0, -30.0, 170.0])
    azimuth = raw.run().table("detections")["azimuth_rad"]
    np.testing.assert_allclose(np.degrees(azimuth.iloc[1:]), [-20.0, -90.0], atol=1e-9)
    # Half way between two attitudes that lean alike the yaw is half way too, but for a second-order rest.
    assert np.degrees(azimuth.iloc[0]) == pytest.approx(10.0, abs=0.2)


def test_a_bow_whose_heading_is_not_known_is_refused(raw):
    raw.recipe["detections"] = _head_up(raw, [0, 0, 0], [1.0, 2.0, 3.0])
    with pytest.raises(WildlabError, match="counts from the bow"):
        raw.run()
    del raw.recipe["detections"][0]["frame"]
    with pytest.raises(WildlabError, match="says when they"):
        raw.run()


def test_detections_of_one_sensor_in_looks_of_another_are_refused(raw):
    looks = raw.tables["photos.csv"].splitlines()
    raw.tables["photos.csv"] = "\n".join(
        f"{look},{who}" for look, who in zip(looks, ["who", "click", "click", "lidar"], strict=True)
    )
    raw.set("frames.sensor", "who")
    with pytest.raises(WildlabError, match="source 'click'") as caught:
        raw.run()
    assert caught.value.file is not None and "clicks.csv" in str(caught.value.file)


def test_groups_by_edges(raw):
    raw.tables["photos.csv"] = (
        "photo,time,h\nA,2024-06-12T09:30:01Z,10\nB,2024-06-12T09:30:02Z,30\nC,2024-06-12T09:30:03Z,52\n"
    )
    raw.set(
        "frames.group",
        {"column": "h", "edges": [20.0, 40.0], "labels": ["low", "mid", "high"], "clear": 10.0},
    )
    assert list(raw.run().table("frames")["group"]) == ["low", "mid", "high"]
    raw.replace("photos.csv", ",30", ",31")
    raw.into.rename(raw.folder / "old")
    with pytest.raises(WildlabError, match="line 3: 31 is closer"):
        raw.run()
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
    zero = value(0.0, "deg")
    raw.set("time", {"kind": "utc"})
    raw.set("clocks", {"camera_offset_s": 2.5})
    raw.set("frames", {"file": "all.csv", "unique": ["time"], "prefix": "F", "time": {"column": "time"}})
    place = {"latitude": value(63.44, "deg"), "longitude": value(10.4, "deg"), "height": quantity("h", "m")}
    attitude = {"roll": zero, "pitch": zero, "yaw": quantity("yaw", "rad")}
    raw.set("poses.log", {"file": "all.csv", "position": place, "attitude": attitude})
    pixel = {"u": quantity("x", "px"), "v": quantity("x", "px")}
    raw.set("detections", [{"source": "click", "file": "all.csv", "pixel": pixel}])
    raw.recipe["truth"].pop()
    flight = raw.run()
    assert list(flight.nav["log"]["frame_id"]) == ["F0", "F1"]
    near(flight.nav["log"]["time_s"], [2.5, 6.5])
    near(flight.table("frames")["time_s"], [0.0, 4.0])
    assert list(flight.table("detections")["frame_id"]) == ["F0", "F0", "F1"]
    raw.replace("all.csv", "0.1,2", "0.3,2")
    with pytest.raises(WildlabError, match="says something else"):
        again(raw)
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


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(-14 * 60, 14 * 60))
def test_fixed_offsets(minutes):
    sign, size = "-" if minutes < 0 else "+", abs(minutes)
    zone = parse_zone(f"{sign}{size // 60:02d}:{size % 60:02d}")
    assert datetime(2024, 1, 1, tzinfo=UTC).astimezone(zone).utcoffset() == timedelta(minutes=minutes)


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


def test_a_mark_at_the_start_and_blanks_do_no_harm(raw):
    raw.tables["buoy.csv"] = "\ufeffid, lat , lon,height,sd\r\n buoy , 63.44,10.401,40,\r\n\r\n"
    truth = raw.run().table("truth")
    assert truth["target_id"].iloc[0] == "buoy"
    assert pd.isna(truth["sd_horizontal_m"].iloc[0])
