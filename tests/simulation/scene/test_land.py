"""Land and scenes on it: closed forms, the surface itself, the sun's way, and the heights of a terrain."""

from dataclasses import replace

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN, CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.landscape import TREES_M, UNEVEN, grow_trees, synthetic_landscape
from wildlab.simulation.scene.drawn import animal, slab, tree
from wildlab.simulation.scene.land import (
    CLOUD_BLANKET,
    EVEN_LAND,
    GRASS,
    SAND,
    SHADOW_DEPTH,
    Cover,
    Land,
    LandScene,
    Weather,
    ground_points,
    height_at,
    render_land,
)

CAMERA = Camera(160, 128, 290.0, 292.0, 78.0, 66.0)
SMOOTH = Cover(heating=20.0, cooling=0.0, lag=0.0, texture_sd=0.0)


def pose(height, roll=0.0, pitch=0.0, yaw=0.0):
    R_nb = euler_to_matrix(*np.radians([roll, pitch, yaw]))
    at = CameraPoses(CAMERA, Mount("down"), np.array([3.0, -7.0, -height]), R_nb)
    return at.p_nc, at.R_nc


def hilly(cells=64, side=128.0, high=4.0):
    north, east = np.meshgrid(*[np.arange(cells) / cells * 2 * np.pi] * 2, indexing="ij")
    return Land(high * np.sin(north) * np.cos(2 * east), side=side, covers=(SMOOTH,))


@pytest.mark.parametrize(("roll", "pitch"), [(0, 0), (25, -20), (10, 55)])
def test_rays_end_on_the_ground_and_project_back(roll, pitch):
    land, (p, R) = hilly(), pose(40.0, roll, pitch, 30.0)
    uv = np.stack(np.meshgrid([0.0, 60.0, 159.0], [0.0, 70.0, 127.0]), axis=-1).reshape(-1, 2)
    points = ground_points(land, CAMERA, p, R, uv)
    met = np.isfinite(points[:, 0])
    assert met[:6].any()
    heights = [height_at(land, point[:2]) for point in points[met]]
    assert np.allclose(-points[met, 2], heights, atol=1e-5)
    assert np.allclose(ground_to_pixel(CAMERA, points[met], p, R), uv[met], atol=1e-6)
    # No ground lies between: along the way the ray is above it.
    for point in points[met]:
        way = p + np.linspace(0, 0.999, 400)[:, None] * (point - p)
        assert all(-w[2] > height_at(land, w[:2]) - 1e-6 for w in way)


def test_a_slope_has_the_heat_of_its_angle_to_the_sun():
    land = replace(hilly(), weather=Weather(hour=9.0))
    p, R = pose(50.0)
    view = render_land(LandScene(land), CAMERA, p, R)
    sun = land.weather.sun
    for u, v in ((20, 20), (80, 64), (140, 100)):
        north, east, _ = ground_points(land, CAMERA, p, R, [[u, v]])[0]
        k, high = 2 * np.pi / 128, 4.0
        slopes = (
            high * k * np.cos(k * north) * np.cos(2 * k * east),
            -2 * high * k * np.sin(k * north) * np.sin(2 * k * east),
        )
        normal = np.array([-slopes[0], -slopes[1], 1.0]) / np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
        # The unevenness of sunlit ground is the only other thing: none here, as no cover has a texture.
        heat = 20.0 * max(float(normal @ sun), 0.0)
        assert view.kelvin[v, u] - land.weather.air == pytest.approx(heat, abs=0.15)


def test_the_sun_rises_in_the_east_and_is_highest_at_noon():
    rise, noon = Weather(hour=6.0).sun, Weather(hour=12.0)
    assert np.allclose(rise, [0, 1, 0], atol=1e-12)
    assert np.arcsin(noon.sun[2]) == pytest.approx(np.radians(55.0))
    assert noon.sun[0] < 0
    assert np.isclose(np.linalg.norm(Weather(hour=9.7).sun), 1)


