"""Scenes against what is known in closed form: outlines, areas, temperatures, horizon; and their layers."""

import numpy as np
import pytest

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.scene.render import (
    EVEN,
    Body,
    Layer,
    Scene,
    Sea,
    mean_square_slope,
    outline_of,
    rectangle,
    render,
    tiles_of,
    vessel,
)

CAMERA = Camera(160, 128, 290.0, 292.0, 78.0, 66.0)


def poses(height, roll=0.0, pitch=0.0, yaw=0.0, camera=CAMERA):
    R_nb = euler_to_matrix(*np.radians([roll, pitch, yaw]))
    return CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -height]), R_nb)


def shown(sea, bodies, at):
    """What the camera of the poses sees of bodies on a sea."""
    return render(Scene(sea, bodies), at.camera, at.p_nc, at.R_nc)


def rendered(body, height=60.0, camera=CAMERA, sea=EVEN, **angles):
    at = poses(height, camera=camera, **angles)
    return shown(sea, (body,), at), at


def test_a_rectangle_straight_below_has_its_size_in_closed_form():
    view, _ = rendered(rectangle(18.0, 6.0, 8.0).at(2.0, -3.0))
    seen = view.seen[0]
    # The top of the image is north: u = cx + fx e / h, v = cy - fy n / h.
    assert np.allclose(seen.uv, [78 - 290 * 3 / 60, 66 - 292 * 2 / 60])
    assert np.isclose(seen.area, 18 * 6 * 290 * 292 / 60**2)
    assert np.allclose(seen.middle, seen.uv)
    assert seen.whole
    assert np.isclose(seen.covered, seen.area, rtol=0.01)
    assert np.isclose(view.kelvin.max(), 294.0, atol=1e-4)
    assert np.isclose(view.kelvin[0, 0], 286.0, atol=1e-3)


@pytest.mark.parametrize(("roll", "pitch", "yaw"), [(12, -8, 40), (-20, 25, 200), (5, 40, -70)])
def test_what_is_warm_integrates_to_the_projected_outline(roll, pitch, yaw):
    body = rectangle(14.0, 9.0, 8.0).at(0.0, 0.0, 0.7)
    at = poses(70.0, roll, pitch, yaw)
    middle = georeference_pixels(at, [[80.0, 64.0]], 0.0)[0]
    body = body.at(middle[0], middle[1], 0.7)
    view = shown(EVEN, (body,), at)
    seen, warm = view.seen[0], (view.kelvin.astype(float) - 286.0) / 8.0
    assert np.isclose(warm.sum(), seen.area, rtol=0.01)
    v, u = np.mgrid[:128, :160]
    assert np.allclose([(warm * u).sum() / warm.sum(), (warm * v).sum() / warm.sum()], seen.middle, atol=0.06)
    # Each labelled pixel's ray meets the water inside of the rectangle, and no other's does.
    pixels = np.stack([u, v], axis=-1).reshape(-1, 2).astype(float)
    ground = georeference_pixels(at, pixels, 0.0)[:, :2] - middle[:2]
    cos, sin = np.cos(0.7), np.sin(0.7)
    ahead, right = ground @ [cos, sin], ground @ [-sin, cos]
    inside = (np.abs(ahead) <= 7.0) & (np.abs(right) <= 4.5)
    assert np.array_equal(view.labels.ravel() == 1, inside)


def test_what_the_border_cuts_is_cut_exactly():
    view, _ = rendered(rectangle(20.0, 6.0, 8.0).at(0.0, 60 * 78 / 290))
    seen = view.seen[0]
    # Its centre lies at u = 156; the image ends at 159.5, half a pixel beyond the centre of the last.
    across = 6 * 290 / 60
    assert np.isclose(seen.share, (159.5 - (156 - across / 2)) / across)
    assert np.isclose(seen.middle[0], (159.5 + 156 - across / 2) / 2)
    assert not seen.whole
    beside, _ = rendered(rectangle(20.0, 6.0, 8.0).at(0.0, 40.0))
    assert beside.seen == ()
    behind = poses(60.0, pitch=60.0)
    view = shown(EVEN, (rectangle(5, 5, 8).at(-500.0, 0.0),), behind)
    assert view.seen == ()


