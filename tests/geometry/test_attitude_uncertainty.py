"""Tilt and heading of an attitude: covariances in the body and in north, east, down."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.geometry.attitude_uncertainty import (
    attitude_covariance,
    level_axes,
    pose_covariance,
    tilt_and_heading,
)
from wildlab.geometry.frames import euler_to_matrix


def attitudes(number: int, seed: int = 0) -> np.ndarray:
    return Rotation.random(number, np.random.default_rng(seed)).as_matrix()


def test_the_axes_are_two_level_ones_and_the_vertical() -> None:
    R = np.concatenate([attitudes(500), [np.eye(3), np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0])]])
    A = level_axes(R)
    np.testing.assert_allclose(np.swapaxes(A, 1, 2) @ A, np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(A), 1.0)
    np.testing.assert_allclose((R @ A)[:, :, 2], np.tile([0.0, 0.0, 1.0], (len(R), 1)), atol=1e-12)
    assert np.isnan(level_axes(np.full((2, 3, 3), np.nan))).all()


def test_the_axes_stay_with_a_body_that_tilts() -> None:
    """No jump on the way through straight down, as Euler angles have one."""
    pitch = np.radians(np.linspace(0, -170, 500))
    A = level_axes(euler_to_matrix(np.full(500, 0.02), pitch, np.full(500, 1.0)))
    assert np.abs(np.diff(A, axis=0)).max() < 2 * np.abs(np.diff(pitch)).max()
    np.testing.assert_allclose(level_axes(euler_to_matrix(0.0, 0.0, 2.0)), np.eye(3), atol=1e-12)


def test_the_covariance_is_that_of_rotations_about_level_axes_and_the_vertical() -> None:
    R, tilt, heading = attitudes(200), 0.02, 0.05
    in_n = R @ attitude_covariance(tilt, heading, R) @ np.swapaxes(R, 1, 2)
    np.testing.assert_allclose(
        in_n, np.tile(np.diag([tilt**2, tilt**2, heading**2]), (200, 1, 1)), atol=1e-15
    )
    A = level_axes(R) * [tilt, tilt, heading]
    np.testing.assert_allclose(A @ np.swapaxes(A, 1, 2), attitude_covariance(tilt, heading, R), atol=1e-15)


def test_a_pose_has_a_position_too_and_the_two_are_independent() -> None:
    R = attitudes(3)
    P = pose_covariance(2.0, 3.0, 0.02, 0.05, R)
    np.testing.assert_allclose(P[:, :3, :3], np.tile(np.diag([4.0, 4.0, 9.0]), (3, 1, 1)))
    np.testing.assert_allclose(P[:, 3:, 3:], attitude_covariance(0.02, 0.05, R))
    assert (P[:, :3, 3:] == 0).all() and (P[:, 3:, :3] == 0).all()


def test_what_is_read_from_a_covariance_is_what_was_put_in() -> None:
    R, rng = attitudes(200), np.random.default_rng(1)
    tilt, heading = rng.uniform(0.001, 0.1, (2, 200))
    found = tilt_and_heading(attitude_covariance(tilt, heading, R), R)
    np.testing.assert_allclose(found, [tilt, heading], rtol=1e-9)


def test_level_it_is_the_covariance_of_roll_pitch_and_yaw() -> None:
    """By finite differences of Euler angles, to first order in roll and pitch."""
    sd = np.radians([1.0, 1.0, 3.0])
    for roll, pitch, yaw in ((0.0, 0.0, 0.7), (0.02, -0.03, -2.0)):
        R, h = euler_to_matrix(roll, pitch, yaw), 1e-6
        columns = [
            Rotation.from_matrix(R.T @ euler_to_matrix(*(np.array([roll, pitch, yaw]) + h * one))).as_rotvec()
            / h
            for one in np.eye(3)
        ]
        E = np.column_stack(columns) * sd
        off = np.abs(attitude_covariance(sd[0], sd[2], R) - E @ E.T).max()
        assert off <= (abs(roll) + abs(pitch)) * sd[0] ** 2 + 1e-12
