"""Planning by what is to be learnt, and the planner above it: F 5.2, 5.3, appendix A."""

from __future__ import annotations

import math

from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.studies.information_planning import trial
from wildlab.studies.information_planning.trial import BUDGET_S, INFORMATION, SWING
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics

_SIDES = {HOLDS: "sooner", MOSTLY: "sooner", MOSTLY_NOT: "later", FAILS: "later"}


def answer(facts: Facts) -> list[str]:
    """On most worlds sooner than rows with a swinging camera or not, then the same with fixed cameras."""
    medians = [facts.value(who, "all_found") for who in (INFORMATION, SWING)]
    if any(map(math.isnan, medians)):
        return ["unknown"]
    swing, fixed = (
        _SIDES.get(facts.verdicts.get(claim, ""), "open")
        for claim in ("lower-search-time-swing", "lower-search-time-fixed")
    )
    # A search ends then: what is recorded at the limit is no time at which all were found.
    limit = "-at-limit" if max(medians) >= BUDGET_S else ""
    return [f"free-{swing}{limit}", f"fixed-{fixed}"]


STUDY = Study(
    "information-planning",
    trial.SUBJECTS,
    trial.trial,
    trial.check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
