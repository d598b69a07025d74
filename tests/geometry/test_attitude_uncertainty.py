"""Tilt and heading of an attitude, beside a pinhole, a plane and hills that are written here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.covariances import (
    attitude_covariance,
    ellipse_axes,
    level_axes,
    pose_covariance,
    tilt_and_heading,
)
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.uncertainty import PoseErrors, ground_covariance

FOCAL, MIDDLE, HEIGHT = 800.0, (1000.0, 750.0), 60.0
CAMERA = Camera(2000, 1500, FOCAL, FOCAL, *MIDDLE)
PITCHES = (0, -15, -30, -45, -60, -75, -80, -85, -88, -90)
#: Standard deviations of tilt and heading, degrees.
KINDS = {"isotropic": (1.0, 1.0), "heading": (0.5, 3.0), "compass": (0.2, 10.0), "wide": (1.0, 15.0)}
DRAWS = 20_000


def attitudes(number: int, seed: int = 0) -> np.ndarray:
    return Rotation.random(number, np.random.default_rng(seed)).as_matrix()


def test_the_axes_are_two_level_ones_and_the_vertical():
    R = np.concatenate([attitudes(500), [np.eye(3), np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0])]])
    A = level_axes(R)
    np.testing.assert_allclose(np.swapaxes(A, 1, 2) @ A, np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(A), 1.0)
    np.testing.assert_allclose((R @ A)[:, :, 2], np.tile([0.0, 0.0, 1.0], (len(R), 1)), atol=1e-12)
    assert np.isnan(level_axes(np.full((2, 3, 3), np.nan))).all()


def test_the_covariance_is_that_of_rotations_about_level_axes_and_the_vertical():
    R, tilt, heading = attitudes(200), 0.02, 0.05
    in_n = R @ attitude_covariance(tilt, heading, R) @ np.swapaxes(R, 1, 2)
    np.testing.assert_allclose(
        in_n, np.tile(np.diag([tilt**2, tilt**2, heading**2]), (200, 1, 1)), atol=1e-15
    )
    A = level_axes(R) * [tilt, tilt, heading]
    np.testing.assert_allclose(A @ np.swapaxes(A, 1, 2), attitude_covariance(tilt, heading, R), atol=1e-15)


def test_what_is_read_from_a_covariance_is_what_was_put_in():
    R, rng = attitudes(200), np.random.default_rng(1)
    tilt, heading = rng.uniform(0.001, 0.1, (2, 200))
    found = tilt_and_heading(attitude_covariance(tilt, heading, R), R)
    np.testing.assert_allclose(found, [tilt, heading], rtol=1e-9)


def test_level_it_is_the_covariance_of_roll_pitch_and_yaw():
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


def camera_axes(pitch_deg: float, yaw: float) -> np.ndarray:
    """Right, down and forward of the image in north, east, down: a pinhole of our own."""
    pitch = np.radians(pitch_deg)
    ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    return np.column_stack([right, np.cross(ahead, right), ahead])


def slope_and_hills(north: np.ndarray, east: np.ndarray) -> np.ndarray:
    """Height of the ground, m."""
    return 0.12 * north - 0.08 * east + 3.0 * np.sin(north / 60.0) * np.cos(east / 75.0)


def meet(start: np.ndarray, rays: np.ndarray, on_hills: bool) -> np.ndarray:
    """Where rays (n, 3) first meet the ground, (n, 2); NaN where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(rays[:, 2] > 0, -start[:, 2] / rays[:, 2], np.nan)
        if on_hills:
            steps = np.arange(20.0, 500.0)
            points = start[:, None] + steps[None, :, None] * rays[:, None]
            below = -points[..., 2] < slope_and_hills(points[..., 0], points[..., 1])
            high = np.where(below.any(axis=1), steps[np.argmax(below, axis=1)], np.nan)
            low = high - 1.0
            for _ in range(20):
                along = (low + high) / 2
                p = start + along[:, None] * rays
                under = -p[:, 2] < slope_and_hills(p[:, 0], p[:, 1])
                low, high = np.where(under, low, along), np.where(under, along, high)
        return (start + along[:, None] * rays)[:, :2]


