"""The camera and its poses in one: shapes, rows, a second way to make one, and how often it is worked out."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import georeference_pixels

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
MOUNT = Mount("down", tilt=0.1, misalignment=(0.03, -0.05, 0.02), lever_arm=(0.4, -0.1, 0.2))
N = 4


def fields(n=N, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, 6, 6))
    return {
        "p_nb": rng.uniform([-50, -50, -300], [50, 50, -60], (n, 3)),
        "R_nb": euler_to_matrix(*rng.uniform([-0.3, -0.3, -3], [0.3, 0.3, 3], (n, 3)).T),
        "pan": rng.uniform(-1, 1, n),
        "tilt": rng.uniform(-0.3, 0.3, n),
        "covariance": A @ np.swapaxes(A, 1, 2),
    }


def poses_of(**changes):
    return CameraPoses(CAMERA, MOUNT, **(fields() | changes))


def same(a, b):
    """Field by field and bit by bit."""
    for name in ("p_nb", "R_nb", "pan", "tilt", "covariance", "p_nc", "R_nc", "R_bc"):
        ours, theirs = getattr(a, name), getattr(b, name)
        assert (ours is None and theirs is None) or np.array_equal(ours, theirs), name


def test_the_camera_sits_where_the_mount_has_it():
    """H (5.8), (5.9): the lens by its lever arm from the airframe, turned by pan, tilt and misalignment."""
    poses, given = poses_of(), fields()
    for k in range(N):
        R_nb = given["R_nb"][k]
        base = Rotation.from_euler("ZYX", MOUNT.misalignment[::-1]).as_matrix()
        gimbal = Rotation.from_euler("ZY", [given["pan"][k], given["tilt"][k]]).as_matrix()
        right, back, down = base @ gimbal @ [0, 1, 0], base @ gimbal @ [-1, 0, 0], base @ gimbal @ [0, 0, 1]
        assert np.allclose(poses.R_bc[k], np.column_stack([right, back, down]))
        assert np.allclose(poses.R_nc[k], R_nb @ np.column_stack([right, back, down]))
        assert np.allclose(poses.p_nc[k], given["p_nb"][k] + R_nb @ MOUNT.lever_arm)
        assert np.allclose(poses.R_bm[k] @ poses.R_mc, poses.R_bc[k])


@pytest.mark.parametrize("rows", [2, slice(1, 3), np.array([3, 0]), np.array([True, False, True, False])])
def test_some_rows_are_the_poses_of_these_rows_alone(rows):
    given = {name: values[rows] for name, values in fields().items()}
    same(poses_of().take(rows), CameraPoses(CAMERA, MOUNT, **given))
    fixed = {name: values for name, values in fields().items() if name in ("p_nb", "R_nb")}
    one = CameraPoses(CAMERA, MOUNT, **fixed).take(rows)
    same(one, CameraPoses(CAMERA, MOUNT, given["p_nb"], given["R_nb"]))
    assert one.R_bc.shape == (3, 3)


def test_one_pose_stands_for_all_rows():
    one = CameraPoses(CAMERA, MOUNT, np.array([0.0, 0.0, -100.0]), np.eye(3))
    uv = np.array([[100.0, 200.0], [300.0, 400.0], [313.0, 265.0]])
    many = CameraPoses(CAMERA, MOUNT, np.tile([0.0, 0.0, -100.0], (3, 1)), np.tile(np.eye(3), (3, 1, 1)))
    assert one.take(7) is one
    assert np.allclose(georeference_pixels(one, uv, 0.0), georeference_pixels(many, uv, 0.0), rtol=1e-14)
    beside = CameraPoses(CAMERA, MOUNT, np.array([0.0, 0.0, -100.0]), np.tile(np.eye(3), (3, 1, 1)))
    same(beside, many)


def test_a_pose_of_the_lens_itself():
    """Given poses are kept to the last bit, and the airframe stands where the mount would have it."""
    given = {name: fields()[name] for name in ("p_nb", "R_nb", "covariance")}
    mounted = CameraPoses(CAMERA, MOUNT, **given)
    free = CameraPoses.at_lens(
        CAMERA, mounted.p_nc, mounted.R_nc, mounted.R_bc, MOUNT.lever_arm, mounted.covariance
    )
    for name in ("p_nc", "R_nc", "R_bc", "covariance"):
        assert np.array_equal(getattr(free, name), getattr(mounted, name)), name
    assert np.allclose(free.p_nb, mounted.p_nb, rtol=0, atol=1e-12)
    assert np.allclose(free.R_nb, mounted.R_nb, rtol=0, atol=1e-14)
    again = camera_pose(free.mount, free.p_nb, free.R_nb)
    assert np.allclose(again[0], free.p_nc, rtol=0, atol=1e-12)
    assert np.allclose(again[1], free.R_nc, rtol=0, atol=1e-14)
    same(free.take(1).take(0), free.take(1))
    assert np.array_equal(free.take(1).p_nc, mounted.p_nc[1])
