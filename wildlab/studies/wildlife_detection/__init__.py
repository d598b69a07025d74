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
    return [f"sun-{_in_sun(facts)}", f"noon-{_at_noon(facts)}"]


def _in_sun(facts: Facts) -> str:
    """What intervals over images show of background subtraction."""
    night, noon = (
        [facts.value(SUBTRACTED, f"f1_{weather}", end) for end in ("low", "high")]
        for weather in ("night", "noon")
    )
    if noon[1] < USABLE:
        return "breaks" if noon[1] < night[0] else "low"
    if night[0] >= USABLE and noon[0] >= USABLE:
        return "costs" if noon[1] < night[0] else "harmless"
    return "open"


def _at_noon(facts: Facts) -> str:
    """Whether any method is usable in full sun."""
    known = [one for one in (*METHODS, *PROPOSED) if not math.isnan(facts.value(one, "f1_noon"))]
    if any(facts.value(one, "f1_noon", "low") >= USABLE for one in known):
        return "usable"
    return "unusable" if all(facts.value(one, "f1_noon", "high") < USABLE for one in known) else "open"


STUDY = Study(
    "wildlife-detection",
    (*trial.SUBJECTS, "ground", "herd"),
    trial.trial,
    check_claims,
    name_metrics(trial.RECORDED),
    answer,
)
