"""F's conventions: the linear conversion is right to first order, the axes are a permutation."""

import numpy as np

from wildlab.geometry import frames
from wildlab.geometry.camera_poses import R_MC_FORWARD

KOLMARDEN = (np.radians(58.662064), np.radians(16.433337))  # F (2.1)


def test_metres_per_degree_are_the_ellipsoid_s_radii():
    """The factors of (2.3) against the radii of curvature of WGS84, from its definition."""
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    for latitude in np.radians([-60.0, 0.0, 31.6, 58.66]):
        s2 = np.sin(latitude) ** 2
        meridian = a * (1 - e2) / (1 - e2 * s2) ** 1.5
        parallel = a / np.sqrt(1 - e2 * s2) * np.cos(latitude)
        k_phi, k_lambda = frames.metres_per_degree(latitude)
        assert abs(k_phi / (np.radians(1) * meridian) - 1) < 1e-6
        assert abs(k_lambda - np.radians(1) * parallel) < 0.30  # the sign slip of the print is worth 0.24


def test_linear_error_vanishes_at_the_origin_and_grows_with_the_square():
    step = np.array([1e-5, 1e-4, 2e-4, 4e-4])
    error = frames.linear_enu_error(KOLMARDEN[0] + step, KOLMARDEN[1] + step, KOLMARDEN)
    assert error[0] < 0.01
    assert 3.5 < error[3] / error[2] < 4.5


def test_camera_axes():
    """Looking level and north, F's x axis is the lens, y the image's right, z its bottom."""
    R_nc = frames.camera_rotation(0.0, 0.0, 0.0)
    assert np.allclose(R_nc @ [0, 0, 1], [1, 0, 0])  # lens to the north
    assert np.allclose(R_nc @ [1, 0, 0], [0, 1, 0])  # right is east
    assert np.allclose(R_nc @ [0, 1, 0], [0, 0, 1])  # image down is down
    assert np.allclose(R_nc, frames.euler_to_matrix(0, 0, 0) @ R_MC_FORWARD)
