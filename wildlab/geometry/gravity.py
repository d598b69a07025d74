"""Gravity and the turning of the Earth, as a local frame n sees them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

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