def drawn(
    pitch: float, yaw: float, pixel: np.ndarray, kind: str, on_hills: bool, seed: int, n: int
) -> np.ndarray:
    """True places (n, 2) of what is seen in a pixel, the true attitude drawn about the logged one."""
    rng = np.random.default_rng(seed)
    tilt, heading = np.radians(KINDS[kind])
    turned = np.column_stack([np.zeros((n, 2)), heading * rng.normal(size=n)])
    tilted = np.column_stack([tilt * rng.normal(size=(n, 2)), np.zeros(n)])
    turn = Rotation.from_rotvec(turned) * Rotation.from_rotvec(tilted)
    uv = pixel + rng.normal(0, 1.0, (n, 2))
    in_camera = np.column_stack([(uv - MIDDLE) / FOCAL, np.ones(n)])
    rays = turn.apply(in_camera @ camera_axes(pitch, yaw).T)
    return meet(np.array([0.0, 0.0, -HEIGHT]) + rng.normal(0, 0.2, (n, 3)), rays, on_hills)


def hills() -> Terrain:
    at = np.arange(-800.0, 801.0, 4.0)
    return Terrain(slope_and_hills(at[:, None], at[None, :]).astype(np.float32), -800.0, -800.0, 4.0)


def ellipse(pitch: float, yaw: float, pixel: np.ndarray, kind: str, terrain: Terrain | None):
    """Point and covariance as the package has them, the camera's attitude being that of the body."""
    pose = CameraPoses(
        CAMERA, Mount("forward"), np.array([0.0, 0.0, -HEIGHT]), euler_to_matrix(0.0, np.radians(pitch), yaw)
    )
    errors = PoseErrors(
        np.eye(2), pose_covariance(0.2, 0.2, *np.radians(KINDS[kind]), pose.R_nb), np.zeros((3, 3)), 0.0
    )
    rng = np.random.default_rng(5)
    if terrain is None:
        return ground_covariance(pose, pixel, 0.0, errors, rng).covariance[0]
    return ground_covariance(pose, pixel[None], terrain, errors, rng).covariance[0]


def coverage(pitch: float, kind: str, on_hills: bool) -> tuple[float, np.ndarray]:
    """Share of the true places in the 90 % ellipse, and its half axes."""
    yaw = 0.7
    pixel = (
        np.array([1100.0, 700.0])
        if pitch < 0
        else np.array([1100.0, MIDDLE[1] + FOCAL * np.tan(np.radians(25.0))])
    )
    n = DRAWS // 10 if on_hills else DRAWS
    exact = np.column_stack([(pixel[None] - MIDDLE) / FOCAL, [1.0]]) @ camera_axes(pitch, yaw).T
    centre = meet(np.array([[0.0, 0.0, -HEIGHT]]), exact, on_hills)
    covariance = ellipse(pitch, yaw, pixel, kind, hills() if on_hills else None)
    off = drawn(pitch, yaw, pixel, kind, on_hills, seed=abs(int(pitch)) + 7, n=n) - centre
    squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off)
    return float((squared <= -2 * np.log(0.1)).mean()), np.array(ellipse_axes(covariance)[:2])


@pytest.mark.parametrize(("kind", "on_hills"), [*((kind, False) for kind in KINDS), ("compass", True)])
def test_ellipses_hold_what_they_say_at_every_pitch(kind, on_hills):
    shares = {pitch: coverage(pitch, kind, on_hills) for pitch in PITCHES}
    for pitch, (share, axes) in shares.items():
        where = "hills" if on_hills else "plane"
        print(f"{kind:9s} {where} {pitch:4d} {100 * share:5.1f} % {axes[0]:6.2f} x {axes[1]:5.2f} m")
    assert all(0.87 <= share <= 0.93 for share, _ in shares.values()), shares
