"""Covariances: quantiles, ellipses on the ground, gates, and what every estimator asks of them.

SciPy's distributions take as long to import as numpy and pandas together, ``scipy.special`` a third of that
of `wildlab list`: each function that needs it asks for it.

How uncertain an attitude is: a tilt and a heading, the same at every pitch.

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

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]


def chi2_quantile(probability: float, dof: float) -> float:
    """What a chi-square variable stays below with a probability; NaN where that, or ``dof``, is none.

    Examples
    --------
    >>> round(chi2_quantile(0.95, 2), 3)
    5.991
    """
    from scipy.special import gammaincinv

    if not (dof > 0 and 0 <= probability <= 1):
        return float("nan")
    return float(2 * gammaincinv(dof / 2, probability))


def chi2_beyond(value: float, dof: float) -> float:
    """Probability that a chi-square variable is larger than a value; NaN where ``dof`` is none.

    Examples
    --------
    >>> round(chi2_beyond(5.991, 2), 3)
    0.05
    """
    from scipy.special import chdtrc

    return float(chdtrc(dof, max(value, 0.0))) if dof > 0 and not math.isnan(value) else float("nan")


def normal_quantile(probability: float) -> float:
    """What a standard normal variable stays below with a probability; NaN where that is none.

    Examples
    --------
    >>> round(normal_quantile(0.975), 2)
    1.96
    """
    from scipy.special import ndtri

    return float(ndtri(probability)) if 0 <= probability <= 1 else float("nan")


def student_quantile(probability: float, dof: float) -> float:
    """What Student's t stays below with a probability; NaN where that, or ``dof``, is none.

    Examples
    --------
    >>> round(student_quantile(0.975, 4), 3)
    2.776
    """
    from scipy.special import stdtrit

    inside = dof > 0 and 0 <= probability <= 1
    if inside and probability in (0, 1):
        return float("inf") if probability else float("-inf")
    return float(stdtrit(dof, probability)) if inside else float("nan")


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


#: Eigenvalues as far below zero as this share of the largest are rounding, and so is as much asymmetry.
ROUNDING = 1e-9


def gate_threshold(gate_probability: float, m: int) -> float:
    """Largest normalised innovation squared inside the validation region, H (3.9).

    Parameters
    ----------
    gate_probability
        Probability that a target's own measurement is let in, above 0 and at most 1. 1 is no gate.
    m
        Elements of the measurement.

    Returns
    -------
    float
        Infinite where there is no gate.

    Raises
    ------
    WildlabError
        Where the probability is outside (0, 1].

    Examples
    --------
    >>> round(gate_threshold(0.99, 2), 2)
    9.21
    >>> gate_threshold(1.0, 2)
    inf
    """
    if not 0 < gate_probability <= 1:  # NaN as well
        raise WildlabError(
            f"a probability of {gate_probability}",
            "give the probability that a target's own measurement is let in, above 0 and at most 1 (no gate)",
            field="gate_probability",
        )
    return chi2_quantile(gate_probability, m)


def check_covariance(P: Array, field: str) -> None:
    """Refuse what is no covariance: not finite, not symmetric, or with a negative variance in some direction.

    Parameters
    ----------
    P
        (n, n), or (B, n, n). Directions without any variance are allowed.
    field
        What to call it in the error.

    Raises
    ------
    WildlabError
        Naming the field, and the first matrix of several that is wrong.
    """
    P = np.asarray(P, float)
    many = P.reshape(-1, *P.shape[-2:])
    largest = np.abs(many).max(axis=(1, 2), keepdims=True, initial=0.0)
    even = np.isfinite(many) & (np.abs(many - np.swapaxes(many, 1, 2)) <= ROUNDING * largest)
    good = even.all(axis=(1, 2)) & (np.diagonal(many, axis1=1, axis2=2) >= 0).all(axis=1)
    # In units of the standard deviations, so that metres and radians weigh alike.
    sizes = np.sqrt(np.diagonal(np.where(good[:, None, None], many, 1.0), axis1=1, axis2=2))
    sizes = np.where(sizes > 0, sizes, 1.0)
    scaled = np.where(good[:, None, None], many, 0.0) / (sizes[:, :, None] * sizes[:, None, :])
    values = np.linalg.eigvalsh(scaled)
    good &= values[:, 0] >= -ROUNDING * np.maximum(values[:, -1], 1.0)
    if not good.all():
        raise WildlabError(
            "not finite, not symmetric, or with a negative variance in some direction",
            "give a covariance",
            field=field if P.ndim == 2 else f"{field}[{int(np.argmin(good))}]",
        )


#: Independent values that a mean is worth at least: with fewer, intervals are wider and hold no more.
FEWEST_WORTH = 3.0


def independent_count(apart: ArrayLike, surely: float = 0.0) -> float:
    """How many independent values a series is worth, three at least.

    Neighbours are as alike as in a process of the first order; the estimate of their correlation is freed of
    its bias (Kendall 1954).

    Parameters
    ----------
    apart
        (N,) in time order, each less the mean of all.
    surely
        By so many of its standard errors the correlation is taken for larger than its estimate.

    Returns
    -------
    float

    Examples
    --------
    >>> round(independent_count(np.sin(np.arange(20) / 4)), 1)
    3.0
    """
    a = np.asarray(apart, float)
    square, count = float(a @ a), len(a)
    alike = float(a[1:] @ a[:-1]) / square if square > 0 else 0.0
    alike += (1 + 3 * alike) / count
    alike += surely * float(np.sqrt(max(1 - alike**2, 0.0) / count))
    alike = float(np.clip(alike, 0.0, 0.9))
    return max(count * (1 - alike) / (1 + alike), min(FEWEST_WORTH, count))


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


class NamedEstimates:
    """Estimates (P,) with names and their covariance (P, P)."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def value(self, name: str) -> float:
        """The estimate called ``name``; zero where it was not estimated."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    def sd(self, name: str) -> float:
        """Its standard deviation; NaN where it was not estimated."""
        if name not in self.names:
            return float("nan")
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of its variance."""
        raise NotImplementedError

    def interval(self, name: str, probability: float = 0.95) -> tuple[float, float]:
        """Student's interval of the estimate called ``name``; NaN where it was not estimated."""
        half = student_quantile((1 + probability) / 2, self.freedom_of(name)) * self.sd(name)
        return self.value(name) - half, self.value(name) + half
