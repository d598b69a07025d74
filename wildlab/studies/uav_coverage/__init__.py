"""Rows over several enclosures from a multicopter, the camera down or turning: F 5.2, 5.4, 7.5.1."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.uav_coverage import trial


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.RECORDED.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study("uav-coverage", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
