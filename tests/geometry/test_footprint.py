"""Outlines of what an image shows of the ground, beside brute force."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.geometry.camera import Camera, in_image
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import Terrain, ground_to_pixel
from wildlab.geometry.viewsheds import footprint

CAMERA = Camera(160, 128, 250.0, 220.0, 83.0, 60.0, 0.4, (0.1, 0.0, 0.0, 0.0, 0.0))


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
