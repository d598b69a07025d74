"""The extended and the Schmidt-Kalman filter with one tuning on three flights: H 7.3, 7.4, 7.5.3, 7.5.4."""

from __future__ import annotations

import math

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study
from wildlab.studies.schmidt import claims, trial
from wildlab.studies.schmidt.trial import MORE_NAMES, NAMES, PUBLISHED

_COURSES = ("rmse_course", "rmse_course_start")
_SHARES = ("outside", "sd_spread", "turning", "moving", "detections", "pauses")
#: Errors this many times as large as predicted, or less, are called nearly as predicted.
NEARLY = 1.5


def _metric(subject: str, name: str) -> Metric:
    """With courses, which are radians in a trial, in degrees."""
    if name in _COURSES:
        return Metric(name, subject, "deg", 180 / math.pi)
    known = NAMES | MORE_NAMES
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


def consistency_of(facts: Facts, who: str) -> str:
    """What one moment of each flight says of a filter, as the end of a text's key."""
    mean, flights = facts.value(who, "mean_of_drawn_nees"), facts.value(who, "mean_of_drawn_nees", "n")
    if math.isnan(mean) or math.isnan(flights):
        return "unknown"
    low, high = chi_square_interval(2, runs=int(flights))
    if low <= mean <= high:
        # So few flights that errors `NEARLY` times as large, or as small, would not show decide nothing.
        return "consistent" if math.sqrt(low / 2) > 1 / NEARLY and math.sqrt(high / 2) < NEARLY else "few"
    if 1 / NEARLY < math.sqrt(mean / 2) < NEARLY:
        return "nearly"
    return "overconfident" if mean > high else "conservative"


def answer(facts: Facts) -> list[str]:
    """The Schmidt filter with poses as a calibration flight gave them, then the extended filter."""
    return [
        f"schmidt-{consistency_of(facts, 'schmidt-estimated')}",
        f"ekf-{consistency_of(facts, 'ekf')}",
    ]


STUDY = Study("schmidt", PUBLISHED, trial.trial, claims.check_claims, _metric, answer)
