"""Pose noise comes back from simulated errors, and stays where it was when the data are silent."""

import numpy as np
import pytest

from wildlab.evaluation.pose_noise import estimate_pose_noise
from wildlab.geometry.attitude_uncertainty import level_axes
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.mount import Mount
from wildlab.geometry.uncertainty import ground_jacobians
from wildlab.studies.sensitivity import TAU2

ASSUMED = {
    "position_horizontal": 2.0,
    "position_vertical": 3.0,
    "tilt": np.radians(0.7),
    "heading": np.radians(3.0),
    "pixel": 3.0,
}


def simulate(seed, sd, n_images, points):
    rng = np.random.default_rng(seed)
    image = np.repeat(np.arange(n_images), points)
    euler = np.column_stack(
        [rng.uniform(-0.3, 0.3, n_images), rng.uniform(-1.2, -0.6, n_images), rng.uniform(-3, 3, n_images)]
    )
    height = rng.uniform(30, 300, n_images)
    p = np.column_stack([np.zeros((n_images, 2)), -height])
    wrong_p = p + rng.normal(0, [sd[0], sd[0], sd[1]], (n_images, 3))
    R = euler_to_matrix(*euler.T)
    wrong = rotation_vector_to_matrix(rng.normal(0, [sd[2], sd[2], sd[3]], (n_images, 3))) @ R
    uv = rng.uniform([0, 0], [640, 512], (len(image), 2))
    mount = Mount("forward")
    poses = CameraPoses(TAU2, mount, p[image], R[image])
    wrong_poses = CameraPoses(TAU2, mount, wrong_p[image], wrong[image])
    true = georeference_pixels(poses, uv, 0.0)
    clicked = uv + rng.normal(0, sd[4], uv.shape)
    ours = georeference_pixels(wrong_poses, clicked, 0.0)
    J = ground_jacobians(poses, uv, 0.0)
    derivatives = J.pose.copy()
    derivatives[:, :, 3:] = J.pose[:, :, 3:] @ level_axes(R[image])
    return (ours - true)[:, :2], derivatives, J.pixel, np.zeros((len(uv), 2, 2)), image


def test_deviations_come_back():
    true = (1.0, 2.0, np.radians(1.5), np.radians(2.0), 5.0)
    found = estimate_pose_noise(*simulate(1, true, 250, 5), ASSUMED)
    for (kind, value), put_in in zip(found.sd.items(), true, strict=True):
        assert value == pytest.approx(put_in, rel=0.25), kind
        assert found.factor[kind] < 1.35


def test_with_three_images_the_assumption_stands_and_the_doubt_is_stated():
    found = estimate_pose_noise(
        *simulate(2, (2.0, 3.0, np.radians(0.7), np.radians(3.0), 3.0), 3, 2), ASSUMED
    )
    assert max(found.factor.values()) > 1.8
    with pytest.raises(ValueError, match="fewer than three images"):
        estimate_pose_noise(*simulate(3, (1, 1, 0.01, 0.01, 1), 2, 2), ASSUMED)


def test_images_with_different_numbers_of_points_in_any_order():
    """Points of an image belong together wherever they stand; and each size of image has its say."""
    true = (1.0, 2.0, np.radians(1.5), np.radians(2.0), 5.0)
    given = simulate(4, true, 150, 5)
    rng = np.random.default_rng(4)
    some = rng.random(len(given[-1])) < 0.6
    sizes = np.unique(given[-1][some], return_counts=True)[1]
    assert len(set(sizes)) == 5
    rows = np.flatnonzero(some)
    in_order = estimate_pose_noise(*(part[rows] for part in given), ASSUMED)
    rng.shuffle(rows)
    shuffled = estimate_pose_noise(*(part[rows] for part in given), ASSUMED)
    for kind, put_in in zip(in_order.sd, true, strict=True):
        assert shuffled.sd[kind] == pytest.approx(in_order.sd[kind], rel=1e-3)
        assert abs(np.log(in_order.sd[kind] / put_in)) < 3 * np.log(in_order.factor[kind]), kind
