"""Finding vessels in thermal images of the sea: H 4.3, 4.4.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics
from wildlab.studies.vessel_detection import trial


def answer(facts: Facts) -> list[str]:
    """Whether vessels are missed, by the worse of both data sets, and whether anything else is found."""
    alarms = [facts.value(who, "false_alarms_per_image") for who in (trial.SHIP, trial.BOATS)]
    return [
        f"found-{facts.outcome('near-perfect')}",
        "alarms-unknown" if any(map(math.isnan, alarms)) else "alarms-some" if any(alarms) else "alarms-none",
    ]


STUDY = Study(
    "vessel-detection", trial.SUBJECTS, trial.trial, trial.check_claims, name_metrics(trial.RECORDED), answer
)
