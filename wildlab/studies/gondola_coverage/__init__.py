"""Four ways to move the camera of a gondola: F 5.4, 7.5.2, 8.2."""

from __future__ import annotations

from wildlab.studies.gondola_coverage import trial
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("gondola-coverage", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