def test_a_layer_above_the_water_is_displaced_by_its_height():
    low, _ = rendered(rectangle(10.0, 6.0, 8.0).at(5.0, 0.0))
    high, _ = rendered(rectangle(10.0, 6.0, 8.0, height=6.0).at(5.0, 0.0))
    assert np.allclose(low.seen[0].uv, high.seen[0].uv)
    assert np.isclose(high.seen[0].middle[1], 66 - 292 * 5 / 54)
    assert np.isclose(low.seen[0].middle[1], 66 - 292 * 5 / 60)
    # The upper one hides the lower one where both are met.
    square = ((3.0, -3.0), (3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0))
    both, _ = rendered(Body("two", (Layer(square, 0.0, 5.0), Layer(square, 6.0, 9.0))).at(8.0, 0.0))
    assert np.isclose(both.kelvin.max(), 295.0, atol=1e-3)
    nine, five = (np.abs(both.kelvin - value) < 1e-3 for value in (295.0, 291.0))
    assert np.isclose(nine.sum(), 36 * 290 * 292 / 54**2, rtol=0.1)  # without those at its edge
    assert 0 < five.sum() < nine.sum()


def test_nearer_bodies_hide_farther_ones():
    at = poses(60.0)
    tall = rectangle(8.0, 8.0, 9.0, height=20.0)
    for bodies in ((tall, rectangle(4, 4, 3.0)), (rectangle(4, 4, 3.0), tall)):
        view = shown(EVEN, bodies, at)
        assert view.labels[66, 78] == 1 + bodies.index(tall)
        assert np.isclose(view.kelvin[66, 78], 295.0, atol=1e-3)


def test_the_horizon_is_where_the_rays_are_level():
    camera = Camera(160, 128, 290.0, 292.0, 78.0, 66.0, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
    at = poses(100.0, roll=10, pitch=85, camera=camera)
    view = shown(Sea(), (), at)
    v, u = np.mgrid[:128, :160].astype(float)
    xy = normalise(camera, np.stack([u, v], axis=-1))
    down = xy @ at.R_nc[2, :2] + at.R_nc[2, 2]
    assert np.array_equal(view.water, down > 1e-4 * np.sqrt(1 + (xy**2).sum(axis=-1)))
    assert 0.05 < view.water.mean() < 0.95
    assert view.kelvin[view.water].mean() > view.kelvin[~view.water].mean()


def test_slopes_are_those_of_cox_and_munk():
    sea = Sea(wind_speed=7.0, seed=3)
    tiles = tiles_of(sea)
    total = sum(float((tile.astype(float) ** 2).sum(axis=-1).mean()) for tile in (tiles.waves, tiles.ripples))
    assert np.isclose(total, mean_square_slope(7.0), rtol=0.02)
    assert np.isclose(tiles.patches.std(), sea.patches_sd, rtol=1e-3)


def test_the_sun_glints_where_it_is_mirrored():
    """A calm sea mirrors a sun at elevation a where the camera looks down by a, away from the sun's back."""
    sea = Sea(
        wind_speed=0.0,
        patches_sd=0.0,
        air=286,
        zenith=286,
        sun_elevation=np.radians(60),
        sun_azimuth=0.0,
        glint=5.0,
    )
    at = poses(60.0, pitch=30.0)  # straight down is turned 30 deg forward: north, 60 deg below the horizon
    warm = shown(sea, (), at).kelvin
    assert np.unravel_index(warm.argmax(), warm.shape) == (66, 78)
    assert warm.max() > 290
    away = poses(60.0, pitch=30.0, yaw=180.0)
    assert shown(sea, (), away).kelvin.max() < 286.1


def test_a_moving_vessel_leaves_a_wake():
    boat = vessel(12.0, 4.0, 6.0, speed=3.0, seed=1).at(0.0, 0.0, np.pi / 2)
    view = shown(EVEN, (boat,), poses(100.0))
    assert view.labels[66, 78 - 25] == 0
    assert view.kelvin[66, 78 - 25] > 286.05
    assert np.isclose(view.kelvin[66, 78 + 25], 286.0, atol=1e-3)


def test_outlines_are_exact_projections():
    body = vessel(12.0, 4.0, seed=1).at(5.0, 3.0, 1.0)
    at = poses(80.0, pitch=15)
    hull = outline_of(body, CAMERA, at.p_nc, at.R_nc)
    corners = np.concatenate([body.corners(layer) for layer in body.layers])
    down = (corners - at.p_nc) @ at.R_nc
    projected = down[:, :2] / down[:, 2:] * [290.0, 292.0] + [78.0, 66.0]
    assert hull is not None
    assert np.allclose([hull.min(axis=0), hull.max(axis=0)], [projected.min(axis=0), projected.max(axis=0)])
