"""Things of one colour: limits as printed, pixels of the whole image, honest centres."""

from __future__ import annotations

import colorsys
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.stats import chi2

from wildlab.detection.colour import Colour, coloured, find_coloured
from wildlab.detection.detections import Detections

BLUE = (10, 110, 240)


def scene(places: list[tuple[float, float]], size: tuple[float, float], shape: tuple[int, int]) -> np.ndarray:
    """Rectangles (centre u, v) of the tarpaulin's blue on green ground, drawn to a sixteenth of a pixel."""
    image = np.full((*shape, 3), (60, 110, 70), np.uint8)
    for u, v in places:
        corners = np.array(
            [(u + a * size[0] / 2, v + b * size[1] / 2) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )
        fine = np.round(16 * corners).astype(np.int32)
        cv2.fillPoly(image, [fine], BLUE, lineType=cv2.LINE_AA, shift=4)
    return image


def all_of(image: np.ndarray) -> np.ndarray:
    return np.ones(image.shape[:2], bool)


def found_in(image: np.ndarray, **kinds: Any) -> Detections:
    return find_coloured(image, all_of(image), Colour(**kinds))


def test_the_limits_are_those_of_another_conversion_of_colours():
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (60, 80, 3), dtype=np.uint8)
    image[:30, :, 0] //= 6
    image[:30, :, 2] |= 0xC0
    mask = coloured(cv2.cvtColor(image, cv2.COLOR_RGB2HSV), Colour(hue=(90, 130)))
    own = np.array([[colorsys.rgb_to_hsv(*(pixel / 255)) for pixel in row] for row in image])
    hue, saturation, value = np.moveaxis(own, -1, 0)
    inside = (np.abs(hue * 180 - 110) <= 20) & (saturation >= 0.75) & (value >= 0.75)
    # OpenCV rounds hue and saturation to whole numbers: only what is near a limit may differ.
    near = (np.abs(np.abs(hue * 180 - 110) - 20) < 1) | (np.abs(saturation - 0.75) < 0.005)
    assert mask.sum() > 100 and (mask == inside)[~near].all()


def test_only_the_largest_is_found():
    image = scene([(200, 180), (400, 180)], (20, 12), (360, 640))
    image[170:190, 100:160] = BLUE
    assert found_in(image).uv.tolist() == [[129.5, 179.5]]
    every = found_in(image, only_largest=False)
    assert len(every) == 3 and (np.diff(every.area) <= 0).all()
    # The largest is at the horizon: what is smaller is not taken in its place, as in print.
    image[0:40] = BLUE
    assert len(found_in(image)) == 0


def test_what_is_too_small_or_outside_of_the_scene_is_not_found():
    image = scene([(300, 180)], (6, 5), (360, 640))
    assert len(found_in(image)) == 0
    assert len(found_in(image, smallest_px=20)) == 1
    image = scene([(300, 180)], (30, 20), (360, 640))
    valid = all_of(image)
    valid[150:210, 250:350] = False
    assert len(find_coloured(image, valid)) == 0


def test_red_goes_through_zero():
    image = np.full((360, 640, 3), 90, np.uint8)
    image[150:170, 300:330] = (250, 10, 30)
    assert len(found_in(image, hue=(170, 10))) == 1
    assert len(found_in(image)) == 0


@pytest.mark.slow
def test_centres_lie_in_their_ellipses_as_often_as_they_say():
    rng = np.random.default_rng(5)
    squares, apart = [], []
    for _ in range(300):
        u, v = rng.uniform([100, 120], [540, 240])
        clean = scene([(u, v)], tuple(rng.uniform([14, 10], [40, 24])), (360, 640))
        image = np.clip(clean + rng.normal(0, 6, clean.shape), 0, 255).astype(np.uint8)
        found = found_in(image, part=0.01, hue=(95, 115))
        assert len(found) == 1
        off = found.uv[0] - [u, v]
        squares.append(off @ np.linalg.solve(found.covariance[0], off))
        apart.append(off)
    # Drawn ones have no weakly coloured rim, for which the default allows more.
    assert np.mean(np.array(squares) < chi2.ppf(0.9, 2)) > 0.87
    assert np.abs(np.mean(apart, axis=0)).max() < 0.06


@pytest.mark.parametrize("factor", [2, 3])
def test_an_image_of_larger_pixels_gives_all_lengths_times_their_size(factor):
    """Each pixel made a block of pixels: what was found is the same, about the middle of the block."""
    small = scene([(40.3, 30.2)], (9.0, 5.0), (60, 80))
    large = np.repeat(np.repeat(small, factor, axis=0), factor, axis=1)
    kinds = Colour(border_px=(0, 0), width_px=80)
    one, other = (find_coloured(image, all_of(image), kinds) for image in (small, large))
    assert len(one) == len(other) == 1
    assert np.allclose(other.uv, factor * one.uv + (factor - 1) / 2)
    assert np.allclose(other.covariance, factor**2 * one.covariance)
    assert np.allclose(other.area, factor**2 * one.area) and np.allclose(other.score, factor**2 * one.score)
    assert np.allclose(other.axes, factor * one.axes) and np.allclose(
        other.box[:, 2:], factor * one.box[:, 2:]
    )
    # The left edge of a pixel is half a pixel before its middle, in both.
    assert np.allclose(other.box[:, :2] + 0.5, factor * (one.box[:, :2] + 0.5))


@pytest.mark.parametrize(
    ("inside", "outside"),
    [((30, 180), (29, 180)), ((609, 180), (610, 180)), ((300, 60), (300, 59)), ((300, 299), (300, 300))],
)
def test_a_centre_on_the_limit_of_the_border_is_inside(inside, outside):
    """The printed limits, 30 px and 60 px."""
    for (u, v), found in ((inside, 1), (outside, 0)):
        image = np.full((360, 640, 3), (60, 110, 70), np.uint8)
        image[v - 6 : v + 7, u - 8 : u + 9] = BLUE
        assert len(found_in(image)) == found
