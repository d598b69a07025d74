"""Autocorrelation against its definition and against processes whose answer is known."""

import numpy as np

from wildlab.evaluation.whiteness import autocorrelation, effective_sample_size, ljung_box, white_bound


def first_order(n, rho, rng):
    x = np.empty(n)
    x[0] = rng.normal()
    for t in range(1, n):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * rng.normal()
    return x


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
        p_values.append(ljung_box(x, 20)[1])
    assert 0.93 < np.mean(inside) < 0.97
    assert 0.01 < np.mean(np.array(p_values) < 0.05) < 0.11


def test_a_first_order_process_is_found_coloured():
    x = first_order(5000, 0.8, np.random.default_rng(2))
    assert np.allclose(autocorrelation(x, 5), 0.8 ** np.arange(6), atol=0.05)
    assert ljung_box(x, 20)[1] < 1e-6
    assert np.isclose(effective_sample_size(x, 200) / 5000, 0.2 / 1.8, rtol=0.25)


def test_a_constant_series_has_no_autocorrelation():
    assert np.isnan(autocorrelation(np.ones(10), 3)).all()
