"""Pixel to ground and back, over random poses; the printed homography; the horizon."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, camera_pose, camera_rotation
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane
from wildlab.studies.sensitivity import TAU2

WIDE = Camera(640, 512, 500.0, 505.0, 322.0, 250.0, 1.5, (-0.2, 0.05, 0.001, -0.002, 0.0))
pixels = st.tuples(st.floats(0, 640), st.floats(0, 512))
poses = st.tuples(
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-np.pi, np.pi),
    st.floats(10, 500),
    st.floats(-1e3, 1e3),
)
mounts = st.builds(
    Mount,
    looks=st.just("down"),
    pan=st.floats(-3, 3),
    tilt=st.floats(-0.3, 0.3),
    misalignment=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    lever_arm=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)


def round_trip(camera, mount, pose, pixel):
    roll, pitch, yaw, height, north = pose
    p_nc, R_nc = camera_pose(
        mount, np.array([[north, 2.0, -height]]), euler_to_matrix([roll], [pitch], [yaw])
    )
    uv = np.array([pixel])
    ground = pixel_to_plane(camera, uv, p_nc, R_nc, 0.0)
    assume(np.isfinite(ground).all() and np.linalg.norm(ground - p_nc) < 100 * height)
    assert ground[0, 2] == 0.0
    return np.abs(ground_to_pixel(camera, ground, p_nc, R_nc) - uv).max()


@given(pixels, poses, mounts)
def test_round_trip_without_distortion(pixel, pose, mount):
    assert round_trip(TAU2, mount, pose, pixel) <= 1e-9


@given(pixels, poses, mounts)
def test_round_trip_with_distortion(pixel, pose, mount):
    assert round_trip(WIDE, mount, pose, pixel) <= 1e-6


@given(pixels, poses, mounts)
def test_cutting_the_plane_is_the_printed_homography(pixel, pose, mount):
    """H (5.13)-(5.14) as printed, with the plane through the origin."""
    roll, pitch, yaw, height, north = pose
    p_nc, R_nc = camera_pose(mount, np.array([north, 2.0, -height]), euler_to_matrix(roll, pitch, yaw))
    R_cn = R_nc.T
    G = np.column_stack([R_cn[:, 0], R_cn[:, 1], -R_cn @ p_nc])
    homogeneous = np.linalg.solve(G, np.linalg.solve(TAU2.matrix, [*pixel, 1.0]))
    ours = pixel_to_plane(TAU2, np.array([pixel]), p_nc[None], R_nc[None], 0.0)[0]
    assume(np.isfinite(ours).all() and np.linalg.norm(ours - p_nc) < 100 * height)
    assert np.allclose(homogeneous[:2] / homogeneous[2], ours[:2], rtol=1e-8, atol=1e-6)


def test_at_and_above_the_horizon_is_nan():
    mount = Mount("forward")
    centre = np.array([[TAU2.cx, TAU2.cy]])
    for pitch, seen in ((-0.1, True), (0.0, False), (0.1, False)):
        pose = camera_pose(mount, np.array([[0.0, 0, -50]]), euler_to_matrix([0.0], [pitch], [0.0]))
        assert np.isfinite(pixel_to_plane(TAU2, centre, *pose, 0.0)).all() == seen


def test_a_camera_straight_down_has_the_top_of_its_image_forward():
    """H (5.12): level flight to the north, image up is north, image right is east."""
    pose = camera_pose(Mount("down"), np.array([[0.0, 0, -100]]), np.eye(3)[None])
    north, east, _ = pixel_to_plane(TAU2, np.array([[TAU2.cx + 10, TAU2.cy - 20]]), *pose, 0.0)[0]
    assert np.isclose(north, 20 / TAU2.fy * 100)
    assert np.isclose(east, 10 / TAU2.fx * 100)


def test_pan_and_tilt_follow_the_printed_gimbal_matrix():
    """H (5.11) and (5.12), written out."""
    pan, tilt = 0.4, -0.3
    cp, sp, ct, s = np.cos(pan), np.sin(pan), np.cos(tilt), np.sin(tilt)
    R_mb = np.array([[cp * ct, sp * ct, -s], [-sp, cp, 0], [cp * s, sp * s, ct]])
    R_cm = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert np.allclose(camera_rotation(Mount("down", pan, tilt)), (R_cm @ R_mb).T)
    moving = camera_rotation(Mount("down"), np.array([pan, 0.0]), np.array([tilt, 0.0]))
    assert np.allclose(moving[0], (R_cm @ R_mb).T)
    assert np.allclose(moving[1], R_cm.T)


def test_a_camera_below_the_plane_sees_nothing_of_it():
    pose = camera_pose(Mount("down"), np.array([[0.0, 0, 5]]), np.eye(3)[None])
    assert np.isnan(pixel_to_plane(TAU2, np.array([[320.0, 256.0]]), *pose, 0.0)).all()
