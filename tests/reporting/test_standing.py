"""The word on top of a study follows from its single verdicts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.evaluation.printed import AGREES, DIFFERS, NOT_JUDGED, POSSIBLE, TOO_VAGUE
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, NO_PREMISE, UNDECIDED
from wildlab.reporting.standing import ALONE, AS_PRINTED, IN_PART, LEVELS, NOT_AS_PRINTED, OPEN, standing

NUMBERS = st.lists(st.sampled_from([AGREES, POSSIBLE, DIFFERS, TOO_VAGUE, NOT_JUDGED]))
CLAIMS = st.lists(st.sampled_from([HOLDS, MOSTLY, FAILS, MOSTLY_NOT, UNDECIDED, NO_PREMISE]))


@pytest.mark.parametrize(
    ("numbers", "claims", "word"),
    [
        ([AGREES], [HOLDS], AS_PRINTED),
        ([AGREES, NOT_JUDGED], [UNDECIDED], AS_PRINTED),
        ([AGREES, DIFFERS], [], IN_PART),
        ([AGREES], [FAILS, MOSTLY_NOT], NOT_AS_PRINTED),
        ([TOO_VAGUE], [], OPEN),
        ([NOT_JUDGED], [NO_PREMISE], ALONE),
    ],
)
def test_words(numbers: list[str], claims: list[str], word: str) -> None:
    found = standing(numbers, claims)
    assert found.word == word and found.level == LEVELS[word]


@given(NUMBERS, CLAIMS)
def test_what_tells_nothing_changes_no_word(numbers: list[str], claims: list[str]) -> None:
    found = standing(numbers, claims)
    if found.word not in (OPEN, ALONE):
        assert (
            standing([*numbers, TOO_VAGUE, NOT_JUDGED], [*claims, UNDECIDED, NO_PREMISE]).word == found.word
        )


@given(NUMBERS, CLAIMS)
def test_one_more_that_differs_never_betters_the_word(numbers: list[str], claims: list[str]) -> None:
    order = [NOT_AS_PRINTED, IN_PART, AS_PRINTED]
    before, after = standing(numbers, claims).word, standing([*numbers, DIFFERS], claims).word
    assert after in order[:2]
    if before in order:
        assert order.index(after) <= order.index(before)
