"""Moments of regions against closed forms; Hu's invariants are invariant."""

import cv2
import numpy as np
import pytest

from tests.detection.ellipses import inside
from wildlab.detection.centres import boundary_spread
from wildlab.detection.detections import describe


def shape_of(mask):
    """Of the only region: place, area, axes, angle and Hu's invariants."""
    found = describe(mask.astype(np.int32), mask, np.ones(mask.shape, bool))
    return found.uv[0], found.area[0], found.axes[0], found.orientation[0], found.hu[0]


def drawn_ellipse(centre, axes, angle):
    """A tenth of a pixel about the smooth one."""
    return inside(centre, axes, angle, (400, 400)).astype(np.uint8)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 3), (40, 90)])
def test_a_rectangle_has_the_moments_of_a_rectangle(width, height):
    mask = np.zeros((120, 130), np.uint8)
    mask[5 : 5 + height, 11 : 11 + width] = 1
    centre, area, axes, angle, _ = shape_of(mask)
    assert area == width * height
    assert np.allclose(centre, [11 + (width - 1) / 2, 5 + (height - 1) / 2])
    assert np.allclose(axes, np.array(sorted([width, height]))[::-1] * 4 / np.sqrt(12))
    if width != height:
        assert np.isclose(np.cos(angle), float(width > height), atol=1e-12)


@pytest.mark.parametrize("angle", [-1.2, -0.3, 0.0, 0.7, 1.5])
def test_an_ellipse_has_its_own_axes_and_angle(angle):
    centre, _, axes, found, _ = shape_of(drawn_ellipse((203.3, 187.8), (160.0, 60.0), angle))
    assert np.allclose(centre, [203.3, 187.8], atol=0.1)
    assert np.allclose(axes, [160.0, 60.0], rtol=2e-3)
    assert abs(np.sin(found - angle)) < 2e-3


def test_hu_invariants_do_not_change_with_place_angle_or_size_and_tell_shapes_apart():
    own = shape_of(drawn_ellipse((200, 200), (150.0, 60.0), 0.3))[-1]
    for centre, angle, size in (((170, 230), 0.3, 1.0), ((200, 200), 1.4, 1.0), ((200, 200), 0.3, 0.5)):
        other = shape_of(drawn_ellipse(centre, (150.0 * size, 60.0 * size), angle))[-1]
        assert np.isclose(other[0], own[0], rtol=5e-3)
        assert np.isclose(other[1], own[1], rtol=2e-2)
    # Closed form of the first for an ellipse with semi-axes a and b: (a / b + b / a) / (4 pi).
    assert np.isclose(own[0], (75 / 30 + 30 / 75) / (4 * np.pi), rtol=2e-3)
    triangle = cv2.fillPoly(np.zeros((400, 400), np.uint8), [np.array([[50, 60], [320, 90], [110, 300]])], 1)
    turned = np.rot90(triangle)
    assert np.allclose(shape_of(triangle)[-1][:6], shape_of(turned)[-1][:6], rtol=1e-9)
    assert not np.isclose(shape_of(triangle)[-1][2], own[2], rtol=0.5)


def test_the_boundary_of_a_disc_in_closed_form():
    """Along a circle of radius r the integral of (r - c)(r - c)^T is pi r^3 times the identity."""
    mask = drawn_ellipse((200, 200), (240.0, 240.0), 0.0)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    spread = boundary_spread(outlines[0], np.array([200.0, 200.0]))
    assert np.allclose(spread, np.pi * 120.0**3 * np.eye(2), rtol=0.07, atol=1e3)
