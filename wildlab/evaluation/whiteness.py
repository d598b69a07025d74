"""Are innovations white? Autocorrelation with bounds, and one test over many lags (H 3.5, criterion 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2, norm

Array = NDArray[np.float64]


def autocorrelation(series: ArrayLike, max_lag: int) -> Array:
    """Sample autocorrelation of a series (T,) at lags 0..max_lag, mean removed, divided by its lag 0.

    Returns (max_lag + 1,). NaN for a constant series.
    """
    x = np.asarray(series, float)
    x = x - x.mean()
    size = len(x) + max_lag
    spectrum = np.fft.rfft(x, 2 * size)
    products = np.fft.irfft(spectrum * spectrum.conj(), 2 * size)[: max_lag + 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(products / products[0])


def white_bound(n: int, level: float = 0.95) -> float:
    """Magnitude that autocorrelations of ``n`` white samples stay below with probability ``level``, each."""
    return float(norm.ppf((1 + level) / 2) / np.sqrt(n))


def ljung_box(series: ArrayLike, lags: int) -> tuple[float, float]:
    """Ljung and Box's statistic over lags 1..``lags`` and the probability of a larger one if white."""
    x = np.asarray(series, float)
    n = len(x)
    r = autocorrelation(x, lags)[1:]
    statistic = float(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))))
    return statistic, float(chi2.sf(statistic, lags))


def effective_sample_size(series: ArrayLike, max_lag: int) -> float:
    """How many independent samples a correlated series (T,) is worth for its mean.

    ``T / (1 + 2 sum of autocorrelations)``, summed up to the first one that is not positive.
    """
    x = np.asarray(series, float)
    r = autocorrelation(x, max_lag)[1:]
    first = np.flatnonzero(~(r > 0))
    r = r[: first[0]] if len(first) else r
    return float(len(x) / (1 + 2 * r.sum()))
