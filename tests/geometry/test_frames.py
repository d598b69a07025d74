"""Frames against closed forms and identities; pyproj is the independent judge of the geodesy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.geometry import frames

angle = st.floats(-np.pi, np.pi)
steep = st.floats(-1.55, 1.55)


def elementary(axis: str, a: float) -> np.ndarray:
    c, s = np.cos(a), np.sin(a)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


@given(angle, steep, angle)
def test_euler_matrix_is_the_zyx_product(roll, pitch, yaw):
    expected = elementary("z", yaw) @ elementary("y", pitch) @ elementary("x", roll)
    assert np.allclose(frames.euler_to_matrix(roll, pitch, yaw), expected, atol=1e-14)


@given(angle, steep, angle)
def test_euler_angles_come_back(roll, pitch, yaw):
    R = frames.euler_to_matrix(roll, pitch, yaw)
    assert np.allclose(frames.euler_to_matrix(*frames.matrix_to_euler(R)), R, atol=1e-12)


def test_straight_up_gives_a_rotation_without_a_warning(recwarn):
    R = frames.euler_to_matrix(0.3, np.pi / 2, 1.1)
    assert np.allclose(frames.euler_to_matrix(*frames.matrix_to_euler(R)), R, atol=1e-12)
    assert not recwarn.list


@given(angle, steep, angle)
def test_quaternion_follows_the_printed_formula(roll, pitch, yaw):
    """H (7.13), written out."""
    R = frames.euler_to_matrix(roll, pitch, yaw)
    q = frames.matrix_to_quaternion(R)
    w, v = q[0], q[1:]
    printed = (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * frames.skew(v)
    assert np.allclose(printed, R, atol=1e-12)
    assert np.allclose(frames.quaternion_to_matrix(q), R, atol=1e-12)
    assert w >= 0


def test_a_nan_quaternion_stays_in_its_row():
    q = np.array([[1.0, 0, 0, 0], [np.nan, 0, 0, 0]])
    R = frames.quaternion_to_matrix(q)
    assert np.array_equal(R[0], np.eye(3))
    assert np.isnan(R[1]).all()


@given(st.floats(-1.4, 1.4), angle, st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-500, 5000))
def test_geodetic_round_trip(lat0, lon0, dlat, dlon, height):
    origin = (lat0, lon0, 100.0)
    ned = frames.geodetic_to_ned(lat0 + dlat, lon0 + dlon, height, origin)
    back = frames.ned_to_geodetic(ned, origin)
    error = back - [lat0 + dlat, lon0 + dlon, height]
    error[1] = frames.wrap(error[1])
    error *= [6.4e6, 6.4e6, 1]
    assert np.abs(error).max() < 1e-6


def test_ned_agrees_with_pyproj():
    from pyproj import Transformer

    rng = np.random.default_rng(0)
    lat0, lon0, h0 = 63.6, 9.7, 45.0
    lat, lon, h = (
        lat0 + rng.uniform(-0.1, 0.1, 50),
        lon0 + rng.uniform(-0.1, 0.1, 50),
        rng.uniform(0, 3000, 50),
    )
    pipeline = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={lat0} +lon_0={lon0} +h_0={h0}"
    )
    east, north, up = pipeline.transform(lon, lat, h)
    ours = frames.geodetic_to_ned(
        np.radians(lat), np.radians(lon), h, (np.radians(lat0), np.radians(lon0), h0)
    )
    assert np.allclose(ours, np.stack([north, east, -up], axis=-1), atol=1e-6)
    enu = frames.ned_to_enu(ours)
    assert np.allclose(enu, np.stack([east, north, up], axis=-1), atol=1e-6)
    assert np.allclose(frames.enu_to_ned(enu), ours)


def test_ecef_agrees_with_pyproj_and_comes_back():
    from pyproj import Transformer

    llh = np.array([[63.6, 9.7, 350.0], [-31.2, 150.0, 10.0], [0.0, -179.9, 8000.0]])
    expected = np.stack(Transformer.from_crs("EPSG:4979", "EPSG:4978").transform(*llh.T), axis=-1)
    radians = np.column_stack([np.radians(llh[:, :2]), llh[:, 2]])
    ours = frames.geodetic_to_ecef(*radians.T)
    assert np.allclose(ours, expected, atol=1e-6)
    assert np.allclose(
        frames.ecef_to_geodetic(ours) * [6.4e6, 6.4e6, 1], radians * [6.4e6, 6.4e6, 1], atol=1e-5
    )


@given(st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_exponential_and_logarithm_undo_each_other(rotation):
    R = frames.rotation_vector_to_matrix(np.array([rotation]))
    assert np.allclose(
        frames.matrix_to_rotation_vector(R),
        [rotation] if np.linalg.norm(rotation) < np.pi else frames.matrix_to_rotation_vector(R),
        atol=1e-9,
    )
    assert np.allclose(R[0] @ R[0].T, np.eye(3), atol=1e-12)


@given(st.floats(-1e3, 1e3))
def test_wrap_keeps_the_direction(a):
    wrapped = float(frames.wrap(a))
    assert -np.pi <= wrapped < np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * a), abs=1e-9)
