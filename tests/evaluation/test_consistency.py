"""NEES, NIS and their limits, against the print, scipy and the definition."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2, kstest

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    average,
    chi_square_interval,
    nees,
    position_nees,
    share_inside,
    simulate_filter_runs,
    whiten,
)


@pytest.mark.parametrize(
    ("dof", "runs", "printed", "digits"),
    [(4, 1, (0.48, 11.14), 2), (2, 1, (0.051, 7.38), 2), (2, 50, (1.5, 2.6), 1)],
)
def test_limits_as_printed_in_example_3_1(dof, runs, printed, digits):
    low, high = chi_square_interval(dof, runs=runs)
    assert (round(low, digits + (printed[0] == 0.051)), round(high, digits)) == printed


def test_nees_is_its_definition():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((50, 4, 4))
    P = root @ root.transpose(0, 2, 1) + np.eye(4) * 0.1
    e = rng.standard_normal((50, 4))
    expected = [row @ np.linalg.inv(matrix) @ row for row, matrix in zip(e, P, strict=True)]
    np.testing.assert_allclose(nees(e, P), expected, rtol=1e-9)
    np.testing.assert_allclose(nees(e, P[0]), [row @ np.linalg.inv(P[0]) @ row for row in e], rtol=1e-9)


def test_moments_without_truth_stay_in_their_row():
    e = np.array([[1.0, 0.0], [np.nan, 0.0], [0.0, 2.0]])
    np.testing.assert_array_equal(nees(e, np.eye(2)), [1.0, np.nan, 4.0])
    assert share_inside([1.0, np.nan, 4.0], (0.5, 2.0)) == 0.5
    assert np.isnan(share_inside([np.nan], (0.0, 1.0)))


@pytest.mark.parametrize("claimed", [1.0, 0.5])
def test_runs_are_those_of_filterpy(claimed):
    found = simulate_filter_runs(np.random.default_rng(5), runs=2, steps=4, claimed_noise=claimed)
    rng, F = np.random.default_rng(5), np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
    push = np.kron([[0.5], [1.0]], np.eye(2)) * 0.3
    for run in range(2):
        kf = KalmanFilter(dim_x=4, dim_z=2)
        kf.F, kf.H, kf.Q, kf.R = F, np.eye(2, 4), push @ push.T, np.eye(2) * (2.0 * claimed) ** 2
        kf.P = np.diag([100.0, 100.0, 9.0, 9.0])
        truth = rng.standard_normal(4) * [10.0, 10.0, 3.0, 3.0]
        for step in range(4):
            truth = F @ truth + push @ rng.standard_normal(2)
            kf.predict()
            kf.update(truth[:2] + 2.0 * rng.standard_normal(2))
            error = truth - kf.x.ravel()
            assert found.nees[run, step] == pytest.approx(error @ np.linalg.solve(kf.P, error))
            assert found.nis[run, step] == pytest.approx((kf.y.T @ kf.SI @ kf.y).item())


def test_the_truth_has_an_uncertainty_of_its_own():
    rng = np.random.default_rng(6)
    P, own = np.array([[4.0, 1.0], [1.0, 2.0]]), np.diag([0.5, 3.0])
    e = rng.multivariate_normal([0, 0], P, 20_000) + rng.multivariate_normal([0, 0], own, 20_000)
    assert kstest(nees(e, P, own), chi2(2).cdf).pvalue > 0.01
    assert np.mean(nees(e, P)) > 2.5
    np.testing.assert_allclose(nees(e, P, np.zeros((2, 2))), nees(e, P))
    with pytest.raises(WildlabError, match="does not go"):
        nees(e, P, np.eye(4))


def test_position_alone_is_the_marginal():
    rng = np.random.default_rng(7)
    root = rng.standard_normal((4, 4))
    P, own = root @ root.T + np.eye(4), np.diag([2.0, 1.0])
    e = rng.standard_normal((50, 4))
    np.testing.assert_allclose(position_nees(e, P, own), nees(e[:, :2], P[:2, :2] + own))


def test_whitened_errors_have_unit_covariance():
    rng = np.random.default_rng(8)
    P = np.array([[9.0, -2.0], [-2.0, 1.0]])
    e = rng.multivariate_normal([0, 0], P, 50_000)
    e[3] = np.nan
    w = whiten(e, P)
    assert np.isnan(w[3]).all()
    np.testing.assert_allclose(np.cov(w[4:].T), np.eye(2), atol=0.03)
    np.testing.assert_allclose(np.sum(w[4:] ** 2, axis=1), nees(e, P)[4:])


def test_an_average_knows_how_many_values_it_is_of():
    rng = np.random.default_rng(9)
    inside = [average(rng.chisquare(2, 40), 2).inside for _ in range(3000)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.012)
    a = average([1.0, np.nan, 3.0], 2)
    assert (a.mean, a.n, a.worth) == (2.0, 2, 2.0)
    assert (a.low, a.high) == chi_square_interval(2, runs=2)
    none = average([np.nan], 2)
    assert np.isnan(none.mean)
    assert (none.n, none.worth, none.inside) == (0, 0.0, False)


def test_values_that_repeat_each_other_are_worth_fewer():
    rng = np.random.default_rng(10)
    inside, naive = [], []
    for _ in range(2000):
        repeated = np.repeat(rng.chisquare(2, 10), 8)
        inside.append(average(repeated, 2, worth=10).inside)
        naive.append(average(repeated, 2).inside)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)
    assert np.mean(naive) < 0.6
    # More than there are, or less than one, is not believed.
    assert average([1.0, 2.0], 2, worth=9.0).worth == 2.0
    assert average([1.0, 2.0], 2, worth=0.2).worth == 1.0
