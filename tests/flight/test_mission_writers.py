"""Way points as ground stations read them: read back by the rules of the formats, not by ours."""

import json

import numpy as np
import pytest
from defusedxml import minidom

from wildlab.flight.readers.vector import parse_areas
from wildlab.flight.writers import (
    Mission,
    plan_geojson,
    plan_kml,
    qgc_plan,
    waypoints_text,
)

HOME = (58.66, 16.46, 71.5)


def mission(n=5, **given):
    lat, lon = 58.66 + 0.001 * np.arange(n), 16.46 + 0.0005 * np.arange(n)
    above = 60.0 + np.arange(n)
    values = dict(above_home=above + 4, above_ground=above, home=HOME, speed=9.5) | given
    return Mission("sortie 1", lat, lon, **values)


def read_wpl(text):
    """QGC WPL 110: a head, then twelve fields between tabs in each line."""
    head, *lines = text.splitlines()
    assert head == "QGC WPL 110"
    fields = [line.split("\t") for line in lines]
    assert all(len(one) == 12 for one in fields)
    assert [int(one[0]) for one in fields] == list(range(len(fields)))
    assert [int(one[1]) for one in fields] == [1] + [0] * (len(fields) - 1)
    assert {one[11] for one in fields} == {"1"}
    return np.array([[float(x) for x in one] for one in fields])


def check_plan(plan):
    """What QGroundControl demands of a plan when it opens one: keys and kinds (its loaders' lists)."""
    assert plan["fileType"] == "Plan" and plan["version"] == 1
    flown = plan["mission"]
    assert flown["version"] == 2 and len(flown["plannedHomePosition"]) == 3
    assert plan["geoFence"]["version"] == plan["rallyPoints"]["version"] == 2
    for number, one in enumerate(flown["items"], start=1):
        assert one["type"] == "SimpleItem" and one["autoContinue"] is True and one["doJumpId"] == number
        assert isinstance(one["command"], int) and isinstance(one["frame"], int) and len(one["params"]) == 7
        assert all(x is None or isinstance(x, int | float) for x in one["params"])
        if one["command"] in (16, 22):
            assert {"Altitude", "AltitudeMode", "AMSLAltAboveTerrain"} <= set(one)
            assert one["Altitude"] == one["params"][6]
            assert one["AltitudeMode"] == {3: 1, 10: 4}[one["frame"]]
    return flown["items"]


@pytest.mark.parametrize("vehicle", ["multicopter", "fixed-wing"])
def test_the_plan_says_the_same_as_the_waypoints(vehicle):
    flown = mission(vehicle=vehicle, photo_distance=12.0)
    plan = qgc_plan(flown)
    assert json.loads(json.dumps(plan, allow_nan=False)) == plan
    items = check_plan(plan)
    rows = read_wpl(waypoints_text(flown))[1:]
    assert [one["command"] for one in items] == rows[:, 3].tolist()
    assert [one["frame"] for one in items] == rows[:, 2].tolist()
    for one, row in zip(items, rows, strict=True):
        assert np.allclose([x or 0 for x in one["params"]], row[4:11], atol=1e-7, rtol=0)
    assert [one["params"][0] for one in items if one["command"] == 206] == [12.0, 0.0]
    assert plan["mission"]["vehicleType"] == {"multicopter": 2, "fixed-wing": 1}[vehicle]
    # Speed over ground for what hovers, airspeed for what has to keep it.
    assert items[1]["params"][:2] == [float(vehicle == "multicopter"), 9.5]


def test_pymavlink_reads_the_waypoints(tmp_path):
    mavwp = pytest.importorskip("pymavlink.mavwp")
    flown = mission(photo_distance=5.0)
    path = tmp_path / "sortie-1.waypoints"
    path.write_text(waypoints_text(flown))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == 10 + 1
    home, takeoff, speed, _, *way, _, _ = points = [loader.wp(k) for k in range(loader.count())]
    assert [one.command for one in points] == [16, 22, 178, 206, *[16] * 5, 206, 20]
    assert (home.frame, home.x, home.y, home.z) == (0, *HOME)
    assert (takeoff.frame, takeoff.x, takeoff.y, takeoff.z) == (3, HOME[0], HOME[1], 64.0)
    assert speed.param2 == 9.5
    found = np.array([(one.frame, one.x, one.y, one.z) for one in way])
    expected = np.column_stack([[3] * 5, flown.latitude, flown.longitude, flown.above_home])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def outlined():
    outer = np.array([[58.66, 16.46], [58.66, 16.47], [58.67, 16.47], [58.67, 16.46]])
    hole = np.array([[58.662, 16.462], [58.662, 16.464], [58.664, 16.464]])
    return [("Wolf & <co>", [outer, hole])]


def test_geojson_reads_back_with_its_rings_as_the_standard_wants_them(tmp_path):
    found = plan_geojson(outlined(), [mission()])
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    kinds = [one["properties"]["kind"] for one in found["features"]]
    assert kinds == ["area", "way", *["way point"] * 5]
    line = np.array(found["features"][1]["geometry"]["coordinates"])
    assert np.allclose(line[0], HOME[1::-1]) and np.allclose(line[-1], HOME[1::-1]) and len(line) == 7
    for k, ring in enumerate(found["features"][0]["geometry"]["coordinates"]):
        p = np.array(ring)
        assert ring[0] == ring[-1]
        counter_clockwise = (p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]).sum() > 0
        assert counter_clockwise == (k == 0)
    areas = {**found, "features": found["features"][:1]}
    back = parse_areas(json.dumps(areas).encode(), tmp_path / "plan.geojson").areas
    assert back[0].name == "Wolf & <co>" and len(back[0].holes) == 1


def test_kml_is_xml_whose_areas_read_back(tmp_path):
    text = plan_kml("plan", outlined(), [mission()])
    assert minidom.parseString(text).documentElement.tagName == "kml"
    back = parse_areas(text.encode(), tmp_path / "plan.kml").areas
    assert [one.name for one in back] == ["Wolf & <co>"] and len(back[0].holes) == 1
    line = text.split("<LineString>")[1]
    assert "relativeToGround" in line and "16.46000000,58.66000000,60.000" in line
