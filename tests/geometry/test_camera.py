"""The camera against its own inverse, finite differences and OpenCV's conventions."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.geometry.camera import (
    Camera,
    camera_from_data_sheet,
    distort,
    distortion_jacobian,
    normalise,
    normalise_jacobian,
    project,
    undistort,
    undistort_approximately,
)

SKYDIO = Camera(
    4056, 3040, 4826.1, 4567.0, 2028.0, 1520.0, 0.0, (-0.077582, 0.197062, 0.001172, 0.000239, -0.06815)
)
coefficient = st.floats(-0.15, 0.15)
tangential = st.floats(-0.005, 0.005)


def test_data_sheet_gives_the_printed_theoretical_matrix():
    """H (2.4): 19 mm lens, 640 x 512 pixels of 17 micrometres."""
    camera = camera_from_data_sheet(640, 512, 19e-3, 640 * 17e-6, 512 * 17e-6)
    assert np.allclose(camera.matrix, [[1117.7, 0, 320], [0, 1117.7, 256], [0, 0, 1]], atol=0.06)


@given(
    st.floats(-0.4, 0.4),
    st.floats(-0.3, 0.3),
    coefficient,
    coefficient,
    tangential,
    tangential,
    st.floats(-5, 5),
)
def test_pixels_come_back_through_distortion(x, y, k1, k2, p1, p2, skew):
    camera = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, skew, (k1, k2, p1, p2, 0.0))
    uv = project(camera, np.array([[x, y, 1.0]]))
    xy = normalise(camera, uv)
    assert np.abs(project(camera, np.column_stack([xy, [1.0]])) - uv).max() <= 1e-6
    assert np.allclose(xy, [[x, y]], atol=1e-9)


def test_beyond_the_fold_of_the_polynomial_there_is_no_inverse():
    """With k1 = -0.5 the image of the radius ends at r = sqrt(2/3), distorted 0.544."""
    inverse = undistort(np.array([[0.54, 0.0], [0.56, 0.0]]), (-0.5, 0, 0, 0, 0))
    assert np.isfinite(inverse[0]).all()
    assert np.isnan(inverse[1]).all()


def before_the_fold(xy, distortion):
    """Whether the image keeps its orientation all the way from the centre to a point (2,)."""
    jacobian = distortion_jacobian(np.linspace(0, 1, 101)[:, None] * xy, distortion)
    return bool((np.linalg.det(jacobian) > 0).all() and (jacobian[:, 0, 0] > 0).all())


def test_lenses_stronger_than_any_have_no_other_inverse():
    """A point before the fold comes back or is NaN (measured 3.2 %); seldom one beyond it comes (1.5 %)."""
    random = np.random.default_rng(0)
    low, high = (-0.6, -0.1, -0.1, -0.1, -0.1), (0.3, 0.3, 0.1, 0.1, 0.1)
    lost, beyond, n = 0, 0, 3000
    for distortion in random.uniform(low, high, (n, 5)):
        xy = random.uniform(-1.2, 1.2, 2)
        (back,) = undistort(distort(xy[None], distortion), distortion)
        if np.isnan(back).any():
            lost += before_the_fold(xy, distortion)
        elif np.abs(back - xy).max() > 1e-6:
            beyond += before_the_fold(xy, distortion) or not before_the_fold(back, distortion)
    assert lost / n < 0.04 and beyond / n < 0.02


@pytest.mark.parametrize("axis", [0, 1])
def test_near_the_fold_of_a_decentred_lens_the_root_is_that_of_the_quadratic(axis):
    """Along its axis it takes x to x + 3 p x^2."""
    seen, p, k = np.zeros(2), 0.1, np.zeros(5)
    seen[axis], k[3 - axis] = -0.8, p
    found = undistort(seen[None], k)[0]
    assert found[axis] == pytest.approx((np.sqrt(1 + 12 * p * seen[axis]) - 1) / (6 * p), rel=1e-9)
    assert found[1 - axis] == 0


def test_no_step_leaps_over_the_fold():
    xy, distortion = np.array([[1.032, 1.176]]), (-0.036, 0.286, -0.075, -0.01, -0.018)
    assert np.allclose(undistort(distort(xy, distortion), distortion), xy, atol=1e-9)


@pytest.mark.parametrize(
    ("target", "distortion"),
    [
        ((-0.999, 1.117), (-0.243, 0.079, 0.041, 0.062, -0.075)),
        ((1.195, -0.909), (-0.282, -0.088, 0.075, -0.021, -0.091)),
    ],
)
def test_a_root_where_the_image_is_turned_over_is_none(target, distortion):
    """Turned by half a circle, the image keeps its orientation, but no lens does that."""
    assert np.isnan(undistort(np.array([target]), distortion)).all()


@given(
    st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), coefficient, coefficient, tangential, tangential, coefficient
)
def test_distortion_jacobian_against_finite_differences(x, y, k1, k2, p1, p2, k3):
    k = (k1, k2, p1, p2, k3)
    h = 1e-6
    numeric = np.stack(
        [
            (distort(np.array([x, y]) + h * e, k) - distort(np.array([x, y]) - h * e, k)) / (2 * h)
            for e in np.eye(2)
        ],
        axis=-1,
    )
    assert np.allclose(distortion_jacobian(np.array([x, y]), k), numeric, atol=1e-8)


@pytest.mark.parametrize("camera", [SKYDIO, Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, 3.0)])
def test_normalise_jacobian_against_finite_differences(camera):
    uv = np.array([[100.0, 50.0], [300.0, 400.0]])
    h = 0.01
    numeric = np.stack(
        [(normalise(camera, uv + h * e) - normalise(camera, uv - h * e)) / (2 * h) for e in np.eye(2)], -1
    )
    assert np.allclose(normalise_jacobian(camera, normalise(camera, uv)), numeric, rtol=1e-6, atol=1e-12)


def test_flodell_s_inverse_is_close_for_a_narrow_lens_and_poor_for_a_wide_one():
    """F 7.1: k1 = 0.446. The exact inverse is the yardstick."""
    k = (0.446, 0, 0, 0, 0)
    for radius, bound in ((0.1, 1e-5), (0.2, 5e-4)):
        ideal = np.array([[radius, 0.0]])
        error = np.abs(undistort_approximately(distort(ideal, k), k[0]) - ideal).max()
        assert 0 < error < bound
    wide = np.array([[0.8, 0.0]])
    assert np.abs(undistort_approximately(distort(wide, k), k[0]) - wide).max() > 0.01


def test_distortion_agrees_with_opencv():
    rng = np.random.default_rng(0)
    p_c = np.column_stack([rng.uniform(-0.4, 0.4, 200), rng.uniform(-0.3, 0.3, 200), np.ones(200)]) * 7.0
    expected = cv2.projectPoints(p_c, np.zeros(3), np.zeros(3), SKYDIO.matrix, np.array(SKYDIO.distortion))[
        0
    ][:, 0]
    assert np.abs(project(SKYDIO, p_c) - expected).max() < 1e-8
