"""Clocks against each other: simulated ones, whose rate, offset and steps are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.flight.clock_fitting import ClockFit, fit_clock, fit_steady

EPOCH = 1.7e9


def clocks(
    seed: int, pairs: int = 3000, long: float = 600.0
) -> tuple[np.random.Generator, np.ndarray, np.ndarray, float]:
    """A generator, stamps of a clock, the reference at these, and the rate."""
    rng = np.random.default_rng(seed)
    offset, rate = rng.choice([-1, 1]) * rng.uniform(0.05, 5.0), rng.uniform(0.9, 1.1)
    own = np.sort(rng.uniform(0, long, pairs))
    return rng, own, EPOCH + offset + rate * own, float(rate)


def assert_as_promised(fit: ClockFit, own: np.ndarray, true: np.ndarray, rate: float) -> None:
    at = np.array([0, len(own) // 2, -1])
    assert np.abs(fit.to_reference(own[at]) - true[at]).max() < 0.010
    assert abs(fit.rate - rate) < 1e-4


@pytest.mark.parametrize("jitter", [0.01, 0.05])
@pytest.mark.parametrize("outliers", [0.0, 0.2])
def test_rate_and_offset_through_jitter_and_outliers(jitter, outliers):
    for seed in range(15):
        rng, own, true, rate = clocks(seed)
        wrong = rng.random(len(own)) < outliers
        fit = fit_clock(own, true + rng.normal(0, jitter, len(own)) + wrong * rng.normal(0, 100, len(own)))
        assert_as_promised(fit, own, true, rate)


@pytest.mark.parametrize("kind", ["uniform", "exponential", "steps of a stamp"])
def test_under_stamps_that_are_only_late(kind):
    for seed in range(10):
        rng, own, true, rate = clocks(seed, 6000, 1200.0)
        late = rng.uniform(0, 0.85, len(own)) if kind == "uniform" else rng.exponential(0.2, len(own))
        stamps = true + late
        if kind == "steps of a stamp":
            stamps = np.ceil(stamps * 1000) / 1000
        fit = fit_clock(own, stamps, late=True)
        assert_as_promised(fit, own, true, rate)
        # Through them, it would be off by the mean delay.
        assert abs(fit_clock(own, stamps).to_reference(300.0) - fit.to_reference(300.0)) > 0.1


@pytest.mark.parametrize("late", [False, True])
def test_standard_deviations_are_those_of_many_clocks(late):
    off = []
    for seed in range(80):
        rng, own, true, rate = clocks(seed, 500)
        noise = rng.exponential(0.2, 500) if late else rng.normal(0, 0.03, 500)
        fit = fit_clock(own, true + noise, late)
        off.append((fit.rate - rate) / fit.rate_sd)
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.3


def test_residuals_that_go_together_count_for_fewer():
    off = []
    for seed in range(100):
        rng, own, true, rate = clocks(seed, 1000)
        noise = np.zeros(1000)
        for i in range(1, 1000):
            noise[i] = 0.9 * noise[i - 1] + rng.normal(0, 0.01)
        fit = fit_clock(own, true + noise)
        off.append((fit.rate - rate) / fit.rate_sd)
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_few_pairs_say_that_they_do_not_tell():
    fit = fit_clock([1.0, 2.0], [11.0, 12.0])
    assert fit.to_reference(3.0) == pytest.approx(13.0)
    one = fit_clock([4.0], [9.0])
    assert one.rate == 1.0 and one.offset_s == pytest.approx(5.0)
    assert np.isinf([fit.rate_sd, one.rate_sd]).all()


def test_coarse_stamps_do_not_hide_the_rate():
    """Most pairs of a clock that a loop of 50 Hz reads fall on one line, and the others beside it."""
    true = np.arange(0.0, 17.0, 0.2)
    own = np.floor((true / 1.0013 + 0.004) / 0.02) * 0.02
    fit = fit_clock(own, true, resolution_s=0.02)
    assert fit.rate == pytest.approx(1.0013, abs=3 * fit.rate_sd) and fit.used.all()


UTC = 1.7e9


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000), rate=st.floats(0.9, 1.1), offset=st.floats(0.05, 5.0))
def test_offset_and_rate_under_jittered_receipts(seed, rate, offset):
    rng = np.random.default_rng(seed)
    own = 700 + np.sort(rng.uniform(0, 600, 5000))
    received = UTC + offset + rate * own + rng.exponential(0.2, 5000)
    fit = fit_steady(own, received, late=True)
    ends = own[[0, -1]]
    assert np.abs(fit.to_reference(ends) - UTC - offset - rate * ends).max() < 0.01
    assert abs(fit.rate - rate) < 1e-4


def test_early_receipts_of_a_short_log_are_outliers():
    own = 300 + np.arange(0, 10, 0.2)
    received = UTC + own + np.linspace(0, 0.2, 50) % 0.07
    received[20] -= 40.0
    fit = fit_steady(own, received, late=True)
    assert abs(fit.rate - 1) < 1e-4
    assert not fit.used[20]
    assert abs(fit.to_reference(305.0) - UTC - 305) < 0.01


@pytest.mark.parametrize("early", [0.05, 0.15, 0.4, 2.0])
def test_one_early_stamp_among_late_ones_moves_nothing(early):
    for seed in range(5):
        rng, own, true, rate = clocks(seed)
        stamps = true + rng.exponential(0.1, len(own))
        stamps[len(own) // 3] = true[len(own) // 3] - early
        assert_as_promised(fit_clock(own, stamps, late=True), own, true, rate)


@pytest.mark.parametrize("early", [1.0, 30.0])
def test_one_early_stamp_in_fifty_moves_nothing(early):
    """More than are left out one by one, from beside the late ones to far below them."""
    for seed in range(3):
        rng, own, true, rate = clocks(seed, 5000)
        wrong = rng.random(len(own)) < 0.02
        stamps = true + rng.exponential(0.2, len(own)) - wrong * early * rng.uniform(0.5, 1.0, len(own))
        assert_as_promised(fit_clock(own, stamps, late=True), own, true, rate)
