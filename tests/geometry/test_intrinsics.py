"""Cameras from views of a board: against exact ones, and their own intervals."""

import numpy as np
import pytest
from scipy.stats import binomtest

from wildlab.geometry.camera import Camera
from wildlab.geometry.intrinsics import (
    calibrate_camera,
    choose_lens,
    parameters_of,
    project_board,
    view_errors,
)
from wildlab.simulation.boards import board_views

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, 0.0, (-0.2, 0.1, 0.001, -0.002, 0.0))
BOARD = np.array([[x, y, 0.0] for y in range(6) for x in range(9)])


def views(seed, n=20, camera=CAMERA, board=BOARD):
    return board_views(np.random.default_rng(seed), camera, board, n)


def pixels(camera, of, board=BOARD):
    return project_board(camera, of, board)


@pytest.mark.parametrize("seed", range(2))
def test_without_noise_the_camera_comes_out(seed):
    """But for what OpenCV rounds pixels to, 3e-5 px."""
    found = calibrate_camera(BOARD, pixels(CAMERA, views(seed)), 640, 512, "tangential")
    assert parameters_of(found.camera) == pytest.approx(parameters_of(CAMERA), rel=1e-5, abs=1e-4)
    assert found.rms < 3e-5 and np.abs(found.sd("fx")) < 1e-2


def test_points_may_be_missing():
    camera = Camera(720, 480, 1267.0, 1267.0, 356.0, 216.6, 0.0, (0.446, 0.0, 0.0, 0.0, 0.0))
    uv = pixels(camera, views(3, 12, camera))
    uv[2, 5:9] = np.nan
    found = calibrate_camera(BOARD, uv, 720, 480, "k1")
    np.testing.assert_allclose(found.values, [1267, 1267, 356, 216.6, 0.446], rtol=1e-5)
    assert np.isnan(found.residuals[2, 6]).all() and np.isfinite(found.residuals[2, 4]).all()
    assert np.isnan(found.sd("k2"))


def test_the_lens_is_as_simple_as_the_views_say():
    rng = np.random.default_rng(10)
    straight = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
    noise = rng.normal(0, 0.2, (20, 54, 2))
    assert choose_lens(BOARD, pixels(straight, views(10, 20, straight)) + noise, 640, 512).lens == "none"
    wide = Camera(640, 480, 535.0, 535.0, 340.0, 236.0, 0.0, (-0.3, 0.12, 0.0, 0.0, 0.0))
    chosen = choose_lens(BOARD, pixels(wide, views(10, 20, wide)) + noise, 640, 480)
    assert chosen.lens == "k1-k2" and chosen.held_out["k1-k2"] < chosen.held_out["k1"]
    assert choose_lens(BOARD, pixels(wide, views(10, 4, wide)), 640, 480) == ("k1", {})


def test_a_covariance_is_that_of_the_jackknife():
    """n - 1 times the spread of what is left without a view each."""
    uv = pixels(CAMERA, views(11, 6)) + np.random.default_rng(11).normal(0, 0.2, (6, 54, 2))
    found = calibrate_camera(BOARD, uv, 640, 512, "k1")
    np.testing.assert_allclose(found.covariance, 5 * np.cov(found.without.T, bias=True), rtol=1e-9)


def test_what_views_say_is_how_many_estimates_spread(draws=60):
    """With poses that have to be estimated too; 60 standard deviations are known to 9 %."""
    rng, clean = np.random.default_rng(12), pixels(CAMERA, views(12, 6))
    many = [
        calibrate_camera(BOARD, clean + rng.normal(0, 0.2, clean.shape), 640, 512, "k1", resample=False)
        for _ in range(draws)
    ]
    said = 0.2 * np.sqrt(np.diag(np.linalg.inv(many[0].information.sum(axis=0))))
    np.testing.assert_allclose(np.std([one.values for one in many], axis=0), said, rtol=0.3)


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
        found = calibrate_camera(BOARD, uv, 640, 512, "tangential")
        intervals = {name: found.interval(name) for name in found.names}
        truth = parameters_of(CAMERA)
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
