"""How much a measurement may be off: covariances ``R`` (N, m, m), one for each row."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array


def constant_noise(n: int, *sd: float) -> Array:
    """The same uncorrelated noise in all rows.

    Parameters
    ----------
    n
        N, the number of rows.
    sd
        Standard deviation of each of the m elements of a measurement, in the element's own unit.

    Returns
    -------
    R, (N, m, m), in the units squared.
    """
    return np.tile(np.diag(np.square(sd)), (n, 1, 1))


def noise_by_altitude(height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions, H 6.2.4: standard deviation a fraction of the height above the plane.

    Parameters
    ----------
    height
        (N,) of the camera above the plane, m.
    fraction
        Without a unit, the same north and east; 0.05 is what H 6.4.4 flies with.

    Returns
    -------
    R, (N, 2, 2), m^2.
    """
    sd = fraction * np.asarray(height, float)
    return np.asarray(sd[:, None, None] ** 2 * np.eye(2))


def noise_by_direction(rays: ArrayLike, height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions whose rays err by an angle: what H 8.2 proposes beyond the height alone.

    A ray ``a`` off the vertical meets the plane at ``h / cos a``, and slantwise: an angle moves the point by
    ``h / cos(a)^2`` times it along the ray's bearing, and by ``h / cos a`` across. A ray straight down has
    the noise of `noise_by_altitude`.

    Parameters
    ----------
    rays
        (N, 3) in n, of any length: of the camera's axis, which the airframe's tilt turns, or of the pixel.
    height
        (N,) of the camera above the plane, m.
    fraction
        The angle's standard deviation about each axis across the ray, rad.

    Returns
    -------
    R, (N, 2, 2), m^2; NaN at and above the horizon.

    Examples
    --------
    >>> straight_down = [[0.0, 0.0, 2.0]]
    >>> bool(np.allclose(noise_by_direction(straight_down, [200.0]), noise_by_altitude([200.0])))
    True
    """
    d, h = np.asarray(rays, float), np.asarray(height, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(d[:, 2:] > 0, d[:, :2] / d[:, 2:], np.nan)
    # 1 / cos(a)^2 is one more than the slope's square: across once, and along once more.
    steep = 1 + np.einsum("ni,ni->n", slope, slope)
    shape = steep[:, None, None] * (np.eye(2) + slope[:, :, None] * slope[:, None, :])
    return np.asarray((fraction * h)[:, None, None] ** 2 * shape)


def own_noise(covariances: ArrayLike, otherwise: ArrayLike) -> Array:
    """The detections' own covariances, and another where a detection has none.

    Parameters
    ----------
    covariances
        (N, m, m), or (N, K, m, m) of K detections in a row; in the measurement's units squared. One with NaN
        in it, or without variance in some direction, is none.
    otherwise
        (m, m), or anything that fits beside ``covariances``: what `constant_noise` or another gives.

    Returns
    -------
    R, as ``covariances``.

    Raises
    ------
    WildlabError
        Where shapes do not fit each other.

    Examples
    --------
    >>> R = own_noise([np.diag([4.0, 9.0]), np.full((2, 2), np.nan)], np.eye(2))
    >>> R[:, 1, 1].tolist()
    [9.0, 1.0]
    """
    own, rest = np.asarray(covariances, float), np.asarray(otherwise, float)
    if own.ndim not in (3, 4) or own.shape[-1] != own.shape[-2] or rest.shape[-2:] != own.shape[-2:]:
        raise WildlabError(
            f"covariances of the shape {own.shape}, and {rest.shape} otherwise",
            "give (N, m, m) or (N, K, m, m), and (m, m)", field="covariances",
        )  # fmt: skip
    there = np.isfinite(own).all(axis=(-1, -2))
    whole = np.where(there[..., None, None], own, np.eye(own.shape[-1]))
    values = np.linalg.eigvalsh((whole + np.swapaxes(whole, -1, -2)) / 2)
    there &= values[..., 0] > 1e-12 * np.abs(values[..., -1])
    return np.where(there[..., None, None], own, np.broadcast_to(rest, own.shape))
