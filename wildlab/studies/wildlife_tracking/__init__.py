"""Animals that walk, followed by a particle filter from a gondola and a multicopter: F 4, 5.3, 7.5, 8.3."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.wildlife_tracking import trial
from wildlab.studies.wildlife_tracking.claims import check_claims


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("wildlife-tracking", trial.SUBJECTS, trial.trial, check_claims, _metric)
