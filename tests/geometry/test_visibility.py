"""Lines of sight over a terrain, beside the walk of rays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.georeference import Terrain, intersect_terrain
from wildlab.geometry.rays import MISSED
from wildlab.geometry.viewsheds import SHORT_OF, lines_clear

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
