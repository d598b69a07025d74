"""A target at rest, seen 552 times from 350 m: H 5.6.1."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.static_point import trial


def _metric(subject: str, name: str) -> Metric | None:
    found = trial.METRICS.get((subject, name))
    return None if found is None else Metric(*found)


STUDY = Study("static-point", tuple(trial.COLUMNS), trial.trial, trial.check_claims, _metric)
