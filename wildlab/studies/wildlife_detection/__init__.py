"""Finding warm animals on cold and on sun-heated ground: F 3, 7.4, 8.1, 8.4."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics
from wildlab.studies.wildlife_detection import trial
from wildlab.studies.wildlife_detection.claims import check_claims
from wildlab.studies.wildlife_detection.trial import METHODS, PROPOSED, SUBTRACTED

#: An F1 from which on a method is called usable: half of what it reports, or of what is there, is right.
USABLE = 0.5


def answer(facts: Facts) -> list[str]:
    """Background subtraction by night and in full sun, then whether another method is usable there."""
    by_night, in_sun = (facts.value(SUBTRACTED, f"f1_{weather}") for weather in ("night", "noon"))
    if math.isnan(by_night + in_sun):
        return ["unknown"]
    low, high = facts.value(SUBTRACTED, "f1_night", "low"), facts.value(SUBTRACTED, "f1_noon", "high")
    best = max(
        facts.value(one, "f1_noon") for one in (*METHODS, *PROPOSED) if facts.value(one, "f1_noon") >= 0
    )
    sun = "breaks" if high < low else "harmless"
    return [f"sun-{sun}", f"noon-{'usable' if best >= USABLE else 'unusable'}"]


STUDY = Study(
    "wildlife-detection",
    (*trial.SUBJECTS, "ground", "herd"),
    trial.trial,
    check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
