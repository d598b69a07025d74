"""What a plan says will be seen, beside what is known otherwise: shares by hand, hiding by brute force."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.test_plan import CAMERA, hills, plan
from tests.flight.test_area import collection, feature, polygon
from wildlab.analysis.plan import make_plan
from wildlab.analysis.plan_coverage import cover, gimbal_rate, images_of
from wildlab.analysis.plan_request import FURTHEST, PlanRequest, simplified
from wildlab.geometry.camera import project

HOLE = [[50, 50], [50, 90], [90, 90], [90, 50], [50, 50]]
FIELD = [[0, 0], [0, 160], [200, 160], [200, 0], [0, 0]]


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    path = tmp_path_factory.mktemp("areas") / "field.geojson"
    path.write_text(json.dumps(collection(feature(polygon(FIELD, HOLE), name="field", animals=12))))
    return path


def over(area, terrain, **given):
    return make_plan(PlanRequest(area, CAMERA, **given), terrain)


def test_with_overlap_all_of_a_flat_field_is_seen_and_its_hole_is_not_asked(field):
    made = plan(field, height_m=50.0)
    (found,) = cover(made)
    assert found.seen == 1.0
    area = float(found.inside.sum()) * found.step**2
    assert area == pytest.approx(160 * 200 - 40 * 40, rel=0.02)
    rows, columns = np.indices(found.inside.shape)
    north, east = found.north + found.step * rows, found.east + found.step * columns
    in_hole = (abs(north - (70 - 100)) < 19) & (abs(east - (70 - 80)) < 19)
    assert in_hole.any() and not found.inside[in_hole].any()


def test_a_tilted_camera_flies_its_rows_so_that_their_ends_are_seen(field):
    for direction in (0.0, 90.0, 215.0):
        made = plan(field, height_m=50.0, tilt_deg=50.0, direction_deg=direction)
        assert cover(made)[0].seen > 0.998


def test_without_overlap_what_lies_at_the_edges_of_images_is_missed(field):
    # Rows to the north; of 640 columns, 25 on either side do not count.
    made = plan(field, height_m=50.2, overlap=0.0, direction_deg=0.0)
    (found,) = cover(made)
    distance = float(made.pattern.distance[0])
    width = made.strip * (640 - 50) / 639
    assert width < distance
    assert found.seen == pytest.approx(width / distance, abs=0.02)
    assert found.share(found.hidden) == 0 and found.share(found.blurred) == 0


@pytest.mark.parametrize("tilt", [90.0, 30.0])
def test_what_is_hidden_is_hidden_by_brute_force(field, tilt):
    terrain = hills(step=8.0)
    steep = replace(terrain, height=5.0 * terrain.height)
    made = over(field, steep, height_m=40.0, tilt_deg=tilt)
    (found,) = cover(made)
    images = images_of(made, made.sorties[0])
    p, R = images.poses.p_nc, images.poses.R_nc
    rng = np.random.default_rng(1)
    rows, columns = np.nonzero(found.inside)
    some = rng.choice(len(rows), 60, replace=False)
    t = np.linspace(0.0, 1.0, 2001)[1:-1, None]
    agreed = 0
    for i, j in zip(rows[some], columns[some], strict=True):
        ne = np.array([found.north + found.step * i, found.east + found.step * j])
        point = np.array([*ne, -steep.heights_at(ne[None])[0] - 0.1])
        camera = images.poses.camera
        offset = np.einsum("nij,ni->nj", R, point - p)
        u, v = project(camera, offset).T
        with np.errstate(invalid="ignore"):
            inside = (u >= 0) & (v >= 0) & (u <= camera.width) & (v <= camera.height)
        inside &= np.linalg.norm(point - p, axis=1) <= FURTHEST * 40.0
        shown = False
        for k in np.flatnonzero(inside):
            line = p[k] + t * (point - p[k])
            if images.sharp[k] and (-line[:, 2] > steep.heights_at(line[:, :2])).all():
                shown = True
                break
        agreed += shown == (found.looks[i, j] > 0)
    assert agreed >= 59  # a line that grazes the ground may fall either way between its steps
    assert found.seen < 1.0 or tilt == 90.0


@pytest.mark.parametrize(("direction", "wind_from"), [(0.0, 270.0), (35.0, 300.0), (250.0, 20.0)])
def test_a_fixed_wing_points_its_camera_where_its_nose_is(field, direction, wind_from):
    """Through the air along the nose, and with the wind: that is the way over the ground."""
    wind = {"wind_m_s": 6.0, "wind_from_deg": wind_from}
    made = plan(field, height_m=60.0, turn_radius_m=30.0, direction_deg=direction, **wind)
    nose = -images_of(made, made.sorties[0]).poses.R_nc[:, :2, 1]  # up in the image
    over_ground = made.wanted.speed_m_s * nose + made.wanted.wind
    along = np.radians(direction)
    ahead, aside = over_ground @ [np.cos(along), np.sin(along)], over_ground @ [-np.sin(along), np.cos(along)]
    assert np.abs(aside).max() < 1e-6 and np.abs(ahead).min() > 1.0
    assert (ahead > 0).any() and (ahead < 0).any()


@pytest.mark.parametrize("gimbal", ["yaw", "roll", "adaptive"])
def test_a_camera_that_swings_sees_a_wider_strip(field, gimbal):
    given = dict(height_m=50.0, tilt_deg=60.0, gimbal=gimbal, swing_deg=30.0, exposure_ms=1.0, speed_m_s=5.0)
    made, still = plan(field, **given), plan(field, height_m=50.0, tilt_deg=60.0)
    assert made.strip > 1.3 * still.strip and len(made.pattern.rows) < len(still.pattern.rows)
    assert gimbal_rate(still) == 0 < gimbal_rate(made)
    (found,) = cover(made)
    assert found.seen > 0.9
    (blurred,) = cover(plan(field, **{**given, "exposure_ms": 500.0}))
    assert blurred.seen < 0.1 and blurred.share(blurred.blurred) > 0.8 and not blurred.hidden.any()


# -- outlines


def test_simpler_outlines_stay_within_the_tolerance():
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    radius = 300 * (1 + 0.15 * np.sin(3 * angle))
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    simple = simplified(ring, 1.5)
    assert 10 < len(simple) < 100
    a, b = simple, np.roll(simple, -1, axis=0)
    for point in ring[::13]:
        t = np.clip(((point - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0, 1)
        assert np.linalg.norm(a + t[:, None] * (b - a) - point, axis=1).min() <= 1.5 + 1e-9
    square = np.array([[0.0, 0], [0, 9], [9, 9], [9, 0]])
    assert simplified(square, 5.0) is square
