"""The field of the airframe, out of one that is known, and the Earth's as a direction."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.frames import euler_to_matrix, matrix_to_rotation_vector
from wildlab.navigation.aiding import earth_field, hard_iron, share_turned
from wildlab.navigation.strapdown import ImuSamples

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
    for field in (seen(0 * yaw, 0 * yaw, yaw), np.ones((3, 3))):
        with pytest.raises(WildlabError, match="too few sides"):
            hard_iron(field)


def test_the_field_turns_as_the_gyros_say_and_only_in_the_same_axes():
    times = np.arange(0, 60, 0.02)
    angles = 0.6 * np.sin(0.5 * times), 0.2 * np.sin(0.9 * times), 0.3 * times
    R = euler_to_matrix(*angles)
    turn = matrix_to_rotation_vector(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / 0.02
    imu = ImuSamples(times[:-1] + 0.01, np.zeros((len(turn), 3)) - [0, 0, 9.8], turn)
    field = np.einsum("kji,j->ki", R, 50.0 * earth_field(0.1, 1.2))
    field += np.random.default_rng(0).normal(0, 0.3, field.shape)
    assert share_turned(times, field, imu) > 0.95
    for flipped in ([1, 1, -1], [1, -1, 1], [-1, 1, 1], [1, -1, -1]):
        assert share_turned(times, field * flipped, imu) < 0.5, flipped
    assert share_turned(times, field[:, [1, 0, 2]], imu) < 0.5
    assert share_turned(times + 2.0, field, imu) < 0.5
    assert np.isnan(share_turned(times[:1], field[:1], imu))


def test_the_earths_field_points_where_it_is_said_to():
    north, east, down = earth_field(np.radians(10.0), np.radians(70.0))
    assert np.degrees(np.arctan2(east, north)) == pytest.approx(10.0)
    assert np.degrees(np.arctan2(down, np.hypot(north, east))) == pytest.approx(70.0)
