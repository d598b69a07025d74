"""What a linearisation leaves out: by closed forms, differences and samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given

from tests.tracking.level_sensors import ranges_bearings
from tests.tracking.poses import CAMERA, CROOKED, PIXEL, POSE, posed
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking.sensors import (
    Sensor,
    left_out,
    pixels,
    second_derivatives,
)

SHAPE = np.array([[1.0, 0.3], [0.3, 0.6]])


def tilted(tilt: float, height: float = 60.0) -> tuple[Sensor, np.ndarray]:
    """A camera that is rolled off the plumb line, and where its axis meets the ground."""
    poses = posed((0.0, 0.0, height, tilt, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    sensor = pixels(poses, 0.0)
    return sensor, georeference_pixels(poses, np.array([CAMERA.cx, CAMERA.cy]), 0.0)[:2]


@given(POSE, PIXEL)
def test_second_derivatives_are_those_of_the_pixels(pose, share):
    poses = posed(pose, CROOKED)
    place = georeference_pixels(poses, np.array(share) * [640, 512], 0.0)
    assume(np.isfinite(place).all() and np.hypot(*place[:2] - poses.p_nc[:2]) < 600)
    sensor, h = pixels(poses, 0.0), 0.3

    def z(north: float, east: float) -> np.ndarray:
        return sensor.predict(0, place[:2] + np.array([north, east])).z

    found = second_derivatives(sensor, 0, place[:2])
    sampled = np.empty_like(found)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        a, b = h * np.eye(2)[i], h * np.eye(2)[j]
        sampled[:, i, j] = (z(*(a + b)) - z(*(a - b)) - z(*(b - a)) + z(*(-a - b))) / (4 * h * h)
    assert found == pytest.approx(sampled, rel=2e-3, abs=2e-3 * np.abs(found).max() + 1e-6)


def test_a_tilted_camera_bends_by_its_tilt_and_one_that_looks_down_does_not():
    """Closed form on the axis: u = f x / (d + y sin a), v = f y cos a / (d + y sin a)."""
    tilt, s = 0.5, 4.0
    sensor, place = tilted(tilt)
    d, P = 60.0 / np.cos(tilt), s * s * np.eye(2)
    B = left_out(P, second_derivatives(sensor, 0, place))
    by_u, by_v = CAMERA.fx * np.sin(tilt) / d**2, CAMERA.fy * np.sin(tilt) / d**2 * np.cos(tilt)
    spread = sorted(np.sqrt(np.diag(B)))
    # Across the tilt one product of two coordinates; along it a square, whose mean counts too.
    assert sorted([s * s * by_u, s * s * np.sqrt(3) * by_v]) == pytest.approx(spread, rel=0.03)
    assert left_out(1e6 * P, second_derivatives(*tilted(0.0)[:1], 0, tilted(0.0)[1])) == pytest.approx(0.0)


def test_left_out_is_the_second_moment_of_the_second_order_part(rng):
    D = second_derivatives(ranges_bearings([0.0, 0.0], 0.0), 0, [40.0, 30.0])
    e = rng.multivariate_normal([0, 0], SHAPE, 400_000)
    part = np.einsum("na,iab,nb->ni", e, D, e) / 2
    B = left_out(SHAPE, D)
    size = np.sqrt(np.outer(np.diag(B), np.diag(B)))  # range and bearing: metres and radians
    assert B / size == pytest.approx(part.T @ part / len(e) / size, abs=0.02)
