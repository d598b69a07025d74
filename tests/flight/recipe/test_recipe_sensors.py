"""Sensors on board through a recipe: axes, units, rows that do not count, flights without poses or images."""

import re
from typing import Any

import numpy as np
import pytest

from tests.flight.recipe.comparing import near
from tests.sound_logs import NED
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import usable_for
from wildlab.flight.clocks import gnss_times
from wildlab.flight.store import Flight

VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
IMU = """
name = "box"
angle_random_walk_deg_sqrt_h = 0.1
file = "imu.csv"
time = {column = "ms", format = "elapsed", unit = "ms"}
force.x = {column = "ay", unit = "g"}
force.y = {column = "ax", unit = "g"}
force.z = {column = "az", unit = "g", negate = true}
rate.x = {column = "gy", unit = "deg/s"}
rate.y = {column = "gx", unit = "deg/s"}
rate.z = {column = "gz", unit = "deg/s", plus = "bias", negate = true}
"""
GNSS = """
name = "receiver"
lever_arm_m = [-0.4, 0.0, -0.1]
latency_s = 0.05
file = "gps.csv"
changed = ["tow"]
where = [{column = "tow", above = 0}, {column = "sats", differs = 0}]
time = {column = "t", format = "elapsed"}
satellites = "sats"
sd_horizontal = {column = "acc", unit = "m"}
position.latitude = {column = "lat", unit = "deg"}
position.longitude = {column = "lon", unit = "deg"}
position.height = {column = "height", unit = "m"}
velocity.speed = {column = "kn", unit = "kn"}
velocity.course = {column = "course", unit = "deg"}
velocity.up = {column = "up", unit = "m/s"}
"""


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
    raw.set("imu", IMU)
    raw.set("gnss", GNSS)
    return raw


def test_axes_and_units(sensors):
    flight = sensors.run()
    imu, g = flight.table("imu"), 9.80665
    near(imu["time_s"], 0.02 * np.arange(200))
    near(imu, [[0.1 * g, 0.02 * g, -g]] * 200, "f_x_m_s2", "f_y_m_s2", "f_z_m_s2")
    # right-handed both ways: forward-right-down is the sensor turned over about the axis between its x and y
    near(imu, np.radians([[4.0, 3.0, 4.0]] * 200), "w_x_rad_s", "w_y_rad_s", "w_z_rad_s")
    assert (flight.manifest.imu.name, flight.manifest.imu.angle_random_walk_deg_sqrt_h) == ("box", 0.1)
    assert {source.file for source in flight.manifest.sources} >= {"imu.csv", "gps.csv"}
    ten = 10 * 1852 / 3600
    near(flight.table("gnss"), [[0, ten, 1], [-ten, 0, -2], [-ten, 0, -2]], *VELOCITY)
    # What the receiver calls so late happened so much before.
    np.testing.assert_allclose(gnss_times(flight), [0.05, 0.25, 3.95], atol=1e-9)
    # All is there for navigation but the speed that its heading is told by: 10 knots are 5.1 m/s.
    assert not usable_for(flight)[2].usable and "5.1 m/s" in usable_for(flight)[2].why


def _navigation_only(raw: Any) -> None:
    for part in ("camera", "frames", "detections", "truth"):
        raw.set(part, None)


def test_attitude_without_positions(sensors):
    _navigation_only(sensors)
    sensors.set("poses.log.position", None)
    sensors.set("poses.log.position_from", "gnss")
    sensors.set("gnss.changed", [])
    sensors.set("gnss.where", [{"column": "tow", "above": 0}, {"column": "tow", "below": 10}])
    sensors.replace("gps.csv", "0.4,9,63.4402", "1.05,9,63.4402")
    flight: Flight = sensors.run()
    nav = flight.nav["log"]
    # Poses at 0, 1, ... 4 s; satellite positions from 0.05 s to 1.0 s, latency taken off.
    near(nav["time_s"], [1.0])
    near(nav, flight.table("gnss")[NED].iloc[[-1]], *NED)
    near(nav, [[1, 0, 0, 0]], "q_w", "q_x", "q_y", "q_z")


def test_gimbal(sensors):
    sensors.tables["gimbal.csv"] = "t,pan,tilt,ok\n0,10,0.5,1\n1,20,0.6,0\n2,-30,0.7,1\n"
    sensors.set("gimbal", """
        file = "gimbal.csv"
        where = [{column = "ok", equals = 1}]
        time = {column = "t", format = "elapsed"}
        pan = {column = "pan", unit = "deg"}
        tilt = {column = "tilt", unit = "rad", negate = true}
    """)  # fmt: skip
    angles = [[np.radians(10), -0.5], [np.radians(-30), -0.7]]
    near(sensors.run().table("gimbal"), angles, "pan_rad", "tilt_rad")


def test_magnetometer(sensors):
    sensors.tables["mag.csv"] = "ms,mx,my,mz\n0,100,200,-300\n100,110,210,-310\n"
    sensors.set("magnetometer", """
        name = "compass"
        declination_deg = 3.0
        inclination_deg = 70.0
        file = "mag.csv"
        time = {column = "ms", format = "elapsed", unit = "ms"}
        field.x = {column = "my", unit = "mG"}
        field.y = {column = "mx", unit = "nT"}
        field.z = {column = "mz", unit = "G", negate = true}
    """)  # fmt: skip
    flight = sensors.run()
    values = [[0.0, 20, 0.1, 30000], [0.1, 21, 0.11, 31000]]
    near(flight.table("magnetometer"), values, "time_s", *(f"field_{axis}_ut" for axis in "xyz"))
    stated = flight.manifest.magnetometer
    assert (stated.name, stated.inclination_deg) == ("compass", 70.0)
    sensors.set("magnetometer.field.x.unit", "m")
    with pytest.raises(WildlabError, match="not of field"):
        sensors.run()


@pytest.mark.parametrize(
    ("dotted", "value", "said"),
    [
        ("imu.force.x.unit", "m/s", "not of acceleration"),
        ("imu.rate.z.plus", "bias2", "bias2 (in [imu.rate.z.plus])"),
        ("imu.rate.z", 'value = 0.0\nunit = "rad/s"\nplus = "bias"', "found plus and value"),
        ("imu.force.z", None, "imu.force.z: this key"),
        ("gnss.latency_s", -1.0, "latency_s: -1.0"),
        ("gnss.velocity.north", 'column = "kn"\nunit = "kn"', "either north"),
        ("gnss.where", [{"column": "tow"}], "says nothing"),
        ("gnss.where", [{"column": "tow", "above": 99}], "6 rows"),
        ("poses.log.position_from", "gnss", "either position"),
    ],
)
def test_one_thing_wrong(sensors, dotted, value, said):
    sensors.set(dotted, value)
    with pytest.raises(WildlabError, match=re.escape(said)) as caught:
        sensors.run()
    assert caught.value.fix and not sensors.into.exists()


def test_a_wrong_unit_is_refused_on_import(sensors):
    for axis in "xyz":
        sensors.set(f"imu.force.{axis}.unit", "m/s2")
    with pytest.raises(WildlabError, match=r"imu\.csv.*gravity alone"):
        sensors.run()
    assert not sensors.into.exists()
