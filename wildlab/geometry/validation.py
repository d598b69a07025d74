"""What every estimator asks of its uncertainties: covariances that are some, and one meaning of a gate."""

from __future__ import annotations

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.quantiles import chi2_quantile

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
