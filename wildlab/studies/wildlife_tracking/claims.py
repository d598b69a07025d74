"""F's claims on tracking animals, with the processor time that one of them is about."""

from __future__ import annotations

from collections.abc import Iterable
from time import process_time

import numpy as np
import pandas as pd

from wildlab.analysis.animals.follow import follow
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
    draw_world,
    follower_of,
)

#: Images of each world that are timed, and worlds at most: so many that a claim can hold.
IMAGES, TIMED = 600, 40


def processor_ratio(seeds: Iterable[int], second: str) -> Array:
    """How many times the Kalman filter's processor time the particle filter takes, on the same images.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    second
        The twin of the multicopter.

    Returns
    -------
    ndarray
        (N,), one of each world; without the negative update, so that both look at the same images.
    """
    ratios = []
    for seed in list(seeds)[:TIMED]:
        world = draw_world(UAV, second, seed)
        images, spent = world.images.first(IMAGES), []
        for name in (POSITIVE, KALMAN):
            follower = follower_of(name, world, seed)
            began = process_time()
            follow(images, world.land, world.detector, follower, world.motion)
            spent.append(process_time() - began)
        ratios.append(spent[0] / spent[1])
    return np.array(ratios)


def check_claims(runs: pd.DataFrame, cost: Array | None = None) -> dict[str, Check]:
    """What the worlds give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `trial.trial` gives, one row for each world.
    cost
        (N,) how many times as much of the processor the particle filter takes as the Kalman filter; the
        claim on it is left out where it is None.
    """

    def of(subject: str, name: str) -> Array:
        return runs[subject, name].to_numpy(float)

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

    off = [
        of(f"{one}-{NEGATIVE}", "rmse") / (np.sqrt(2) * of(one, "by_fence_alone")) for one in (GONDOLA, UAV)
    ]
    found = {
        "particle-filter-performs-well": known(np.maximum(*off)),
        "small-part-at-once": known(of(UAV, "at_once"), most=1),
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
