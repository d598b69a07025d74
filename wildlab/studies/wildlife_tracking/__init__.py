"""Animals that walk, tracked by a particle filter from a gondola and a multicopter: F 4, 5.3, 7.5, 8.3."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics
from wildlab.studies.wildlife_tracking import trial
from wildlab.studies.wildlife_tracking.claims import check_claims
from wildlab.studies.wildlife_tracking.trial import GONDOLA, NEGATIVE, UAV

#: The particle filter of each platform.
_FILTERS = (f"{GONDOLA}-{NEGATIVE}", f"{UAV}-{NEGATIVE}")


def answer(facts: Facts) -> list[str]:
    """Errors out of sight and whether they are as predicted, then how many tracks are found a lap later."""
    return [f"known-{_consistency(facts)}", f"lap-{_reacquired(facts)}"]


def _consistency(facts: Facts) -> str:
    if any(math.isnan(facts.value(one, name)) for one in _FILTERS for name in ("rmse", "anees")):
        return "unknown"
    if all(facts.value(one, "anees", "centre_low") > 2 for one in _FILTERS):
        return "overconfident"
    if all(facts.value(one, "anees", "centre_high") < 2 for one in _FILTERS):
        return "conservative"
    return "open"


def _reacquired(facts: Facts) -> str:
    if any(math.isnan(facts.value(one, "right_share")) for one in _FILTERS):
        return "unknown"
    found = {facts.outcome(claim) for claim in ("hard-to-associate", "same-problem-uav")}
    return "hard" if found == {"holds"} else "easy" if found == {"fails"} else "open"


STUDY = Study(
    "wildlife-tracking", trial.SUBJECTS, trial.trial, check_claims, name_metrics(trial.RECORDED), answer
)
