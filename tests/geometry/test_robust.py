"""Student's t: as good as least squares on normal errors, and deaf to what is far out."""

import numpy as np
import pytest

from wildlab.geometry.robust import fit_linear, student_cost, student_scale


def test_on_normal_errors_the_scale_is_the_standard_deviation():
    e = np.random.default_rng(0).normal(0, 3.0, (20000, 2))
    assert student_scale((e**2).sum(axis=1)) == pytest.approx(3.0, rel=0.02)
    assert np.isnan(student_scale([np.nan]))


def test_a_tenth_far_out_hardly_matters():
    rng = np.random.default_rng(1)
    J = rng.normal(size=(300, 2, 3)) * [1.0, 1e3, 1e-3]
    x = np.array([2.0, 3e-3, -4e3])
    r = -J @ x + rng.normal(0, 1.0, (300, 2))
    r[:30] += [200.0, -100.0]
    fit = fit_linear(J, r)
    assert np.allclose(fit / x, 1.0, atol=0.15)
    # They count as one ordinary point each, however far out.
    assert 1.0 < student_scale(((r + J @ fit) ** 2).sum(axis=1)) < 1.3
    plain = np.linalg.lstsq(J.reshape(-1, 3), -r.ravel(), rcond=None)[0]
    assert np.abs(plain / x - 1).max() > 0.5


def test_the_cost_is_least_at_the_fit():
    rng = np.random.default_rng(4)
    J, r = rng.normal(size=(80, 2, 2)), rng.normal(1.0, 1.0, (80, 2))
    x = fit_linear(J, r)
    cost = [student_cost(((r + J @ (x + step)) ** 2).sum(axis=1)) for step in ([0, 0], [0.1, 0], [0, -0.1])]
    assert cost[0] < min(cost[1:])
