"""Ellipses on terrain, beside finite differences, level ground, and samples drawn from other seeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import Terrain, pixels_to_terrain
from wildlab.geometry.uncertainty import (
    PoseErrors,
    ground_covariance,
    sample_ground,
    terrain_jacobians,
)

CAMERA = Camera(640, 512, 800.0, 790.0, 320.0, 256.0, 0.0, (-0.2, 0.05, 0.001, -0.001, 0.0))


def looking(pitch_deg: float, height: float, *, yaw: float = 0.4, north: float = 0.0, east: float = 0.0):
    """A camera so many degrees below the horizon, its airframe a little askew."""
    mount = Mount("down", tilt=np.radians(90 - pitch_deg), lever_arm=(0.3, -0.2, 0.1))
    return CameraPoses(CAMERA, mount, np.array([north, east, -height]), euler_to_matrix(0.05, -0.04, yaw))


def errors(attitude_deg: float = 1.0, height: float = 0.5) -> PoseErrors:
    pose = np.zeros((6, 6))
    pose[:3, :3] = np.diag([1.0, 1.5, 2.0]) ** 2
    pose[3:, 3:] = np.diag(np.radians([1.0, 0.8, 2.0]) * attitude_deg) ** 2
    return PoseErrors(np.eye(2) * 4.0, pose, np.eye(3) * np.radians(0.2) ** 2, height**2)


def sloping(a: float, b: float, reach: float = 800.0) -> Terrain:
    """A plane that rises by ``a`` a metre north and ``b`` a metre east."""
    at = np.array([-reach, reach])
    return Terrain((a * at[:, None] + b * at[None, :]).astype(np.float32), -reach, -reach, 2 * reach)


def hills(rng: np.random.Generator, rough: float) -> Terrain:
    n, step = 160, 5.0
    kinds = ((16, 12.0), (6, 4.0), (2.5, rough))
    height = sum(size * gaussian_filter(rng.normal(size=(n, n)), width) * width for width, size in kinds)
    return Terrain(np.asarray(height, np.float32), -n * step / 2, -n * step / 2, step)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.25, -0.5), (-0.125, 0.75)])
def test_the_derivatives_are_those_of_finite_differences(slope):
    terrain, pose, uv = sloping(*slope), looking(50.0, 100.0), np.array([[150.0, 400.0]])
    at = pixels_to_terrain(pose, uv, terrain).points
    J = terrain_jacobians(pose, uv, at, terrain.slopes_at(at[:, :2]))

    def shifted(source: str, k: int, by: float) -> np.ndarray:
        off = np.zeros(6)
        off[k] = by
        if source == "pixel":
            return pixels_to_terrain(pose, uv + off[:2], terrain).points[0, :2]
        if source == "pose":
            moved = replace(
                pose, p_nb=pose.p_nb + off[:3], R_nb=pose.R_nb @ rotation_vector_to_matrix(off[3:])
            )
            return pixels_to_terrain(moved, uv, terrain).points[0, :2]
        if source == "plane":  # counts downwards
            return pixels_to_terrain(
                pose, uv, Terrain(terrain.height + np.float32(-by), *_place(terrain))
            ).points[0, :2]
        R_nm = pose.R_nb @ pose.R_bm @ rotation_vector_to_matrix(off[:3])
        turned = CameraPoses.at_lens(CAMERA, pose.p_nc, R_nm @ pose.R_mc, np.eye(3))
        return pixels_to_terrain(turned, uv, terrain).points[0, :2]

    for source, size, tiny in (
        ("pixel", 2, 1e-3),
        ("pose", 6, 1e-5),
        ("mount", 3, 1e-5),
        ("plane", 1, 0.0625),
    ):
        found = getattr(J, source)[0].reshape(2, -1)
        finite = np.column_stack(
            [(shifted(source, k, tiny) - shifted(source, k, -tiny)) / (2 * tiny) for k in range(size)]
        )
        np.testing.assert_allclose(found, finite, rtol=1e-5, atol=1e-6, err_msg=source)


def _place(terrain: Terrain) -> tuple[float, float, float]:
    return terrain.north, terrain.east, terrain.step


def test_on_level_ground_it_is_what_a_plane_gives():
    terrain, uv = sloping(0.0, 0.0), np.array([[100.0, 50.0], [320.0, 256.0], [600.0, 500.0]])
    pose, e = looking(55.0, 120.0), errors()
    found = ground_covariance(pose, uv, terrain, e, np.random.default_rng(0))
    expected = ground_covariance(pose, uv, 0.0, e, np.random.default_rng(0))
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9)
    assert list(found.method) == ["linear"] * 3


def test_samples_are_those_of_each_error_by_itself():
    """One pixel, one pose, one terrain at a time: raised, turned and moved as the draws say."""
    rng = np.random.default_rng(3)
    terrain, pose, uv, e = hills(rng, 3.0), looking(45.0, 90.0), np.array([200.0, 300.0]), errors()
    found = sample_ground(pose, uv, terrain, e, np.random.default_rng(7), 20)
    draws = np.random.default_rng(7)
    off = draws.multivariate_normal(np.zeros(6), e.pose, 20)
    turn = draws.multivariate_normal(np.zeros(3), e.mount, 20)
    pixel = draws.multivariate_normal(np.zeros(2), e.pixel, 20)
    higher = np.sqrt(e.plane) * draws.standard_normal(20)
    for k in range(20):
        R = pose.R_nb @ rotation_vector_to_matrix(off[k, 3:])
        R_nc = R @ pose.R_bm @ rotation_vector_to_matrix(turn[k]) @ pose.R_mc
        one = CameraPoses.at_lens(CAMERA, pose.p_nb + off[k, :3] + R @ pose.lever_arm, R_nc, np.eye(3))
        raised = Terrain(terrain.height + np.float32(higher[k]), *_place(terrain))
        expected = pixels_to_terrain(one, uv[None] + pixel[k], raised).points[0]
        np.testing.assert_allclose(found[k], expected, atol=1e-3)


@pytest.mark.parametrize(("rough", "flattest"), [(0.0, 20.0), (3.0, 45.0), (10.0, 20.0)])
def test_ellipses_hold_nine_tenths_of_samples_on_slopes(rough, flattest):
    """Random hills and poses, samples of other seeds: 85 to 95 % of each, and 90 % of all together."""
    inside = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        terrain = hills(rng, rough)
        for k in range(20):
            at = rng.uniform(-100, 100, 2)
            ground = terrain.heights_at(at[None])[0]
            pose = looking(
                rng.uniform(flattest, 90), ground + rng.uniform(40, 150), yaw=rng.uniform(-3, 3), north=at[0],
                east=at[1],
            )  # fmt: skip
            e, uv = errors(rng.uniform(0.3, 2.0), rng.uniform(0.2, 2.0)), rng.uniform([0, 0], [640, 512])
            found = ground_covariance(pose, uv[None], terrain, e, rng)
            if np.isfinite(found.covariance).all():
                others = sample_ground(pose, uv, terrain, e, np.random.default_rng([seed, k, 9]), 2000)
                centre = pixels_to_terrain(pose, uv[None], terrain).points[0, :2]
                inside.append(inside_ellipse(others[:, :2] - centre, found.covariance[0]).mean())
    assert len(inside) > 60
    assert all(0.85 <= one <= 0.95 for one in inside), np.sort(inside)[[0, -1]]
    assert 0.89 <= np.mean(inside) <= 0.91
