"""The detector of floating objects, H 4.3, against a second writing of it by scipy, and its choices."""

import numpy as np
import pytest
from scipy import ndimage

from wildlab.detection.centres import cut_sides
from wildlab.detection.floating import (
    FloatingThresholds,
    detect_floating,
    find_edges,
    find_objects,
    to_grey,
)


def sea(height=90, width=120, noise=0.0, seed=0):
    level = 288.0 + noise * np.random.default_rng(seed).standard_normal((height, width))
    return level.astype(np.float32)


def plain_steps(grey, size, sd, threshold):
    """H (4.1) to (4.4) by scipy, rounded where an 8-bit image rounds."""
    x = np.arange(-(size // 2), size // 2 + 1)
    g = np.exp(-(x**2) / (2 * sd**2)) / np.exp(-(x**2) / (2 * sd**2)).sum()
    smoothed = np.round(ndimage.correlate(grey.astype(float), np.outer(g, g), mode="nearest"))
    du, dv = (ndimage.prewitt(smoothed, axis, mode="nearest") for axis in (1, 0))
    gradient = np.hypot(du, dv)
    return smoothed, gradient, np.round(np.minimum(gradient, 255)) >= threshold


def plain_detect(grey, thresholds):
    """Steps 1 to 6 for objects within the image: filled areas and centres, largest first."""
    steep = plain_steps(grey, thresholds.smoothing_size, thresholds.smoothing_sd, thresholds.gradient)[2]
    labels, count = ndimage.label(steep, np.ones((3, 3)))
    blobs = [labels == number for number in range(1, count + 1)]
    blobs = [blob for blob in blobs if blob.sum() >= thresholds.smallest_area]
    boxes = np.array([[np.min(rc, axis=1), -np.max(rc, axis=1)] for rc in map(np.nonzero, blobs)])
    found = []
    for blob, box in zip(blobs, boxes, strict=True):
        around = (boxes <= box).all(axis=(1, 2)) & (boxes != box).any(axis=(1, 2))
        if not around.any():
            v, u = np.nonzero(ndimage.binary_fill_holes(blob))
            found.append((len(u), u.mean(), v.mean()))
    return sorted(found, reverse=True)


@pytest.mark.parametrize("seed", range(3))
def test_against_the_same_steps_by_scipy(seed):
    rng = np.random.default_rng(seed)
    grey = rng.normal(60, 8, (70, 100))
    for _ in range(4):
        u, v = rng.integers(12, 70), rng.integers(12, 45)
        grey[v : v + rng.integers(5, 14), u : u + rng.integers(6, 20)] += rng.uniform(90, 190)
    grey = np.clip(np.round(grey), 0, 255).astype(np.uint8)
    thresholds = FloatingThresholds(smallest_area=20, close_at_border=False)
    smoothed, gradient, steep = plain_steps(grey, 5, 1.1, 230)
    steps = find_edges(grey, None, thresholds)
    # OpenCV's kernel has fixed-point weights: a grey level may differ by one, its gradient by a few.
    assert np.abs(steps.smoothed - smoothed).max() <= 1
    assert np.abs(steps.gradient - gradient).max() <= 6
    assert ((steps.steep > 0) != steep)[np.abs(gradient - 230) > 6].sum() == 0
    same = plain_detect(grey, thresholds)
    found = detect_floating(grey, thresholds=thresholds)
    assert len(found) == len(same) > 0
    assert np.allclose(found.area, [area for area, _, _ in same], atol=6)
    assert np.allclose(found.uv, [centre for _, *centre in same], atol=0.3)


def test_a_warm_rectangle_is_found_where_it_is_and_as_large():
    image = sea(noise=0.05)
    image[30:50, 40:90] += 12
    found = detect_floating(image)
    assert len(found) == 1
    assert np.allclose(found.uv[0], [64.5, 39.5], atol=0.1)
    # The contour reaches beyond the edge by less than the blur of both kernels.
    assert 20 * 50 < found.area[0] < 25 * 55
    warm = 20 * 50 / found.area[0]
    assert np.isclose(found.intensity[0], 288 + 12 * warm, atol=0.05)
    assert found.score[0] >= 1
    assert np.allclose(found.box[0, :2] + found.box[0, 2:] / 2, [65, 40], atol=1)


def test_nothing_is_found_on_an_even_or_noisy_sea():
    assert len(detect_floating(sea())) == 0
    assert len(detect_floating(sea(noise=0.3, height=512, width=640))) == 0
    assert detect_floating(sea()).covariance.shape == (0, 2, 2)


def test_an_image_of_grey_levels_is_taken_as_it_is_and_counts_as_kelvin_by_their_gain():
    image = sea(noise=0.05)
    image[30:50, 40:90] += 12
    counts = np.round((image - 273.15) * 25 + 4000).astype(np.uint16)
    assert np.allclose(detect_floating(counts).uv, detect_floating(image).uv, atol=0.1)
    grey = np.full((90, 120), 90, np.uint8)
    grey[30:50, 40:90] = 130  # 40 levels are too little for a threshold of 230, whatever the range
    assert len(detect_floating(grey)) == 0
    grey[30:50, 40:90] = 250
    assert len(detect_floating(grey)) == 1


def test_a_narrow_range_is_not_stretched_to_black_and_white():
    thresholds = FloatingThresholds(scaling="stretched")
    image = sea(noise=0.1)
    assert np.ptp(to_grey(image, None, thresholds).astype(float)) < 90
    image[:45] += 30
    grey = to_grey(image, None, thresholds)
    assert grey.min() == 0 and grey.max() == 255
    fixed = to_grey(image, None, FloatingThresholds(scaling="fixed"))
    assert 0.4 < (fixed == 255).mean() < 0.6
    assert 3 < fixed[45:].std() < 9  # 0.1 K at 255 levels over 4 K


def test_whether_the_contour_or_the_filled_blob_is_small():
    """A ring of steep pixels is counted before it is filled, H 4.3, or after."""
    image = sea()
    image[20:70, 30:100] += 12
    edges = int((find_edges(image, None, FloatingThresholds()).steep > 0).sum())
    assert edges < 50 * 70
    between = (edges + 50 * 70) / 2
    assert len(detect_floating(image, thresholds=FloatingThresholds(smallest_area=between))) == 0
    filled = FloatingThresholds(smallest_area=between, area_of="filled")
    assert len(detect_floating(image, thresholds=filled)) == 1
    # What is too large leaves nothing behind, also not the inner side of its ring.
    largest = FloatingThresholds(smallest_area=10, largest_area=edges - 1)
    assert len(detect_floating(image, thresholds=largest)) == 0
    largest = FloatingThresholds(smallest_area=10, largest_area=between)
    assert len(detect_floating(image, thresholds=largest)) == 1
    largest = FloatingThresholds(smallest_area=10, largest_area=between, area_of="filled")
    assert len(detect_floating(image, thresholds=largest)) == 0


def test_a_buoy_in_the_corner_of_a_slanting_ships_box_is_lost_by_boxes_and_kept_by_contours():
    image = sea(200, 200)
    v, u = np.mgrid[:200, :200]
    image[(np.abs(u - v) < 14) & (u + v > 60) & (u + v < 340)] += 12
    image[40:50, 140:152] += 12
    assert len(detect_floating(image)) == 1
    assert len(detect_floating(image, thresholds=FloatingThresholds(nested="contours"))) == 2


@pytest.mark.parametrize(
    "where",
    [
        (slice(0, 20), slice(40, 80)),
        (slice(30, 60), slice(0, 30)),
        (slice(0, 40), slice(0, 50)),
        (slice(0, 90), slice(45, 75)),
        (slice(30, 60), slice(0, 120)),
    ],
)
def test_what_the_border_cuts_is_filled_and_is_one(where):
    image = sea(noise=0.05)
    image[where] += 12
    found = find_objects(image)
    assert len(found.detections) == 1
    assert (found.labels[where] == 1).mean() > 0.99
    assert (found.labels > 0).mean() < 1.35 * (image > 294).mean()
    assert cut_sides(found.detections.box[0], image.shape).any()
    assert np.trace(found.detections.covariance[0]) > 50


def test_a_cold_object_at_the_border_is_filled_where_it_is_said_to_be_cold():
    image = sea(noise=0.05)
    image[0:30, 40:80] -= 12
    cold = find_objects(image, thresholds=FloatingThresholds(warm=False))
    assert (cold.labels[0:30, 40:80] == 1).mean() > 0.99
    assert (cold.labels > 0).mean() < 0.2


def test_pixels_that_show_nothing_have_no_edges():
    image, valid = sea(noise=0.05), np.ones((90, 120), bool)
    image[:, :25] = 0.0
    valid[:, :25] = False
    image[40:60, 60:90] += 12
    assert len(detect_floating(image, valid)) == 1
    image[:, :25] = np.nan
    found = detect_floating(image, valid)
    assert len(found) == 1
    assert np.allclose(found.uv[0], [74.5, 49.5], atol=0.1)
    assert np.allclose(detect_floating(image).uv, found.uv)
    assert len(detect_floating(image, np.zeros_like(valid))) == 0
