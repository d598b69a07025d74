"""The conventions of Flodell and Christensson (F), converted where they enter.

F works in east-north-up, and its camera looks along x with y right and z down (F table 2.1). Everything
inside wildlab is north-east-down with the camera looking along z. F also replaces the exact conversion of
WGS84 coordinates by a linear one; it is kept because it is a formula of the thesis, beside its error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array, Origin, euler_to_matrix, geodetic_to_ned, ned_to_enu

#: Takes a vector from F's camera axes (x forward, y right, z down) to c (x right, y down, z forward).
R_CAMERA: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """``k_phi`` and ``k_lambda`` of F (2.3): metres per degree of latitude and of longitude.

    Parameters
    ----------
    latitude
        Radians.

    Returns
    -------
    Metres per degree of latitude, and of longitude.
    """
    k_phi = (
        111132.92
        - 559.82 * np.cos(2 * latitude)
        + 1.175 * np.cos(4 * latitude)
        - 0.0023 * np.cos(6 * latitude)
    )
    k_lambda = 111412.84 * np.cos(latitude) - 93.5 * np.cos(3 * latitude) - 0.118 * np.cos(5 * latitude)
    return float(k_phi), float(k_lambda)


def geodetic_to_enu_linear(latitude: ArrayLike, longitude: ArrayLike, origin: tuple[float, float]) -> Array:
    """East and north (metres) by F (2.2)-(2.3), linear in the coordinates.

    The print multiplies the row ``(k_phi k_lambda)`` with the column of differences and so adds metres east
    to metres north; what is meant is one factor per axis, east from longitude and north from latitude. The
    last term of ``k_lambda`` is printed with a minus; the usual series has a plus there, a difference of
    0.24 m per degree at most.

    Parameters
    ----------
    latitude, longitude
        Radians, (N,).
    origin
        Latitude and longitude of the origin, radians.

    Returns
    -------
    (N, 2): east, north, metres.
    """
    k_phi, k_lambda = metres_per_degree(origin[0])
    east = k_lambda * np.degrees(np.asarray(longitude, float) - origin[1])
    north = k_phi * np.degrees(np.asarray(latitude, float) - origin[0])
    return np.stack([east, north], axis=-1)


def linear_enu_error(latitude: ArrayLike, longitude: ArrayLike, origin: tuple[float, float]) -> Array:
    """Horizontal distance between F's linear conversion and the exact one at zero height.

    Parameters
    ----------
    latitude, longitude
        Radians, (N,).
    origin
        Latitude and longitude of the origin, radians.

    Returns
    -------
    (N,) metres.
    """
    exact_origin: Origin = (*origin, 0.0)
    exact = ned_to_enu(geodetic_to_ned(latitude, longitude, np.zeros(np.shape(latitude)), exact_origin))
    linear = geodetic_to_enu_linear(latitude, longitude, origin)
    return np.asarray(np.linalg.norm(exact[..., :2] - linear, axis=-1))


def camera_rotation(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """``R_nc`` from the Euler angles of F's camera (F 2.9-2.10), which looks along its own x axis.

    Parameters
    ----------
    roll, pitch, yaw
        Radians, (N,) or scalars.

    Returns
    -------
    (N, 3, 3), or (3, 3) where all three are scalars; takes a vector from c to n.
    """
    return np.asarray(euler_to_matrix(roll, pitch, yaw) @ R_CAMERA.T)
