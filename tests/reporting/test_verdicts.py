"""How numbers and claims stand beside published ones, and the spread over few flights and many."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.evaluation.replication import Closeness, Comparison, Compatibility
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, NO_PREMISE, UNDECIDED
from wildlab.reporting.published import (
    ALONE,
    AS_PUBLISHED,
    IN_PART,
    LEVELS,
    NOT_AS_PUBLISHED,
    OPEN,
    bounds_of,
    spread_key,
    standing,
)
from wildlab.reporting.report import open_report
from wildlab.studies import page


def number(closeness: Closeness, compatibility: Compatibility, fitted: str = "") -> Comparison:
    return Comparison(closeness, compatibility, 1.0, fitted=fitted)


GOOD = number(Closeness.CLOSE, Compatibility.WITHIN)
BAD = number(Closeness.NOT_CLOSE, Compatibility.OUTSIDE)
VAGUE = number(Closeness.CANNOT_TELL, Compatibility.NO_POWER)
POSSIBLE = number(Closeness.NOT_CLOSE, Compatibility.WITHIN)
UNJUDGED = number(Closeness.NOT_JUDGED, Compatibility.NOT_JUDGED)
MISSED = number(Closeness.NOT_CLOSE, Compatibility.OUTSIDE, "chosen by it")
NUMBERS = st.lists(st.sampled_from([GOOD, BAD, VAGUE, POSSIBLE, UNJUDGED, MISSED]))
CLAIMS = st.lists(st.sampled_from([HOLDS, MOSTLY, FAILS, MOSTLY_NOT, UNDECIDED, NO_PREMISE]))


@pytest.mark.parametrize(
    ("numbers", "claims", "word"),
    [
        ([GOOD], [HOLDS], AS_PUBLISHED),
        ([GOOD, UNJUDGED], [UNDECIDED], AS_PUBLISHED),
        ([GOOD, BAD], [], IN_PART),
        ([GOOD], [FAILS, MOSTLY_NOT], NOT_AS_PUBLISHED),
        ([], [HOLDS, MOSTLY], IN_PART),
        ([POSSIBLE] * 5, [], OPEN),
        ([VAGUE] * 9 + [GOOD], [], OPEN),
        ([UNJUDGED], [NO_PREMISE], ALONE),
        ([MISSED], [], ALONE),
    ],
)
def test_words(numbers, claims, word):
    found = standing(numbers, claims)
    assert found.word == word and found.level == LEVELS[word]


@given(NUMBERS, CLAIMS)
def test_one_more_that_is_contradicted_or_open_never_betters_the_word(numbers, claims):
    order = [NOT_AS_PUBLISHED, IN_PART, AS_PUBLISHED]
    before = standing(numbers, claims).word
    after = standing([*numbers, BAD], claims).word
    assert after != AS_PUBLISHED and (before not in order or after not in order or
                                      order.index(after) <= order.index(before))  # fmt: skip
    assert standing([*numbers, VAGUE], claims).word in (before, OPEN)
    assert standing([*numbers, UNJUDGED, MISSED], [*claims, NO_PREMISE]).word == before


FLIGHTS = pd.Series(np.random.default_rng(1).permutation(np.arange(200.0)))


@pytest.mark.parametrize("n", [18, 19, 200])
def test_few_flights_have_a_range_and_many_the_prediction_interval_of_one_more(n):
    values, rank = FLIGHTS[:n], max((n + 1) // 20, 1)
    assert bounds_of(values) == (np.sort(values)[rank - 1], np.sort(values)[-rank])
    assert spread_key(n) == ("lowest to highest" if n < 19 else "middle 90 %")


@pytest.mark.parametrize("n", [1, 18, 19])
def test_metrics_follow_the_number_of_flights(n):
    values = FLIGHTS[:n]
    spread = pd.DataFrame({("kf", "mae"): values})
    report = open_report(study="linear-vs-nonlinear-fast", kind="twin")
    page.record_spread(report, lambda name: "m", spread, {})
    (entry,) = report._metrics
    assert (entry["low"], entry["high"]) == (bounds_of(values) if n > 1 else (None, None))
    assert entry["value"] == values.median()