def test_heat_that_is_kept_fades_by_its_lag_at_night():
    one, other = Weather(hour=20.0).kept(2.0), Weather(hour=23.0).kept(2.0)
    assert np.allclose(other, one * np.exp(-3 / 2), rtol=1e-3)
    assert np.allclose(Weather(hour=11.0).kept(0.01), Weather(hour=11.0).sun, atol=0.01)
    assert np.allclose(Weather(hour=2.0).kept(0.0), 0)


def test_clouds_take_heat_and_keep_the_night_warm():
    clear, closed = Weather(hour=13.0), Weather(hour=13.0, clouds=1.0)
    heat = clear.heat(SAND)[2]
    assert closed.level(SAND) - closed.air == pytest.approx(
        heat * (1 - SHADOW_DEPTH) - SAND.cooling * (1 - CLOUD_BLANKET)
    )
    assert Weather(hour=2.0, clouds=1.0).level(GRASS) > Weather(hour=2.0).level(GRASS)


def test_a_body_stands_on_the_height_of_the_ground():
    land, (p, R) = hilly(), pose(50.0, 8.0, -5.0)
    at = ground_points(land, CAMERA, p, R, [[140.0, 100.0]])[0]
    view = render_land(LandScene(land, (slab(4.0, 4.0, 30.0).at(*at[:2]),)), CAMERA, p, R)
    assert abs(at[2]) > 0.3
    assert np.allclose(view.seen[0].uv, [140.0, 100.0], atol=1e-3)
    depth = ((at - p) @ R)[2]
    assert view.seen[0].area == pytest.approx(16 * 290 * 292 / depth**2, rel=0.05)


def test_a_tree_hides_what_is_under_it():
    weather = EVEN_LAND.weather
    under = animal("antelope", weather).at(0.0, 0.0)
    beside = animal("antelope", weather).at(0.0, 8.0)
    scene = LandScene(EVEN_LAND, (under, beside, tree(5.0, weather).at(0.0, 0.0)))
    view = render_land(scene, CAMERA, [0, 0, -40.0], R_MC_DOWN)
    assert view.visible(1) < 0.05
    assert view.visible(2) == pytest.approx(1.0, abs=0.05)
    assert (view.labels == 3).any()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: render_land(LandScene(EVEN_LAND), CAMERA, [0, 0, 1.0], R_MC_DOWN), "raise"),
        (lambda: render_land(LandScene(hilly()), CAMERA, [32.0, 0, -3.5], R_MC_DOWN), "-0.5 m above"),
    ],
)
def test_what_cannot_be_is_refused(make, words):
    with pytest.raises(WildlabError, match=f"(?i){words}"):
        make()


def test_cloud_shadows_cool_the_ground_under_them():
    still = replace(EVEN_LAND, covers=(SMOOTH,), weather=Weather(hour=12.0))
    p, R = pose(50.0)
    sunny = render_land(LandScene(still), CAMERA, p, R).kelvin
    shaded = render_land(
        LandScene(replace(still, weather=Weather(hour=12.0, clouds=1.0))), CAMERA, p, R
    ).kelvin
    air = still.weather.air
    assert np.allclose(shaded - air, (1 - SHADOW_DEPTH) * (sunny - air), atol=1e-3)


def test_it_has_the_size_and_the_relief_that_are_printed():
    land = synthetic_landscape(3)
    assert land.extent == (-250.0, 250.0, -500.0, 500.0)
    assert land.height.min() == 0 and land.height.max() == pytest.approx(51.0, abs=1e-4)
    assert np.array_equal(land.height, synthetic_landscape(3).height)
    assert not np.allclose(land.height, synthetic_landscape(4).height)


def test_trees_stand_on_their_share_of_the_ground_in_groups():
    land = synthetic_landscape(3)
    grown = grow_trees(land, 5, share=0.2)
    trees = grown.height - land.height
    assert (trees > 0).mean() == pytest.approx(0.2, abs=0.001)
    assert trees[trees > 0].min() >= (1 - UNEVEN) * TREES_M - 1e-3
    assert trees.max() <= (1 + UNEVEN) * TREES_M + 1e-3
    beside = (trees[:, 1:] > 0)[trees[:, :-1] > 0].mean()
    assert beside > 0.8, "beside a tree stands another"
    assert np.array_equal(grown.height, grow_trees(land, 5, share=0.2).height)
    assert grown.extent == land.extent
