"""The local-contrast chain and F's chain on pictures whose content is known."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from tests.detection.ellipses import inside as inside_ellipse
from tests.refused import refused
from wildlab.detection.contrast import Contrast, find_by_contrast
from wildlab.detection.detections import Detections, describe, join, no_detections
from wildlab.detection.warm import (
    Warm,
    block_from_distance,
    enhance,
    find_warm,
    gate_from_distance,
    subtract_background,
    to_grey,
)

EVERYWHERE = np.ones((160, 200), bool)


def ground(seed: int = 1, noise: float = 2.0) -> np.ndarray:
    """Uneven warm ground, brighter to the right."""
    rng = np.random.default_rng(seed)
    return 90 + np.linspace(0, 30, 200)[None] + rng.normal(0, noise, (160, 200))


def ellipse(u: float, v: float, a: float, b: float, angle: float = 0.0) -> np.ndarray:
    return inside_ellipse((u, v), (2 * a, 2 * b), angle, EVERYWHERE.shape)


def by_contrast(image: np.ndarray, **thresholds: Any) -> Detections:
    return find_by_contrast(image, EVERYWHERE, Contrast(**thresholds))


def warm(image: np.ndarray, **thresholds: Any) -> Detections:
    return find_warm(image, EVERYWHERE, Warm(**thresholds))


def test_shape_of_an_ellipse_comes_out():
    inside = ellipse(100, 80, 24, 9, 0.6)
    found = describe(inside.astype(np.int32), 5.0 + 10.0 * inside, EVERYWHERE)
    assert np.allclose(found.uv, [[100, 80]], atol=0.1)
    assert np.allclose(found.axes, [[48, 18]], rtol=0.03)
    assert found.orientation[0] == pytest.approx(0.6, abs=0.02)
    assert found.area[0] == inside.sum() and found.intensity[0] == pytest.approx(15.0)
    rows, columns = np.nonzero(inside)
    assert found.box[0].tolist() == [
        columns.min() - 0.5, rows.min() - 0.5, np.ptp(columns) + 1, np.ptp(rows) + 1
    ]  # fmt: skip


def test_hu_moments_of_a_lopsided_shape_are_those_of_opencv():
    inside = ellipse(60, 60, 20, 7, 0.4) | ellipse(75, 75, 9, 9)
    found = describe(inside.astype(np.int32), 1.0 * inside, EVERYWHERE)
    truth = cv2.HuMoments(cv2.moments(inside.astype(np.uint8), binaryImage=True)).ravel()
    assert np.allclose(found.hu[0], truth, rtol=1e-6, atol=1e-15)


def drawn(u: float, v: float, a: float, b: float, angle: float) -> np.ndarray:
    """An ellipse at a place between pixels: its share of each pixel."""
    left, top = int(u) - 24, int(v) - 24
    steps = np.arange(0, 48, 0.125) - 0.4375
    x, y = (steps + left - u)[None], (steps + top - v)[:, None]
    along, across = x * np.cos(angle) + y * np.sin(angle), -x * np.sin(angle) + y * np.cos(angle)
    fine = ((along / a) ** 2 + (across / b) ** 2 <= 1).astype(np.float32)
    image = np.zeros((160, 200), np.float32)
    image[top : top + 48, left : left + 48] = fine.reshape(48, 8, 48, 8).mean(axis=(1, 3))
    return image


@pytest.mark.parametrize(("a", "b", "warmer"), [(9, 5, 20), (4, 3, 40), (18, 9, 60)])
def test_ellipses_hold_the_true_centre_as_often_as_they_say(a, b, warmer):
    """Things that are seen whole, at places between pixels, blurred and in noise."""
    rng = np.random.default_rng(4)
    squared = []
    for _ in range(60):
        u, v, angle = rng.uniform(60, 140), rng.uniform(60, 100), rng.uniform(0, 3)
        shown = warmer * cv2.GaussianBlur(drawn(u, v, a, b, angle), (0, 0), 1.0)
        image = ground(int(rng.integers(1e6))) + shown
        found = by_contrast(image, part=0.0, largest_px=3000)
        assert len(found) == 1
        off = found.uv[0] - [u, v]
        squared.append(off @ np.linalg.solve(found.covariance[0], off))
    assert 0.8 <= np.mean(np.array(squared) < 4.605) <= 1.0
    assert 0.5 < np.mean(squared) < 3.0


def test_what_is_not_seen_widens_the_ellipse():
    image = ground()
    image[100:105, 90:110] += 60
    whole, part = (by_contrast(image, part=one) for one in (0.0, 0.2))
    assert np.allclose(
        part.covariance - whole.covariance, (0.2 * whole.axes[:, :1, None]) ** 2 * np.eye(2), rtol=1e-6
    )


def test_what_stands_out_is_found_and_what_is_too_small_too_large_or_too_long_is_not():
    image = ground()
    image[ellipse(50, 40, 9, 5)] += 40
    image[ellipse(120, 40, 1.2, 1.2)] += 60
    image[100:150, 20:80] += 40
    image[20:22, 60:150] += 60
    found = by_contrast(image, window_px=101, smallest_px=30, largest_px=1000)
    assert np.allclose(found.uv, [[50, 40]], atol=0.5)


def test_two_animals_that_touch_are_two_with_a_share_of_the_peak():
    image = ground(noise=1.0)
    for u in (80, 96):
        image += 80 * np.exp(
            -((np.arange(200)[None] - u) ** 2 + (np.arange(160)[:, None] - 80) ** 2) / (2 * 5**2)
        )
    assert len(by_contrast(image, of_peak=0.0)) == 1
    assert len(by_contrast(image, of_peak=0.85)) == 2


def test_cold_things_are_found_in_a_black_hot_image_only():
    image = ground()
    image[ellipse(50, 40, 9, 5)] -= 40
    assert len(by_contrast(image)) == 0
    found = by_contrast(image, warm_is_bright=False)
    assert np.allclose(found.uv, [[50, 40]], atol=0.5)


# -- F's chain


def test_grey_enhancement_and_background_are_those_of_f():
    colour = np.random.default_rng(1).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    exact = colour @ np.array([0.299, 0.587, 0.114])
    assert np.abs(to_grey(colour) - exact).max() <= 0.51
    grey = to_grey(colour)
    assert (enhance(grey) == np.clip(2 * grey.astype(int) - grey.max(), 0, 255)).all()
    everywhere = np.ones(grey.shape, bool)
    for by, level in (("mean", grey.mean()), ("median", np.median(grey))):
        left = subtract_background(grey, everywhere, by)  # type: ignore[arg-type]
        assert np.abs(left - np.clip(grey - level, 0, 255)).max() <= 1


def test_a_constant_threshold_fails_where_the_background_changes_and_an_adaptive_one_copes():
    image = np.linspace(60, 180, 200)[None] + np.zeros((160, 1))
    for u in (30, 170):
        image[ellipse(u, 80, 9, 6)] += 45
    grey = image.astype(np.uint8)
    constant = Warm(background="none", level=150)
    adaptive = Warm(background="none", threshold="adaptive", level=25, level_is="offset", block_px=51)
    assert len(find_warm(grey, EVERYWHERE, constant)) != 2
    found = find_warm(grey, EVERYWHERE, adaptive)
    assert sorted(np.round(found.uv[:, 0]).astype(int).tolist()) == pytest.approx([30, 170], abs=1)


def test_block_and_gate_shrink_with_the_distance():
    assert block_from_distance(30, 800) > block_from_distance(60, 800) > block_from_distance(120, 800)
    assert block_from_distance(1e6, 800) == 3
    near, far = gate_from_distance(50, 800), gate_from_distance(100, 800)
    assert np.allclose(np.array(near) / 4, far)
    with refused("above zero"):
        block_from_distance(0, 800)
    with refused("middle"):
        Warm(block_px=50)


def at(uv: list[list[float]], score: list[float]) -> Detections:
    labels = np.zeros((160, 200), np.int32)
    for number, (u, v) in enumerate(uv):
        labels[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2] = number + 1
    return describe(labels, 1.0 * (labels > 0), EVERYWHERE, score=score)


@pytest.mark.parametrize("find", [warm, by_contrast])
def test_an_even_image_has_nothing(find):
    assert len(find(np.full((160, 200), 100, np.uint8))) == 0
    assert len(join([no_detections(), no_detections()])) == 0


def test_one_grey_level_on_even_ground_is_rounding_and_not_an_animal():
    image = np.full((160, 200), 100, np.uint8)
    image[60:70, 90:100] = 101
    assert len(by_contrast(image)) == 0
    image[60:70, 90:100] = 110
    assert len(by_contrast(image)) == 1


def test_what_is_too_hot_for_an_animal_is_left_out_in_kelvin():
    """F 8.4: a fire beside a deer, in an image of temperatures."""
    kelvin = np.full((160, 200), 280, np.float32)
    kelvin[ellipse(50, 80, 9, 6)] = 300
    kelvin[ellipse(150, 80, 9, 6)] = 700
    window = (270.0, 310.0)
    assert len(warm(kelvin, window=window)) == 2
    cool = warm(kelvin, window=window, hottest=320.0)
    assert np.allclose(cool.uv, [[50, 80]], atol=0.1) and cool.intensity[0] == 300


def test_noise_of_a_window_keeps_rough_ground_quiet():
    rng = np.random.default_rng(2)
    image = ground(noise=1.0)
    image[:, 100:] += cv2.GaussianBlur(rng.normal(0, 60, (160, 100)), (0, 0), 1.5)
    image[ellipse(50, 80, 6, 4)] += 40
    over_all = by_contrast(image, peak=7)
    by_window = by_contrast(image, peak=7, deviation="window")
    assert len(by_window) < len(over_all) / 2 and np.abs(by_window.uv - [50, 80]).sum(axis=1).min() < 1


def test_the_warmest_part_of_a_body_is_not_taken_for_all_of_it():
    """A hot end: the centre is off by as much as all that stands out lies beside it; the ellipse says so."""
    body, hot = ellipse(90, 80, 20, 6), ellipse(104, 80, 4, 4)
    image = np.full((160, 200), 100.0) + np.random.default_rng(1).normal(0, 1, (160, 200))
    image[body] += 40
    even = by_contrast(image, part=0.0)
    image[hot] += 100
    uneven = by_contrast(image, part=0.0)
    assert len(even) == len(uneven) == 1 and np.allclose(even.uv, [[90, 80]], atol=0.2)
    off = uneven.uv[0] - [90, 80]
    assert off[0] > 10
    # Along the body by that much, across it no more than before.
    assert np.isclose(np.sqrt(uneven.covariance[0, 0, 0]), off[0], rtol=0.1)
    assert uneven.covariance[0, 1, 1] < 0.1 > even.covariance[0].max()
    # Two hot ends: which of them all the rest belongs to is not known, and nothing is added.
    image[ellipse(76, 80, 4, 4)] += 100
    two = by_contrast(image, part=0.0)
    assert len(two) == 2 and two.covariance.max() < 0.5


def test_limits_of_the_area_are_themselves_allowed():
    image = np.full((160, 200), 90, np.uint8)
    image[60:66, 40:50] = 200
    # A rectangle of 10 by 6 pixels has 60 of them, whatever its contour's polygon.
    assert len(warm(image, smallest_px=60, largest_px=60)) == 1
    assert len(warm(image, smallest_px=61, largest_px=900)) == 0
    assert len(warm(image, smallest_px=1, largest_px=59)) == 0
    rough = ground(noise=1.0)
    rough[ellipse(90, 80, 7, 5)] += 60
    for of_peak in (0.0, 0.5):
        one = by_contrast(rough, of_peak=of_peak)
        area = float(one.area[0])
        kept = Contrast(of_peak=of_peak, smallest_px=area, largest_px=area)
        assert np.allclose(find_by_contrast(rough, EVERYWHERE, kept).uv, one.uv)


@pytest.mark.parametrize("sd", [4.0, 9.0])
def test_the_ellipse_of_a_warm_animal_grows_with_the_noise_as_it_is(sd):
    """With all else as it is, what noise adds goes with its square."""
    image = np.full((160, 200), 60, np.uint8)
    image[ellipse(90, 80, 10, 6)] = 220
    labels = np.asarray(ellipse(90, 80, 10, 6), np.int32)
    noisy = np.clip(image + np.random.default_rng(3).normal(0, sd, image.shape), 0, 255).astype(np.uint8)
    thresholds = Warm(background="none", level=150, part=0.0, window=(0.0, 255.0))
    found = find_warm(noisy, EVERYWHERE, thresholds).covariance[0]
    stated = describe(labels, noisy, EVERYWHERE, contrast=noisy, noise=sd, part=0.0).covariance[0]
    assert np.allclose(np.diag(found), np.diag(stated), rtol=0.12)


def test_what_touches_a_border_may_go_on_beyond_it_by_as_much_as_is_seen():
    """Evenly spread over its own extent: a twelfth of its square, across the border that it touches."""
    image = np.full((160, 200), 10.0)
    covariances = []
    for left in (90, 0):
        labels = np.zeros((160, 200), np.int32)
        labels[70:80, left : left + 24] = 1
        found = describe(labels, image + 40 * labels, EVERYWHERE, noise=1.0, part=0.0)
        covariances.append(found.covariance[0])
    inside, cut = covariances
    assert np.allclose(cut - inside, np.diag([24**2 / 12, 0.0]))


def test_an_empty_border_gives_nothing_and_hides_nothing():
    image, valid = ground(), EVERYWHERE.copy()
    valid[:30] = False
    valid[100:108, 60:72] = False
    image[~valid] = 0
    image[ellipse(100, 45, 8, 5)] += 40
    found = find_by_contrast(image, valid)
    assert np.allclose(found.uv, [[100, 45]], atol=0.5)
