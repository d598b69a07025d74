"""One verdict for a flight and its reports: it turns with each number, and no part contradicts the whole."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.evaluation.runs import Interval
from wildlab.pipeline.overviews.verdict import (
    PARTS,
    VERDICT_LEVEL,
    Evidence,
    Verdict,
    parts_of,
    verdict_of,
)

NAN = math.nan
#: Nothing is against it.
GOOD = Evidence(lost=0.1, gain=0.02, possible=0.0, points=90, excess=(Interval(1.0, 0.9, 1.2),), judged=1)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, Verdict.SOUND),
        ({"judged": 0}, Verdict.UNJUDGED),
        ({"excess": (Interval(1.3, 1.1, 1.6),)}, Verdict.LOOK),
        ({"excess": (Interval(1.3, 0.9, 1.6),)}, Verdict.SOUND),  # may be by chance
        ({"excess": (Interval(1.02, 1.01, 1.03),)}, Verdict.SOUND),  # certain, and of no consequence
        ({"excess": (Interval(NAN, NAN, NAN),)}, Verdict.SOUND),
        ({"points": 9}, Verdict.LOOK),
        ({"points": NAN}, Verdict.SOUND),
        ({"possible": 0.1}, Verdict.LOOK),
        ({"possible": NAN, "gain": NAN, "lost": NAN}, Verdict.SOUND),
        ({"troubled": 1}, Verdict.LOOK),
        ({"gain": 0.1, "troubled": 1}, Verdict.FIX),
        ({"gain": 0.9, "alarmed": 1}, Verdict.LOOK),
        ({"gain": 0.9, "lost": 0.21}, Verdict.MEND),
        ({"gain": 0.9, "problems": 1}, Verdict.MEND),
        ({"problems": 1, "broken": 1}, Verdict.ALARM),
    ],
)
def test_each_number_turns_the_verdict(changes: dict[str, object], verdict: Verdict) -> None:
    assert verdict_of(GOOD._replace(**changes)) == verdict


def test_of_nothing_there_is_no_verdict() -> None:
    assert verdict_of(Evidence()) == Verdict.UNJUDGED
    # One report, and it could not judge: sound is said of no flight whose errors nobody measured.
    assert verdict_of(Evidence(judged=1, parts=(Verdict.UNJUDGED,))) == Verdict.UNJUDGED


verdicts = st.sampled_from(list(Verdict))


@given(st.lists(verdicts, max_size=3), st.integers(0, 1), st.integers(0, 2))
def test_no_part_presses_more_than_the_flight(parts: list[Verdict], problems: int, judged: int) -> None:
    whole = verdict_of(Evidence(problems=problems, judged=judged, parts=tuple(parts)))
    assert whole.level >= max((one.level for one in parts), default=-1)
    assert whole != Verdict.SOUND or not any(one.level > 0 for one in parts)


@given(st.dictionaries(st.sampled_from(PARTS), verdicts))
def test_what_a_report_records_is_what_the_flight_reads(parts: dict[str, Verdict]) -> None:
    numbers = {(VERDICT_LEVEL, about): {"value": float(one.level)} for about, one in parts.items()}
    assert parts_of(numbers) == parts
    assert {one.colour for one in Verdict} == {"bad", "warn", "good", "neutral"}
