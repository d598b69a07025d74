"""Line of sight as F has it, beside slow twins in numpy, hand-made ground, and the exact walk."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.geometry.camera import Camera, in_image, project
from wildlab.geometry.frames import R_CAMERA, camera_rotation, euler_to_matrix
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import cast_rays, compare_angles, field_of_view, in_field_of_view

CAMERA = Camera(640, 512, 1000.0, 900.0, 320.0, 256.0)


def all_nodes(terrain: Terrain) -> np.ndarray:
    return np.argwhere(np.ones(terrain.height.shape, bool))


def points_of(terrain: Terrain, nodes: np.ndarray) -> np.ndarray:
    """Nodes as points in n."""
    rows, columns = nodes.T
    north, east = terrain.north + rows * terrain.step, terrain.east + columns * terrain.step
    return np.column_stack([north, east, -terrain.height[rows, columns].astype(float)])


def cast_slowly(terrain, nodes, p_nc, step, tolerance, top):
    """F algorithm 1 in its own words, one ray after the other."""
    clear, steps = [], []
    for poi in points_of(terrain, nodes):
        way = poi - p_nc
        length = np.linalg.norm(way)
        ray = way / length
        begin = max(0.0, (-top - p_nc[2]) / ray[2]) if ray[2] > 0 else 0.0
        count = 0
        while True:
            at = p_nc + (begin + count * step) * ray
            ground = terrain.heights_at(at[None, :2])[0]
            outside = np.isnan(ground)
            if (outside and begin + count * step >= length) or -at[2] <= ground:
                break
            count += 1
        clear.append(np.linalg.norm(at - poi) <= tolerance)
        steps.append(count)
    return np.array(clear), np.array(steps)


def depression(terrain, node, p_nc):
    """F (2.24), radians."""
    point = points_of(terrain, np.atleast_2d(node))[0]
    return np.arctan2(point[2] - p_nc[2], np.hypot(*(point - p_nc)[:2]))


def compare_slowly(terrain, nodes, p_nc):
    """The prose of F's extended Bresenham, in its sense."""
    clear = []
    for node in nodes:
        towards = (p_nc[:2] - [terrain.north, terrain.east]) / terrain.step - node
        longer = np.abs(towards).max()
        seen = True
        if longer > 0:
            for k in range(1, int(np.ceil(longer))):
                between = np.floor(node + k * towards / longer + 0.5).astype(int)
                inside = (between >= 0).all() and (between < terrain.height.shape).all()
                if inside and depression(terrain, between, p_nc) <= depression(terrain, node, p_nc):
                    seen = False
        clear.append(seen)
    return np.array(clear)


@st.composite
def scenes(draw):
    """A rough terrain, and a camera above it or beside it."""
    shape = draw(st.tuples(st.integers(2, 11), st.integers(2, 11)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    step = float(rng.choice([0.5, 2.0, 10.0]))
    height = rng.normal(0, draw(st.sampled_from([0.3, 2.0, 9.0])), shape).astype(np.float32)
    terrain = Terrain(height, *rng.normal(0, 50, 2), step=step)
    north, far_north, east, far_east = terrain.extent
    at = [rng.uniform(north - step, far_north + step), rng.uniform(east - step, far_east + step)]
    return terrain, np.array([*at, -float(height.max() + rng.uniform(0.5, 25.0))])


@settings(max_examples=5)
@given(scenes())
def test_rays_in_steps_are_those_of_the_slow_twin(scene):
    terrain, p_nc = scene
    nodes = all_nodes(terrain)
    step, tolerance = 0.37 * terrain.step, 0.9 * terrain.step
    for shorten, top in ((True, float(terrain.height.max())), (False, np.inf)):
        found = cast_rays(terrain, nodes, p_nc, step, tolerance, shorten=shorten)
        clear, steps = cast_slowly(terrain, nodes, p_nc, step, tolerance, min(top, -p_nc[2]))
        # To the highest node a shortened ray begins at that itself, above it or below by rounding.
        but_one = terrain.height.ravel() < (terrain.height.max() if shorten else np.inf)
        np.testing.assert_array_equal(found.clear[but_one], clear[but_one])
        np.testing.assert_array_equal(found.steps[but_one], steps[but_one])


@settings(max_examples=50)
@given(scenes())
def test_angles_are_those_of_the_slow_twin(scene):
    terrain, p_nc = scene
    nodes = all_nodes(terrain)
    np.testing.assert_array_equal(
        compare_angles(terrain, nodes, p_nc).clear, compare_slowly(terrain, nodes, p_nc)
    )


def test_without_absolute_values_a_line_to_the_other_side_leaves_its_wall_out():
    """The camera west of the point: dx < 0 < dy, so the line is scaled to the shorter side."""
    height = np.zeros((12, 40), np.float32)
    height[:, 22] = 30.0
    terrain = Terrain(height, 0.0, 0.0, 1.0)
    west, east = np.array([8.0, 3.0, -40.0]), np.array([8.0, 36.0, -40.0])
    assert not compare_angles(terrain, [[4, 36]], west).clear[0]
    assert compare_angles(terrain, [[4, 36]], west, signed=True).clear[0]
    # From the east dx > dy, which is the longer side in the sense, too.
    assert not compare_angles(terrain, [[4, 3]], east, signed=True).clear[0]
    assert compare_angles(terrain, [[8, 36]], west, signed=True).steps[0] == -1  # dy is zero: no direction
    assert compare_angles(terrain, [[8, 36]], west).steps[0] > 0


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_the_field_of_view_is_the_image_of_a_centred_camera(seed):
    rng = np.random.default_rng(seed)
    R_nc = euler_to_matrix(*rng.uniform(-3, 3, 3))
    p_nc = rng.normal(0, 10, 3)
    points = p_nc + rng.normal(0, 20, (200, 3))
    uv = project(CAMERA, (points - p_nc) @ R_nc)
    # The image as (2.23) has it reaches from 0 to its width, both ends included.
    edge = np.nanmin(np.abs(np.concatenate([uv, uv - [640, 512]], axis=1)), axis=1, initial=np.inf)
    clearly = ~(edge < 1.0)
    found = in_field_of_view(field_of_view(CAMERA), points, p_nc, R_nc)
    np.testing.assert_array_equal(found[clearly], in_image(CAMERA, uv)[clearly])


def test_the_field_of_view_in_the_axes_of_f():
    """(2.22) as printed, in F's camera frame, of points before the camera."""
    rng = np.random.default_rng(5)
    angles = (np.radians(16), np.radians(13))
    roll, pitch, yaw = 0.1, -0.9, 2.0
    points = rng.normal(0, 10, (500, 3))
    in_f = points @ euler_to_matrix(roll, pitch, yaw)
    u, v = in_f[:, 1] / in_f[:, 0], in_f[:, 2] / in_f[:, 0]
    area = (np.abs(np.arctan(u)) <= angles[0]) & (np.abs(np.arctan(v)) <= angles[1])
    found = in_field_of_view(np.tan(angles), points, np.zeros(3), camera_rotation(roll, pitch, yaw))
    ahead = in_f[:, 0] > 0
    np.testing.assert_array_equal(found, area & ahead)
    assert (area & ~ahead).any()  # the print takes some that lie behind
    np.testing.assert_allclose(R_CAMERA @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
