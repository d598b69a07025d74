"""The claims of H 6.4.4 on two vessels that cross, held against what the flights give."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.shares import Check
from wildlab.studies.crossing_vessels.trial import DISTANCE, FEATURES, LOOKS
from wildlab.studies.crossing_vessels.trial.crossing import TUNING

Array = NDArray[np.float64]


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.4, by the claim's id.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    """

    def of(subject: str, name: str) -> Array:
        return spread[subject, name].to_numpy(float)

    def worse(subject: str) -> Array:
        """The larger share of wrong associations of the two vessels."""
        return np.maximum(*(of(subject, f"wrong_rate_boat_{n}") for n in (1, 2)))

    met = of(LOOKS, "closest") < TUNING.measurement
    swapped = of(DISTANCE, "swapped") > 0
    size, intensity, hu = (of(LOOKS, f"separation_{name}") for name in ("size", "intensity", "hu"))
    wrong, wrong_without = of(FEATURES, "wrong"), of(DISTANCE, "wrong")
    return {
        "swap-without-features": Check(true=swapped, premise=met),
        "never-recovers": Check(true=of(DISTANCE, "swapped_at_end") > 0, premise=swapped),
        "accurate-though-swapped": Check(true=of(DISTANCE, "any_near_share") > 0.5, premise=swapped),
        "size-best": Check(true=(size > intensity) & (size > hu)),
        "intensity-differs": Check(measured=intensity, above=True),
        "hu-similar": Check(measured=hu),
        "no-swap-with-features": Check(true=of(FEATURES, "swapped") == 0, premise=met),
        "mostly-within-20-m": Check(true=of(FEATURES, "near_share") > 0.5),
        "most-correct-in-contrast": Check(
            true=(worse(FEATURES) < 0.5) & (worse(DISTANCE) >= 0.5), premise=met
        ),
        "fewer-wrong": Check(
            true=wrong < wrong_without, first=wrong, second=wrong_without, unit="detections"
        ),
    }
