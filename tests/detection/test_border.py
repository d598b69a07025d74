"""The centre of what the border cuts, H (4.7)."""

import numpy as np
import pytest

from tests.detection.ellipses import inside
from wildlab.detection.centres import adjust_at_border, border_moves, to_border
from wildlab.detection.floating import detect_floating


def ellipse_image(centre=(8.0, 90.0), axes=(120.0, 24.0), angle=0.1):
    return (288.0 + 12.0 * inside(centre, axes, angle, (200, 260))).astype(np.float32)


@pytest.mark.parametrize(
    ("centre", "angle"),
    [((8.0, 90.0), 0.1), ((250.0, 90.0), -0.2), ((120.0, 5.0), 1.5), ((120.0, 192.0), 1.7)],
)
def test_the_centre_comes_near_to_the_true_one_and_is_inside_what_is_stated(centre, angle):
    image = ellipse_image(centre, angle=angle)
    seen = detect_floating(image)
    assert len(seen) == 1
    moved = adjust_at_border(seen, image.shape, 124.0, 4.0)
    before, after = (np.linalg.norm(found.uv[0] - centre) for found in (seen, moved))
    assert before > 18
    assert after < before / 3
    miss = moved.uv[0] - centre
    assert miss @ np.linalg.solve(moved.covariance[0], miss) < 9.2
    assert np.trace(moved.covariance[0]) < np.trace(seen.covariance[0])


def test_h_4_7_holds_for_the_full_axis():
    """Cut near its end, along the axis: the centre moves by L/2 - (a - i) towards the border."""
    image = ellipse_image((55.0, 100.0), (120.0, 30.0), 0.0)
    seen = detect_floating(image)
    i = abs(to_border(seen.uv[0], np.array([1.0, 0.0]), 260, 200))
    moves = border_moves(seen, image.shape, np.array([130.0]))
    assert moves == pytest.approx(np.array([[seen.axes[0, 0] - i - 130.0 / 2, 0.0]]))


@pytest.mark.parametrize(
    ("centre", "axes", "angle", "length", "why"),
    [
        ((130.0, 100.0), (120.0, 24.0), 0.3, 150.0, "whole"),
        ((3.0, 100.0), (60.0, 56.0), 0.0, 150.0, "round"),
        ((130.0, 100.0), (400.0, 30.0), 0.0, 150.0, "cut at both ends"),
        ((130.0, 4.0), (120.0, 30.0), 0.0, 150.0, "along the border"),
        ((8.0, 90.0), (120.0, 24.0), 0.1, np.nan, "of unknown length"),
    ],
)
def test_what_is_whole_round_or_cut_otherwise_stays(centre, axes, angle, length, why):
    image = ellipse_image(centre, axes, angle)
    seen = detect_floating(image)
    assert len(seen) == 1, why
    assert np.array_equal(adjust_at_border(seen, image.shape, length).uv, seen.uv), why
