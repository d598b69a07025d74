"""Poses and targets for the tests of sensors and filters: a camera over a plane, looking roughly down."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wildlab.geometry.camera import Camera, project
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix

CAMERA = Camera(640, 512, 1100.0, 1120.0, 318.0, 250.0)
CROOKED = Camera(640, 512, 1100.0, 1120.0, 318.0, 250.0, 1.5, (-0.2, 0.05, 1e-3, -2e-3, 0.01))
ANGLE = st.floats(-0.4, 0.4)
POSE = st.tuples(
    *(st.floats(-300, 300),) * 2, st.floats(50, 400), ANGLE, ANGLE, st.floats(-np.pi, np.pi),
    st.tuples(ANGLE, ANGLE, ANGLE), st.tuples(*(st.floats(-2, 2),) * 3),
)  # fmt: skip
#: Generators of random numbers, shown by their seed where an example fails.
GENERATORS = st.builds(np.random.default_rng, st.integers(0, 2**31))
#: Where in the image the target is, as a share of it.
PIXEL = st.tuples(st.floats(0.05, 0.95), st.floats(0.05, 0.95))


def posed(pose, camera=CAMERA):
    """`CameraPoses` of one drawn pose."""
    north, east, height, roll, pitch, yaw, misalignment, lever = pose
    p_nb, R_nb = np.array([north, east, -height]), euler_to_matrix(roll, pitch, yaw)
    mount = Mount(misalignment=misalignment, lever_arm=lever)
    return CameraPoses(camera, mount, p_nb, R_nb)


def disturbed(poses, error):
    """The camera's pose with errors dp, da (four times MRP) of the body: q = q_hat * dq."""
    turn = Rotation.from_mrp(np.asarray(error[3:]) / 4).as_matrix()
    return replace(poses, p_nb=poses.p_nb + error[:3], R_nb=poses.R_nb @ turn)


def turned(poses, rows, turn=(1.0, -1.0, -1.0)):
    """The same with the cameras of some rows turned over, to look away from the ground."""
    R_nc = poses.R_nc.copy()
    R_nc[rows] = R_nc[rows] @ np.diag(turn)
    return CameraPoses.at_lens(poses.camera, poses.p_nc, R_nc, poses.R_bc, poses.lever_arm)


def overflight(n=60, seed=0, sd_pixel=2.0, velocity=(1.5, -0.8), period=0.3):
    """Level circling over a slow target at the origin: times, pixels, poses, truth (N, 4)."""
    rng = np.random.default_rng(seed)
    times = period * np.arange(n)
    truth = np.column_stack([np.outer(times, velocity), np.tile(velocity, (n, 1))])
    course = 0.1 * times
    p_nb = np.column_stack([60 * np.sin(course), 60 * np.cos(course), np.full(n, -300.0)])
    attitude = rng.normal(0, 0.03, (n, 2))
    R_nb = euler_to_matrix(attitude[:, 0], attitude[:, 1], course)
    poses = CameraPoses(CAMERA, Mount(), p_nb, R_nb)
    target = np.column_stack([truth[:, :2], np.zeros(n)])
    p_c = np.einsum("nji,nj->ni", poses.R_nc, target - poses.p_nc)
    return times, project(CAMERA, p_c) + rng.normal(0, sd_pixel, (n, 2)), poses, truth
