"""Noise has the statistics it is documented with; clocks and logs do what they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.simulation.error_models import (
    computer_stamps,
    gauss_markov,
    rounded,
    stream,
    with_attitude_error,
)


def test_gauss_markov_has_its_variance_and_autocorrelation_from_the_first_sample_on():
    runs, step, tau, sd = 40_000, 0.1, 3.0, 2.0
    x = gauss_markov(61, step, np.full(runs, sd), tau, np.random.default_rng(11))
    # 40 000 independent runs: a variance is known to sqrt(2/N) = 0.7 %, a product to about the same.
    tolerance = 5 * np.sqrt(2.0 / runs) * sd**2
    for sample in (0, 1, 30, 60):
        assert np.mean(x[sample] ** 2) == pytest.approx(sd**2, abs=tolerance)
        assert np.mean(x[sample]) == pytest.approx(0.0, abs=5 * sd / np.sqrt(runs))
    for first, lag in ((0, 1), (0, 10), (0, 30), (20, 30), (0, 60)):
        expected = sd**2 * np.exp(-lag * step / tau)
        assert np.mean(x[first] * x[first + lag]) == pytest.approx(expected, abs=tolerance)


def test_gauss_markov_axes_are_independent_and_have_their_own_numbers():
    x = gauss_markov(400_000, 1.0, [1.0, 3.0], [2.0, 5.0], np.random.default_rng(5))
    # The effective number of samples is N (1 - a^2)/(1 + a^2) or more: about 80 000 for tau = 5.
    assert np.std(x, axis=0) == pytest.approx([1.0, 3.0], rel=5 / np.sqrt(2 * 80_000))
    for axis, tau in enumerate((2.0, 5.0)):
        lagged = np.corrcoef(x[:-4, axis], x[4:, axis])[0, 1]
        assert lagged == pytest.approx(np.exp(-4 / tau), abs=0.02)
    assert abs(np.corrcoef(x.T)[0, 1]) < 0.02


def test_a_new_sensor_changes_nobody_elses_noise():
    a, again, other, next_seed = (
        stream(seed, name).standard_normal(50)
        for seed, name in ((1, "gyro"), (1, "gyro"), (1, "clock"), (2, "gyro"))
    )
    assert np.array_equal(a, again)
    assert not np.isin(a, other).any()
    assert not np.isin(a, next_seed).any()


def test_reported_attitude_and_error_give_back_the_truth():
    rng = np.random.default_rng(2)
    true = Rotation.random(20, rng=rng).as_matrix()
    error = 0.05 * rng.standard_normal((20, 3))
    reported = with_attitude_error(true, error)
    assert np.allclose(reported @ Rotation.from_rotvec(error).as_matrix(), true, atol=1e-14)
    assert not np.allclose(reported, true, atol=1e-3)


def test_rounding_is_to_the_step():
    assert rounded([1.234, -0.006], 0.01) == pytest.approx([1.23, -0.01])
    assert rounded([1.234], 0.0) == pytest.approx([1.234])


def test_stamps_of_an_idle_computer_are_the_clocks():
    t = 100 + np.arange(100) / 7.5
    stamps = computer_stamps(t, -0.3, 1e-4, 0.0, np.random.default_rng(0))
    assert stamps == pytest.approx(t - 0.3 + 1e-4 * (t - 100), abs=1e-12)


def test_stamps_never_overtake_and_are_late_by_the_mean_latency():
    rare = np.arange(20_000) * 10.0  # so far apart that none waits for another
    late = computer_stamps(rare, 0.0, 0.0, 0.05, np.random.default_rng(1)) - rare
    assert late.min() >= 0
    assert late.mean() == pytest.approx(0.05, abs=5 * 0.05 / np.sqrt(20_000))
    assert late.std() == pytest.approx(0.05, rel=0.06)
    dense = np.arange(20_000) / 100
    assert np.diff(computer_stamps(dense, 0.0, 0.0, 0.05, np.random.default_rng(1))).min() >= 1e-3 - 1e-9
    assert len(computer_stamps([], 0.0, 0.0, 0.05, np.random.default_rng(1))) == 0
