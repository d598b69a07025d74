"""The field of the airframe, out of one that is known, and the Earth's as a direction."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.frames import euler_to_matrix
from wildlab.navigation.magnetometer import earth_field, hard_iron

IRON = np.array([20.0, -5.0, 11.0])


def seen(roll, pitch, yaw):
    field_n = 50.0 * earth_field(0.1, 1.2)
    return np.einsum("kji,j->ki", euler_to_matrix(roll, pitch, yaw), field_n) + IRON


def test_the_centre_of_the_sphere_is_what_the_airframe_adds():
    rng = np.random.default_rng(0)
    field = seen(rng.uniform(-0.8, 0.8, 500), rng.uniform(-0.3, 0.3, 500), rng.uniform(-3, 3, 500))
    assert hard_iron(field) == pytest.approx(IRON, abs=1e-9)
    field[7] = np.nan
    assert hard_iron(field + rng.normal(0, 0.5, field.shape)) == pytest.approx(IRON, abs=0.5)


def test_an_airframe_that_never_banks_is_told_so():
    yaw = np.linspace(-3, 3, 200)
    with pytest.raises(WildlabError, match="from too few sides"):
        hard_iron(seen(0 * yaw, 0 * yaw, yaw))
    with pytest.raises(WildlabError, match="from too few sides"):
        hard_iron(np.ones((3, 3)))


def test_the_earths_field_points_where_it_is_said_to():
    north, east, down = earth_field(np.radians(10.0), np.radians(70.0))
    assert np.degrees(np.arctan2(east, north)) == pytest.approx(10.0)
    assert np.degrees(np.arctan2(down, np.hypot(north, east))) == pytest.approx(70.0)
