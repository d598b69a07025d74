"""Is a filter honest about its own uncertainty? NEES and NIS with their limits, and whiteness (H 3.5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import chi2_beyond, chi2_quantile, normal_quantile

Array = NDArray[np.float64]

#: What every error in this room is, H (3.11). NEES does not depend on the sign; means and biases do.
ERROR_CONVENTION = "truth minus estimate"


def chi_square_interval(dof: float, runs: float = 1) -> tuple[float, float]:
    """Two-sided interval in which NEES or NIS lies with 95 % if the filter is consistent (H example 3.1).

    Parameters
    ----------
    dof
        Number of states (NEES) or of elements of a measurement (NIS); their mean where they vary.
    runs
        Of how many independent runs the value is the mean; their sum has ``runs * dof`` degrees of freedom.
        For a mean over the time of one run: as many as its correlated values are worth, which need not be
        whole (`wildlab.evaluation.consistency.worth`).

    Returns
    -------
    (low, high)

    Raises
    ------
    WildlabError
        If ``dof`` or ``runs`` is below 1.

    Examples
    --------
    The mean NEES of four states over a hundred independent runs:

    >>> low, high = chi_square_interval(4, runs=100)
    >>> round(low, 2), round(high, 2)
    (3.46, 4.57)
    """
    if dof < 1 or runs < 1:
        raise WildlabError(
            f"no interval for {dof} degrees of freedom and {runs} runs", "give at least one of each"
        )
    return chi2_quantile(0.025, dof * runs) / runs, chi2_quantile(0.975, dof * runs) / runs


def whiten(errors: ArrayLike, covariances: ArrayLike) -> Array:
    """Errors in units of their own standard deviation: ``L^-1 e`` with ``P = L L'``.

    Parameters
    ----------
    errors
        (N, n). A row with NaN gives NaN.
    covariances
        (N, n, n), or (n, n) for all. One with NaN gives NaN.

    Returns
    -------
    (N, n); of unit covariance where the errors have the covariances stated.

    Raises
    ------
    WildlabError
        If the shapes do not fit, or a covariance is not positive definite.
    """
    e = np.asarray(errors, dtype=float)
    P = np.asarray(covariances, dtype=float)
    if e.ndim != 2 or P.shape not in ((e.shape[1],) * 2, (*e.shape, e.shape[1])):
        raise WildlabError(
            f"errors of shape {e.shape} do not go with covariances of shape {P.shape}",
            "give (N, n) and (N, n, n)",
        )
    P = np.broadcast_to(P, (*e.shape, e.shape[1]))
    known = np.isfinite(e).all(axis=1) & np.isfinite(P).all(axis=(1, 2))
    values = np.full(e.shape, np.nan)
    try:
        L = np.linalg.cholesky(P[known])
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(P[known])[:, 0]
        row = int(np.flatnonzero(known)[np.argmin(smallest)])
        raise WildlabError(
            f"the covariance in row {row} is not positive definite", "look at the filter that made it"
        ) from None
    values[known] = np.linalg.solve(L, e[known][..., None])[..., 0]
    return values


def nees(errors: ArrayLike, covariances: ArrayLike, truth_covariance: ArrayLike | None = None) -> Array:
    """Normalised error squared, NEES of estimates and NIS of innovations: ``e' P^-1 e``, H (3.11), (3.12).

    Parameters
    ----------
    errors
        (N, n), `ERROR_CONVENTION`; innovations with angles wrapped. A row with NaN gives NaN.
    covariances
        (N, n, n) of the estimates, or of the innovations; (n, n) for all.
    truth_covariance
        Likewise, of the errors of the truth itself, which are independent of the filter's: then the
        difference has the sum of both. Left out, the truth is taken for exact.

    Returns
    -------
    (N,)

    Raises
    ------
    WildlabError
        If the shapes do not fit, or a covariance is not positive definite.

    Examples
    --------
    >>> nees([[1.0, 2.0], [0.0, float("nan")]], [[1.0, 0.0], [0.0, 4.0]]).tolist()
    [2.0, nan]
    """
    P = np.asarray(covariances, dtype=float)
    if truth_covariance is not None:
        own = np.asarray(truth_covariance, dtype=float)
        if own.shape[-2:] != P.shape[-2:]:
            raise WildlabError(
                f"a truth covariance of shape {own.shape} does not go with covariances of shape {P.shape}",
                "give one of the same states",
            )
        P = P + own
    # A sum with NaN stays NaN: squares of a row that is not known are not known.
    return np.asarray(np.sum(whiten(errors, P) ** 2, axis=1))


def position_nees(
    errors: ArrayLike, covariances: ArrayLike, truth_covariance: ArrayLike | None = None
) -> Array:
    """NEES of the position alone, as H 7.5 uses it where the true velocity is not known well.

    Parameters
    ----------
    errors
        (N, n), truth minus estimate; the first two states are north and east.
    covariances
        (N, n, n) of the estimates.
    truth_covariance
        (2, 2) or (N, 2, 2) of the true positions, m^2; left out, they are taken for exact.

    Returns
    -------
    (N,), two degrees of freedom.

    Raises
    ------
    WildlabError
        As `nees`.
    """
    e, P = np.asarray(errors, dtype=float), np.asarray(covariances, dtype=float)
    return nees(e[:, :2], P[..., :2, :2], truth_covariance)


class Average(NamedTuple):
    """Mean of NEES or NIS (ANEES, ANIS; not divided by the degrees of freedom) beside its 95 % interval.

    ``n``: values it is of. ``worth``: how many independent ones they are worth. ``dof``: what it should be.
    """

    mean: float
    low: float
    high: float
    n: int
    worth: float
    dof: float

    @property
    def inside(self) -> bool:
        """Whether the mean is what a consistent filter's would be."""
        return bool(self.low <= self.mean <= self.high)

    @property
    def telling(self) -> bool:
        """Whether means of half and of twice what it should be would be outside."""
        return bool(self.low >= self.dof / 2 and self.high <= self.dof * 2)


