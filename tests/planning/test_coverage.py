"""Coverage: all images at once as each alone, and times and probabilities counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from wildlab.geometry.camera import Camera, in_image
from wildlab.geometry.camera_poses import R_MC_DOWN, CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import Terrain, ground_to_pixel
from wildlab.geometry.viewsheds import lines_clear, widest_view
from wildlab.planning.coverage import (
    Coverage,
    Sightings,
    first_seen,
    from_sightings,
    see,
    walks,
)
from wildlab.planning.patterns import check_area, contains
from wildlab.simulation.landscape import synthetic_landscape

CAMERA = Camera(720, 480, 1267.0, 1117.0, 356.0, 216.6, 0.0, (0.446, 0.0, 0.0, 0.0, 0.0))
#: 90 degrees each way, without distortion.
WIDE = Camera(100, 100, 50.0, 50.0, 50.0, 50.0)


def hills(seed: int, holes: bool = False) -> Terrain:
    land = synthetic_landscape(seed, north=120.0, east=160.0, relief=25.0)
    height = land.height.copy()
    height[20:25, 30:40] = np.nan
    return replace(land, height=height) if holes else land


def poses_over(terrain: Terrain, seed: int, count: int = 40) -> CameraPoses:
    """Cameras anywhere above the terrain and a little beyond it, looking anywhere from down to level."""
    rng = np.random.default_rng(seed)
    p = np.stack(
        [rng.uniform(-80, 80, count), rng.uniform(-100, 100, count), -rng.uniform(25, 70, count)], -1
    )
    R = euler_to_matrix(0.0, rng.uniform(0.0, 1.5, count), rng.uniform(-3, 3, count)) @ R_MC_DOWN
    return CameraPoses.at_lens(CAMERA, p, R, np.eye(3))


def shown_alone(terrain: Terrain, pose: CameraPoses, furthest: float) -> NDArray[np.bool_]:
    """Which nodes one image shows: each projected, and its line of sight followed."""
    north, east = (
        at + terrain.step * np.arange(n)
        for at, n in zip((terrain.north, terrain.east), terrain.height.shape, strict=True)
    )
    points = np.stack([*np.meshgrid(north, east, indexing="ij"), -terrain.height.astype(float)], axis=-1)
    p, R, points = pose.p_nc.reshape(3), pose.R_nc.reshape(3, 3), points.reshape(-1, 3)
    x, y, z = ((points - p) @ R).T
    # Far outside the image a lens's polynomial may fold back into it.
    shown = (z > 0) & (np.hypot(x, y) <= (1 + 1e-9) * widest_view(CAMERA) * z)
    shown &= np.linalg.norm(points - p, axis=1) <= furthest
    shown[shown] = in_image(CAMERA, ground_to_pixel(CAMERA, points[shown], p, R))
    shown[shown] = lines_clear(terrain, points[shown], p)
    return shown.reshape(terrain.height.shape)


@pytest.mark.parametrize("holes", [False, True])
def test_many_images_show_what_each_shows_alone(holes):
    terrain = hills(3, holes)
    poses = poses_over(terrain, 4)
    found = see(terrain, poses, 150.0)
    some = 0
    for k in range(poses.rows[0]):
        shown = shown_alone(terrain, poses.take(k), 150.0)
        assert np.array_equal(np.sort(found.node[found.image == k]), np.flatnonzero(shown))
        some += int(shown.sum())
    assert some > 2000


def test_a_lens_that_folds_back_shows_nothing_behind_its_edge():
    folds = Camera(160, 128, 100.0, 100.0, 80.0, 64.0, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    flat = Terrain(np.zeros((201, 201), np.float32), -400.0, -400.0, 4.0)
    poses = CameraPoses(folds, Mount("down"), np.array([[0.0, 0.0, -40.0]]), np.eye(3))
    at = np.stack(np.divmod(see(flat, poses, 500.0).node, 201))
    assert at.shape[1] > 100 and np.hypot(*(at * 4.0 - 400.0)).max() < 60
    behind = ground_to_pixel(folds, [[80.0, 0.0, 0.0]], poses.p_nc[0], poses.R_nc[0])
    assert in_image(folds, behind).all(), "the polynomial alone would show it"


def cover(terrain: Terrain, poses: CameraPoses, times: NDArray[np.float64], sharp=None, **more) -> Coverage:
    """What images show of a terrain up to 100 m."""
    clear = np.ones(len(times), bool) if sharp is None else sharp
    return from_sightings(see(terrain, poses, 100.0), terrain, times, clear, **more)


def flat_flight(times: NDArray[np.float64]) -> tuple[Terrain, CameraPoses]:
    """1 m/s north at 10 m over a plane: a square of 20 m is in view."""
    flat = Terrain(np.zeros((201, 101), np.float32), north=-50.0, east=-50.0, step=1.0)
    p = np.stack([times, 0 * times, 0 * times - 10.0], axis=-1)
    return flat, CameraPoses(WIDE, Mount("down"), p, np.eye(3))


def test_times_are_those_of_a_square_that_moves():
    times = np.arange(0.0, 61.0)
    flat, poses = flat_flight(times)
    shown = cover(flat, poses, times)
    north = flat.north + np.arange(201)
    column = 50  # below the way
    seen = [times[np.abs(n - times) <= 10] for n in north]
    assert shown.looks[:, column].tolist() == [len(one) for one in seen]
    for k, one in enumerate(seen):
        if len(one):
            assert shown.last[k, column] == one[-1]
            assert shown.revisit_age[k, column] == 60 - one[-1]
        else:
            assert np.isnan(shown.last[k, column])
    assert not shown.looks[:, 50 + 11].any() and shown.looks[:, 50 + 10].any()


def test_probability_is_that_of_independent_looks():
    times = np.arange(0.0, 5.0)
    flat, poses = flat_flight(times)
    shown = cover(flat, poses, times, range_scale=12.0)
    n, e = 3.0, 4.0
    each = np.exp(-((n - times) ** 2 + e**2 + 10.0**2) / 12.0**2)
    assert shown.detected[53, 54] == pytest.approx(1 - np.prod(1 - each))
    perfect = cover(flat, poses, times)
    assert np.array_equal(perfect.detected, (perfect.looks > 0).astype(float))


def test_a_blurred_image_is_not_counted_and_told():
    times = np.arange(0.0, 61.0)
    flat, poses = flat_flight(times)
    sharp = times < 30
    shown = cover(flat, poses, times, sharp=sharp)
    half = cover(flat, poses.take(sharp), times[sharp])
    assert np.array_equal(shown.looks, half.looks)
    # Seen up to 39 m, in blurred images alone from there to 70 m.
    only_blurred = (~shown.seen & (shown.blurred > 0))[:, 45:56]
    assert only_blurred.mean() == pytest.approx(31 / 201)


# -- animals that walk within a fence, and when images show them first

FENCE = check_area([[0, 0], [0, 60], [30, 60], [30, 20], [80, 20], [80, 0]])


def test_walks_stay_inside_and_begin_anywhere():
    ways = walks(FENCE, np.arange(200.0), 300, 0.5, 1.0, np.random.default_rng(1))
    assert ways.shape == (300, 200, 2)
    # Straight lines between steps may cut a concave corner; at whole steps every animal is inside.
    assert contains(FENCE, ways.reshape(-1, 2)).all()
    share = (ways[:, 0, 0] > 30).mean()
    assert share == pytest.approx(1000 / 2800, abs=3 * np.sqrt(0.36 * 0.64 / 300))


def test_first_seen_is_the_first_sharp_image_with_the_nearest_node():
    flat = Terrain(np.zeros((5, 5), np.float32), north=0.0, east=0.0, step=10.0)
    found = Sightings(np.array([0, 1, 1, 2]), np.array([6, 7, 12, 7]), np.zeros(4))
    times = np.array([0.0, 5.0, 9.0])
    there = np.array(
        [[12.0, 22.0], [18.0, 17.0], [40.0, 40.0], [-50.0, 0.0]]
    )  # nodes 7, 12, 24 and off the map
    ways = np.repeat(there[:, None], 3, axis=1)
    sharp = np.array([True, True, True])
    assert np.array_equal(first_seen(found, flat, times, sharp, ways), [5, 5, np.nan, np.nan], equal_nan=True)
    sharp[1] = False
    assert np.array_equal(
        first_seen(found, flat, times, sharp, ways), [9, np.nan, np.nan, np.nan], equal_nan=True
    )
    nothing = Sightings(np.zeros(0, int), np.zeros(0, int), np.zeros(0))
    assert np.isnan(first_seen(nothing, flat, times, sharp, ways)).all()
