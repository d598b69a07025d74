"""Tracking on the ground against tracking in the image: H 6.2, 6.3, 6.4.2."""

from __future__ import annotations

import math

from wildlab.studies.linear_vs_nonlinear import trial
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.single_target import consistency_of

#: The numbers of the thesis's figures, by twin.
FIGURES = {
    twin: {
        part: f"6-{number:02d}"
        for number, part in enumerate(("paths", "errors", "map", "speed", "squares", "correlation"), first)
    }
    for twin, first in (("fast-vessel", 5), ("slow-vessel-eight", 11))
}


def unit_of(name: str) -> str:
    """The unit of a number of the trial; those of innovations and bands have none."""
    return trial.UNITS.get(name, "1")


def answer(facts: Facts) -> list[str]:
    """Which filter is the more accurate one, then whether both know their errors."""
    if math.isnan(facts.value("kf", "mae") + facts.value("ekf", "mae")):
        accuracy = "unknown"
    else:
        better = facts.choose("kf-more-accurate", "ground", "image")
        accuracy = facts.choose("kf-ekf-similar", "alike", better, better)
    return [f"accuracy-{accuracy}", f"consistency-{consistency_of(facts, 'kf', 'ekf')}"]


STUDY = Study("linear-vs-nonlinear", trial.trial, trial.check_claims, unit_of, answer)
