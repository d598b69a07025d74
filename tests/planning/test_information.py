"""Information of a grid, held against numerical derivatives, plain inverses and the letter of appendix A."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.planning.ground import bearing_information, bearing_jacobian
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.geometry.frames import wrap
from wildlab.geometry.viewsheds import field_of_view, in_field_of_view
from wildlab.planning.legs import SearchSensor
from wildlab.planning.planner import detection_probability, inverse_traces

SENSOR = SearchSensor((0.3, 0.2), sd=0.02, reach=100.0, nearest=1e-6)
coordinate = st.floats(-300, 300)
point = st.tuples(coordinate, coordinate, st.floats(-50, 50)).filter(lambda p: np.hypot(p[0], p[1]) > 1.0)
camera_at = np.array([0.0, 0.0, -80.0])


def matrices(seed: int, count: int = 20) -> np.ndarray:
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(count, 3, 3)) * 10 ** rng.uniform(-2, 1, (count, 1, 3))
    return half @ np.swapaxes(half, 1, 2) + 1e-4 * np.eye(3)


def azimuth_elevation(p):
    """F (5.7): from north clockwise, and above the horizon."""
    north, east, down = p - camera_at
    return np.array([np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))])


def test_at_its_reach_one_in_e_is_detected():
    sensor, at = SearchSensor((0.3, 0.2), sd=0.02, reach=70.0), [0.0, 0.0, -70.0]
    below = detection_probability([[0.0, 0.0, 0.0], [0.0, 0.0, -35.0]], at, R_MC_DOWN, sensor)
    assert below == pytest.approx(np.exp([-1.0, -0.25]))


@settings(deadline=None, max_examples=100)
@given(point)
def test_the_jacobian_is_the_numerical_derivative(p):
    p = np.array(p)
    H = bearing_jacobian(p[None], camera_at)[0]
    step = 1e-3
    for axis in range(3):
        by = step * np.eye(3)[axis]
        before, after = (azimuth_elevation(q) for q in (p - by, p + by))
        numeric = wrap(after - before) / (2 * step)
        assert numeric == pytest.approx(H[:, axis], abs=1e-6)


def test_straight_below_the_azimuth_tells_no_more_than_from_nearest():
    below = np.array([[0.0, 0.0, 0.0]])
    assert np.isnan(bearing_jacobian(below, camera_at)).any()
    sensor = SearchSensor((0.3, 0.2), sd=0.02, reach=100.0, nearest=5.0)
    Y = bearing_information(below, camera_at, sensor)[0]
    assert np.diag(Y) == pytest.approx([1 / (0.02 * 80) ** 2, 1 / (0.02 * 5) ** 2, 0])
    beside = bearing_information([[5.0, 0.0, 0.0]], camera_at, sensor)[0]
    assert beside[1, 1] == pytest.approx(Y[1, 1])
    assert bearing_information([[50.0, 0.0, 0.0]], camera_at, sensor)[0, 1, 1] == pytest.approx(1)


def test_the_field_of_view_is_that_of_a_camera_without_distortion():
    camera = Camera(720, 480, 1267.0, 1117.0, 360.0, 240.0)
    halves = field_of_view(camera)
    rng = np.random.default_rng(2)
    points = rng.uniform(-60, 60, (400, 3)) * [1, 1, 0.1]
    x, y, z = ((points - camera_at) @ R_MC_DOWN).T
    u, v = 360 + 1267 * x / z, 240 + 1117 * y / z
    inside = (u >= 0) & (u <= 720) & (v >= 0) & (v <= 480)
    assert 20 < inside.sum() < 380
    assert (in_field_of_view(halves, points, camera_at, R_MC_DOWN) == inside).all()
    behind = points * [1, 1, 0] - [0, 0, 160]
    assert not in_field_of_view(halves, behind, camera_at, R_MC_DOWN).any()


def test_the_trace_of_the_inverse_by_plain_inverses():
    Y = matrices(5, 500)
    assert inverse_traces(Y) == pytest.approx(np.trace(np.linalg.inv(Y), axis1=1, axis2=2), rel=1e-6)
    assert np.isinf(inverse_traces(np.array([np.zeros((3, 3)), np.diag([1.0, -1.0, 1.0])]))).all()


def test_the_trace_of_the_inverse_keeps_its_digits_where_directions_differ_a_lot():
    d = np.array([0.36, 0.48, 0.8])
    along = np.outer(d, d)
    Y = 1e6 * along + 1e-4 * (np.eye(3) - along)
    assert inverse_traces(Y[None])[0] == pytest.approx(2e4, rel=1e-5)
