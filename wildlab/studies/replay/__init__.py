"""What the operator of F 6.3.3 sees, at moments like those of its screenshots."""

from __future__ import annotations

import math

from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics
from wildlab.studies.replay import trial
from wildlab.studies.replay.trial import CLOCK, NONE

_CLOCK = {HOLDS: "better", MOSTLY: "better", MOSTLY_NOT: "no-better", FAILS: "no-better"}


def answer(facts: Facts) -> list[str]:
    """How often several tracks run and no animal is in view, then what setting the clock by hand changes."""
    empty = facts.value(NONE, "share_of_frames")
    gain = facts.value(CLOCK, "error_unset") - facts.value(CLOCK, "error_set")
    view = "unknown" if math.isnan(empty) else "empty" if empty > 0.5 else "other"
    verdict = facts.verdicts.get("manual-sync-increases-precision", "")
    clock = "unknown" if math.isnan(gain) else _CLOCK.get(verdict, "open")
    return [f"view-{view}", f"clock-{clock}"]


STUDY = Study("replay", trial.SUBJECTS, trial.trial, trial.check_claims, name_metrics(trial.RECORDED), answer)
