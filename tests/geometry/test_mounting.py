"""The mounting calibration: exact without errors, and its refusals."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.calibration import mounting_from_points
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount, helgesen_misalignment
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
TURNED = Mount("down", misalignment=helgesen_misalignment(*np.radians([-1.7, 3.9, 1.9])))
POINTS = np.array([[x, y, 0.0] for x in (-0.2, 0.0, 0.2) for y in (-0.2, 0.0, 0.2)])


def room(points, poses=3):
    """Pixels of points from so many poses, with the airframe's poses told as they are."""
    rng = np.random.default_rng(1)
    image = np.repeat(np.arange(poses), len(points))
    R = euler_to_matrix(*rng.uniform(-0.1, 0.1, (3, poses)))[image]
    p = np.column_stack([rng.uniform(-0.1, 0.1, (poses, 2)), np.full(poses, -1.2)])[image]
    known = np.tile(points, (poses, 1))
    true = CameraPoses(CAMERA, TURNED, p, R)
    uv = ground_to_pixel(CAMERA, known, true.p_nc, true.R_nc)
    return CameraPoses(CAMERA, Mount("down"), p, R), uv, known, image


def test_the_printed_angles_come_back():
    found = mounting_from_points(*room(POINTS))
    np.testing.assert_allclose(found.mount.misalignment, TURNED.misalignment, atol=1e-8)
    assert found.error < 1e-8 and 1.2 < found.range < 1.25


def test_what_is_left_grows_with_the_range():
    poses, uv, known, image = room(POINTS)
    uv = uv + np.random.default_rng(2).normal(0, 3, uv.shape)
    found = mounting_from_points(poses, uv, known, image)
    # A pixel is 1.2 m / 1163 px on the ground; the mean of a Rayleigh distribution is sqrt(pi / 2) of its SD.
    assert found.error == pytest.approx(3 * 1.2 / 1163 * np.sqrt(np.pi / 2), rel=0.25)
    low, high = found.calibration.interval("tilt")
    assert low < TURNED.misalignment[1] < high


def test_angles_that_cannot_be_told_apart_are_named():
    # Three points in one place do not tell how the camera is turned about its own axis.
    near = np.array([[0.0, 0.0, 0.0]] * 3) + 1e-9 * np.arange(9).reshape(3, 3) * [1, 1, 0]
    poses, uv, known, image = room(near, poses=1)
    with pytest.raises(WildlabError, match="told apart"):
        mounting_from_points(poses, uv + np.random.default_rng(3).normal(0, 0.5, uv.shape), known, image)
