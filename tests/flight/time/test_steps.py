"""Clocks that were set anew, and counters that begin again."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.flight.time.steps import fit_stretches, step_sentences, unwrap_counter


@pytest.mark.parametrize("jump", [-300.0, -1.0, 0.5, 3600.0])
@pytest.mark.parametrize("rate", [0.92, 1.0, 1.08])
def test_a_clock_set_anew_is_found_and_said(jump, rate):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        true = np.sort(rng.uniform(0, 600, 1500))
        at = int(rng.integers(200, 1300))
        own = (true - 3.0) / rate
        own[at:] += jump
        stretches = fit_stretches(own, 1.7e9 + true + rng.normal(0, 0.02, 1500))
        assert len(stretches) == 2
        assert abs(stretches[1].first - at) <= 2
        for one in stretches:
            rows = slice(max(one.first, 0) + 3, one.last - 2)
            assert np.abs(one.fit.to_reference(own[rows]) - 1.7e9 - true[rows]).max() < 0.02
        (said,) = step_sentences(stretches, "the camera's clock")
        amount = re.search(r" by (\S+) s before", said)
        assert amount is not None and float(amount[1]) == pytest.approx(abs(jump), abs=0.02, rel=0.01)
        assert ("forward" if jump > 0 else "back") in said


@pytest.mark.parametrize("noise", ["normal", "late", "outliers", "none"])
def test_no_step_where_there_is_none(noise):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        own = np.sort(rng.uniform(0, 600, 1200))
        y = 1.7e9 + rng.uniform(0.9, 1.1) * own
        if noise == "normal":
            y += rng.normal(0, 0.05, 1200)
        elif noise == "late":
            y += rng.uniform(0, 0.85, 1200)
        elif noise == "outliers":
            y += rng.normal(0, 0.02, 1200) + (rng.random(1200) < 0.1) * rng.normal(0, 50, 1200)
        stretches = fit_stretches(own, y, late=noise == "late")
        assert len(stretches) == 1
        assert (stretches[0].first, stretches[0].last) == (0, 1199)
        assert step_sentences(stretches) == []


def test_two_steps_and_missing_stamps():
    rng = np.random.default_rng(4)
    true = np.arange(0, 300, 0.5)
    own = true + np.select([true < 100, true < 200], [0.0, 5.0], -40.0)
    own[::17] = np.nan
    stretches = fit_stretches(own, true + rng.normal(0, 0.01, len(true)))
    assert [one.first for one in stretches] == pytest.approx([0, 200, 400], abs=2)
    assert len(step_sentences(stretches)) == 2
    with pytest.raises(WildlabError, match="no stamp"):
        fit_stretches([np.nan, 1.0], [1.0, np.nan])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([2.0**16, 2.0**32, 604800.0]))
def test_a_counter_that_begins_again_goes_on(seed, period):
    rng = np.random.default_rng(seed)
    true = np.cumsum(rng.uniform(0, 0.4 * period, 50)) + rng.uniform(0, period)
    out = unwrap_counter(true % period, period)
    assert out - out[0] == pytest.approx(true - true[0], abs=1e-6 * period)


def test_a_start_anew_is_no_wrap_and_nan_stays():
    stamps = np.array([100.0, 101.0, np.nan, 0.0, 1.0])
    assert unwrap_counter(stamps, 4294.967296)[[0, 1, 3, 4]].tolist() == [100.0, 101.0, 0.0, 1.0]
    assert np.isnan(unwrap_counter(stamps, 4294.967296)[2])
