"""Cameras from views of a board: against exact ones, OpenCV's, and their own intervals."""

import cv2
import numpy as np
import pytest
from scipy.stats import binomtest

from wildlab.geometry.board_views import (
    INTRINSICS,
    Views,
    parameters_of,
    project_board,
)
from wildlab.geometry.camera import Camera, project
from wildlab.geometry.frames import rotation_vector_to_matrix
from wildlab.geometry.intrinsics import (
    LENSES,
    PINHOLE,
    calibrate_camera,
    choose_lens,
    confused,
    view_errors,
)
from wildlab.simulation.boards import board_views

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, 0.0, (-0.2, 0.1, 0.001, -0.002, 0.0))
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(9)])


def views(seed, n=20, camera=CAMERA, board=BOARD):
    return board_views(np.random.default_rng(seed), camera, board, n)


def pixels(camera, of, board=BOARD):
    return project_board(parameters_of(camera), of, board).uv


def test_projection_is_that_of_the_camera():
    of = views(1, 3)
    points = np.einsum("vij,mj->vmi", of.rotation, BOARD) + of.translation[:, None]
    np.testing.assert_allclose(pixels(CAMERA, of), project(CAMERA, points), rtol=1e-12)


def test_derivatives_are_those_of_small_changes():
    of, theta = views(2, 2), parameters_of(CAMERA)
    theta[4], theta[9] = 3.0, 0.05
    found = project_board(theta, of, BOARD)
    for i in range(len(INTRINSICS)):
        step = 1e-6 * max(1.0, abs(theta[i])) * np.eye(10)[i]
        slope = (project_board(theta + step, of, BOARD).uv - project_board(theta - step, of, BOARD).uv) / (
            2 * step[i]
        )
        np.testing.assert_allclose(found.by_intrinsics[..., i], slope, rtol=1e-4, atol=1e-4)
    for i in range(6):
        small = 1e-6 * np.tile(np.eye(6)[i], (2, 1))
        ends = [
            project_board(
                theta,
                Views(
                    rotation_vector_to_matrix(s * small[:, :3]) @ of.rotation,
                    of.translation + s * small[:, 3:],
                ),
                BOARD,
            ).uv
            for s in (1, -1)
        ]
        np.testing.assert_allclose(found.by_pose[..., i], (ends[0] - ends[1]) / 2e-6, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_without_noise_the_camera_comes_out(seed):
    found = calibrate_camera(BOARD, pixels(CAMERA, views(seed)), 640, 512)
    np.testing.assert_allclose(parameters_of(found.camera), parameters_of(CAMERA), rtol=1e-5, atol=1e-4)
    assert found.rms < 1e-6


def test_skew_comes_out_and_points_may_be_missing():
    camera = Camera(720, 480, 1267.0, 1117.0, 356.0, 216.6, 8.0, (0.446, 0.0, 0.0, 0.0, 0.0))
    uv = pixels(camera, views(3, 12, camera))
    uv[2, 5:9] = np.nan
    found = calibrate_camera(BOARD, uv, 720, 480, ("fx", "fy", "cx", "cy", "skew", "k1"))
    np.testing.assert_allclose(found.values, [1267, 1117, 356, 216.6, 8, 0.446], rtol=1e-5)
    assert np.isnan(found.residuals[2, 6]).all() and np.isfinite(found.residuals[2, 4]).all()


@pytest.mark.parametrize("lens", ["k1-k2", "full"])
def test_it_agrees_with_opencv(lens):
    rng = np.random.default_rng(4)
    uv = pixels(CAMERA, views(4))
    uv += rng.normal(0, 0.3, uv.shape)
    flags = cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3 if lens == "k1-k2" else 0
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    rms, A, bends, _, _ = cv2.calibrateCamera(
        [BOARD.astype(np.float32)] * len(uv), list(uv.astype(np.float32)), (640, 512), None, None,
        flags=flags, criteria=stop,
    )  # fmt: skip
    found = calibrate_camera(BOARD, uv, 640, 512, (*PINHOLE, *LENSES[lens]))
    assert found.rms == pytest.approx(rms, abs=1e-5)
    np.testing.assert_allclose(found.camera.matrix, A, atol=0.05)
    np.testing.assert_allclose(found.camera.distortion, bends.ravel()[:5], atol=2e-2)


def test_what_is_not_estimated_is_held():
    uv = pixels(CAMERA, views(6))
    found = calibrate_camera(BOARD, uv, 640, 512, ("fx", "fy"), held=CAMERA)
    assert found.camera.distortion == CAMERA.distortion and found.camera.cx == CAMERA.cx
    np.testing.assert_allclose(found.values, [CAMERA.fx, CAMERA.fy], rtol=1e-6)
    assert np.isnan(found.sd("cx"))


def test_flat_views_do_not_tell_focal_length():
    rng = np.random.default_rng(8)
    flat = board_views(rng, CAMERA, BOARD, 8, tilt=np.radians(0.5))
    uv = pixels(CAMERA, flat) + rng.normal(0, 0.2, (8, 54, 2))
    found = calibrate_camera(BOARD, uv, 640, 512, PINHOLE)
    assert any({"fx", "fy"} <= set(group) for group in confused(found))
    tilted = calibrate_camera(BOARD, pixels(CAMERA, views(8)), 640, 512, PINHOLE)
    assert confused(tilted) == []


def test_the_lens_is_as_simple_as_the_views_say():
    rng = np.random.default_rng(10)
    straight = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
    noise = rng.normal(0, 0.2, (20, 54, 2))
    assert choose_lens(BOARD, pixels(straight, views(10, 20, straight)) + noise, 640, 512).lens == "none"
    wide = Camera(640, 480, 535.0, 535.0, 340.0, 236.0, 0.0, (-0.3, 0.12, 0.0, 0.0, 0.0))
    chosen = choose_lens(BOARD, pixels(wide, views(10, 20, wide)) + noise, 640, 480)
    assert chosen.lens == "k1-k2" and chosen.held_out["k1-k2"] < chosen.held_out["k1"]
    assert choose_lens(BOARD, pixels(wide, views(10, 4, wide)), 640, 480) == ("k1", {})


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say(n=12, shared=0.3):
    """Noise of each point, and an error that the points of a view share."""
    inside = []
    for seed in range(60):
        rng = np.random.default_rng(1000 + seed)
        of = board_views(rng, CAMERA, BOARD, n)
        uv = pixels(CAMERA, of)
        bent = rng.normal(0, shared, (n, 1, 1)) * np.linspace(-1, 1, 54)[None, :, None] ** 2
        uv += rng.normal(0, 0.2, uv.shape) + bent
        found = calibrate_camera(BOARD, uv, 640, 512, (*PINHOLE, "k1", "k2", "p1", "p2"))
        intervals = {name: found.interval(name) for name in found.names}
        truth = dict(zip(INTRINSICS, parameters_of(CAMERA), strict=True))
        inside.append([low <= truth[name] <= high for name, (low, high) in intervals.items()])
    for name, held in zip(found.names, np.sum(inside, axis=0), strict=True):
        share = binomtest(int(held), len(inside)).proportion_ci(0.999)
        assert share.low <= 0.98 and share.high >= 0.92, (name, held)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_views_of_another_camera_fit_worse():
    uv = pixels(CAMERA, views(7, 5))
    np.testing.assert_allclose(view_errors(CAMERA, BOARD, uv), 0, atol=1e-6)
    bent = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
    assert (view_errors(bent, BOARD, uv) > 0.05).all()
