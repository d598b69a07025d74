"""Quantiles against scipy.stats, at every probability and number of degrees of freedom."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from wildlab.geometry.covariances import chi2_beyond, chi2_quantile, normal_quantile, student_quantile

probabilities = st.floats(-0.5, 1.5) | st.sampled_from([0.0, 1.0, float("nan")])
freedoms = st.floats(-2.0, 1e4, allow_subnormal=False) | st.integers(-1, 500) | st.just(float("nan"))


@given(probabilities, freedoms)
@example(0.975, 0)
def test_quantiles_are_those_of_scipy_stats(probability, dof):
    np.testing.assert_equal(chi2_quantile(probability, dof), float(stats.chi2.ppf(probability, dof)))
    np.testing.assert_equal(student_quantile(probability, dof), float(stats.t.ppf(probability, dof)))
    np.testing.assert_equal(normal_quantile(probability), float(stats.norm.ppf(probability)))


@given(st.floats(-5.0, 1e4) | st.sampled_from([0.0, float("inf"), float("nan")]), freedoms)
def test_the_tail_is_that_of_scipy_stats(value, dof):
    np.testing.assert_equal(chi2_beyond(value, dof), float(stats.chi2.sf(value, dof)))


@pytest.mark.slow
def test_a_report_does_without_scipy_stats():
    rooms = "reporting.report", "analysis.accuracy", "analysis.navigate", "runner.job"
    imports = "; ".join(f"import wildlab.{room}" for room in rooms)
    code = f"import sys; {imports}; print('scipy.stats' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"
