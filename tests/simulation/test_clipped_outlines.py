"""Cut polygons and their moments: identities, closed forms, and OpenCV's moments of filled pixels."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.simulation.camera_detections import clip_polygon, moments, visible_part

WIDTH, HEIGHT = 640.0, 512.0


def rectangle(u, v, length, beam, angle):
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, beam / 2]
    cos, sin = np.cos(angle), np.sin(angle)
    return half @ np.array([[cos, sin], [-sin, cos]]) + [u, v]


rectangles = st.builds(
    rectangle,
    st.floats(-300, 900),
    st.floats(-300, 800),
    st.floats(20, 900),
    st.floats(20, 400),
    st.floats(-3.2, 3.2),
)


def area(polygon):
    return moments(polygon)[0] if len(polygon) > 2 else 0.0


@given(rectangles)
def test_parts_on_either_side_of_a_cut_make_up_the_whole(polygon):
    """Nine images tile the plane; what they show adds up to the polygon, in area and in first moment."""
    big = 4000.0
    total, first = 0.0, np.zeros(2)
    for u0, u1 in ((-big, 0.0), (0.0, WIDTH), (WIDTH, big)):
        for v0, v1 in ((-big, 0.0), (0.0, HEIGHT), (HEIGHT, big)):
            part = clip_polygon(polygon - [u0, v0], u1 - u0, v1 - v0)
            if area(part) > 1e-6:
                total += area(part)
                first += area(part) * (moments(part)[1] + [u0, v0])
    whole, centre, _ = moments(polygon)
    assert total == pytest.approx(whole, rel=1e-9)
    assert first / total == pytest.approx(centre, abs=1e-3)


@given(st.floats(-500, 5000), st.floats(20, 900), st.floats(5, 19), st.floats(-1.5, 1.5))
def test_moments_of_a_rectangle_are_known(u, length, beam, angle):
    size, centre, covariance = moments(rectangle(u, 3.0, length, beam, angle))
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert size == pytest.approx(length * beam)
    assert centre == pytest.approx([u, 3.0], abs=1e-6)
    expected = axes @ np.diag([length**2 / 12, beam**2 / 12]) @ axes.T
    assert covariance == pytest.approx(expected, abs=1e-6 * length**2)


def test_a_cut_outline_is_what_filled_pixels_say():
    """OpenCV's moments of the pixels whose centres lie inside: a hundred across, so to a part in 200."""
    polygon = rectangle(600, 60, 500, 90, 0.6)
    blob = visible_part(polygon, WIDTH, HEIGHT)
    assert blob.cut
    assert np.linalg.norm(blob.centre - [600, 60]) > 30  # not where the middle of the whole is
    v, u = np.mgrid[0 : int(HEIGHT), 0 : int(WIDTH)] + 0.5
    edge = np.roll(polygon, -1, axis=0) - polygon
    side = [e[0] * (v - p[1]) - e[1] * (u - p[0]) for p, e in zip(polygon, edge, strict=True)]
    filled = np.all(np.array(side) > 0, axis=0) | np.all(np.array(side) < 0, axis=0)
    m = cv2.moments(filled.astype(np.uint8), binaryImage=True)
    assert blob.area == pytest.approx(m["m00"], rel=0.005)
    assert blob.centre == pytest.approx([m["m10"] / m["m00"] + 0.5, m["m01"] / m["m00"] + 0.5], abs=0.5)
    covariance = np.array([[m["mu20"], m["mu11"]], [m["mu11"], m["mu02"]]]) / m["m00"]
    sizes, axes = np.linalg.eigh(covariance)
    assert [blob.minor, blob.major] == pytest.approx(4 * np.sqrt(sizes), rel=0.005)
    assert np.tan(blob.angle) == pytest.approx(axes[1, 1] / axes[0, 1], rel=0.01)


def test_nothing_shows_of_what_is_outside_or_behind_the_camera():
    for polygon in (rectangle(-400, 0, 100, 100, 0.0), np.full((4, 2), np.nan)):
        blob = visible_part(polygon, WIDTH, HEIGHT)
        assert blob.area == 0
        assert np.isnan(blob.centre).all()
        assert not blob.cut
