"""What a camera sees of a terrain, beside lines followed in small steps and beside the whole map."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, in_image
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import MISSED, ground_to_pixel
from wildlab.geometry.mount import Mount
from wildlab.geometry.terrain import Terrain, intersect_terrain
from wildlab.geometry.viewsheds import SHORT_OF, lines_clear, visible_nodes

CAMERA = Camera(160, 128, 250.0, 250.0, 80.0, 64.0)


def rough(seed, cells=24, high=6.0):
    rng = np.random.default_rng(seed)
    return Terrain(rng.uniform(0, high, (cells, cells)).astype(np.float32), -23.0, -31.0, 2.0)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.4, 3.0, 30.0]), st.booleans())
def test_a_line_is_clear_where_the_walk_from_the_camera_meets_nothing(seed, high, one):
    """The walk of rays goes the other way, works out crossings, and does not know what hid lines before."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(2, 40, 2)
    height = np.round(rng.uniform(0, high, shape), rng.integers(0, 5)).astype(np.float32)
    height[rng.random(shape) < rng.choice([0.0, 0.02])] = np.nan
    if np.isnan(height).all():
        height[0, 0] = 1.0
    terrain = Terrain(height, *rng.normal(0, 20, 2), step=float(rng.choice([0.5, 2.0])))
    least, most, west, east = terrain.extent
    count, beyond = 60, terrain.step * rng.choice([0, 3])
    corners = [least - beyond, west - beyond], [most + beyond, east + beyond]
    # Some points on nodes, some on the ground between them, some above and below it.
    points = np.column_stack([rng.uniform(*corners, (count, 2)), -rng.uniform(-1, 2 * high, count)])
    points[:20, :2] = np.round((points[:20, :2] - corners[0]) / terrain.step) * terrain.step + corners[0]
    ground = terrain.heights_at(points[:40, :2])
    points[:40, 2] = np.where(np.isnan(ground), points[:40, 2], -ground)
    lens = np.column_stack([rng.uniform(*corners, (count, 2)), -rng.uniform(0, 3 * high, count)])
    # Straight above or below; not at a node, where the walk begins in a patch that the line may not cross.
    lens[21::7, :2] = points[21::7, :2]
    lens = lens[0] if one else lens
    met = intersect_terrain(terrain, points - lens, lens, furthest=1 - SHORT_OF)
    np.testing.assert_array_equal(lines_clear(terrain, points, lens), met.became == MISSED)


def test_no_line_leads_to_what_is_not_known():
    terrain = rough(1)
    points = np.array([[0.0, 0.0, -50.0], [np.nan, 0.0, -50.0], [0.0, 0.0, -50.0]])
    lenses = [[0.0, 5.0, -60.0], [0.0, 5.0, -60.0], [np.nan, 0.0, 0.0]]
    assert lines_clear(terrain, points, lenses).tolist() == [True, False, False]
    with pytest.raises(WildlabError, match="one camera for each point"):
        lines_clear(terrain, points, np.zeros((2, 3)))


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6), st.floats(-0.6, 0.6), st.floats(-0.9, 1.3), st.floats(-3.1, 3.1),
    st.sampled_from([0.0, 1.5]), st.sampled_from([15.0, 60.0, np.inf]),
)  # fmt: skip
def test_the_block_leaves_nothing_out(seed, roll, pitch, yaw, above, furthest):
    terrain = rough(seed)
    p = np.array([3.0, -5.0, -20.0])
    pose = CameraPoses(CAMERA, Mount("down"), p, euler_to_matrix(roll, pitch, yaw))
    seen = visible_nodes(terrain, pose, above, furthest)
    whole = np.zeros(terrain.height.shape, bool)
    whole[seen.rows, seen.columns] = seen.visible
    north, east = (at + terrain.step * np.arange(24) for at in (terrain.north, terrain.east))
    points = np.stack([*np.meshgrid(north, east, indexing="ij"), -terrain.height - above], axis=-1)
    points = points.reshape(-1, 3).astype(float)
    uv = ground_to_pixel(CAMERA, points, pose.p_nc, pose.R_nc)
    expected = in_image(CAMERA, uv) & lines_clear(terrain, points, p)
    expected &= np.linalg.norm(points - p, axis=1) <= furthest
    assert np.array_equal(whole.ravel(), expected)


def test_a_lens_that_folds_back_shows_nothing_behind_its_edge():
    folds = Camera(160, 128, 100.0, 100.0, 80.0, 64.0, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    flat = Terrain(np.zeros((201, 201), np.float32), -400.0, -400.0, 4.0)
    pose = CameraPoses(folds, Mount("down"), np.array([0.0, 0.0, -40.0]), np.eye(3))
    seen = visible_nodes(flat, pose)
    at = np.argwhere(seen.visible) + np.array([seen.rows.start, seen.columns.start])
    assert len(at) > 100 and np.hypot(*(at * 4.0 - 400.0).T).max() < 60
    behind = ground_to_pixel(folds, [[80.0, 0.0, 0.0]], pose.p_nc, pose.R_nc)
    assert in_image(folds, behind).all(), "the polynomial alone would show it"
