"""Flow and velocity: finite differences of the exact projection are the truth of every derivative."""

import numpy as np
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount, mount_rotation
from wildlab.geometry.flow import (
    CameraMotion,
    FlowErrors,
    flow_between,
    flow_matrix,
    gimbal_axes,
    mean_velocity,
    motion_between,
    target_velocity,
    velocity_jacobian,
)
from wildlab.geometry.frames import (
    euler_to_matrix,
    matrix_to_rotation_vector,
    rotation_vector_to_matrix,
)
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel

CAMERA = Camera(640, 512, 760.0, 770.0, 313.0, 265.0, skew=1.5)
BENT = Camera(640, 512, 760.0, 770.0, 313.0, 265.0, distortion=(-0.25, 0.08, 0.001, -0.002, 0.0))
MOUNT = Mount("down", misalignment=(0.03, -0.05, 0.04), lever_arm=(0.4, -0.1, 0.2))
PLANE, VELOCITY = 1.5, np.array([3.0, -2.0])
MOTION = CameraMotion(np.array([16.0, 5.0, 0.7]), np.array([0.1, -0.2, 0.15]), np.array([0.12, -0.08]))
R0 = euler_to_matrix(0.15, -0.05, 0.8)


def pose_at(time, camera=CAMERA, motion=MOTION):
    """The camera some time from now, its rates in b, its velocity in n and its gimbal's rates constant."""
    pan, tilt = 0.2 + motion.gimbal_rates[0] * time, 0.3 + motion.gimbal_rates[1] * time
    p = np.array([10.0, -20.0, -120.0]) + motion.velocity * time
    R = R0 @ rotation_vector_to_matrix(motion.rates * time)
    return CameraPoses(camera, MOUNT, p, R, np.array(pan), np.array(tilt))


def points(time):
    """Three things that move alike on the plane."""
    start = np.array([[45.0, 20.0, PLANE], [75.0, 30.0, PLANE], [60.0, -15.0, PLANE]])
    return start + np.append(VELOCITY, 0.0) * time


def pixels(time, camera=CAMERA, moving=True):
    pose = pose_at(time, camera)
    return ground_to_pixel(camera, points(time if moving else 0.0), pose.p_nc, pose.R_nc)


@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_the_velocity_is_what_the_points_move_with(camera):
    step = 1e-5
    flow = (pixels(step, camera) - pixels(-step, camera)) / (2 * step)
    found = target_velocity(pose_at(0.0, camera), MOTION, pixels(0.0, camera), flow, PLANE)
    assert np.allclose(found, VELOCITY, atol=1e-6)


def test_the_matrix_is_that_of_the_print_for_its_camera():
    f, R = 800.0, euler_to_matrix(0.1, 0.2, 0.3)
    camera = Camera(640, 512, f, f, 320.0, 256.0)
    poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), R)
    uv = np.array([[400.0, 200.0]])
    ray = np.array([(400.0 - 320.0) / f, (200.0 - 256.0) / f, 1.0])
    z = 100.0 / (poses.R_nc @ ray)[2]
    x, y = ray[:2] * z
    printed = [
        [f, 0, -f * x / z, -f * x / z * y, f * z + f * x / z * x, -f * y],
        [0, f, -f * y / z, -f * z - f * y / z * y, f * y / z * x, f * x],
    ]
    assert np.allclose(flow_matrix(poses, uv, 0.0)[0], np.array(printed) / z)


def test_the_gimbal_turns_the_camera_as_its_angles_say():
    step, rates = 1e-6, np.array([0.3, -0.2])
    pan, tilt = 0.4, -0.3
    here, there = (mount_rotation(MOUNT, pan + rates[0] * s, tilt + rates[1] * s) for s in (-step, step))
    truth = matrix_to_rotation_vector(there @ here.T) / (2 * step)
    assert np.allclose(gimbal_axes(MOUNT, pan) @ rates, truth, atol=1e-8)
    assert gimbal_axes(MOUNT, np.array([0.1, 0.2])).shape == (2, 3, 2)


def test_the_finite_form_is_exact_and_the_other_one_nearly():
    errors = []
    for interval in (0.4, 0.2, 0.1):
        ends = (-interval / 2, interval / 2)
        first, second = (pose_at(end) for end in ends)
        one, two = (pixels(end) for end in ends)
        ends = [georeference_pixels(p, uv, PLANE)[:, :2] for p, uv in ((first, one), (second, two))]
        exact = (ends[1] - ends[0]) / interval
        assert np.allclose(exact, VELOCITY, atol=1e-9)
        poses, motion = motion_between(first, second, interval)
        middle, flow = flow_between(one, two, interval)
        found = target_velocity(poses, motion, middle, flow, PLANE)
        errors.append(np.abs(found - VELOCITY).max())
    # Half the interval, a quarter of the error.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)
    assert errors[2] < 0.02


