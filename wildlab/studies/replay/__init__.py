"""What the operator of F 6.3.3 sees, at moments like those of its screenshots."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.replay import trial


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("replay", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
