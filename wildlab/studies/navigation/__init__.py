"""Position, velocity and attitude from inertial samples and satellites: H 5.5, 7.3, 7.5.3, 7.5.4."""

from __future__ import annotations

from wildlab.analysis.navigation_errors import TUNINGS, unit_of
from wildlab.studies.navigation import trial
from wildlab.studies.protocol import Metric, Study


def _metric(subject: str, name: str) -> Metric:
    return Metric(name, subject, unit_of(name))


STUDY = Study("navigation", ("mekf", *TUNINGS), trial.trial, trial.check_claims, _metric)
