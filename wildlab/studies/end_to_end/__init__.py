"""What a real detector changes: the tracking claims on detections drawn and rendered, of the same flights."""

from __future__ import annotations

from wildlab.studies.end_to_end import trial
from wildlab.studies.linear_vs_nonlinear.trial import UNITS
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    if subject in trial.KINDS:
        return Metric(name, subject, trial.PIXEL_UNITS[name])
    return Metric(name, subject, UNITS[name]) if name in UNITS else None


STUDY = Study("end-to-end", trial.KINDS, trial.trial, trial.check_claims, _metric)
