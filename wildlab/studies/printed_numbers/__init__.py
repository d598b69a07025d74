"""Which numbers that H gives in two places, or of two related things, agree."""

from __future__ import annotations

from wildlab.studies.page import Facts
from wildlab.studies.printed_numbers.pairs import MARGIN
from wildlab.studies.protocol import Study


def answer(facts: Facts) -> list[str]:
    """How many pairs of numbers differ by more than the margin."""
    ratios = [facts.value(subject, name) for name, subject in facts.recorded if name == "ratio"]
    if not ratios:
        return ["unknown"]
    if all(1 / MARGIN <= ratio <= MARGIN for ratio in ratios):
        return ["all-agree"]
    return ["some-differ", "reasons"]


STUDY = Study("printed-numbers", (), answer=answer)
