"""Directions of pixels: what a turn does is taken off, what a lens does stays."""

import numpy as np

from wildlab.geometry.camera import Camera, normalise, project
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.intrinsics import direction_differences, image_raster

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)


def test_a_turn_is_no_difference():
    """A camera that is turned sees the same directions at the pixels that the turn takes them to."""
    small = euler_to_matrix(0.002, -0.003, 0.004)
    xy = normalise(CAMERA, image_raster(CAMERA))
    turned = project(CAMERA, np.column_stack([xy, np.ones(len(xy))]) @ small.T) - image_raster(CAMERA)
    x, y = xy.T
    rates = np.stack([-x * y * 0.002 + (1 + x * x) * -0.003 - y * 0.004,
                      -(1 + y * y) * 0.002 + x * y * -0.003 + x * 0.004], -1)  # fmt: skip
    np.testing.assert_allclose(turned, rates * [CAMERA.fx, CAMERA.fy], atol=0.02)
    assert np.abs(direction_differences(CAMERA, CAMERA)).max() < 1e-9


def test_pixels_that_see_nothing_are_nan_and_do_no_harm():
    folding = Camera(640, 512, 400.0, 400.0, 320.0, 256.0, 0.0, (-0.6, 0.0, 0.0, 0.0, 0.0))
    apart = direction_differences(Camera(640, 512, 400.0, 400.0, 320.0, 256.0), folding)
    assert np.isnan(apart).any() and np.isfinite(apart).any()


def test_another_focal_length_shows_most_at_the_corners():
    longer = Camera(640, 512, 1159.2 * 1.01, 1167.8 * 1.01, 313.0, 265.0)
    apart = np.linalg.norm(direction_differences(CAMERA, longer), axis=1)
    far = np.linalg.norm(image_raster(CAMERA) - [313, 265], axis=1)
    assert np.corrcoef(apart, far)[0, 1] > 0.97
    # One per cent of the distance from the middle.
    assert np.isclose(apart.max(), 0.01 * far.max(), rtol=0.15)
