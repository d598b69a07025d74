"""Tracking on the ground against tracking in the image: H 6.2, 6.3, 6.4.2."""

from __future__ import annotations

from wildlab.studies.linear_vs_nonlinear import trial
from wildlab.studies.protocol import Metric, Study

#: What is recorded of the georeferenced detections themselves.
MEASURED = ("mae_georeferenced", "mean_north", "mean_east")


def track_metric(subject: str, name: str) -> Metric | None:
    """Of a number that `wildlab.studies.linear_vs_nonlinear.trial.numbers_of` gives."""
    if subject == "measurements":
        return Metric(name, subject, "m") if name in MEASURED else None
    return Metric(name, subject, trial.UNITS.get(name, "1"))


STUDY = Study(
    "linear-vs-nonlinear", (*trial.PUBLISHED, "measurements"), trial.trial, trial.check_claims, track_metric
)
