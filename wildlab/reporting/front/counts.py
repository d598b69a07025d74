"""How many of how many: what the front page says in figures. What was not run is in no denominator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from wildlab.evaluation.printed import AGREES, DIFFERS, NOT_JUDGED, POSSIBLE, TOO_VAGUE
from wildlab.reporting.front.ratios import drawable
from wildlab.reporting.status import FIRST_LOOK, MISSING, StudyStatus

#: Verdicts, and the words for many.
WORDS = {AGREES: "agree", POSSIBLE: "possible", TOO_VAGUE: "too vague to tell", DIFFERS: "differ"}


class Counts(NamedTuple):
    """Of all printed numbers, each counted once.

    Attributes
    ----------
    all
        How many there are in print.
    judged
        By verdict; only of studies that are done.
    others
        Why the rest is not among them, and how many for each reason.
    undrawn
        Judged ones that have no ratio.
    """

    all: int
    judged: dict[str, int]
    others: dict[str, int]
    undrawn: int

    @property
    def of(self) -> int:
        """How many were judged: the denominator."""
        return sum(self.judged.values())


def counted(studies: Sequence[StudyStatus]) -> Counts:
    """Count them."""
    judged: Counter[str] = Counter()
    others: Counter[str] = Counter()
    undrawn = 0
    for study in studies:
        for one in study.counted:
            if study.state != "done":
                others[_WAITING.get(study.state, study.state)] += 1
            elif one.verdict in WORDS:
                judged[one.verdict] += 1
                undrawn += not drawable([one])
            elif one.verdict == NOT_JUDGED:
                others["not judged: what it was fitted to, or what says nothing alone"] += 1
            elif one.verdict == MISSING:
                others["not given by its study yet"] += 1
            else:
                others[one.verdict] += 1
    every = sum(len(study.counted) for study in studies)
    return Counts(every, {name: judged[name] for name in WORDS}, dict(others.most_common()), undrawn)


_WAITING = {
    FIRST_LOOK: "seen in a first look only, from fewer flights than the study's own",
    "not run": "of studies not run yet",
    "failed": "of studies that failed",
    "broken off": "of studies that were broken off",
}
