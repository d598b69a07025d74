"""Quantiles of the normal, chi-square and Student's distribution.

The numbers are those of scipy.stats, to the last digit. Its import takes as long as those of numpy and pandas
together, and every report pays for it twice. That of scipy.special is a third of the time of `wildlab list`:
each function asks for it.
"""

from __future__ import annotations

import math


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
