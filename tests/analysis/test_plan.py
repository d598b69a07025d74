"""Plans held against what must be: heights, times by hand, batteries, and what forbids a flight."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.flight.test_area import collection, feature, polygon
from tests.planning.test_courses import curvature
from tests.refused import refused
from wildlab.analysis.plan import TOLERANCE, fly_rows, follow, make_plan, nearest_ground, refuse_near
from wildlab.analysis.plan_coverage import cover
from wildlab.analysis.plan_request import PlanRequest, look
from wildlab.analysis.plan_result import missions, plan_result
from wildlab.flight.writers import CHANGE_SPEED, mission_items
from wildlab.geometry.camera import Camera
from wildlab.geometry.georeference import Terrain
from wildlab.reporting.plan import with_words

CAMERA = Camera(640, 512, 800.0, 800.0, 319.5, 255.5)
#: 200 m east and 400 m north.
FIELD = [[0, 0], [0, 200], [400, 200], [400, 0], [0, 0]]


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    path = tmp_path_factory.mktemp("areas") / "field.geojson"
    other = [[-300, 0], [-300, 150], [-100, 150], [-100, 0], [-300, 0]]
    content = collection(feature(polygon(FIELD), name="field"), feature(polygon(other), name="wood"))
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def plan(area, **given):
    return make_plan(PlanRequest(area, CAMERA, **{"names": True} | given))


def result_of(made):
    return plan_result(made, cover(made))


# -- what is seen


def test_a_tilted_camera_sees_further_and_wider():
    view = look(CAMERA, 45.0)
    half = math.atan(255.5 / 800)
    assert view.ahead[0] == pytest.approx(1 / math.tan(math.pi / 4 + half), rel=1e-6)
    assert view.ahead[1] == pytest.approx(1 / math.tan(math.pi / 4 - half), rel=1e-6)
    assert view.slant == pytest.approx(math.sqrt(2), rel=1e-3)
    assert view.width == pytest.approx(639 / 800 * math.sqrt(2), rel=1e-3)


# -- height, rows, times


@pytest.mark.parametrize(
    ("given", "facts"),
    [
        (
            {"pixels": 25.0},
            {"fewer-pixels": {"animal": "1.5", "pixels": "20.0", "wanted": "25"}},
        ),  # 800 * 1.5 / 60
        ({"animal_m": 0.3}, {"few-pixels": {"animal": "0.3", "pixels": "4.0", "wanted": "10"}}),
        ({"wind_m_s": 6.0, "wind_from_deg": 0.0}, {"airspeed": {"air": "16", "speed": "10"}}),
        ({"wind_m_s": 6.0, "wind_from_deg": 0.0, "max_air_m_s": 16.0}, {}),
        ({}, {}),
    ],
)
def test_plans_warn_of_few_pixels_and_of_a_head_wind(field, given, facts):
    found = dict(result_of(plan(field, height_m=60.0, direction_deg=0.0, **given))["warnings"])
    assert facts.items() <= found.items() and bool(found) == bool(facts)


@pytest.mark.parametrize(
    "given",
    [
        {"battery_min": 30.0, "animals": 3.0, "photo_m": 5.0, "names": True},
        {"turn_radius_m": 40.0, "wind_m_s": 4.0, "wind_from_deg": 90.0, "heights": "ground"},
        {"gimbal": "adaptive", "swing_deg": 20.0, "tilt_deg": 70.0, "trees_m": 5.0},
        {"exposure_ms": 400.0, "gimbal": "roll", "swing_deg": 30.0, "home": (58.66, 16.46)},
    ],
)
def test_every_fact_has_its_words(field, given):
    facts = result_of(plan(field, height_m=60.0, **given))
    said = with_words(facts)
    for name in ("assumed", "warnings", "sentences"):
        assert len(said[name]) == len(facts[name]) and not any("{" in one for one in said[name])


def test_the_height_follows_from_the_animal_and_the_rule(field):
    assert plan(field, animal_m=1.0, pixels=10.0).height == 80.0
    assert plan(field, animal_m=3.0, pixels=10.0).height == 115.0
    assert plan(field, height_m=42.5).height == 42.5
    assert plan(field, height_m=120.0).height == 120.0
    with refused("121 m"):
        plan(field, height_m=121.0)
    assert plan(field, height_m=150.0, max_height_m=200.0).height == 150.0
    with refused(r"8\.0 m"):
        plan(field, animal_m=0.1, pixels=10.0)


def test_times_are_those_of_the_way(field):
    made = plan(
        field, height_m=60.0, speed_m_s=8.0, turn_s=4.0, climb_m_s=2.0, direction_deg=0.0, overlap=0.25
    )
    assert made.strip == pytest.approx(60 * 639 / 800)
    assert (made.pattern.distance <= 0.75 * made.strip + 1e-9).all()
    one = made.sorties[0]
    legs = np.diff(one.way.points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    along = legs / lengths[:, None]
    corners = int(((along[1:] * along[:-1]).sum(axis=1) < 1 - 1e-9).sum())
    expected = lengths.sum() / 8.0 + 4.0 * corners + 2 * 60.0 / 2.0
    assert one.duration == pytest.approx(expected, rel=1e-6)
    seconds = made.area_seconds()
    assert (seconds > 0).all() and seconds.sum() < one.duration
    rows = np.linalg.norm(np.diff(made.pattern.rows, axis=1)[:, 0], axis=1)
    for area in (0, 1):
        assert seconds[area] > rows[made.pattern.area == area].sum() / 8.0


def test_wind_along_the_rows_costs_what_the_triangle_says(field):
    wing = {"height_m": 60.0, "direction_deg": 0.0, "turn_radius_m": 30.0}
    still, hover = plan(field, **wing), plan(field, height_m=60.0, direction_deg=0.0)
    windy = plan(field, **wing, wind_m_s=6.0, wind_from_deg=0.0)
    rows = np.linalg.norm(np.diff(still.pattern.rows, axis=1)[:, 0], axis=1)
    assert np.allclose(windy.pattern.rows, still.pattern.rows)
    up = np.cos(still.pattern.directions) > 0

    def on_rows(made):
        one = made.sorties[0]
        pieces = np.flatnonzero(one.row_of >= 0)
        return (one.course.times[pieces + 1] - one.course.times[pieces])[np.argsort(one.row_of[pieces])]

    assert np.allclose(on_rows(still), rows / 10.0)
    # From the north: against it on rows to the north, with it on those to the south.
    assert np.allclose(on_rows(windy), np.where(up, rows / 4.0, rows / 16.0))
    # The autopilot of a multicopter is told a speed over the ground, and holds it.
    gusty = plan(field, height_m=60.0, direction_deg=0.0, wind_m_s=6.0, wind_from_deg=0.0)
    assert gusty.duration == hover.duration
    for made, kind in ((windy, 0), (gusty, 1)):
        commanded = [one for one in mission_items(missions(made)[0]) if one.command == CHANGE_SPEED]
        assert [one.parameters[:2] for one in commanded] == [(kind, 10.0)]


def test_way_points_of_an_aircraft_that_cannot_stop_are_few_and_hold_its_rows(field):
    made = plan(field, height_m=60.0, turn_radius_m=35.0)
    assert made.wanted.vehicle == "fixed-wing"
    course, way = made.sorties[0].course.points, made.sorties[0].way.points
    assert 0 < curvature(course).max() < 1 / (0.45 * 35.0) and len(way) < len(course) / 2
    for end in made.pattern.rows.reshape(-1, 2):
        assert np.linalg.norm(way - end, axis=1).min() < 1e-6


def test_a_wing_flies_the_direction_that_is_quickest_with_its_turns_and_the_wind(tmp_path):
    path = tmp_path / "a.geojson"
    ring = [[0, 0], [0, 390], [400, 390], [400, 0], [0, 0]]
    path.write_text(json.dumps(collection(feature(polygon(ring)))))
    for wind_from in (0.0, 90.0):
        given = {"height_m": 60.0, "turn_radius_m": 40.0, "wind_m_s": 7.0, "wind_from_deg": wind_from}
        made = plan(path, **given)
        each = [plan(path, direction_deg=one, **given).duration for one in (0.0, 90.0)]
        assert made.duration == pytest.approx(min(each), rel=0.001)
        assert abs(each[0] - each[1]) > 0.05 * each[0]


# -- batteries


def test_longer_plans_become_flights_that_each_last(field):
    whole = plan(field, height_m=40.0)
    made = plan(field, height_m=40.0, battery_min=8.0, reserve=0.25)
    assert len(made.sorties) > 1 and len(whole.sorties) == 1
    assert all(one.duration <= 8 * 60 * 0.75 for one in made.sorties)
    assert np.concatenate([one.rows for one in made.sorties]).tolist() == list(range(len(made.pattern.rows)))
    for before, after in zip(made.sorties[:-1], made.sorties[1:], strict=True):
        assert np.allclose(before.way.points[-1], made.home) and np.allclose(after.way.points[0], made.home)
        # Not one row fewer than fits.
        more = [*before.rows, before.rows[-1] + 1]
        longer = fly_rows("longer", more, made.pattern, made.home, made.wanted, None, made.height)
        assert longer.duration > 8 * 60 * 0.75
    assert result_of(made)["sorties"][0]["of_battery"] <= 0.75


def test_what_lies_in_two_areas_counts_once(tmp_path):
    path = tmp_path / "a.geojson"
    # 8 ha each; the second is the first, 150 m further east: 50 m by 400 m are in both.
    other = [[a, b + 150] for a, b in FIELD]
    content = collection(feature(polygon(FIELD), name="a"), feature(polygon(other), name="b"))
    path.write_text(json.dumps(content))
    made = plan(path, height_m=60.0, density_km2=100.0)
    assert sum(made.alone.values()) == pytest.approx(14e4, rel=0.01)
    said = result_of(made)
    assert said["animals"] == pytest.approx(14, rel=0.01)
    assert dict(said["warnings"]) == {"overlap": {"size": "2.0 ha"}}


def test_where_one_takes_off(field):
    made = plan(field, height_m=60.0, home=(58.659, 16.46))
    assert np.allclose(made.sorties[0].way.points[0], made.home)
    assert made.home[0] == pytest.approx(
        -161.4, abs=0.5
    )  # 0.001 deg below the field, about the areas' middle
    with refused("exchanged"):
        plan(field, home=(16.46, 58.66))
    with refused("km from the areas"):
        plan(field, home=(-58.66, 16.46))


# -- the ground below


def hills(n=120, step=10.0):
    x, y = np.meshgrid(np.arange(n) * step, np.arange(n) * step)
    height = 40 * np.sin(x / 90) * np.cos(y / 130) + 0.05 * x
    return Terrain(height.astype(np.float32), north=-n * step / 2, east=-n * step / 2, step=step)


def test_a_way_stays_near_its_height_everywhere():
    terrain = hills()
    way = np.array([[-500.0, -500.0], [500.0, -480.0], [480.0, 500.0], [-400.0, 100.0]])
    found = follow(way, terrain, 60.0, 62.0)
    assert np.allclose(found.points[found.corner >= 0], way)
    t = np.linspace(0, 1, 4001)[:, None]
    total = 0
    for k in range(len(found.points) - 1):
        a, b = found.points[k], found.points[k + 1]
        flown = found.height[k] + t[:, 0] * (found.height[k + 1] - found.height[k])
        above = flown - terrain.heights_at(a + t * (b - a))
        # Looked at every few metres: between these places, the ground bends by less than half a metre.
        assert above.min() > 60 - TOLERANCE - 0.5 and above.max() < 62 + 0.5
        total += 1
    assert np.allclose(found.height - found.ground, 60.0)
    straight = int(np.linalg.norm(np.diff(way, axis=0), axis=1).sum() / 5)
    assert total < straight / 4, "far fewer way points than places"


def test_climbing_that_is_too_steep_takes_longer_and_is_said(field):
    cliff = np.zeros((200, 200), np.float32)
    cliff[100:] = 90.0
    terrain = Terrain(cliff, north=-1000.0, east=-1000.0, step=10.0)
    wanted = PlanRequest(field, CAMERA, height_m=60.0, direction_deg=0.0, climb_m_s=2.0)
    flat, steep = make_plan(wanted), make_plan(wanted, terrain)
    wing = make_plan(replace(wanted, turn_radius_m=30.0, max_height_m=500.0), terrain)
    assert wing.sorties[0].steepest == pytest.approx(2.0, rel=0.01) and not result_of(wing)["warnings"]
    assert steep.duration > flat.duration + 2 * 90 / 2.0
    assert result_of(steep)["warnings"] and not result_of(flat)["warnings"]


def wall(rise, step=4.0):
    """Ground that rises between two nodes."""
    height = np.zeros((300, 300), np.float32)
    height[150:] = rise
    return Terrain(height, north=-600.0, east=-600.0, step=step)


def test_a_way_keeps_off_a_wall_on_all_sides():
    across = follow(np.array([[-200.0, 0.0], [200.0, 0.0]]), wall(90.0), 60.0)
    # Up before the wall, whose foot is at -4 and top at 0; between places looked at, the way is straight.
    near = nearest_ground(across, wall(90.0))
    assert 7.0 < near < 11.0
    beside = follow(np.array([[-8.0, -200.0], [-8.0, 200.0]]), wall(90.0), 60.0)
    assert nearest_ground(beside, wall(90.0)) > 7.0 and beside.most > 85.0
    far = follow(np.array([[-20.0, -200.0], [-20.0, 200.0]]), wall(90.0), 60.0)
    assert far.most == pytest.approx(60.0)
    assert nearest_ground(far, wall(90.0)) == pytest.approx(16 + 4 * 60 / 90, abs=0.6)


def test_the_nearest_ground_of_a_slope_is_that_of_a_plane():
    steep = Terrain((np.arange(300)[:, None] * 4.0 * np.ones(300)).astype(np.float32), -600.0, -600.0, 4.0)
    way = follow(np.array([[0.0, -100.0], [0.0, 100.0]]), steep, 60.0)
    assert way.most == pytest.approx(60.0)
    assert nearest_ground(way, steep) == pytest.approx(60 / math.sqrt(2), rel=0.02)
    assert nearest_ground(way, steep, 20.0) == pytest.approx(40 / math.sqrt(2), rel=0.02)


def test_a_way_that_comes_too_near_is_refused(field):
    terrain = wall(90.0)
    made = make_plan(PlanRequest(field, CAMERA, height_m=60.0), terrain)
    assert made.nearest > 5.0
    one = made.sorties[0]
    low = one._replace(way=one.way._replace(height=np.minimum(one.way.height, 92.0)))
    with refused(r"within [0-4]\.\d m"):
        refuse_near([low], terrain, made.wanted, 60.0)
    with refused(r"1\d\d m above"):
        make_plan(PlanRequest(field, CAMERA, height_m=60.0), wall(150.0))


def test_heights_above_take_off_are_differences_of_ground(field):
    terrain = hills()
    wanted = PlanRequest(field, CAMERA, height_m=60.0)
    made = make_plan(wanted, terrain)
    flight = missions(made)[0]
    way = made.sorties[0].way
    assert np.allclose(flight.above_ground, 60.0)
    # The Earth's curvature over some hundred metres is a centimetre or two.
    assert np.allclose(flight.above_home, 60 + way.ground - way.ground[0], atol=0.05)
    assert np.ptp(flight.above_home) > 20
    assert flight.above_home[0] == pytest.approx(60.0, abs=1e-3)


# -- numbers that are none
