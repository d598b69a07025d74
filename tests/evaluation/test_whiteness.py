"""Autocorrelation against its definition and against processes whose answer is known."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2, kstest

from wildlab.evaluation.consistency import (
    autocorrelation,
    average,
    chi_square_interval,
    innovation_whiteness,
    portmanteau,
    white_bound,
    worth,
    worth_of_errors,
)


def first_order(n, rho, rng):
    x = np.empty(n)
    x[0] = rng.normal()
    for t in range(1, n):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * rng.normal()
    return x


def ljung_box(x, lags):
    """The statistic as it is printed, of one element, and its p-value."""
    n, r = len(x), autocorrelation(x, lags)[1:]
    statistic = n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1)))
    return statistic, chi2.sf(statistic, lags)


def test_autocorrelation_is_its_definition():
    x = np.random.default_rng(0).normal(size=57)
    d = x - x.mean()
    direct = [d[: len(d) - k] @ d[k:] / (d @ d) for k in range(20)]
    assert np.allclose(autocorrelation(x, 19), direct)


def test_white_noise_stays_inside_its_bounds():
    rng = np.random.default_rng(1)
    n, inside, p_values = 500, [], []
    for _ in range(200):
        x = rng.normal(size=n)
        inside.append(np.abs(autocorrelation(x, 20)[1:]) < white_bound(n))
        p_values.append(portmanteau(x[:, None], 20)[1])
    assert 0.93 < np.mean(inside) < 0.97
    assert 0.01 < np.mean(np.array(p_values) < 0.05) < 0.11


def test_a_first_order_process_is_found_coloured():
    x = first_order(5000, 0.8, np.random.default_rng(2))
    assert np.allclose(autocorrelation(x, 5), 0.8 ** np.arange(6), atol=0.05)
    assert portmanteau(x[:, None], 20)[1] < 1e-6
    assert np.isclose(worth(x) / 5000, 0.2 / 1.8, rtol=0.25)


def test_what_lasts_beneath_white_noise_is_counted():
    """Half of the variance falls by e in fifty samples: neighbours hardly go together, sums do."""
    rng = np.random.default_rng(4)
    found = [worth(first_order(20000, 0.98, rng) + rng.normal(size=20000)) / 20000 for _ in range(5)]
    assert np.isclose(np.mean(found), 1 / (1 + 0.98 / 0.02), rtol=0.3)


@pytest.mark.parametrize("n", [50, 200, 1000])
@pytest.mark.parametrize(
    ("share", "rho", "wider"),
    [(0.0, 0.0, 1.1), (1.0, 0.5, 1.5), (1.0, 0.9, 4.0), (1.0, 0.97, 8.0), (0.2, 0.98, 3.5), (0.5, 0.98, 5.0)],
)
def test_the_band_of_a_mean_holds_that_of_a_consistent_filter(share, rho, wider, n):
    """Of 400 runs: white noise, first-order processes, and one beneath white noise, of which correlations of
    squares see so little that 67 to 89 % would be inside."""
    drawn = np.random.default_rng(1).normal(size=(2, 400, n + 400, 2))
    drawn[0] *= np.sqrt(1 - rho**2)
    slow = lfilter([1], [1, -rho], drawn[0], axis=1)[:, 400:]
    errors = np.sqrt(share) * slow + np.sqrt(1 - share) * drawn[1, :, 400:]
    runs = [average((one**2).sum(axis=1), 2, worth_of_errors(one)) for one in errors]
    assert 0.89 < np.mean([run.inside for run in runs]) < 0.995
    low, high = chi_square_interval(2, runs=n)
    assert np.median([run.high - run.low for run in runs]) < wider * (high - low)


def test_an_error_that_stands_is_one_value_however_its_square_wavers():
    rng = np.random.default_rng(0)
    assert worth_of_errors(rng.normal(size=2) + rng.normal(0, 0.05, (400, 2))) < 3
    assert worth_of_errors(np.full((3, 2), np.nan)) == 0.0


def test_portmanteau_of_one_element_is_ljung_and_box():
    x = np.random.default_rng(3).normal(size=80)
    statistic, p_value = ljung_box(x, 10)
    ours = portmanteau(x[:, None], 10)
    # Theirs has T (T + 2), Hosking's T^2.
    assert np.isclose(ours[0] * (80 + 2) / 80, statistic)
    assert abs(ours[1] - p_value) < 0.05


def test_portmanteau_of_correlated_elements_that_are_white_in_time():
    rng = np.random.default_rng(4)
    mix = np.array([[1.0, 0.0], [5.0, 0.3]])
    p_values = [portmanteau(rng.normal(size=(400, 2)) @ mix.T, 8)[1] for _ in range(400)]
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_what_one_element_tells_of_the_next_of_another_is_found():
    x = np.random.default_rng(5).normal(size=401)
    pair = np.column_stack([x[1:], x[:-1]])
    white = innovation_whiteness(pair, 10)
    assert (np.abs(white.autocorrelation[:, 1]) < 2 * white.bound).all()
    assert white.p_value < 1e-9
