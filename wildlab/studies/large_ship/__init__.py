"""Tracking a ship that does not fit into the image: H 6.4.1."""

from __future__ import annotations

from wildlab.studies.large_ship import trial
from wildlab.studies.large_ship.claims import check_claims
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric | None:
    unit = trial.UNITS.get(name)
    return None if unit is None else Metric(name, subject, unit)


STUDY = Study(
    "large-ship",
    (*trial.SUBJECTS, trial.DETECTOR),
    trial.trial,
    check_claims,
    _metric,
)
