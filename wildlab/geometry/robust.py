"""Fits under a heavy-tailed likelihood: Student's t in two dimensions (Lange, Little and Taylor 1989).

A residual that is far out for its neighbours gets little weight, and the further out the less. The scale is
estimated along with the parameters, by the same weights, so that it is not the far ones that set it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array

#: Degrees of freedom: heavy tails, and on normal errors still nine tenths of the efficiency of least squares.
DEGREES = 4.0
#: Least scale, for residuals that vanish.
LEAST = 1e-9
_ROUNDS = 30
_SETTLED = 1e-4


class RobustFit(NamedTuple):
    """A linear fit under Student's t.

    Attributes
    ----------
    x
        (P,) parameters.
    scale
        Standard deviation of one component of the residual, as normal errors of the same middle would have.
    weights
        (N,), about one for an ordinary residual and near zero for one that is far out.
    """

    x: Array
    scale: float
    weights: Array


def student_weights(squared: ArrayLike, scale: float) -> Array:
    """Weights of two-dimensional residuals at a scale.

    Parameters
    ----------
    squared
        (N,) squared lengths.
    scale
        Of the distribution, in the unit of a length.

    Returns
    -------
    (N,), about one for an ordinary residual

    Examples
    --------
    >>> student_weights([2.0, 1000.0], 1.0).round(2).tolist()
    [1.0, 0.01]
    """
    return np.asarray((DEGREES + 2) / (DEGREES + np.asarray(squared, float) / scale**2))


def student_scale(squared: ArrayLike) -> float:
    """The scale under which squared lengths (N,) of two-dimensional residuals are most likely.

    Multiplied so that normal errors give their own standard deviation.

    Parameters
    ----------
    squared
        (N,); NaN are left out.

    Returns
    -------
    float
        NaN where nothing is left.

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(0, 2.0, (4000, 2))
    >>> e[:200] += 500.0  # one in twenty is far out
    >>> round(student_scale((e**2).sum(axis=1)), 1)
    2.2
    """
    d = np.asarray(squared, float)
    d = d[np.isfinite(d)]
    return _normal_scale(_raw_scale(d)) if len(d) else float("nan")


def student_cost(squared: ArrayLike) -> float:
    """Negative log-likelihood of two-dimensional residuals at their best scale.

    Parameters
    ----------
    squared
        (N,) squared lengths.

    Returns
    -------
    float
    """
    d = np.asarray(squared, float)
    scale = _raw_scale(d)
    tail = (DEGREES + 2) / 2 * np.log1p(d / (DEGREES * scale**2)).sum()
    return float(tail + 2 * len(d) * np.log(scale))


def fit_linear(J: ArrayLike, r: ArrayLike) -> RobustFit:
    """The ``x`` under which ``r + J x`` is most likely.

    Parameters
    ----------
    J
        (N, 2, P) derivatives of the residuals.
    r
        (N, 2) residuals at zero, of equal standard deviation (whitened).

    Returns
    -------
    RobustFit

    Raises
    ------
    ValueError
        Where there is no residual.

    Examples
    --------
    A constant shift, and one residual in ten that has nothing to do with it:

    >>> rng = np.random.default_rng(1)
    >>> r = rng.normal(3.0, 1.0, (100, 2))
    >>> r[:10] = 80.0
    >>> fit = fit_linear(np.tile(-np.eye(2), (100, 1, 1)), r)
    >>> bool(np.abs(fit.x - 3.0).max() < 0.3)
    True
    """
    J, r = np.asarray(J, float), np.asarray(r, float)
    if not len(r):
        raise ValueError("there is no residual to fit")
    x = np.zeros(J.shape[-1])
    squared = (r**2).sum(axis=1)
    scale = _raw_scale(squared)
    if len(x):
        flat, target = J.reshape(-1, len(x)), r.ravel()
        length = np.linalg.norm(flat, axis=0)
        flat = flat / np.where(length > 0, length, 1.0)
        for _ in range(_ROUNDS):
            weighted = np.repeat(student_weights(squared, scale), 2)[:, None] * flat
            step = np.linalg.lstsq(weighted.T @ flat, -weighted.T @ target, rcond=None)[0]
            moved = np.abs(flat @ (step - x)).max()
            x = step
            squared = ((target + flat @ x).reshape(-1, 2) ** 2).sum(axis=1)
            scale = _raw_scale(squared, scale, 3)
            if moved < _SETTLED * scale:
                break
        x = x / np.where(length > 0, length, 1.0)
    return RobustFit(x, _normal_scale(scale), student_weights(squared, scale))


def _raw_scale(squared: Array, start: float | None = None, rounds: int = 25) -> float:
    """Scale of the distribution itself, by expectation and maximisation, from the median outwards."""
    scale = max(float(np.sqrt(np.median(squared) / (2 * np.log(2)))) if start is None else start, LEAST)
    for _ in range(rounds):
        better = max(float(np.sqrt((student_weights(squared, scale) * squared).mean() / 2)), LEAST)
        if abs(better - scale) < 1e-3 * scale:
            return better
        scale = better
    return scale


def _normal_factor() -> float:
    """Scale of the t that fits normal errors of unit standard deviation: where the mean of w d is 2."""
    d = -2 * np.log1p(-(np.arange(20000) + 0.5) / 20000)  # quantiles of chi-square with two degrees
    return _raw_scale(d, 1.0, 200)


_FACTOR = _normal_factor()


def _normal_scale(scale: float) -> float:
    return scale / _FACTOR
