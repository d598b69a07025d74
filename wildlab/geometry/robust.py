"""Fits under a heavy-tailed likelihood: Student's t in two dimensions (Lange, Little and Taylor 1989).

A residual that is far out for its neighbours gets little weight, and the further out the less. The scale is
estimated along with the parameters, by the same weights, so that it is not the far ones that set it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array

#: Degrees of freedom: heavy tails, and on normal errors still nine tenths of the efficiency of least squares.
DEGREES = 4.0
#: Least scale, for residuals that vanish.
LEAST = 1e-9
_ROUNDS = 30
_SETTLED = 1e-4


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
    return _raw_scale(d) / _FACTOR if len(d) else float("nan")


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


def fit_linear(J: ArrayLike, r: ArrayLike) -> Array:
    """The ``x`` (P,) under which ``r + J x`` is most likely.

    Parameters
    ----------
    J
        (N, 2, P) derivatives of the residuals.
    r
        (N, 2) residuals at zero, of equal standard deviation (whitened).

    Returns
    -------
    (P,)

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
    >>> bool(np.abs(fit_linear(np.tile(-np.eye(2), (100, 1, 1)), r) - 3.0).max() < 0.3)
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
            weighted = np.repeat(_weights(squared, scale), 2)[:, None] * flat
            step = np.linalg.lstsq(weighted.T @ flat, -weighted.T @ target, rcond=None)[0]
            moved = np.abs(flat @ (step - x)).max()
            x = step
            squared = ((target + flat @ x).reshape(-1, 2) ** 2).sum(axis=1)
            scale = _raw_scale(squared, scale, 3)
            if moved < _SETTLED * scale:
                break
        x = x / np.where(length > 0, length, 1.0)
    return x


def _weights(squared: Array, scale: float) -> Array:
    """(N,) of two-dimensional residuals by their squared lengths, about one for an ordinary one."""
    return np.asarray((DEGREES + 2) / (DEGREES + squared / scale**2))


def _raw_scale(squared: Array, start: float | None = None, rounds: int = 25) -> float:
    """Scale of the distribution itself, by expectation and maximisation, from the median outwards."""
    scale = max(float(np.sqrt(np.median(squared) / (2 * np.log(2)))) if start is None else start, LEAST)
    for _ in range(rounds):
        better = max(float(np.sqrt((_weights(squared, scale) * squared).mean() / 2)), LEAST)
        if abs(better - scale) < 1e-3 * scale:
            return better
        scale = better
    return scale


def _normal_factor() -> float:
    """Scale of the t that fits normal errors of unit standard deviation: where the mean of w d is 2."""
    d = -2 * np.log1p(-(np.arange(20000) + 0.5) / 20000)  # quantiles of chi-square with two degrees
    return _raw_scale(d, 1.0, 200)


_FACTOR = _normal_factor()
