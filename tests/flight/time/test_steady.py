"""A rate that is none of a quartz only where the log can tell it, for instants and for receipts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.flight.time.steady import fit_steady

UTC = 1.7e9


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), rate=st.floats(0.9, 1.1), offset=st.floats(0.05, 5.0))
def test_offset_and_rate_under_jittered_receipts(seed, rate, offset):
    rng = np.random.default_rng(seed)
    own = 700 + np.sort(rng.uniform(0, 600, 5000))
    received = UTC + offset + rate * own + rng.exponential(0.2, 5000)
    fit = fit_steady(own, received, late=True)
    ends = own[[0, -1]]
    assert np.abs(fit.to_reference(ends) - UTC - offset - rate * ends).max() < 0.01
    assert abs(fit.rate - rate) < 1e-4


@pytest.mark.parametrize("late", [False, True])
def test_a_short_log_does_not_tell_the_rate(late):
    rng = np.random.default_rng(5)
    own = 300 + np.arange(0, 12, 0.2)
    noise = rng.exponential(0.3, len(own)) if late else rng.normal(0, 0.02, len(own))
    fit = fit_steady(own, UTC + own + noise, late)
    assert abs(fit.rate - 1) < 1e-4
    assert abs(fit.to_reference(306.0) - UTC - 306) < 0.03
    assert np.allclose(fit.residual, UTC + own + noise - fit.to_reference(own), atol=1e-6)


def test_early_receipts_of_a_short_log_are_outliers():
    own = 300 + np.arange(0, 10, 0.2)
    received = UTC + own + np.linspace(0, 0.2, 50) % 0.07
    received[20] -= 40.0
    fit = fit_steady(own, received, late=True)
    assert abs(fit.rate - 1) < 1e-4
    assert not fit.used[20]
    assert abs(fit.to_reference(305.0) - UTC - 305) < 0.01


def test_one_pair_gives_an_offset_and_none_an_error():
    fit = fit_steady([5.0], [UTC])
    assert (fit.rate, fit.offset_s) == (1.0, UTC - 5)
    with pytest.raises(WildlabError, match="no stamp"):
        fit_steady([np.nan], [1.0], late=True)
