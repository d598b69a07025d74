"""Finding vessels in thermal images of the sea: H 4.3, 4.4.1."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.vessel_detection import trial


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("vessel-detection", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