def average(values: ArrayLike, dof: float, worth: float | None = None) -> Average:
    """Mean over the known values, and the interval in which that of a consistent filter lies.

    Parameters
    ----------
    values
        (N,) NEES or NIS; NaN where not known.
    dof
        Degrees of freedom of each; what the mean should be.
    worth
        How many independent values they are worth, at least one: all of them for independent runs, which is
        taken where it is left out. Neighbouring moments of one run share their error and are worth fewer.

    Returns
    -------
    Average
        Its mean is NaN where no value is known.

    Raises
    ------
    WildlabError
        If ``dof`` is below 1.
    """
    array = np.asarray(values, dtype=float)
    known = array[np.isfinite(array)]
    n = len(known)
    runs = max(1.0, float(n if worth is None or not np.isfinite(worth) else min(worth, n)))
    low, high = chi_square_interval(dof, runs=runs)
    return Average(float(known.mean()) if n else float("nan"), low, high, n, runs if n else 0.0, dof)


def share_inside(values: ArrayLike, interval: tuple[float, float]) -> float:
    """Share of the known values inside an interval.

    Parameters
    ----------
    values
        (N,); NaN where not known.
    interval
        Low and high end, in the unit of the values; both belong to it.

    Returns
    -------
    From 0 to 1; NaN where no value is known.
    """
    array = np.asarray(values, dtype=float)
    known = array[np.isfinite(array)]
    return float(np.mean((known >= interval[0]) & (known <= interval[1]))) if len(known) else float("nan")


class FilterRuns(NamedTuple):
    """NEES and NIS of simulated filter runs, each (runs, steps), and the time of each step in seconds."""

    time_s: Array
    nees: Array
    nis: Array


#: Standard deviation of each coordinate that simulated runs measure, m.
MEASURED_M = 2.0


