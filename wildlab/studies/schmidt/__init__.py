"""The extended and the Schmidt-Kalman filter with one tuning on three flights: H 7.3, 7.4, 7.5.3, 7.5.4."""

from __future__ import annotations

from wildlab.studies.protocol import Metric, Study
from wildlab.studies.schmidt import claims, trial
from wildlab.studies.schmidt.trial import MORE_NAMES, NAMES, PUBLISHED

_COURSES = {"rmse_course": "deg", "rmse_course_start": "deg"}
_SHARES = ("outside", "sd_spread", "turning", "moving", "detections", "pauses")


def _metric(subject: str, name: str) -> Metric:
    """With courses, which are radians in a trial, in degrees."""
    known = NAMES | MORE_NAMES | _COURSES
    if name in known:
        return Metric(name, subject, known[name])
    return Metric(name, subject, _unit_of_pose(subject, name))


def _unit_of_pose(subject: str, name: str) -> str:
    if name.endswith("_px"):
        return "px"
    if name == "settled":
        return "s"
    if name.startswith(_SHARES):
        return "1"
    return "m" if name.endswith(("north", "east", "down")) else "deg"


STUDY = Study("schmidt", PUBLISHED, trial.trial, claims.check_claims, _metric)
