"""What is known of each point of a grid, as information matrices: F 5.3.2 and its appendix A, derived anew.

Where an animal stands that is at a grid point is known with the covariance P (3, 3), and Y is its inverse. An
image that shows the point adds what two angles tell (5.4), less where an animal may be missed (5.10), and
with time it wears off (5.5); `information_kernels` has both. What is left to be known is the sum of all
tr(Y^-1), (5.6).

F writes this in east-north-up; here it is n, north-east-down. Where the print contradicts itself,
``docs/contradictions.md`` says what holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError, above_zero
from wildlab.geometry.frames import Array, Mask


@dataclass(frozen=True)
class SearchSensor:
    """A camera as a planner sees it: how far its field of view reaches, and what an image tells.

    Attributes
    ----------
    half_width, half_height
        Tangents of half the angles of view, F (2.23).
    sd
        Standard deviation of both angles of (5.7), rad; a parameter, which F does not print.
    reach
        The ``r`` of (5.9), m: from so far an animal is found in 37 % of the images.
    nearest
        Least horizontal distance at which an azimuth counts, m. Straight below, (5.7) has none, and close to
        it one would tell any amount about a point that stands for a whole cell: half a cell is right.

    Raises
    ------
    WildlabError
        Where one of them is not above zero.
    """

    half_width: float
    half_height: float
    sd: float
    reach: float
    nearest: float = 1.0

    def __post_init__(self) -> None:
        above_zero(
            **{name: getattr(self, name) for name in ("half_width", "half_height", "sd", "reach", "nearest")}
        )


def bearing_jacobian(points: ArrayLike, p_nc: ArrayLike, nearest: float = 0.0) -> Array:
    """How azimuth and elevation, F (5.7), change with the point: (north, clockwise) and above the horizon.

    With ``rho`` the horizontal distance and ``r`` the distance, the azimuth turns by 1 / rho a metre across
    the view, and the elevation by 1 / r a metre across it. As rho = r cos(theta), the azimuth brings the
    factor 1 / cos(theta)^2 into the information, which F (A.1) leaves out.

    Parameters
    ----------
    points
        (N, 3) in n, m.
    p_nc
        Of the camera, (3,) or (N, 3), m.
    nearest
        Horizontal distance below which the azimuth turns no faster, m. With 0 a point straight below has no
        azimuth: NaN.

    Returns
    -------
    (N, 2, 3) rad/m: rows azimuth and elevation, columns north, east, down.

    Examples
    --------
    >>> print(bearing_jacobian([[0.0, 50.0, 0.0]], [0.0, 0.0, 0.0])[0] + 0.0)
    [[-0.02  0.    0.  ]
     [ 0.    0.   -0.02]]
    """
    d = np.asarray(points, float) - np.asarray(p_nc, float)
    rho = np.hypot(d[..., 0], d[..., 1])
    r2 = rho**2 + d[..., 2] ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        below = (rho == 0) & (nearest > 0)
        # Straight below any bearing would do; north is taken.
        cos = np.where(below, 1.0, d[..., 0] / rho)
        sin = np.where(below, 0.0, d[..., 1] / rho)
        turn = 1 / np.maximum(rho, nearest)
        H = np.empty((*rho.shape, 2, 3))
        H[..., 0, 0], H[..., 0, 1], H[..., 0, 2] = -sin * turn, cos * turn, 0.0
        H[..., 1, 0], H[..., 1, 1] = cos * d[..., 2] / r2, sin * d[..., 2] / r2
        H[..., 1, 2] = -rho / r2
    return H


def bearing_information(points: ArrayLike, p_nc: ArrayLike, sensor: SearchSensor) -> Array:
    """What one image of a camera that sees a point for certain tells of it: H^T R^-1 H of F (5.4).

    Parameters
    ----------
    points
        (N, 3) in n, m.
    p_nc
        Of the camera, (3,) or (N, 3), m.
    sensor
        Its ``sd`` makes R, the same for both angles (appendix A).

    Returns
    -------
    (N, 3, 3) 1/m^2, of rank two: nothing is told along the view.

    Examples
    --------
    >>> sensor = SearchSensor(0.3, 0.2, sd=0.02, reach=100.0)
    >>> print(np.diag(bearing_information([[0.0, 50.0, 0.0]], [0.0, 0.0, 0.0], sensor)[0]))
    [1. 0. 1.]
    """
    H = bearing_jacobian(points, p_nc, sensor.nearest)
    return np.asarray(np.swapaxes(H, -1, -2) @ H / sensor.sd**2)


def in_field_of_view(points: ArrayLike, p_nc: ArrayLike, R_nc: ArrayLike, sensor: SearchSensor) -> Mask:
    """Which points lie in the field of view, F (2.22)-(2.23); what hides them is not asked.

    Parameters
    ----------
    points
        (N, 3) in n, m.
    p_nc
        Of the camera, (3,), m.
    R_nc
        (3, 3), takes a vector from c (z out of the lens) to n.
    sensor
        Its half angles are used.

    Returns
    -------
    (N,) bool.
    """
    x, y, z = ((np.asarray(points, float) - np.asarray(p_nc, float)) @ np.asarray(R_nc, float)).T
    inside = (np.abs(x) <= sensor.half_width * z) & (np.abs(y) <= sensor.half_height * z)
    return np.asarray(inside & (z > 0))


def detection_probability(
    points: ArrayLike,
    p_nc: ArrayLike,
    R_nc: ArrayLike,
    sensor: SearchSensor,
) -> Array:
    """With which probability an animal at a point is found in one image, F (5.8) with (5.9).

    Parameters
    ----------
    points
        (N, 3) in n, m.
    p_nc
        Of the camera, (3,), m.
    R_nc
        (3, 3), takes a vector from c to n.
    sensor
        Field of view and reach; what hides the point is not asked.

    Returns
    -------
    (N,) from 0 to 1; 0 outside of the field of view.

    Examples
    --------
    >>> down = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> sensor = SearchSensor(0.3, 0.2, sd=0.01, reach=100.0)
    >>> ground = [[0.0, 0.0, 0.0], [0.0, 80.0, 0.0]]
    >>> print(np.round(detection_probability(ground, [0.0, 0.0, -50.0], down, sensor), 2))
    [0.78 0.  ]
    """
    away = np.asarray(points, float) - np.asarray(p_nc, float)
    seen = in_field_of_view(points, p_nc, R_nc, sensor)
    return np.where(seen, np.exp(-(away**2).sum(axis=-1) / sensor.reach**2), 0.0)


def initial_information(count: int, sd: ArrayLike) -> Array:
    """What is known before the first image: a small value on the diagonal, for F (5.10) asks for an inverse.

    Parameters
    ----------
    count
        N, of grid points.
    sd
        How far off an animal may be in each direction, m: one number as F has it, or (3,) north, east, down.
        Where the terrain is known, the third is its own standard deviation.

    Returns
    -------
    (N, 3, 3) 1/m^2.

    Raises
    ------
    WildlabError
        Where a standard deviation is not above zero.

    Examples
    --------
    >>> print(np.diag(initial_information(1, [50.0, 50.0, 1.0])[0]))
    [4.e-04 4.e-04 1.e+00]
    """
    each = np.broadcast_to(np.asarray(sd, float), (3,))
    if not (each > 0).all():
        raise WildlabError(f"standard deviations of {each} m", "give metres above zero", field="sd")
    return np.tile(np.diag(1 / each**2), (count, 1, 1))


def trace_of_inverse(Y: ArrayLike) -> Array:
    """tr(Y^-1) of each matrix, in closed form by its factors L D L'.

    Parameters
    ----------
    Y
        (..., 3, 3), symmetric.

    Returns
    -------
    (...) m^2; infinite where a matrix is not positive definite. By pivots rather than by the determinant:
    where one direction is known ten million times better than another, that loses all digits.

    Examples
    --------
    >>> print(trace_of_inverse(np.diag([0.5, 0.25, 1.0])))
    7.0
    """
    Y = np.asarray(Y, float)
    a, b, c = Y[..., 0, 0], Y[..., 0, 1], Y[..., 0, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        l2, l3 = b / a, c / a
        d2 = Y[..., 1, 1] - b * l2
        rest = Y[..., 1, 2] - c * l2
        m = rest / d2
        d3 = Y[..., 2, 2] - c * l3 - m * rest
        total = 1 / a + (l2**2 + 1) / d2 + ((l2 * m - l3) ** 2 + m**2 + 1) / d3
    return np.where((a > 0) & (d2 > 0) & (d3 > 0), total, np.inf)
