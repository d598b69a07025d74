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
        pooled = Pooled(int(np.nansum(later - right)), int(np.nansum(later)))
        return Check(measured=each, above=True, pooled=pooled, reach=(0, 1), unit="animals seen again")

    def lower(name: str, first: str, second: str) -> Check:
        one, other = of(first, name), of(second, name)
        # A world in which there is nothing to compare says neither.
        return Check(
            true=one < other, first=one, second=other, unit="m", premise=np.isfinite(one) & np.isfinite(other)
        )

    def known(values: Array, *, above: bool = False, most: float = np.inf) -> Check:
        return Check(measured=values, above=above, premise=np.isfinite(values), reach=(0, most))

    def large(platform: str) -> Check:
        return Check(
            measured=of(f"{platform}-{NEGATIVE}", "sd_later") / of(platform, "by_fence_alone"),
            above=True,
            premise=np.isfinite(of(f"{platform}-{NEGATIVE}", "sd_later")),
            reach=(0, np.inf),
        )

    found = {
        "falls-on-revisit": known(of(REVISITS, "fall")),
        "grows-between": known(of(REVISITS, "grew"), above=True, most=1),
        "couple-of-seconds": known(of(GONDOLA, "in_view")),
        "very-large-a-lap-later": large(GONDOLA),
        "hard-to-associate": wrong(GONDOLA),
        "same-problem-uav": wrong(UAV),
        "visits-keep-known": lower("rmse", REVISITS, ROWS),
    }
    for platform in (GONDOLA, UAV):
        one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
        found[f"negative-lowers-uncertainty-{platform}"] = lower("sd", one, other)
        found[f"negative-lowers-error-{platform}"] = lower("rmse", one, other)
        found[f"closer-than-kalman-{platform}"] = lower("rmse", one, f"{platform}-{KALMAN}")
    if cost is not None:
        found["dearer-than-ekf"] = Check(measured=cost, above=True, reach=(0, np.inf))
    return found
