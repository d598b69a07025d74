"""The word on top of a study follows from its single verdicts."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.evaluation.replication import Closeness, Comparison, Compatibility
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, NO_PREMISE, UNDECIDED
from wildlab.reporting.standing import (
    ALONE,
    AS_PUBLISHED,
    IN_PART,
    LEVELS,
    NOT_AS_PUBLISHED,
    OPEN,
    standing,
)


def number(closeness: Closeness, compatibility: Compatibility, fitted: str = "") -> Comparison:
    return Comparison(closeness, compatibility, 1.0, 0.0, fitted=fitted)


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
def test_words(numbers: list[Comparison], claims: list[str], word: str) -> None:
    found = standing(numbers, claims)
    assert found.word == word and found.level == LEVELS[word]


def test_the_reason_counts_numbers_fitted_ones_and_claims_apart() -> None:
    reason = standing([GOOD, GOOD, BAD, MISSED], [HOLDS, FAILS, FAILS, FAILS]).reason
    totals = [re.findall(r"\d+", part) for part in reason.split(";")]
    assert [int(part[0]) for part in totals] == [3, 1, 4]
    assert [sum(map(int, part[1:])) for part in totals] == [3, 1, 4]


@given(NUMBERS, CLAIMS)
def test_one_more_that_is_contradicted_or_open_never_betters_the_word(
    numbers: list[Comparison], claims: list[str]
) -> None:
    order = [NOT_AS_PUBLISHED, IN_PART, AS_PUBLISHED]
    before = standing(numbers, claims).word
    after = standing([*numbers, BAD], claims).word
    assert after != AS_PUBLISHED and (before not in order or after not in order or
                                      order.index(after) <= order.index(before))  # fmt: skip
    assert standing([*numbers, VAGUE], claims).word in (before, OPEN)
    assert standing([*numbers, UNJUDGED, MISSED], [*claims, NO_PREMISE]).word == before
