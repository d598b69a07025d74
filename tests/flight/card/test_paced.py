"""The rate that a stream has while it runs, and its pauses: of uneven streams too."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.flight.card.said import paced


@given(
    st.sampled_from([1.0, 5.0, 10.0, 50.0, 200.0]),
    st.lists(st.tuples(st.integers(30, 200), st.floats(8, 500)), min_size=1, max_size=5),
    st.integers(0, 99),
)
def test_running_periods_have_their_rate_and_pauses_are_counted(rate, periods, seed):
    rng = np.random.default_rng(seed)
    stamps, at, paused = [], 0.0, []
    for count, steps in periods:
        stamps.append(at + (np.arange(count) + rng.uniform(-0.1, 0.1, count)) / rate)
        at = stamps[-1][-1] + steps / rate
        paused.append(steps / rate)
    said = paced(rng.permutation(np.concatenate(stamps)))
    found = re.fullmatch(r" at ([\d.e+]+) Hz(?: \((\d+) pauses?, ([\d.e+-]+) s\))?", said)
    assert found is not None, said
    assert float(found[1]) == pytest.approx(rate, rel=0.05)
    assert int(found[2] or 0) == len(periods) - 1
    assert float(found[3] or 0) == pytest.approx(sum(paused[:-1]), rel=0.05, abs=0.3 / rate)
