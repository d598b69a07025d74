"""Our camera and georeferencing against OpenCV and cameratransform, other people's software."""

import cv2
import numpy as np
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane

BENT = Camera(640, 512, 700.0, 705.0, 322.0, 250.0, 0.0, (-0.1, 0.05, 0.001, -0.002, 0.01))


def test_ground_to_pixel_agrees_with_opencv_over_random_poses():
    rng = np.random.default_rng(0)
    for _ in range(100):
        p_nb = rng.uniform([-100, -100, -400], [100, 100, -50])
        R_nb = euler_to_matrix(*rng.uniform([-0.3, -0.3, -3], [0.3, 0.3, 3]))
        p_nc, R_nc = camera_pose(Mount("down", tilt=0.1, misalignment=(0.02, 0.01, -0.03)), p_nb, R_nb)
        points = np.column_stack([p_nb[:2] + rng.uniform(-20, 20, (20, 2)), rng.uniform(-5, 5, 20)])
        expected, _ = cv2.projectPoints(
            points, cv2.Rodrigues(R_nc.T)[0], -R_nc.T @ p_nc, BENT.matrix, np.array(BENT.distortion)
        )
        assert np.abs(ground_to_pixel(BENT, points, p_nc, R_nc) - expected[:, 0]).max() < 1e-6


def test_pixel_to_plane_agrees_with_cameratransform():
    cameratransform = pytest.importorskip("cameratransform", reason="needs the extra 'oracles'")
    rng = np.random.default_rng(1)
    camera = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
    for _ in range(20):
        heading, depression, roll = rng.uniform(0, 360), rng.uniform(30, 89), rng.uniform(-20, 20)
        height, north, east = rng.uniform(50, 400), *rng.uniform(-100, 100, 2)
        oracle = cameratransform.Camera(
            cameratransform.RectilinearProjection(
                focallength_x_px=camera.fx, focallength_y_px=camera.fy, center_x_px=camera.cx,
                center_y_px=camera.cy, image_width_px=640, image_height_px=512,
            ),
            # Tilt 0 looks down and 90 level; x is east, y north; roll turns the picture, ours the axes.
            cameratransform.SpatialOrientation(
                heading_deg=heading, tilt_deg=90 - depression, roll_deg=-roll, elevation_m=height,
                pos_x_m=east, pos_y_m=north,
            ),
        )  # fmt: skip
        uv = rng.uniform([0, 0], [640, 512], (50, 2))
        theirs = oracle.spaceFromImage(uv, Z=0.0)
        R_nb = euler_to_matrix(*np.radians([roll, -depression, heading]))
        ours = pixel_to_plane(
            camera, uv, *camera_pose(Mount("forward"), np.array([north, east, -height]), R_nb), 0.0
        )
        seen = np.isfinite(ours).all(axis=1) & (np.linalg.norm(ours, axis=1) < 20 * height)
        assert seen.sum() > 20
        assert np.allclose(ours[seen][:, [1, 0]], theirs[seen][:, :2], rtol=1e-6, atol=1e-5)