def test_motion_between_two_poses_is_the_motion():
    first, second = pose_at(-0.05), pose_at(0.05)
    poses, motion = motion_between(first, second, 0.1)
    assert np.allclose(motion.velocity, MOTION.velocity)
    assert np.allclose(motion.rates, MOTION.rates)
    assert np.allclose(motion.gimbal_rates, MOTION.gimbal_rates)
    assert np.allclose(poses.R_nc, pose_at(0.0).R_nc)
    assert np.allclose(motion_between(first, second, 0.1, [1.0, 2.0, 3.0])[1].velocity, [1, 2, 3])


def moved(camera, pixel=0, flow=0, pose=0, mount=0, velocity=0, rates=0, gimbal_rates=0, plane=0, interval=0):
    """The velocity with one thing changed."""
    here = pose_at(0.0, camera)
    pose = np.zeros(6) + pose
    R = here.R_nb @ rotation_vector_to_matrix(pose[3:])
    p = here.p_nb + pose[:3]
    turned = here.R_bm @ rotation_vector_to_matrix(np.zeros(3) + mount) @ here.R_mc
    lens = CameraPoses.at_lens(camera, p + R @ here.lever_arm, R @ turned, turned, here.lever_arm)
    # The gimbal's axes are those of the base, which the error of the mount behind it does not turn.
    axes = gimbal_axes(MOUNT, here.pan)
    spin = MOTION.rates + rates
    all_rates = spin + axes @ (MOTION.gimbal_rates + gimbal_rates)
    # Of a camera fixed to b with these rates, whose lens moves as b's own rates have it.
    v = MOTION.velocity + velocity - R @ np.cross(all_rates - spin, here.lever_arm)
    uv = pixels(0.0, camera) + pixel
    measured = (FLOW + flow) * np.exp(-interval)
    return target_velocity(lens, CameraMotion(v, all_rates), uv, measured, PLANE + plane)


FLOW = np.array([[-40.0, 25.0], [10.0, 60.0], [5.0, -90.0]])


@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_derivatives_are_those_of_finite_differences(camera):
    J = velocity_jacobian(pose_at(0.0, camera), MOTION, pixels(0.0, camera), FLOW, PLANE)
    whole = target_velocity(pose_at(0.0, camera), MOTION, pixels(0.0, camera), FLOW, PLANE)
    assert np.allclose(moved(camera), whole)
    first = 0
    for name, size in (
        ("pixel", 2), ("flow", 2), ("pose", 6), ("mount", 3), ("velocity", 3), ("rates", 3),
        ("gimbal_rates", 2), ("plane", 1), ("interval", 1),
    ):  # fmt: skip
        step = 1e-3 if name in ("pixel", "flow", "velocity", "plane") else 1e-6
        columns = []
        for axis in np.eye(size):
            there, here = (moved(camera, **{name: s * axis if size > 1 else s}) for s in (step, -step))
            columns.append((there - here) / (2 * step))
        truth = np.stack(columns, axis=-1)
        assert np.allclose(J[..., first : first + size], truth, rtol=1e-4, atol=1e-6), name
        first += size


def errors_of(scale=1.0):
    pose = np.diag([2.0, 2.0, 3.0, 0.02, 0.02, 0.04]) ** 2
    return FlowErrors(
        0.25 * np.eye(2), 4.0 * np.eye(2), pose * scale, 1e-5 * np.eye(3) * scale, 0.04 * np.eye(3) * scale,
        1e-4 * np.eye(3) * scale, 1e-4 * np.eye(2) * scale, 0.25 * scale, 0.01 * scale,
    )  # fmt: skip


def test_what_features_share_does_not_average_out():
    pose, uv = pose_at(0.0), pixels(0.0)
    one = mean_velocity(pose, MOTION, uv[:1], FLOW[:1], PLANE, errors_of())
    many = mean_velocity(
        pose, MOTION, np.repeat(uv[:1], 100, axis=0), np.repeat(FLOW[:1], 100, axis=0), PLANE, errors_of()
    )
    alone = mean_velocity(pose, MOTION, uv[:1], FLOW[:1], PLANE, errors_of(0.0))
    assert np.allclose(one.value, many.value)
    assert np.allclose(one.covariance - many.covariance, 0.99 * alone.covariance)
    (J,) = velocity_jacobian(pose, MOTION, uv[:1], FLOW[:1], PLANE)
    expected = np.zeros((2, 2))
    for given in map(np.atleast_2d, errors_of()):
        by, J = J[:, : len(given)], J[:, len(given) :]
        expected += by @ given @ by.T
    assert np.allclose(one.covariance, expected)
