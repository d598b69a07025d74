"""Intervals for a mean and for a share of independent runs."""

import numpy as np
import pytest
from scipy.stats import binomtest, ttest_1samp

from wildlab.evaluation.intervals import mean_interval, mean_share_interval, share_interval


def test_mean_is_students():
    values = np.array([3.0, 5.0, 4.5, 9.0])
    known = ttest_1samp(values, 0.0).confidence_interval(0.95)
    found = mean_interval([*values, np.nan])
    assert found == pytest.approx((values.mean(), known.low, known.high), rel=1e-12)


@pytest.mark.parametrize(("count", "runs"), [(0, 8), (3, 8), (8, 8), (170, 200)])
@pytest.mark.parametrize("probability", [0.9, 0.95])
def test_share_is_that_of_wilson(count, runs, probability):
    known = binomtest(count, runs).proportion_ci(probability, method="wilson")
    assert share_interval(count, runs, probability) == pytest.approx(
        (count / runs, known.low, known.high), abs=1e-9
    )


def test_few_runs_have_a_mean_and_no_interval():
    for found in (mean_interval([1.0, np.nan]), mean_share_interval([1.0])):
        assert found.estimate == 1.0 and np.isnan(found[1:]).all()
    for nothing in (mean_interval([]), mean_share_interval([np.nan]), share_interval(0, 0)):
        assert np.isnan(nothing).all()
