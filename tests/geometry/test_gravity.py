"""Gravity about a place is that of a ball of the Earth's size, to first order: it points at the centre."""

import numpy as np
import pytest

from wildlab.geometry.frames import attraction, local_earth


@pytest.mark.parametrize("offset", [(800.0, 0, 0), (0, -900.0, 0), (0, 0, -400.0), (500.0, 600.0, -300.0)])
def test_about_a_place_it_falls_with_height_and_points_at_the_centre(offset):
    earth, radius = local_earth(np.radians(50.0)), 6371e3
    to_centre = np.array([0.0, 0.0, radius]) - np.array(offset)
    ball = earth.gravity * radius**2 * to_centre / np.linalg.norm(to_centre) ** 3
    found = attraction(earth, offset)
    # The Earth is flattened and turns: its free-air gradient is 0.4 % from the ball's.
    change, expected = found - [0, 0, earth.gravity], ball - [0, 0, earth.gravity]
    assert change == pytest.approx(expected, abs=0.01 * np.abs(expected).max())
    assert np.abs(expected).max() > 1e-4
