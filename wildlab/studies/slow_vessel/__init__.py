"""A vessel that mostly drifts, seen in eights: H 5.6.2."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.slow_vessel import trial


def _metric(subject: str, name: str) -> Metric | None:
    found = trial.METRICS.get((subject, name))
    return None if found is None else Metric(*found)


STUDY = Study("slow-vessel", trial.SUBJECTS, trial.trial, trial.check_claims, _metric)
