"""Are innovations white? Autocorrelation with bounds, and one test over many lags (H 3.5, criterion 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import chi2_beyond, normal_quantile

Array = NDArray[np.float64]


def autocorrelation(series: ArrayLike, max_lag: int) -> Array:
    """Sample autocorrelation of a series, mean removed, divided by its lag 0.

    Parameters
    ----------
    series
        (T,) at equal intervals, without NaN.
    max_lag
        The largest lag, counted in samples.

    Returns
    -------
    (max_lag + 1,)
        At lags 0..max_lag, the first one 1. A constant series has none: NaN, or what rounding in its mean
        makes of it.
    """
    x = np.asarray(series, float)
    x = x - x.mean()
    size = len(x) + max_lag
    spectrum = np.fft.rfft(x, 2 * size)
    products = np.fft.irfft(spectrum * spectrum.conj(), 2 * size)[: max_lag + 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(products / products[0])


def white_bound(n: int, level: float = 0.95) -> float:
    """Magnitude that autocorrelations of white samples stay below with probability ``level``, each.

    Parameters
    ----------
    n
        How many samples they are from; the bound holds where they are many.
    level
        Between 0 and 1.

    Returns
    -------
    float
    """
    return float(normal_quantile((1 + level) / 2) / np.sqrt(n))


def effective_sample_size(series: ArrayLike, max_lag: int) -> float:
    """How many independent samples a correlated series is worth for its mean.

    ``T / (1 + 2 sum of autocorrelations)``, summed up to the first one that is not positive.

    Parameters
    ----------
    series
        (T,) at equal intervals, without NaN.
    max_lag
        The largest lag that is summed, counted in samples.

    Returns
    -------
    At most T.
    """
    x = np.asarray(series, float)
    r = autocorrelation(x, max_lag)[1:]
    first = np.flatnonzero(~(r > 0))
    r = r[: first[0]] if len(first) else r
    return float(len(x) / (1 + 2 * r.sum()))


class Whiteness(NamedTuple):
    """Whether a sequence of innovations is white.

    ``autocorrelation`` (m, lags + 1) of each element, ``bound`` what that of white noise stays below at each
    lag in 95 % of cases; ``statistic`` and ``p_value`` of all elements and lags at once (`portmanteau`);
    ``n``: innovations it is from.
    """

    autocorrelation: Array
    bound: float
    statistic: float
    p_value: float
    n: int


def innovation_whiteness(innovations: ArrayLike, lags: int) -> Whiteness:
    """The third criterion of H 3.5 for a sequence of innovations.

    Rows with NaN (no measurement) are left out, so that lags count measurements. Where the covariances of
    the innovations differ much, whiten them first (`wildlab.evaluation.consistency.whiten`).

    Parameters
    ----------
    innovations
        (N, m), in the measurement's units, angles wrapped.
    lags
        How many lags are tested, from 1 on.

    Returns
    -------
    Whiteness

    Raises
    ------
    WildlabError
        If fewer innovations are left than ``lags + 2``.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white = rng.standard_normal((500, 2))
    >>> innovation_whiteness(white, lags=10).p_value > 0.05
    True
    >>> innovation_whiteness(white[1:] + white[:-1], lags=10).p_value < 1e-6
    True
    """
    v = np.asarray(innovations, float)
    v = v[np.isfinite(v).all(axis=1)]
    if len(v) < lags + 2:
        raise WildlabError(
            f"{len(v)} innovations are too few for {lags} lags", "ask for fewer lags, or a longer track"
        )
    statistic, p_value = portmanteau(v, lags)
    correlation = np.stack([autocorrelation(column, lags) for column in v.T])
    return Whiteness(correlation, white_bound(len(v)), statistic, p_value, len(v))


def portmanteau(series: ArrayLike, lags: int) -> tuple[float, float]:
    """Hosking's statistic over several lags of a series, and the probability of a larger one if white.

    The test of Ljung and Box for several elements at once, correlations between them included; for one
    element it is theirs. Chi-square with ``m^2 lags`` degrees of freedom.

    Parameters
    ----------
    series
        (T, m) at equal intervals, without NaN.
    lags
        The statistic is over lags 1..``lags``, counted in samples; fewer than T.

    Returns
    -------
    The statistic, and the probability.
    """
    x = np.asarray(series, float)
    x = x - x.mean(axis=0)
    T, m = x.shape
    inverse = np.linalg.pinv(x.T @ x / T)
    statistic = 0.0
    for lag in range(1, lags + 1):
        C = x[lag:].T @ x[: T - lag] / T
        statistic += T**2 / (T - lag) * float(np.trace(C.T @ inverse @ C @ inverse))
    return statistic, chi2_beyond(statistic, m * m * lags)
