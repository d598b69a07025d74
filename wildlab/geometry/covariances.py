"""Covariances: quantiles, ellipses on the ground, gates, and what every estimator asks of them.

SciPy's distributions take as long to import as numpy and pandas together, ``scipy.special`` a third of that
of `wildlab list`: each function that needs it asks for it.
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
        Naming the field, the first matrix of several that is wrong, and what is wrong with it.
    """
    P = np.asarray(P, float)
    if _all_covariances(P):
        return
    for index, one in enumerate(P[None] if P.ndim == 2 else P):
        problem = _wrong_with(one)
        if problem:
            raise WildlabError(
                problem,
                "give a covariance: finite, symmetric, no variance below zero",
                field=field if P.ndim == 2 else f"{field}[{index}]",
            )


def _per_sd(P: Array) -> Array:
    """In units of the standard deviations, so that metres and radians weigh alike."""
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    unit = np.sqrt(np.where(variances > 0, variances, 1.0))
    return np.asarray(P / (unit[..., :, None] * unit[..., None, :]))


def _all_covariances(P: Array) -> bool:
    """All at once, since a study may start thousands of runs."""
    if not np.isfinite(P).all():
        return False
    largest = np.abs(P).max(axis=(-2, -1), keepdims=True, initial=0.0)
    if (np.abs(P - np.swapaxes(P, -1, -2)) > ROUNDING * largest).any():
        return False
    values = np.linalg.eigvalsh(_per_sd(P))
    least = -ROUNDING * np.maximum(values[..., -1], 1.0)
    return bool((np.diagonal(P, axis1=-2, axis2=-1) >= 0).all() and (values[..., 0] >= least).all())


def _wrong_with(P: Array) -> str:
    """What keeps a matrix (n, n) from being a covariance; nothing where it is one."""
    if _all_covariances(P):
        return ""
    finite = np.isfinite(P).all(axis=1)
    if not finite.all():
        row = int(np.argmin(finite))
        return f"row {row} is not finite: {P[row].tolist()}"
    uneven = np.argwhere(np.abs(P - P.T) > ROUNDING * np.abs(P).max())
    if len(uneven):
        row, column = uneven[0]
        return (
            f"not symmetric: row {row}, column {column} has {P[row, column]:g}, the other way round "
            f"{P[column, row]:g}"
        )
    variances = np.diag(P)
    if (variances < 0).any():
        row = int(np.argmax(variances < 0))
        return f"row {row} has the variance {variances[row]:g}"
    row = int(np.argmax(np.abs(np.linalg.eigh(_per_sd(P))[1][:, 0])))
    return f"the variance is negative in a direction between the states, most of all along row {row}"


#: Independent values that a mean is worth at least: with fewer, intervals are wider and hold no more.
FEWEST_WORTH = 3.0


def independent_count(apart: ArrayLike) -> float:
    """How many independent values a series is worth, three at least.

    Neighbours are as alike as in a process of the first order; the estimate of their correlation is freed of
    its bias (Kendall 1954).

    Parameters
    ----------
    apart
        (N,) in time order, each less the mean of all.

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
    alike = float(np.clip(alike + (1 + 3 * alike) / count, 0.0, 0.9))
    return max(count * (1 - alike) / (1 + alike), min(FEWEST_WORTH, count))