def simulate_filter_runs(
    rng: np.random.Generator,
    *,
    runs: int,
    steps: int,
    claimed_noise: float = 1.0,
    acceleration_m_s2: float = 0.3,
) -> FilterRuns:
    """Runs of a linear Kalman filter on targets that move and are measured exactly as it assumes (H example
    3.1).

    North and east position and velocity are estimated from measured north and east positions.

    Parameters
    ----------
    claimed_noise
        Factor on the measurement noise that the filter believes in: 1 is the truth, 0.5 an overconfident
        filter.
    acceleration_m_s2
        Standard deviation of the process noise, constant over a step of a second.
    """
    F = np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2))
    # The order of the state is north, east, velocity north, velocity east. Q has rank 2: one acceleration per
    # axis, which moves position and velocity together.
    push = np.kron(np.array([[0.5], [1.0]]), np.eye(2)) * acceleration_m_s2
    Q, H, R = push @ push.T, np.eye(2, 4), np.eye(2) * (MEASURED_M * claimed_noise) ** 2
    P = np.diag([10.0, 10.0, 3.0, 3.0]) ** 2
    drawn = rng.standard_normal((runs, 4 + 4 * steps))
    truth = drawn[:, :4] * np.sqrt(np.diag(P))
    pushes, noises = np.split(drawn[:, 4:].reshape(runs, steps, 4), 2, axis=2)
    # All runs have the same covariances, so that one gain serves them all.
    estimate, values = np.zeros((runs, 4)), np.empty((2, runs, steps))
    for step in range(steps):
        truth = truth @ F.T + pushes[:, step] @ push.T
        estimate, P = estimate @ F.T, F @ P @ F.T + Q
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        innovation = (truth - estimate) @ H.T + MEASURED_M * noises[:, step]
        kept = np.eye(4) - K @ H
        estimate, P = estimate + innovation @ K.T, kept @ P @ kept.T + K @ R @ K.T
        values[0, :, step] = nees(truth - estimate, P)
        values[1, :, step] = nees(innovation, S)
    return FilterRuns(np.arange(1.0, steps + 1), values[0], values[1])


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


def white_bound(n: int) -> float:
    """Magnitude that autocorrelations of white samples stay below with 95 %, each.

    Parameters
    ----------
    n
        How many samples they are from; the bound holds where they are many.

    Returns
    -------
    float
    """
    return float(normal_quantile(0.975) / np.sqrt(n))


class Whiteness(NamedTuple):
    """Whether a sequence of innovations is white.

    ``autocorrelation`` (m, lags + 1) of each element, ``bound`` what that of white noise stays below at each
    lag in 95 % of cases; ``p_value`` of all elements and lags at once (`portmanteau`);
    ``n``: innovations it is from.
    """

    autocorrelation: Array
    bound: float
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
    correlation = np.stack([autocorrelation(column, lags) for column in v.T])
    return Whiteness(correlation, white_bound(len(v)), portmanteau(v, lags)[1], len(v))


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


class Series(NamedTuple):
    """NEES or NIS (N,) of one run over its times (N,), s, with ``dof`` degrees of freedom; NaN: none.

    ``worth``: how many independent values they are worth (`worth_of_errors`).
    """

    name: str
    dof: float
    times: Array
    values: Array
    worth: float


#: What errors are taken for: white noise and a first-order process, which has one of these shares of the
#: variance, and one of so many time constants, from a sample to four times the series.
LASTING, TIME_CONSTANTS = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0]), 12
#: Frequencies are taken together, the higher the more of them, in about so many bands.
BANDS = 60


