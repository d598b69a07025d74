"""Rays over terrain, beside a slow walk over every patch, planes, and finite differences."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import Terrain, ground_to_pixel, intersect_terrain, pixels_to_terrain
from wildlab.geometry.rays import BELOW, HIT, MISSED, NO_DATA, NOT_KNOWN

CAMERA = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)


def slow_crossing(terrain: Terrain, start: np.ndarray, ray: np.ndarray) -> float:
    """First crossing, patch by patch between all lines of the grid, by a root finder; NaN for none."""
    rows, columns = terrain.height.shape
    x, y = (start[1] - terrain.east) / terrain.step, (start[0] - terrain.north) / terrain.step
    dx, dy = ray[1] / terrain.step, ray[0] / terrain.step
    cuts = [0.0]
    for at, along, count in ((x, dx, columns), (y, dy, rows)):
        if along:
            crossed = (np.arange(count) - at) / along
            cuts += crossed[crossed > 0].tolist()
    cuts = sorted(cuts)
    h = terrain.height.astype(float)

    def above(t: float, i: int, j: int) -> float:
        u, v = x + t * dx - j, y + t * dy - i
        low, high = h[i, j] * (1 - u) + h[i, j + 1] * u, h[i + 1, j] * (1 - u) + h[i + 1, j + 1] * u
        return float(-start[2] - t * ray[2] - (low * (1 - v) + high * v))

    for first, last in pairwise(cuts):
        middle = (first + last) / 2
        j, i = int(np.floor(x + middle * dx)), int(np.floor(y + middle * dy))
        if not (0 <= i < rows - 1 and 0 <= j < columns - 1):
            continue
        values = [above(t, i, j) for t in (first, middle, last)]
        if values[0] <= 0:
            return first
        roots = np.roots(np.polyfit([0.0, 0.5, 1.0], values, 2))
        real = roots[np.isreal(roots)].real
        inside = real[(real >= 0) & (real <= 1)]
        if len(inside):
            return float(first + inside.min() * (last - first))
    return float("nan")


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_rays_meet_the_patch_that_a_slow_walk_finds(data):
    shape = data.draw(st.tuples(st.integers(2, 19), st.integers(2, 19)))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    rough = data.draw(st.sampled_from([0.5, 5.0, 40.0]))
    terrain = Terrain(
        rng.normal(0, rough, shape).astype(np.float32),
        *rng.normal(0, 50, 2),
        step=float(rng.choice([0.5, 2, 10])),
    )
    north, far_north, east, far_east = terrain.extent
    count = 12
    starts = np.column_stack(
        [
            rng.uniform(north, far_north, count),
            rng.uniform(east, far_east, count),
            -(terrain.height.max() + rng.uniform(0.1, 30, count)),
        ]
    )
    rays = np.column_stack(
        [rng.normal(size=(count, 2)) * rng.choice([0.05, 1.0]), rng.uniform(-0.1, 1.5, count)]
    )
    met = intersect_terrain(terrain, rays, starts)
    for start, ray, point in zip(starts, rays, met.points, strict=True):
        expected = start + slow_crossing(terrain, start, ray) * ray
        np.testing.assert_allclose(point, expected, atol=1e-6 * max(1.0, rough))


@given(arrays(float, 2, elements=st.floats(-0.3, 0.3)), st.floats(-0.6, 0.6), st.floats(-3, 3))
@settings(deadline=None)
def test_a_tilted_plane_is_met_where_algebra_says(slope, pitch, yaw):
    north, east = np.meshgrid(np.arange(-400.0, 401, 10), np.arange(-400.0, 401, 10), indexing="ij")
    plane = Terrain((slope[0] * north + slope[1] * east).astype(np.float32), -400.0, -400.0, 10.0)
    poses = CameraPoses(CAMERA, Mount("down"), np.array([0.0, 0.0, -100.0]), euler_to_matrix(0.1, pitch, yaw))
    uv = np.array([[320.0, 256.0], [10.0, 500.0], [630.0, 20.0]])
    met = pixels_to_terrain(poses, uv, plane)
    good = met.became == HIT
    # up = slope . (north, east) on the surface, so (slope, 1) is at right angles to it in north, east, down.
    np.testing.assert_allclose(met.points[good] @ [slope[0], slope[1], 1.0], 0.0, atol=1e-3)
    back = ground_to_pixel(CAMERA, met.points[good], poses.p_nc, poses.R_nc)
    np.testing.assert_allclose(back, uv[good], atol=1e-6)


def test_what_becomes_of_rays_is_counted():
    height = np.zeros((9, 9), np.float32)
    height[0, 0], height[4, 4] = 30.0, np.nan
    terrain = Terrain(height, 0.0, 0.0, 10.0)
    rays = [[0, 0, 1], [0, 0, 1], [1, 0, -0.1], [0, 0, 1], [np.nan, 0, 1], [0, 0, 1]]
    starts = [[60, 60, -50], [45, 45, -50], [60, 60, -50], [60, 60, 5], [0, 0, -50], [-5, 20, -50]]
    met = intersect_terrain(terrain, rays, starts)
    assert met.became.tolist() == [HIT, NO_DATA, MISSED, BELOW, NOT_KNOWN, MISSED]
    np.testing.assert_array_equal(np.isnan(met.points[:, 0]), [False, True, True, True, True, True])
    counts = met.counts()
    assert sum(counts.values()) == 6 and counts["left the map without meeting the ground"] == 2


def test_a_ray_passes_over_a_hole_that_nothing_known_reaches():
    height = np.zeros((9, 9), np.float32)
    height[4, 4] = np.nan
    terrain = Terrain(height, 0.0, 0.0, 10.0)
    over = intersect_terrain(terrain, [[0.0, 1.0, 0.02]], [40.0, 0.0, -1.5])
    assert over.became[0] == HIT
    np.testing.assert_allclose(over.points[0], [40.0, 75.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("way", [(0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (1.0, 0.0)])
def test_a_ray_from_a_border_has_nothing_to_do_with_the_cell_behind_it(way):
    """The hole lies behind a start on a border: whichever way it looks, the ground is met before."""
    north, east = way
    height = np.zeros((5, 5), np.float32)
    height[[0, 0, 4, 4], [0, 4, 0, 4]] = 5.0  # there is higher ground: over a hole nothing is known
    start = np.array([2.0 + 0.4 * abs(east), 2.0 + 0.4 * abs(north), -0.5])
    if north:
        height[int(2 - 2 * north)] = np.nan
        height[int(2 - north)] = np.nan
    else:
        height[:, int(2 - 2 * east)] = np.nan
        height[:, int(2 - east)] = np.nan
    met = intersect_terrain(Terrain(height, 0.0, 0.0, 1.0), [[north, east, 0.5]], start)
    assert met.became.tolist() == [HIT]
    assert met.points[0] == pytest.approx([start[0] + north, start[1] + east, 0.0])


def test_heights_and_slopes_are_those_of_the_surface():
    rng = np.random.default_rng(5)
    terrain = Terrain(rng.normal(0, 5, (8, 11)).astype(np.float32), 3.0, -4.0, 2.5)
    north, far_north, east, far_east = terrain.extent
    assert (far_north, far_east) == (3.0 + 7 * 2.5, -4.0 + 10 * 2.5)
    at = np.column_stack([rng.uniform(north, far_north, 60), rng.uniform(east, far_east, 60)])
    inside = (at - [north, east]) / 2.5 % 1
    at = at[((inside > 0.01) & (inside < 0.99)).all(axis=1)]  # not across an edge of patches
    tiny = 1e-5
    for axis in (0, 1):
        off = np.eye(2)[axis] * tiny
        finite = (terrain.heights_at(at + off) - terrain.heights_at(at - off)) / (2 * tiny)
        np.testing.assert_allclose(terrain.slopes_at(at)[:, axis], finite, atol=1e-6)
    np.testing.assert_allclose(terrain.heights_at([[3.0 + 2.5, -4.0 + 5.0]]), terrain.height[1, 2])
    assert np.isnan(terrain.heights_at([[2.9, 0.0], [5.0, 21.1]])).all()
    met = intersect_terrain(
        terrain, np.tile([0.0, 0.0, 1.0], (len(at), 1)), np.c_[at, np.full(len(at), -99.0)]
    )
    np.testing.assert_allclose(-met.points[:, 2], terrain.heights_at(at), atol=1e-9)


@pytest.mark.parametrize("slope", [(0.2, 0.0), (0.0, -0.2), (0.1, 0.1)])
@pytest.mark.parametrize("along", [(-1e-99, -0.0998), (-0.0998, -1e-99), (-1e-99, 0.0998)])
def test_a_ray_on_a_border_that_hardly_leaves_it_arrives(slope, along):
    """In rounded numbers it never leaves: only the cell that was entered says where it is."""
    north, east = np.meshgrid(np.arange(-400.0, 401, 10), np.arange(-400.0, 401, 10), indexing="ij")
    plane = Terrain((slope[0] * north + slope[1] * east).astype(np.float32), -400.0, -400.0, 10.0)
    met = intersect_terrain(plane, [[*along, 0.995]], [0.0, 0.0, -100.0])
    assert met.became[0] == HIT
    t = 100 / (0.995 + np.dot(slope, along))
    np.testing.assert_allclose(met.points[0], [t * along[0], t * along[1], 0.995 * t - 100], atol=1e-4)
