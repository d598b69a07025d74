"""What a real detector changes: the tracking claims on detections drawn and rendered, of the same flights."""

from __future__ import annotations

import math

from wildlab.studies.end_to_end import trial
from wildlab.studies.linear_vs_nonlinear.trial import UNITS
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    if subject in trial.KINDS:
        return Metric(name, subject, trial.PIXEL_UNITS[name])
    return Metric(name, subject, UNITS[name]) if name in UNITS else None


def answer(facts: Facts) -> list[str]:
    """Whether tracks change, then how many claims do."""
    if math.isnan(sum(facts.value(f"{kind}-kf", "mae") for kind in trial.KINDS)):
        return ["unknown"]
    return [f"tracks-{facts.choose('tracks-alike', 'alike', 'differ')}", "claims"]


STUDY = Study("end-to-end", trial.KINDS, trial.trial, trial.check_claims, _metric, answer)
