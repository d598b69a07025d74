"""Words and verdicts of the report on consistency bounds, on opposed numbers."""

from __future__ import annotations

import numpy as np

from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDED
from wildlab.studies.consistency_bounds import text


def test_words_turn_with_their_numbers() -> None:
    apart = text.summary({"nees-1-run": 0.95}, {"nees-1-run": 0.4}, 6, 6)
    assert "40 times in 100, so that the limits tell" in apart[1] and apart[2].startswith("6 of the 6")
    alike = text.summary({"nees-1-run": 0.95}, {"nees-1-run": 0.94}, 2, 6)
    assert "hardly tell" in alike[1] and alike[2].startswith("2 of the 6")


def test_titles_and_alternative_texts_turn_with_their_numbers() -> None:
    calm, wild = np.full(60, 1.0), np.full(60, 9.0)
    title, alt = text.one_run({"honest": calm, "overconfident": wild}, (0.5, 5.0), 59.0)
    assert "above the limit 60 times if overconfident, 0 if honest" in title
    assert "over 59 seconds, 60 steps" in alt and "honest filter is above them at 0 steps" in alt
    title, alt = text.one_run({"honest": wild, "overconfident": calm * 0.1}, (0.5, 5.0), 9.0)
    assert "above the limit 0 times if overconfident, 60 if honest" in title and "below them at 60" in alt
    title, alt = text.fifty_runs({"honest": calm, "overconfident": wild}, (0.5, 5.0), 0.25)
    assert "inside 25 %" in title and "overconfident filter has 9.0 in the middle and is inside 0 %" in alt
    assert "honest filter has 1.0 in the middle and is inside 100 %" in alt


def test_a_share_is_decided_by_its_interval() -> None:
    runs = np.arange(2000)
    assert text.decide(runs < 1900)[0] == HOLDS
    assert text.decide(runs < 1860)[0] == FAILS and text.decide(runs < 2000)[0] == FAILS
    assert text.decide(np.arange(20) < 19)[0] == UNDECIDED
