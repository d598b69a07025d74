"""The extended and the Schmidt-Kalman filter with one tuning on three flights: H 7.3, 7.4, 7.5.3, 7.5.4."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.schmidt import trial

#: Units of the metrics: those of the trial, but for courses, which a reader wants in degrees.
UNITS = trial.NAMES | {"rmse_course": "deg"}


def _metric(subject: str, name: str) -> Metric:
    return Metric(name, subject, UNITS[name])


STUDY = Study("schmidt", trial.PUBLISHED, trial.trial, trial.check_claims, _metric)
