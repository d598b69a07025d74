"""Sensors on board through a recipe: axes, units, rows that do not count, flights without poses or images."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.clocks import gnss_times
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned, matrix_to_euler, quaternion_to_matrix

FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
NED = ["north_m", "east_m", "down_m"]


def _q(column: str, unit: str, **more: Any) -> dict[str, Any]:
    return {"column": column, "unit": unit, **more}


@pytest.fixture
def sensors(raw: Any) -> Any:
    """The right recipe, with a sensor that sits x right, y forward, z up, and a receiver that repeats."""
    # At rest and level such a sensor feels +1 g along its z.
    raw.tables["imu.csv"] = "ms,ax,ay,az,gx,gy,gz,bias\n" + "".join(
        f"{20 * i},0.02,0.1,1.0,3.0,4.0,-5.0,1.0\n" for i in range(200)
    )
    raw.tables["gps.csv"] = (
        "t,tow,lat,lon,height,kn,course,up,sats,acc\n"
        "0.0,0,45,-93,0,0,0,0,0,\n"  # a placeholder
        "0.1,7,63.44,10.4,140,10,90,-1,8,1.5\n"
        "0.2,7,63.44,10.4,140,10,90,-1,8,1.5\n"  # the same again
        "0.3,8,63.4401,10.4,141,10,180,2,9,\n"
        "0.4,9,63.4402,10.4,142,10,180,2,0,9\n"  # no satellites
        "4.0,10,63.4403,10.4,143,10,180,2,7,2.5\n"
    )
    raw.set(
        "imu",
        {
            "name": "box",
            "angle_random_walk_deg_sqrt_h": 0.1,
            "file": "imu.csv",
            "time": {"column": "ms", "format": "elapsed", "unit": "ms"},
            "force": {"x": _q("ay", "g"), "y": _q("ax", "g"), "z": _q("az", "g", negate=True)},
            "rate": {
                "x": _q("gy", "deg/s"),
                "y": _q("gx", "deg/s"),
                "z": _q("gz", "deg/s", plus="bias", negate=True),
            },
        },
    )
    raw.set(
        "gnss",
        {
            "name": "receiver",
            "lever_arm_m": [-0.4, 0.0, -0.1],
            "latency_s": 0.05,
            "file": "gps.csv",
            "changed": ["tow"],
            "where": [{"column": "tow", "above": 0}, {"column": "sats", "differs": 0}],
            "time": {"column": "t", "format": "elapsed"},
            "satellites": "sats",
            "sd_horizontal": _q("acc", "m"),
            "position": {
                "latitude": _q("lat", "deg"),
                "longitude": _q("lon", "deg"),
                "height": _q("height", "m"),
            },
            "velocity": {"speed": _q("kn", "kn"), "course": _q("course", "deg"), "up": _q("up", "m/s")},
        },
    )
    return raw


def test_axes_and_units(sensors):
    flight = sensors.run()
    imu = flight.table("imu")
    assert len(imu) == 200
    np.testing.assert_allclose(imu["time_s"], 0.02 * np.arange(200))
    g = 9.80665
    np.testing.assert_allclose(imu[FORCE], [[0.1 * g, 0.02 * g, -g]] * 200)
    # right-handed both ways: forward-right-down is the sensor turned over about the axis between its x and y
    np.testing.assert_allclose(np.degrees(imu[RATE]), [[4.0, 3.0, 4.0]] * 200)
    assert flight.manifest.imu.name == "box"
    assert flight.manifest.imu.angle_random_walk_deg_sqrt_h == 0.1
    assert {source.file for source in flight.manifest.sources} >= {"imu.csv", "gps.csv"}
    # All is there for navigation but the speed that its heading is told by: 10 knots are 5.1 m/s.
    assert not usable_for(flight)[2].usable and "5.1 m/s" in usable_for(flight)[2].why


def test_only_fresh_fixes(sensors):
    sensors.set("clocks.gnss_offset_s", 0.3)
    flight = sensors.run()
    gnss = flight.table("gnss")
    np.testing.assert_allclose(gnss["time_s"], [0.1, 0.3, 4.0])  # as stamped
    np.testing.assert_allclose(gnss_times(flight), [0.35, 0.55, 4.25])
    assert flight.manifest.gnss.lever_arm_m == (-0.4, 0.0, -0.1)
    origin = (math.radians(63.44), math.radians(10.4), 140.0)
    expected = geodetic_to_ned(
        np.radians([63.44, 63.4401, 63.4403]), math.radians(10.4), np.array([140, 141, 143]), origin
    )
    np.testing.assert_allclose(gnss[NED], expected, atol=1e-6)
    v = 10 * 1852 / 3600
    np.testing.assert_allclose(
        gnss[["v_north_m_s", "v_east_m_s", "v_down_m_s"]], [[0, v, 1], [-v, 0, -2], [-v, 0, -2]], atol=1e-9
    )
    np.testing.assert_allclose(gnss["sd_horizontal_m"], [1.5, np.nan, 2.5])
    np.testing.assert_allclose(gnss["satellites"], [8, 9, 7])


def test_local_satellite_positions_and_the_vertical_correction(sensors):
    sensors.set("origin", {"latitude_deg": 63.44, "longitude_deg": 10.4, "height_m": 40.0})
    sensors.set(
        "gnss.position",
        {
            "north": {"value": 1.0, "unit": "m"},
            "east": {"value": 2.0, "unit": "m"},
            "down": _q("height", "m", negate=True),
        },
    )
    sensors.set("vertical", {"correction_m": 40.0, "taken_off": ["gnss"], "note": "sea level"})
    gnss = sensors.run().table("gnss")
    np.testing.assert_allclose(gnss[NED], [[1, 2, -100], [1, 2, -101], [1, 2, -103]])


def _navigation_only(raw: Any) -> None:
    for part in ("camera", "frames", "detections", "truth"):
        raw.set(part, None)


def test_no_images_and_no_poses(sensors):
    _navigation_only(sensors)
    sensors.set("poses", None)
    flight = sensors.run()
    assert flight.manifest.camera is None
    assert flight.nav == {}
    assert set(flight.tables) == {"imu", "gnss"}
    np.testing.assert_allclose(flight.table("gnss")[NED].iloc[0], 0, atol=1e-9)
    with pytest.raises(WildlabError, match="no camera"):
        flight.manifest.geometry_camera()
    assert {one.level for one in check_flight(flight) if one.field == "camera"} == {"note"}


def test_attitude_without_positions(sensors):
    _navigation_only(sensors)
    sensors.set("poses.log.position", None)
    sensors.set("poses.log.position_from", "gnss")
    sensors.set("gnss.changed", [])
    sensors.set("gnss.where", [{"column": "tow", "above": 0}, {"column": "tow", "below": 10}])
    sensors.replace("gps.csv", "0.4,9,63.4402", "1.05,9,63.4402")
    sensors.set("poses.log.time", {"column": "time"})
    flight: Flight = sensors.run()
    nav = flight.nav["log"]
    # Poses at 0, 1, ... 4 s; satellite positions from 0.05 s to 1.0 s, latency taken off.
    np.testing.assert_allclose(nav["time_s"], [1.0])
    np.testing.assert_allclose(nav[NED], flight.table("gnss")[NED].iloc[[-1]])
    R = quaternion_to_matrix(nav[["q_w", "q_x", "q_y", "q_z"]].to_numpy())
    np.testing.assert_allclose(matrix_to_euler(R), 0, atol=1e-12)


def test_gimbal(sensors):
    sensors.tables["gimbal.csv"] = "t,pan,tilt,ok\n0,10,0.5,1\n1,20,0.6,0\n2,-30,0.7,1\n"
    sensors.set(
        "gimbal",
        {
            "file": "gimbal.csv",
            "where": [{"column": "ok", "equals": 1}],
            "time": {"column": "t", "format": "elapsed"},
            "pan": _q("pan", "deg"),
            "tilt": _q("tilt", "rad", negate=True),
        },
    )
    gimbal = sensors.run().table("gimbal")
    np.testing.assert_allclose(np.degrees(gimbal["pan_rad"]), [10, -30])
    np.testing.assert_allclose(gimbal["tilt_rad"], [-0.5, -0.7])


def test_magnetometer(sensors):
    sensors.tables["mag.csv"] = "ms,mx,my,mz\n0,100,200,-300\n100,110,210,-310\n"
    sensors.set(
        "magnetometer",
        {
            "name": "compass",
            "declination_deg": 3.0,
            "inclination_deg": 70.0,
            "heading_sd_deg": 5.0,
            "file": "mag.csv",
            "time": {"column": "ms", "format": "elapsed", "unit": "ms"},
            "field": {"x": _q("my", "mG"), "y": _q("mx", "nT"), "z": _q("mz", "G", negate=True)},
        },
    )
    flight = sensors.run()
    table = flight.table("magnetometer")
    np.testing.assert_allclose(table["time_s"], [0.0, 0.1])
    np.testing.assert_allclose(
        table[[f"field_{axis}_ut" for axis in "xyz"]], [[20, 0.1, 30000], [21, 0.11, 31000]]
    )
    assert flight.manifest.magnetometer.inclination_deg == 70.0
    assert flight.manifest.magnetometer.name == "compass"
    sensors.set("magnetometer.field.x.unit", "m")
    with pytest.raises(WildlabError, match="not of field"):
        sensors.run()


@pytest.mark.parametrize(
    ("dotted", "value", "said"),
    [
        ("imu.force.x.unit", "m/s", "not of acceleration"),
        ("imu.rate.z.plus", "bias2", "bias2 (in [imu.rate.z.plus])"),
        ("imu.rate.z", {"value": 0.0, "unit": "rad/s", "plus": "bias"}, "plus is added"),
        ("imu.force.z", None, "imu.force.z: this key"),
        ("gnss.latency_s", -1.0, "latency_s: -1.0"),
        ("gnss.velocity.north", _q("kn", "kn"), "either north"),
        ("gnss.where", [{"column": "tow"}], "says nothing"),
        ("gnss.where", [{"column": "tow", "above": 99}], "6 rows"),
        ("poses.log.position_from", "gnss", "either a position"),
    ],
)
def test_one_thing_wrong(sensors, dotted, value, said):
    sensors.set(dotted, value)
    with pytest.raises(WildlabError) as caught:
        sensors.run()
    assert said in str(caught.value)
    assert caught.value.fix
    assert not sensors.into.exists()


def test_a_wrong_unit_is_refused_on_import(sensors):
    for axis in "xyz":
        sensors.set(f"imu.force.{axis}.unit", "m/s2")
    with pytest.raises(WildlabError, match="gravity alone") as caught:
        sensors.run()
    assert (caught.value.file or "").endswith("imu.csv")
    assert not sensors.into.exists()
