"""Two vessels that cross, distinguished by their images: H 6.4.4."""

from __future__ import annotations

import math

from wildlab.studies.crossing_vessels import trial
from wildlab.studies.crossing_vessels.outcomes import check_claims
from wildlab.studies.crossing_vessels.trial import joint
from wildlab.studies.crossing_vessels.trial import reacquisition as again
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study, name_metrics


def answer(facts: Facts) -> list[str]:
    """Whether features keep the tracks apart, and which feature does."""
    apart = facts.value(trial.LOOKS, "separation_size")
    best = "unknown" if math.isnan(apart) else "size" if facts.outcome("size-best") == "holds" else "open"
    return [f"swap-{facts.outcome('no-swap-with-features')}", f"feature-{best}"]


STUDY = Study(
    "crossing-vessels",
    (
        *trial.SUBJECTS,
        joint.JOINT,
        trial.LOOKS,
        *map(trial.curve_subject, trial.SEPARATIONS),
        *again.WAYS,
    ),
    trial.trial,
    check_claims,
    name_metrics(trial.UNITS),
    answer,
)