def worth_of_errors(errors: ArrayLike) -> float:
    """How many independent values the NEES or NIS of errors are worth for their mean.

    Squares go together as the squares of the autocorrelations of errors do, about zero and not about their
    mean: an error that is the same throughout is one. The sum of these squares is taken up to the first
    autocorrelation that is not positive, and no smaller than expected of white noise and a first-order
    process in sum: what lasts beneath noise is hardly seen at any one lag. Shares and time constants count
    by the likelihood of the periodogram.

    Parameters
    ----------
    errors
        (N, m) errors or innovations in the order of time, in units of their own standard deviations
        (`whiten`) or a multiple of these; rows with NaN are left out.

    Returns
    -------
    float
        From 1 to N, or 0 where there is none.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> round(worth_of_errors(rng.standard_normal((1000, 2))), -2), worth_of_errors(np.ones((1000, 2)))
    (1000.0, 1.0)
    """
    x = np.asarray(errors, float)
    x = x[np.isfinite(x).all(axis=1)]
    n, m = x.shape
    if n < 4 or not x.any():
        return float(n)
    power = (np.abs(np.fft.rfft(x, 2 * n, axis=0)) ** 2).sum(axis=1)
    products, lag = np.fft.irfft(power), np.arange(n // 2 + 1)
    r = (products[lag] / products[0] * n / (n - lag))[1:]
    seen = 1 + 2 * float(np.cumprod(r > 0) @ r**2)

    power, often = power[::2], np.full(n // 2 + 1, 2.0)
    often[0], often[-1] = 1.0, 1.0 + n % 2
    band = np.unique(np.append(0, np.geomspace(1, n // 2, BANDS).astype(int)))
    count = np.add.reduceat(often, band)
    level = np.add.reduceat(often * power, band) / count
    angle = np.add.reduceat(often * lag, band) / count * 2 * np.pi / n
    share = LASTING[:, None, None]
    rho = np.exp(-1 / np.geomspace(0.7, 4 * n, TIME_CONSTANTS))[:, None]

    def tapered_sum(z: NDArray[Any], last: Array) -> Array:
        """Of ``(1 - |k| / n) z^|k|`` over all lags k, with ``last = z^n``: the expected periodogram."""
        return np.asarray(2 * (1 / (1 - z) - z * (1 - last) / (n * (1 - z) ** 2)).real - 1)

    spectrum = 1 - share + share * tapered_sum(rho * np.exp(1j * angle), rho**n)
    likelihood = -m / 2 * (np.log(spectrum) @ count + n * np.log((level / spectrum) @ count))
    chance = np.exp(likelihood - likelihood.max())
    inflation = 1 + share[..., 0] ** 2 * (tapered_sum(rho**2, rho ** (2 * n))[:, 0] - 1)
    return float(np.clip(n / max(seen, float((chance * inflation).sum() / chance.sum())), 1.0, n))


def worth(values: ArrayLike) -> float:
    """How many independent values those of one run (N,) are worth for their mean; NaN are left out.

    ``N / (1 + 2 sum of autocorrelations)``, summed up to the first one that is not positive; at most that of
    a first-order process, since in a short series these sums are too small. Its coefficient is the first
    autocorrelation without its bias (Kendall 1954), and larger by one standard error.

    Parameters
    ----------
    values
        (N,) in the order of time.

    Returns
    -------
    float
        From 1 to N, or 0 where there is none.

    Examples
    --------
    >>> worth([2.0, 1.0, float("nan")])
    2.0
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    n = len(known)
    if n < 4 or np.ptp(known) == 0:
        return float(n)
    r = autocorrelation(known, n - 1)[1:]
    within = np.cumprod(r > 0) @ r
    first = min(r[0] + (1 + 3 * r[0]) / n + np.sqrt((1 - r[0] ** 2) / n), 1.0)
    share = min(1 / (1 + 2 * within), (1 - first) / (1 + first))
    return float(np.clip(n * share, 1.0, n))


def mean_of_runs(runs: Sequence[Series]) -> Average:
    """Mean of the same quantity over independent runs, and the 95 % interval of a consistent filter's.

    Parameters
    ----------
    runs
        One series for each run; degrees of freedom that differ are averaged over the values.

    Returns
    -------
    Average
        ``worth`` is less than the sum of what runs are worth where values of one are worth more than those of
        another: variances of their sums add up.

    Examples
    --------
    >>> run = Series("NEES", 2, np.arange(3.0), np.array([1.0, 2.0, 3.0]), 3.0)
    >>> mean = mean_of_runs([run, run])
    >>> mean.mean, mean.n, mean.worth, mean.inside
    (2.0, 6, 6.0, True)
    """
    values = np.concatenate([np.asarray(run.values, float) for run in runs])
    known = np.array([np.isfinite(run.values).sum() for run in runs])
    dof = float(np.average([run.dof for run in runs], weights=known)) if known.any() else runs[0].dof
    lost = sum(n**2 / run.worth for n, run in zip(known, runs, strict=True) if n)
    return average(values, dof, known.sum() ** 2 / lost if lost else 0.0)
