"""Planning by what is to be learnt, and the planner above it: F 5.2, 5.3, appendix A."""

from __future__ import annotations

import math

from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.studies.information_planning import trial
from wildlab.studies.information_planning.trial import INFORMATION, SWING
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics

_SIDES = {HOLDS: "sooner", MOSTLY: "sooner", MOSTLY_NOT: "later", FAILS: "later"}


def answer(facts: Facts) -> list[str]:
    """On most worlds sooner than rows with a swinging camera or not, then the same with fixed cameras."""
    if math.isnan(facts.value(INFORMATION, "all_found") + facts.value(SWING, "all_found")):
        return ["unknown"]
    swing, fixed = (
        _SIDES.get(facts.verdicts.get(claim, ""), "open")
        for claim in ("lower-search-time-swing", "lower-search-time-fixed")
    )
    return [f"free-{swing}", f"fixed-{fixed}"]


STUDY = Study(
    "information-planning",
    trial.SUBJECTS,
    trial.trial,
    trial.check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
