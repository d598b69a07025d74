"""A vessel that mostly drifts, seen in eights: H 5.6.2."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Metric, Study
from wildlab.studies.slow_vessel import trial


def _metric(subject: str, name: str) -> Metric | None:
    found = trial.METRICS.get((subject, name))
    return None if found is None else Metric(*found)


def answer(facts: Facts) -> list[str]:
    """How far a single image is off, then whether a track is nearer, by the intervals of both medians."""
    image, receiver = facts.value("observer", "mae"), facts.value("reference", "mae")
    track = facts.value("filter", "filter_error_mean")
    if math.isnan(image + receiver + track):
        return ["unknown"]
    low, high = (facts.value("observer", "mae", f"centre_{end}") for end in ("low", "high"))
    track_low, track_high = (
        facts.value("filter", "filter_error_mean", f"centre_{end}") for end in ("low", "high")
    )
    track_is = "nearer" if track_high < low else "farther" if track_low > high else "unclear"
    return ["located", f"track-{track_is}"]


STUDY = Study("slow-vessel", trial.SUBJECTS, trial.trial, trial.check_claims, _metric, answer)
