"""How uncertain an attitude is: a tilt and a heading, the same at every pitch.

The error of an attitude is a rotation vector, ``R_true = R Exp(delta)`` with ``delta`` in b (H 7.15). Two
standard deviations describe it:

``tilt``
    about each of the two level axes of n: by how much the vertical is missed.
``heading``
    about the vertical.

The three are independent, so in n the covariance is ``diag(tilt^2, tilt^2, heading^2)``. For an airframe that
lies level these are errors of roll, pitch and yaw. A camera that looks straight down has no roll that differs
from its yaw, and the same tilt and heading as any other.

Standard deviations of roll, pitch and yaw become these by one rule, at every pitch: the tilt is the root mean
square of roll's and pitch's, the heading is yaw's. What is wrong with an autopilot or a gimbal is which way
down is, and which way north is, however the axes of its camera are called.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


def level_axes(R_nb: ArrayLike) -> Array:
    """Find two level axes and the vertical, as they lie in the body.

    The level axes are the first two of b, turned by the shortest rotation that takes its third to the
    vertical: an error about one of them stays the same error while the body tilts.

    Parameters
    ----------
    R_nb
        (..., 3, 3).

    Returns
    -------
    (..., 3, 3), a column for each axis, in b; the third points down. NaN where the attitude is.

    Examples
    --------
    A camera pitched straight down has the vertical ahead:

    >>> from wildlab.geometry.frames import euler_to_matrix
    >>> print(level_axes(euler_to_matrix(0.0, -np.pi / 2, 0.5)).round(12) + 0.0)
    [[ 0.  0.  1.]
     [ 0.  1.  0.]
     [-1.  0.  0.]]
    """
    down = np.asarray(R_nb, float)[..., 2, :]
    x, y, z = np.moveaxis(down, -1, 0)
    level2 = x * x + y * y
    with np.errstate(divide="ignore", invalid="ignore"):
        # 1 / (1 + z), without cancellation where the body hangs upside down; there any two axes will do.
        k = np.where(z > 0, 1 / (1 + np.maximum(z, 0)), (1 - z) / level2)
    upside_down = (z < 0) & (level2 == 0)
    k = np.where(upside_down, 0.0, k)
    axes = np.empty((*down.shape, 3))
    axes[..., 0, 0], axes[..., 1, 0], axes[..., 2, 0] = 1 - k * x * x, -k * x * y, -x
    axes[..., 0, 1], axes[..., 1, 1], axes[..., 2, 1] = -k * x * y, 1 - k * y * y, -y
    axes[..., 2] = down
    axes[..., 1, 1] = np.where(upside_down, -1.0, axes[..., 1, 1])
    return axes


def attitude_covariance(tilt: ArrayLike, heading: ArrayLike, R_nb: ArrayLike) -> Array:
    """Covariance of the rotation vector in b that a tilt and a heading error make.

    Parameters
    ----------
    tilt, heading
        Standard deviations, rad, scalars or (...).
    R_nb
        (..., 3, 3).

    Returns
    -------
    (..., 3, 3) rad^2.

    Examples
    --------
    >>> print(attitude_covariance(0.01, 0.03, np.eye(3)).round(6))
    [[0.0001 0.     0.    ]
     [0.     0.0001 0.    ]
     [0.     0.     0.0009]]
    """
    down = np.asarray(R_nb, float)[..., 2, :]
    tilted, turned = np.square(np.asarray(tilt, float)), np.square(np.asarray(heading, float))
    both = down[..., :, None] * down[..., None, :]
    return np.asarray(tilted[..., None, None] * np.eye(3) + (turned - tilted)[..., None, None] * both)


def tilt_and_heading(covariance: ArrayLike, R_nb: ArrayLike) -> tuple[Array, Array]:
    """Read tilt and heading from the covariance of a rotation vector: the inverse of `attitude_covariance`.

    Parameters
    ----------
    covariance
        (..., 3, 3) in b, rad^2; of tilts that differ, the root mean square is taken.
    R_nb
        (..., 3, 3).

    Returns
    -------
    tilt, heading
        Standard deviations, rad, (...).

    Examples
    --------
    >>> tilt, heading = tilt_and_heading(np.diag([1.0, 7.0, 9.0]), np.eye(3))
    >>> print(tilt, heading)
    2.0 3.0
    """
    P, down = np.asarray(covariance, float), np.asarray(R_nb, float)[..., 2, :]
    turned = np.einsum("...i,...ij,...j->...", down, P, down)
    tilted = (np.trace(P, axis1=-2, axis2=-1) - turned) / 2
    return np.sqrt(np.maximum(tilted, 0)), np.sqrt(np.maximum(turned, 0))


def tilt_from_roll_pitch(*deviations: ArrayLike) -> Array:
    """The tilt that standard deviations of roll and pitch stand for: their root mean square, in their unit.

    Parameters
    ----------
    deviations
        Of roll and of pitch; of the one that is stated where the other is not.

    Returns
    -------
    Of their shape.

    Examples
    --------
    >>> print(tilt_from_roll_pitch(1.0, 7.0))
    5.0
    """
    return np.asarray(np.sqrt(np.mean([np.square(np.asarray(one, float)) for one in deviations], axis=0)))


def pose_covariance(
    horizontal: ArrayLike, vertical: ArrayLike, tilt: ArrayLike, heading: ArrayLike, R_nb: ArrayLike
) -> Array:
    """Covariance of a pose from standard deviations of place and attitude, all independent.

    Parameters
    ----------
    horizontal, vertical
        Of north and of east, and of down, m, scalars or (...).
    tilt, heading
        rad, scalars or (...).
    R_nb
        (..., 3, 3).

    Returns
    -------
    (..., 6, 6): position in n, m^2, and rotation vector in b, rad^2.
    """
    pose = np.zeros((*np.shape(R_nb)[:-2], 6, 6))
    pose[..., 0, 0] = pose[..., 1, 1] = np.square(np.asarray(horizontal, float))
    pose[..., 2, 2] = np.square(np.asarray(vertical, float))
    pose[..., 3:, 3:] = attitude_covariance(tilt, heading, R_nb)
    return pose
