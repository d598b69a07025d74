"""Rows over several enclosures from a multicopter, the camera down or turning: F 5.2, 5.4, 7.5.1."""

from __future__ import annotations

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.uav_coverage import trial
from wildlab.studies.uav_coverage.trial import DOWN, LOW, LOW_CLOSE, YAW

#: Quantities of the page's tables, by its key.
TABLES = {
    "plans": ("seen", "ground", "outside", "in_sight", "time"),
    "rows": ("time", "unseen", "missed_still", "missed"),
}
#: A plan that sees so much of the enclosures leaves little to gain; so small a difference is none.
NEARLY_ALL, SMALL = 0.95, 0.02


def answer(facts: Facts) -> list[str]:
    """What turning the camera adds from the usual height, then what half the height costs."""
    return [f"camera-{_camera(facts)}", f"half-height-{_half_height(facts)}"]


def _camera(facts: Facts) -> str:
    down, yaw = (facts.value(plan, "seen") for plan in (DOWN, YAW))
    found = facts.compare((YAW, "seen"), (DOWN, "seen"))
    if found in ("unknown", "few"):
        return "unknown" if found == "unknown" else "open"
    if abs(yaw - down) <= SMALL:
        return "both-see-nearly-all" if min(down, yaw) >= NEARLY_ALL else "alike"
    return {"more": "yaw", "less": "down"}.get(found, "open")


def _half_height(facts: Facts) -> str:
    lost = facts.compare((LOW, "seen"), (YAW, "seen"))
    gained = facts.compare((LOW_CLOSE, "seen"), (LOW, "seen"))
    if "unknown" in (lost, gained):
        return "unknown"
    low, close, yaw = (facts.value(plan, "seen") for plan in (LOW, LOW_CLOSE, YAW))
    if lost == "less" and low < yaw - SMALL:
        if gained == "more" and close > low + SMALL:
            return "closer-rows"
        return "lost"
    return "open"


STUDY = Study("uav-coverage", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
