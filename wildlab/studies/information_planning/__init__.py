"""Planning by what is to be learnt, and the planner above it: F 5.2, 5.3, appendix A."""

from __future__ import annotations

from wildlab.studies.information_planning import trial
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("information-planning", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
