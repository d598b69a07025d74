"""What a flight has seen, what hides a point, pixels on slopes, outlines: beside brute force and algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, in_image
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import HIT, ground_to_pixel
from wildlab.geometry.mount import Mount
from wildlab.geometry.terrain import Terrain, pixels_to_terrain
from wildlab.geometry.viewsheds import footprint, ground_per_pixel, hidden_by, lines_clear, viewshed

CAMERA = Camera(160, 128, 250.0, 220.0, 83.0, 60.0, 0.4, (0.1, 0.0, 0.0, 0.0, 0.0))


def rough(seed, cells=24, high=6.0):
    rng = np.random.default_rng(seed)
    return Terrain(rng.uniform(0, high, (cells, cells)).astype(np.float32), -23.0, -31.0, 2.0)


def test_counts_are_the_sum_over_images():
    terrain, rng = rough(7), np.random.default_rng(7)
    count = 6
    where = np.column_stack([rng.uniform(-20, 20, (count, 2)), rng.uniform(-30, -12, count)])
    where[4] = np.nan
    R_nb = euler_to_matrix(rng.normal(0, 0.3, count), rng.normal(0, 0.5, count), rng.uniform(-3, 3, count))
    poses = CameraPoses(CAMERA, Mount("down"), where, R_nb)
    found = viewshed(terrain, poses, above=0.5, furthest=40.0)
    nodes = np.argwhere(np.ones(terrain.height.shape, bool))
    points = np.column_stack([nodes * 2.0 + [-23.0, -31.0], -terrain.height.ravel() - 0.5])
    expected = np.zeros(len(points), int)
    for row in (0, 1, 2, 3, 5):
        p, R = poses.p_nc[row], poses.R_nc[row]
        near = np.linalg.norm(points - p, axis=1) <= 40.0
        expected += (
            near & in_image(CAMERA, ground_to_pixel(CAMERA, points, p, R)) & lines_clear(terrain, points, p)
        )
    np.testing.assert_array_equal(found.counts.ravel(), expected)
    assert 0 < found.share < 1 and found.share == pytest.approx((expected > 0).mean())


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_what_hides_a_point_lies_on_the_ground_and_on_the_line(seed):
    terrain, rng = rough(seed), np.random.default_rng(seed)
    where = rng.uniform(-20, 10, (30, 2))
    points = np.column_stack([where, -terrain.heights_at(where)])
    lens = np.array([*rng.uniform(-20, 10, 2), -9.0])
    found = hidden_by(terrain, points, lens)
    np.testing.assert_array_equal(found.clear, np.isnan(found.by[:, 0]))
    by, of = found.by[~found.clear], points[~found.clear]
    np.testing.assert_allclose(-by[:, 2], terrain.heights_at(by[:, :2]), atol=1e-6)
    np.testing.assert_allclose(np.cross(by - lens, of - lens), 0, atol=1e-6)
    assert (np.linalg.norm(by - lens, axis=1) < np.linalg.norm(of - lens, axis=1)).all()


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(-0.5, 0.5), st.floats(-0.9, 0.9))
def test_a_pixel_is_as_large_as_its_neighbours_are_apart(seed, roll, pitch):
    """On planes of any slope, and on rough ground, by finite differences of exact rays."""
    rng = np.random.default_rng(seed)
    n, e = np.meshgrid(np.arange(-600.0, 601, 20), np.arange(-600.0, 601, 20), indexing="ij")
    slope = rng.uniform(-0.3, 0.3, 2)
    plane = Terrain((slope[0] * n + slope[1] * e).astype(np.float32), -600.0, -600.0, 20.0)
    for terrain, height in ((plane, 60.0), (rough(seed), 20.0)):
        poses = CameraPoses(
            CAMERA, Mount("down"), np.array([0.0, 0.0, -height]), euler_to_matrix(roll, pitch, 1)
        )
        uv = rng.uniform(10, 110, (20, 2))
        sizes = ground_per_pixel(poses, uv, terrain)
        met = pixels_to_terrain(poses, uv, terrain)
        assert np.isfinite(sizes).all(axis=1).tolist() == (met.became == HIT).tolist()
        cells = np.floor((met.points[:, :2] - [terrain.north, terrain.east]) / terrain.step)
        for axis in (0, 1):
            tiny = 1e-5 * np.eye(2)[axis]
            ends = [pixels_to_terrain(poses, uv + sign * tiny, terrain).points for sign in (-1, 1)]
            same = (met.became == HIT) & np.isfinite(ends).all(axis=(0, 2))
            # Within one patch, and not across a crest: elsewhere there is no derivative.
            for end in ends:
                moved = np.linalg.norm(end - met.points, axis=1)
                same &= (np.floor((end[:, :2] - [terrain.north, terrain.east]) / terrain.step) == cells).all(
                    axis=1
                )
                same &= moved < 1e-3
            finite = np.linalg.norm(ends[1] - ends[0], axis=1) / 2e-5
            np.testing.assert_allclose(sizes[same, axis], finite[same], rtol=1e-3)


def inside(polygon, points):
    """(N,) bool, by the number of sides east of a point."""
    found = np.zeros(len(points), bool)
    for (n0, e0), (n1, e1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = e0 + (points[:, 0] - n0) / (n1 - n0) * (e1 - e0)
        found ^= ((n0 > points[:, 0]) != (n1 > points[:, 0])) & (points[:, 1] < crossing)
    return found


@settings(max_examples=40)
@given(st.floats(-0.5, 0.5), st.floats(-0.6, 1.8), st.floats(-3, 3))
def test_the_outline_holds_what_the_image_shows_of_even_ground(roll, pitch, yaw):
    flat = Terrain(np.zeros((3, 3), np.float32), -2000.0, -2000.0, 2000.0)
    furthest = 300.0
    pose = CameraPoses(CAMERA, Mount("down"), np.array([5.0, -7.0, -40.0]), euler_to_matrix(roll, pitch, yaw))
    found = footprint(flat, pose, per_side=40, furthest=furthest)
    if np.isnan(found.points).any():
        assert np.isnan(found.points).all() and not found.cut.any()
        return
    low, high = found.points.min(axis=0), found.points.max(axis=0)
    points = np.random.default_rng(1).uniform(1.1 * low - 0.1 * high, 1.1 * high - 0.1 * low, (4000, 2))
    uv = ground_to_pixel(CAMERA, np.c_[points, np.zeros(4000)], pose.p_nc, pose.R_nc)
    shown = in_image(CAMERA, uv) & (np.hypot(*(points - [5.0, -7.0]).T) <= furthest)
    np.testing.assert_allclose(np.hypot(*(found.points[found.cut] - [5.0, -7.0]).T), furthest)
    # A chord in place of an arc, and borders between rays, may be wrong by a little.
    assert (inside(found.points, points) != shown).sum() < 0.03 * shown.sum() + 20


def test_an_outline_needs_one_pose_and_rays():
    flat = Terrain(np.zeros((3, 3), np.float32), -2000.0, -2000.0, 2000.0)
    two = CameraPoses(CAMERA, Mount("down"), np.zeros((2, 3)), np.eye(3))
    with pytest.raises(WildlabError, match="Give one pose"):
        footprint(flat, two)
    with pytest.raises(WildlabError, match="0 rays"):
        footprint(flat, two.take(0), per_side=0)


def test_one_pose_is_one_image_and_what_is_not_known_is_not_counted():
    height = np.zeros((21, 21), np.float32)
    height[0] = np.nan
    terrain = Terrain(height, -20.0, -20.0, 2.0)
    wide = Camera(400, 400, 50.0, 50.0, 200.0, 200.0)
    seen = viewshed(terrain, CameraPoses(wide, Mount("down"), np.array([0.0, 0.0, -30.0]), np.eye(3)))
    assert seen.known.sum() == 20 * 21 and seen.counts[0].sum() == 0
    assert seen.counts.max() == 1 and seen.share == 1.0
