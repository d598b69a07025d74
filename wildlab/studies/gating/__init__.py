"""Which of two detections belongs to the target that is tracked: H 6.3.2, 6.4.3."""

from __future__ import annotations

import math

from wildlab.studies.gating.monte_carlo import FORMS
from wildlab.studies.gating.readings import STRESS, subject
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study


def answer(facts: Facts) -> list[str]:
    """How often the nearer detection is the right one, and what mistakes do to a track that they update."""
    own, stress = (
        [facts.value(subject("angles", reading), name) for name in ("success_rate", "success_rate_se")]
        for reading in ("own", STRESS)
    )
    if math.isnan(own[0] + stress[0]):
        return ["rate-unknown", "stress-unknown"]
    lost, error = own[0] - stress[0], 2 * math.hypot(own[1], stress[1])
    stress_test = "lower" if lost > error else "higher" if -lost > error else "unclear"
    agree = facts.outcome("forms-agree") == "holds"
    return ["rate-forms-agree" if agree else "rate-by-form", f"stress-{stress_test}"]


STUDY = Study("gating", FORMS, answer=answer)
