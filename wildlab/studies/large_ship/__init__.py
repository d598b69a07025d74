"""Tracking a ship that does not fit into the image: H 6.4.1."""

from __future__ import annotations

import math

from wildlab.studies.large_ship import trial
from wildlab.studies.large_ship.claims import check_claims
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics


def answer(facts: Facts) -> list[str]:
    """Whether the track is nearer with the centre moved, then whether the centre in the image is."""
    errors = [facts.value(who, "mae_after_start") for who in trial.SUBJECTS]
    if math.isnan(sum(errors)):
        return ["unknown"]
    track = facts.choose("more-accurate-after-start", "helps", "harms")
    apart = facts.value(trial.WITH, "pixel_error", "high") < facts.value(trial.WITHOUT, "pixel_error", "low")
    return [f"track-{track}", "image-nearer" if apart else "image-unclear"]


STUDY = Study(
    "large-ship",
    (*trial.SUBJECTS, trial.DETECTOR),
    trial.trial,
    check_claims,
    name_metrics(trial.UNITS),
    answer,
)
