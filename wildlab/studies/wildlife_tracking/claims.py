"""F's sentences on tracking animals, held against what drawn worlds give."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.shares import Check, Pooled
from wildlab.geometry.frames import Array
from wildlab.studies.wildlife_tracking.trial import (
    GONDOLA,
    KALMAN,
    NEGATIVE,
    POSITIVE,
    REVISITS,
    ROWS,
    UAV,
)


def check_claims(spread: pd.DataFrame, cost: Array | None = None) -> dict[str, Check]:
    """What the worlds give for each claim, by the claim's id.

    Parameters
    ----------
    spread
        What `trial.trial` gives, one row for each world.
    cost
        (N,) how many times as much of the processor the particle filter takes as the Kalman filter; the
        claim on it is left out where it is None.
    """

    def of(subject: str, name: str) -> Array:
        return spread[subject, name].to_numpy(float)

    def wrong(platform: str) -> Check:
        later, right = of(f"{platform}-{NEGATIVE}", "later"), of(f"{platform}-{NEGATIVE}", "right")
        with np.errstate(invalid="ignore"):
            each = (later - right) / later
        pooled = Pooled(int((later - right).sum()), int(later.sum()))
        return Check(measured=each, above=True, pooled=pooled, reach=(0, 1), unit="animals seen again")

    def lower(name: str, first: str, second: str) -> Check:
        one, other = of(first, name), of(second, name)
        return Check(true=one < other, first=one, second=other, unit="m")

    def large(platform: str) -> Check:
        return Check(
            measured=of(f"{platform}-{NEGATIVE}", "sd_later") / of(platform, "by_fence_alone"),
            above=True,
            premise=np.isfinite(of(f"{platform}-{NEGATIVE}", "sd_later")),
            reach=(0, np.inf),
        )

    visited = of(REVISITS, "visits") > 0
    found = {
        "falls-on-revisit": Check(measured=of(REVISITS, "fall"), premise=visited, reach=(0, np.inf)),
        "grows-between": Check(measured=of(REVISITS, "grew"), above=True, premise=visited, reach=(0, 1)),
        "couple-of-seconds": Check(measured=of(GONDOLA, "in_view"), reach=(0, np.inf)),
        "very-large-a-lap-later": large(GONDOLA),
        "hard-to-associate": wrong(GONDOLA),
        "same-problem-uav": wrong(UAV),
        "visits-keep-known": lower("sd", REVISITS, ROWS),
    }
    for platform in (GONDOLA, UAV):
        one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
        found[f"negative-lowers-uncertainty-{platform}"] = lower("sd", one, other)
        found[f"negative-lowers-error-{platform}"] = lower("rmse", one, other)
        found[f"closer-than-kalman-{platform}"] = lower("rmse", one, f"{platform}-{KALMAN}")
    if cost is not None:
        found["dearer-than-ekf"] = Check(measured=cost, above=True, reach=(0, np.inf))
    return found
