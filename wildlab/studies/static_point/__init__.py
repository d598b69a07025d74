"""A target at rest, seen 552 times from 350 m: H 5.6.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study
from wildlab.studies.static_point import trial


def _metric(subject: str, name: str) -> Metric | None:
    found = trial.METRICS.get((subject, name))
    return None if found is None else Metric(*found)


def answer(facts: Facts) -> list[str]:
    """How far a single image is off, then what calibration and clocks are worth."""
    if any(math.isnan(facts.value(column, "mae")) for column in trial.COLUMNS):
        return ["unknown"]
    most = facts.choose("misalignment-matters-most", "first", "unclear")
    return ["located", f"calibration-{most}"]


STUDY = Study("static-point", tuple(trial.COLUMNS), trial.trial, trial.check_claims, _metric, answer)
