"""Earth frames and rotations.

Positions on the Earth go through pymap3d (exact, ellipsoidal); rotations through scipy. The conventions are
those of H 5.2: Euler angles in zyx order (H 5.10), quaternions scalar first, Hamilton, from b to n (H 7.13).

The print of H (5.10) has two slips in its first row; it is the standard zyx matrix
``R_z(yaw) R_y(pitch) R_x(roll)`` that is meant, and that is what stands here.

Gravity and the turning of the Earth, as a local frame n sees them.

The conventions of Flodell and Christensson (F), converted where they enter.

F works in east-north-up, and its camera looks along x with y right and z down (F table 2.1). Everything
inside wildlab is north-east-down with the camera looking along z. F also replaces the exact conversion of
WGS84 coordinates by a linear one; it is kept because it is a formula of the thesis, beside its error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError

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


def between_attitudes(q_nb: ArrayLike, before: Indices, after: Indices, share: ArrayLike) -> Array:
    """Rotations on the way from some attitudes to others, turning at an even rate the shorter way (slerp).

    Parameters
    ----------
    q_nb
        (M, 4) quaternions w, x, y, z, of any length but zero.
    before, after
        (N,) their rows to start from and to end at.
    share
        (N,) how far on the way, 0 at the start and 1 at the end.

    Returns
    -------
    (N, 3, 3), takes a vector from b to n; NaN where the share or one of both quaternions is NaN or zero.

    Examples
    --------
    Half-way from north to east is north-east:

    >>> q = np.array([[1.0, 0.0, 0.0, 0.0], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    >>> R = between_attitudes(q, np.array([0]), np.array([1]), np.array([0.5]))
    >>> print(np.round(R[0] @ [1.0, 0.0, 0.0], 3))
    [0.707 0.707 0.   ]
    """
    q, s = np.asarray(q_nb, float), np.asarray(share, float)
    size = np.linalg.norm(q, axis=1)
    known = np.isfinite(size) & (size > 0)
    known = known[before] & known[after] & np.isfinite(s)
    start, end = (Rotation.from_quat(q[rows[known]], scalar_first=True) for rows in (before, after))
    turn = Rotation.from_rotvec(s[known, None] * (start.inv() * end).as_rotvec())
    R = np.full((len(s), 3, 3), np.nan)
    R[known] = (start * turn).as_matrix()
    return R


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


#: Of the Earth, rad/s (WGS84).
EARTH_RATE = 7.292115e-5
#: What data sheets mean by g, m/s^2, and what gravity is taken to be where nothing better is known.
STANDARD_GRAVITY, USUAL_GRAVITY = 9.80665, 9.81

# WGS84: semi-major axis (m), first eccentricity squared, flattening, gravity at the equator (m/s^2),
# Somigliana's constant, and the ratio of centrifugal force to gravity at the equator.
_A, _E2, _FLATTENING = 6378137.0, 6.69437999014e-3, 1 / 298.257223563
_GAMMA, _SOMIGLIANA, _M = 9.7803253359, 1.931852652458e-3, 3.449786506841e-3


class Earth(NamedTuple):
    """What turns, and pulls, in a frame n that stands still on the ground at its origin.

    Attributes
    ----------
    gravity
        At the origin, m/s^2.
    gradient
        How much it grows per metre downwards, 1/s^2.
    curvature
        One over the Earth's radius, 1/m: away from the origin the plumb line leans back towards it.
    rate
        Angular rate of n, in n, (3,) rad/s.
    """

    gravity: float
    gradient: float
    curvature: float
    rate: tuple[float, float, float]

    def as_array(self) -> Array:
        """Gravity, gradient, curvature and the three parts of the rate, (6,), as compiled code takes them."""
        return np.array([self.gravity, self.gradient, self.curvature, *self.rate])


def normal_gravity(latitude: ArrayLike, height: ArrayLike = 0.0) -> Array:
    """Gravity of the WGS84 ellipsoid, m/s^2: Somigliana's formula, to second order in the height.

    Parameters
    ----------
    latitude, height
        Radians, and metres above the ellipsoid; (N,) or scalars.

    Returns
    -------
    (N,) m/s^2.

    Examples
    --------
    >>> print(f"{normal_gravity(np.radians(45.0)):.4f} m/s^2")
    9.8062 m/s^2
    """
    s2 = np.sin(np.asarray(latitude, float)) ** 2
    h = np.asarray(height, float) / _A
    on_ellipsoid = _GAMMA * (1 + _SOMIGLIANA * s2) / np.sqrt(1 - _E2 * s2)
    return np.asarray(on_ellipsoid * (1 - 2 * (1 + _FLATTENING + _M - 2 * _FLATTENING * s2) * h + 3 * h**2))


def local_earth(latitude: float, height: float = 0.0) -> Earth:
    """The Earth at a place: normal gravity that falls with height and leans with distance, and its rotation.

    Parameters
    ----------
    latitude
        Radians.
    height
        Metres above the ellipsoid.

    Returns
    -------
    The Earth as n sees it.

    Raises
    ------
    WildlabError
        Where the latitude is not within a quarter turn, as when it is given in degrees.
    """
    if not abs(latitude) <= np.pi / 2 or not np.isfinite(height):
        raise WildlabError(
            f"no place on Earth has the latitude {latitude} rad and the height {height} m",
            "give the latitude in radians and the height in metres",
            field="origin",
        )
    gradient = float(normal_gravity(latitude, height - 0.5) - normal_gravity(latitude, height + 0.5))
    rate = (EARTH_RATE * float(np.cos(latitude)), 0.0, -EARTH_RATE * float(np.sin(latitude)))
    return Earth(float(normal_gravity(latitude, height)), gradient, 1 / 6371e3, rate)


def flat_earth(gravity: float = USUAL_GRAVITY) -> Earth:
    """Frame n as an inertial one with the same gravity everywhere, as in H 7.3.2.

    Parameters
    ----------
    gravity
        m/s^2.

    Returns
    -------
    An Earth that neither turns nor curves.
    """
    return Earth(gravity, 0.0, 0.0, (0.0, 0.0, 0.0))


def attraction(earth: Earth, p_n: ArrayLike) -> Array:
    """Gravity at positions in n.

    Parameters
    ----------
    earth
        As n sees it.
    p_n
        (N, 3) metres in n.

    Returns
    -------
    (N, 3) m/s^2 in n.
    """
    p = np.asarray(p_n, float)
    down = earth.gravity + earth.gradient * p[..., 2]
    return np.asarray(
        down[..., None]
        * np.stack(
            [-earth.curvature * p[..., 0], -earth.curvature * p[..., 1], np.ones(p.shape[:-1])], axis=-1
        )
    )


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
