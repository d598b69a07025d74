"""How many there are: against all ways in which each animal can be there or not."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import poisson

from wildlab.errors import WildlabError
from wildlab.tracking.particles import count_interval, count_probabilities, existence_after

some = st.lists(st.floats(0, 1), max_size=7)


@given(existence=some)
def test_every_way_of_being_there_is_counted(existence):
    wanted = np.zeros(len(existence) + 1)
    for way in product([0, 1], repeat=len(existence)):
        wanted[sum(way)] += np.prod([r if there else 1 - r for r, there in zip(existence, way, strict=True)])
    np.testing.assert_allclose(count_probabilities(existence), wanted, atol=1e-12)


@given(existence=some, unseen=st.floats(0.01, 40))
def test_those_never_seen_come_on_top(existence, unseen):
    p = count_probabilities(existence, unseen)
    numbers = np.arange(len(p))
    assert np.isclose(p.sum(), 1)
    mean, variance = numbers @ p, numbers**2 @ p - (numbers @ p) ** 2
    r = np.array(existence)
    assert np.isclose(mean, r.sum() + unseen) and np.isclose(
        variance, (r * (1 - r)).sum() + unseen, rtol=1e-6
    )
    if not existence:
        np.testing.assert_allclose(p, poisson(unseen).pmf(numbers), atol=1e-10)


@given(existence=some, unseen=st.floats(0, 10), probability=st.floats(0.05, 0.99))
def test_the_interval_is_the_shortest_that_holds_enough(existence, unseen, probability):
    p = count_probabilities(existence, unseen)
    count = count_interval(p, probability)
    assert np.isclose(count.probability, p[count.low : count.high + 1].sum())
    assert count.probability >= probability - 1e-9
    length = count.high - count.low
    for low in range(len(p)):
        assert p[low : low + length].sum() < probability  # none that is shorter by one holds it
        assert p[low : low + length + 1].sum() <= count.probability + 1e-9
    assert np.isclose(count.mean, np.arange(len(p)) @ p)


def test_looking_n_times_for_one_that_is_not_seen():
    r = 0.7
    for _ in range(5):
        r = float(existence_after(r, 0.4))
    assert np.isclose(r, 0.7 * 0.4**5 / (0.3 + 0.7 * 0.4**5))
    assert (
        existence_after(1.0, 0.0) == 0 and existence_after(1.0, 1e-9) == 1 and existence_after(0.0, 1e9) == 0
    )


@pytest.mark.parametrize("existence, unseen", [([1.2], 0.0), ([np.nan], 0.0), ([0.5], -1.0), ([0.5], np.inf)])
def test_what_cannot_be_counted_is_refused(existence, unseen):
    with pytest.raises(WildlabError, match="0 to 1"):
        count_probabilities(existence, unseen)


@pytest.mark.parametrize("probability", [0.0, 1.0, np.nan])
def test_an_interval_of_no_probability_is_refused(probability):
    with pytest.raises(WildlabError, match="above 0"):
        count_interval([0.5, 0.5], probability)
