"""The ellipse that a covariance on the ground stands for: its axes, and what lies inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.geometry.quantiles import chi2_quantile


def ellipse_axes(covariance: ArrayLike, probability: float = 0.9) -> tuple[Array, Array, Array]:
    """Half axes and bearing of covariance ellipses.

    Parameters
    ----------
    covariance
        (N, 2, 2) or (2, 2), north-east, metres squared.
    probability
        Share of a normal distribution that the ellipse holds.

    Returns
    -------
    Long and short half axis (metres) and the bearing of the long one (radians from north), each (N,). NaN
    covariances give NaN.

    Examples
    --------
    Twice as uncertain to the east as to the north:

    >>> long_axis, short_axis, bearing = ellipse_axes([[1.0, 0.0], [0.0, 4.0]])
    >>> print(f"{long_axis:.2f} m by {short_axis:.2f} m, {np.degrees(bearing):.0f} deg from north")
    4.29 m by 2.15 m, 90 deg from north
    """
    C = np.asarray(covariance, float)
    mean = (C[..., 0, 0] + C[..., 1, 1]) / 2
    half = (C[..., 0, 0] - C[..., 1, 1]) / 2
    spread = np.hypot(half, C[..., 0, 1])
    scale = chi2_quantile(probability, 2)
    long_axis = np.sqrt(scale * (mean + spread))
    short_axis = np.sqrt(scale * np.maximum(mean - spread, 0))
    return long_axis, short_axis, np.arctan2(C[..., 0, 1], half) / 2


def inside_ellipse(offset: ArrayLike, covariance: ArrayLike, probability: float = 0.9) -> np.ndarray:
    """Which offsets from the truth lie inside the ellipse of their covariance.

    Parameters
    ----------
    offset
        (N, 2) metres, north and east.
    covariance
        (N, 2, 2), or (2, 2) for all, metres squared.
    probability
        Share of a normal distribution that the ellipse holds.

    Returns
    -------
    (N,) bool; NaN rows are outside.

    Examples
    --------
    >>> inside_ellipse([[2.0, 0.0], [2.2, 0.0]], np.eye(2))
    array([ True, False])
    """
    e, C = np.asarray(offset, float), np.asarray(covariance, float)
    determinant = C[..., 0, 0] * C[..., 1, 1] - C[..., 0, 1] * C[..., 1, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        squared = (
            C[..., 1, 1] * e[..., 0] ** 2
            - 2 * C[..., 0, 1] * e[..., 0] * e[..., 1]
            + C[..., 0, 0] * e[..., 1] ** 2
        ) / determinant
        return np.asarray(squared <= chi2_quantile(probability, 2))
