"""Rows over several enclosures from a multicopter, the camera down or turning: F 5.2, 5.4, 7.5.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics
from wildlab.studies.uav_coverage import trial
from wildlab.studies.uav_coverage.trial import DOWN, LOW, LOW_CLOSE, YAW

#: Quantities of the page's tables, by its key.
TABLES = {
    "plans": ("seen", "ground", "outside", "in_sight", "sharp", "time"),
    "held": ("sure", "held", "kept"),
    "rows": ("time", "unseen", "missed_still", "missed"),
}
#: A plan that sees so much of the enclosures leaves little to gain; so small a difference is none.
NEARLY_ALL, SMALL = 0.95, 0.02


def answer(facts: Facts) -> list[str]:
    """What turning the camera adds from the usual height, then what half the height costs."""
    down, yaw, low, close = (facts.value(plan, "seen") for plan in (DOWN, YAW, LOW, LOW_CLOSE))
    if math.isnan(down + yaw):
        camera = "unknown"
    elif abs(yaw - down) <= SMALL:
        camera = "both-see-nearly-all" if down >= NEARLY_ALL else "alike"
    else:
        camera = "yaw" if yaw > down else "down"
    if math.isnan(low + close + yaw):
        height = "unknown"
    elif low >= yaw - SMALL:
        height = "alike"
    else:
        height = "closer-rows" if close > low + SMALL else "lost"
    return [f"camera-{camera}", f"half-height-{height}"]


STUDY = Study(
    "uav-coverage", trial.SUBJECTS, trial.trial, trial.check_claims, name_metrics(trial.RECORDED), answer
)
