"""Earth frames and rotations.

Positions on the Earth go through pymap3d (exact, ellipsoidal); rotations through scipy. The conventions are
those of H 5.2: Euler angles in zyx order (H 5.10), quaternions scalar first, Hamilton, from b to n (H 7.13).

The print of H (5.10) has two slips in its first row; it is the standard zyx matrix
``R_z(yaw) R_y(pitch) R_x(roll)`` that is meant, and that is what stands here.
"""

from __future__ import annotations

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

#: Numbers, truth values, and rows or counts: of any shape.
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Origin = tuple[float, float, float]

#: Exchanges north-east-down and east-north-up; its own inverse (F 2.4).
R_NED_ENU: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def euler_to_matrix(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """``R_nb`` of zyx Euler angles, H (5.10).

    Parameters
    ----------
    roll, pitch, yaw
        Radians, scalars or (N,), broadcast against each other.

    Returns
    -------
    (N, 3, 3), or (3, 3) where all three are scalars; takes a vector from b to n. Written out rather than
    asked of scipy, which takes five times as long.

    Examples
    --------
    An airframe that heads east has its nose, x of the body, to the east:

    >>> R_nb = euler_to_matrix(0.0, 0.0, np.pi / 2)
    >>> print(np.round(R_nb @ [1.0, 0.0, 0.0], 12))
    [0. 1. 0.]
    """
    angles = np.broadcast_arrays(*(np.asarray(angle, float) for angle in (roll, pitch, yaw)))
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    R = np.empty((*sr.shape, 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = -sp, cp * sr, cp * cr
    return R


def matrix_to_euler(R_nb: ArrayLike) -> Array:
    """Roll, pitch, yaw of rotation matrices, the inverse of :func:`euler_to_matrix`.

    Written out rather than asked of scipy: at a pitch of +-90 deg, where roll and yaw cannot be told apart,
    roll is set to zero without a warning.

    Parameters
    ----------
    R_nb
        (N, 3, 3) or (3, 3).

    Returns
    -------
    (N, 3) or (3,), radians.

    Examples
    --------
    >>> print(np.degrees(matrix_to_euler(euler_to_matrix(0.0, 0.0, np.pi / 2))))
    [ 0.  0. 90.]
    """
    R = np.asarray(R_nb, float)
    level = np.hypot(R[..., 0, 0], R[..., 1, 0])
    pitch = np.arctan2(-R[..., 2, 0], level)  # keeps its digits near the vertical, where arcsin loses half
    vertical = level < 1e-12
    roll = np.where(vertical, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(vertical, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1)


def quaternion_to_matrix(q_nb: ArrayLike) -> Array:
    """``R_nb`` of quaternions, H (7.13).

    Parameters
    ----------
    q_nb
        (N, 4) or (4,): w, x, y, z. They are normalised; rows with NaN give NaN.

    Returns
    -------
    (N, 3, 3) or (3, 3).

    Raises
    ------
    ValueError
        Where a quaternion is zero.

    Examples
    --------
    >>> quaternion_to_matrix([0.0, 1.0, 0.0, 0.0])  # upside down
    array([[ 1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0., -1.]])
    """
    q = np.asarray(q_nb, float)
    rows = np.atleast_2d(q)
    whole = np.isfinite(rows).all(axis=1)
    R = np.full((len(rows), 3, 3), np.nan)
    if whole.any():
        R[whole] = Rotation.from_quat(rows[whole], scalar_first=True).as_matrix()
    return R.reshape(*q.shape[:-1], 3, 3)


def matrix_to_quaternion(R_nb: ArrayLike) -> Array:
    """Unit quaternions of rotation matrices, the inverse of :func:`quaternion_to_matrix`.

    Parameters
    ----------
    R_nb
        (N, 3, 3) or (3, 3).

    Returns
    -------
    (N, 4) or (4,): w, x, y, z with ``w >= 0``.
    """
    return np.asarray(
        Rotation.from_matrix(np.asarray(R_nb, float)).as_quat(canonical=True, scalar_first=True)
    )


def rotation_vector_to_matrix(rotation: ArrayLike) -> Array:
    """The exponential map: matrices of rotation vectors.

    Parameters
    ----------
    rotation
        (N, 3) or (3,), radians.

    Returns
    -------
    (N, 3, 3) or (3, 3).
    """
    return np.asarray(Rotation.from_rotvec(np.asarray(rotation, float)).as_matrix())


def matrix_to_rotation_vector(R: ArrayLike) -> Array:
    """The logarithm, the inverse of :func:`rotation_vector_to_matrix`.

    Parameters
    ----------
    R
        (N, 3, 3) or (3, 3).

    Returns
    -------
    (N, 3) or (3,), radians, of a length up to pi.
    """
    return np.asarray(Rotation.from_matrix(np.asarray(R, float)).as_rotvec())


def skew(vector: ArrayLike) -> Array:
    """``S(a)`` with ``S(a) b = a x b``, H (5.1).

    Parameters
    ----------
    vector
        (N, 3) or (3,).

    Returns
    -------
    (N, 3, 3) or (3, 3).
    """
    a = np.asarray(vector, float)
    S = np.zeros((*a.shape, 3))
    S[..., 0, 1], S[..., 0, 2] = -a[..., 2], a[..., 1]
    S[..., 1, 0], S[..., 1, 2] = a[..., 2], -a[..., 0]
    S[..., 2, 0], S[..., 2, 1] = -a[..., 1], a[..., 0]
    return S


def geodetic_to_ned(latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike, origin: Origin) -> Array:
    """Positions in n from WGS84 coordinates.

    Parameters
    ----------
    latitude, longitude
        Radians, (N,) or scalars.
    height
        Metres above the ellipsoid.
    origin
        Latitude, longitude (radians) and ellipsoidal height (metres) of the origin of n.

    Returns
    -------
    (N, 3) or (3,): north, east, down in metres, exact (not a projection).

    Examples
    --------
    A minute of latitude is a nautical mile, and a point at the same height falls behind the horizon:

    >>> origin = (np.radians(63.0), np.radians(10.0), 0.0)
    >>> print(np.round(geodetic_to_ned(np.radians(63.0 + 1 / 60), np.radians(10.0), 0.0, origin), 1))
    [1.8577e+03 0.0000e+00 3.0000e-01]
    """
    lat, lon, h = (np.asarray(a, float) for a in (latitude, longitude, height))
    ned = pymap3d.geodetic2ned(lat, lon, h, *origin, deg=False)
    return np.stack(ned, axis=-1).astype(float)


def ned_to_geodetic(p_n: ArrayLike, origin: Origin) -> Array:
    """WGS84 coordinates of positions in n, the inverse of :func:`geodetic_to_ned`.

    Parameters
    ----------
    p_n
        (N, 3) or (3,): north, east, down, metres.
    origin
        Latitude, longitude (radians) and ellipsoidal height (metres) of the origin of n.

    Returns
    -------
    (N, 3) or (3,): latitude, longitude (radians), height above the ellipsoid (metres).
    """
    p = np.asarray(p_n, float)
    llh = pymap3d.ned2geodetic(p[..., 0], p[..., 1], p[..., 2], *origin, deg=False)
    return _rows(llh, p.shape)


def geodetic_to_ecef(latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike) -> Array:
    """Positions in e of WGS84 coordinates.

    Parameters
    ----------
    latitude, longitude
        Radians, (N,) or scalars.
    height
        Metres above the ellipsoid.

    Returns
    -------
    (N, 3) or (3,), metres.
    """
    lat, lon, h = (np.asarray(a, float) for a in (latitude, longitude, height))
    xyz = pymap3d.geodetic2ecef(lat, lon, h, deg=False)
    return np.stack(xyz, axis=-1).astype(float)


def ecef_to_geodetic(p_e: ArrayLike) -> Array:
    """WGS84 coordinates of positions in e, the inverse of :func:`geodetic_to_ecef`.

    Parameters
    ----------
    p_e
        (N, 3) or (3,), metres.

    Returns
    -------
    (N, 3) or (3,): latitude, longitude (radians), height above the ellipsoid (metres).
    """
    p = np.asarray(p_e, float)
    llh = pymap3d.ecef2geodetic(p[..., 0], p[..., 1], p[..., 2], deg=False)
    return _rows(llh, p.shape)


def _rows(parts: tuple[ArrayLike, ...], shape: tuple[int, ...]) -> Array:
    """Coordinates side by side; pymap3d drops the axis of a single row, which comes back here."""
    return np.stack([np.reshape(np.asarray(part, float), shape[:-1]) for part in parts], axis=-1)


def ned_to_enu(p_n: ArrayLike) -> Array:
    """East-north-up of north-east-down, F (2.4), and the other way round: the same exchange.

    Parameters
    ----------
    p_n
        (N, 3) or (3,).

    Returns
    -------
    (N, 3) or (3,).

    Examples
    --------
    >>> ned_to_enu([1.0, 2.0, -30.0])
    array([ 2.,  1., 30.])
    """
    return np.asarray(p_n, float) @ R_NED_ENU


enu_to_ned = ned_to_enu


def wrap(angle: ArrayLike) -> Array:
    """Angles brought into [-pi, pi).

    Parameters
    ----------
    angle
        Radians, of any shape.

    Returns
    -------
    Of the same shape.

    Examples
    --------
    From a course of 350 deg to one of 10 deg is 20 deg to the right:

    >>> print(np.round(np.degrees(wrap(np.radians(10.0 - 350.0))), 9))
    20.0
    """
    return np.asarray((np.asarray(angle, float) + np.pi) % (2 * np.pi) - np.pi)
