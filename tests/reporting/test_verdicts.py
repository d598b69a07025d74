"""How a number is said beside a printed one."""

from __future__ import annotations

import pytest

from wildlab.evaluation.replication import Closeness, Comparison, Compatibility
from wildlab.reporting.verdicts import comparison_words


@pytest.mark.parametrize(
    ("ratio", "difference", "words"),
    [
        (1.214, 9.0, "1.21"),
        (None, 3.25, "+3.25"),
        (None, -0.0033, "−0.003"),
        (None, -0.012, "−0.01"),
        (None, 0.0, "0.00"),
    ],
)
def test_a_small_difference_is_not_said_as_none(ratio: float | None, difference: float, words: str) -> None:
    compared = Comparison(Closeness.CLOSE, Compatibility.WITHIN, ratio, difference)
    assert comparison_words(compared) == words
