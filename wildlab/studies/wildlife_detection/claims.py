"""What the pictures give for each sentence of F 3.2, 7.4, 8.1 and 8.4, and rates over all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.matching import Rates, rates, shares
from wildlab.evaluation.runs import Interval, mean_interval
from wildlab.evaluation.shares import Check
from wildlab.studies.wildlife_detection.trial import (
    BY_BLOCK,
    BY_EMPTY,
    BY_MEAN,
    BY_MEDIAN,
    BY_SIZE,
    CLOUDY,
    CONSTANT,
    COUNTS,
    ENHANCED,
    LARGE,
    METHODS,
    NIGHT,
    NOON,
    NOT_HOT,
    OVER_MEAN,
    PROPOSED,
    SMALL,
    SUBTRACTED,
    VIEWS,
    WEATHERS,
)

Array = NDArray[np.float64]
#: How many grey levels the ground changes at least where it "changes too much": a tenth of all.
TOO_MUCH = 25.0
#: The reading of figures 7.7 and 7.8 for the claims, that of `METHODS`.
CLAIMED = "pieces_offset_65"


def places(weathers: Iterable[str] = tuple(WEATHERS), heights: Iterable[int] = tuple(VIEWS)) -> list[str]:
    """Names of pictures: of those weathers, from those heights."""
    tall = list(heights)
    return [f"{weather}_{height}" for weather in weathers for height in tall]


def counts_of(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Array:
    """(images, 3) found, invented and missed of all seeds; an image that was not looked at has no row."""
    named = [[(subject, f"{name}_{one}") for name in COUNTS] for one in at]
    rows = [runs[one].to_numpy(float) for one in named if one[0] in runs.columns]
    table = np.concatenate([np.zeros((0, 3)), *rows])
    return np.asarray(table[np.isfinite(table).all(axis=1)])


def rates_of(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Rates:
    """Precision, recall and F1 over all images, with intervals over images."""
    return rates(counts_of(runs, subject, at))


def false_alarms(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Interval:
    """How many an image, with the interval of the mean, which ends at zero."""
    invented = counts_of(runs, subject, at)[:, 1]
    if len(invented) < 2:
        return Interval(float(invented.mean()) if len(invented) else np.nan, np.nan, np.nan)
    found = mean_interval(invented)
    return Interval(found.estimate, max(found.low, 0.0), found.high)


def rates_metrics(runs: pd.DataFrame) -> list[tuple[str, str, Interval, int]]:
    """Name, subject, value with interval, and number of images of each method's rates in each weather."""
    found = []
    for subject in (*METHODS, *PROPOSED):
        for weather in WEATHERS:
            at = places([weather])
            one, alarms = rates_of(runs, subject, at), false_alarms(runs, subject, at)
            if one.groups:
                values = {"recall": one.recall, "f1": one.f1, "false_alarms_per_image": alarms}
                found += [(f"{name}_{weather}", subject, each, one.groups) for name, each in values.items()]
    return found


def by_seed(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Array:
    """(seeds, 3) sums of found, invented and missed."""
    return np.stack(
        [runs[[(subject, f"{name}_{one}") for one in at]].to_numpy(float).sum(axis=1) for name in COUNTS],
        axis=1,
    )


def f1(counts: Array) -> Array:
    """(...) of (..., 3) counts: zero where nothing was found, NaN where there was nothing."""
    return np.asarray(shares(counts)[..., 2])


def fall(before: ArrayLike, after: ArrayLike) -> Array:
    """By which part an F1 falls: 1 is all of it. NaN where it was zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(1 - np.asarray(after, float) / np.asarray(before, float))


def _recall(counts: Array) -> Array:
    return np.asarray(shares(counts)[..., 1])


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the pictures of each seed give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `wildlab.studies.wildlife_detection.trial.trial` gives, one row for each seed.
    """

    def of(subject: str, name: str) -> Array:
        return runs[subject, name].to_numpy(float)

    cloudy = places([CLOUDY])
    changed = np.abs(of("ground", "level_after") - of("ground", "level_before")) > TOO_MUCH
    drop = {
        method: fall(f1(by_seed(runs, method, ["before"])), f1(by_seed(runs, method, ["after"])))
        for method in (CONSTANT, OVER_MEAN)
    }
    seen = {method: f1(by_seed(runs, method, ["before"])) > 0 for method in drop}
    pieces = {method: of(method, CLAIMED) for method in (SMALL, LARGE)}
    left = {
        method: np.mean([of(method, f"background_{one}") for one in cloudy], axis=0)
        for method in (SUBTRACTED, ENHANCED)
    }
    recall = {method: _recall(by_seed(runs, method, cloudy)) for method in (SUBTRACTED, ENHANCED)}
    herd = {method: _recall(by_seed(runs, method, ["herd"])) for method in (BY_MEAN, BY_MEDIAN, BY_EMPTY)}
    good = {
        method: f1(by_seed(runs, method, cloudy))
        for method in (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_MEAN)
    }
    warm = {
        weather: np.nanmean([of("ground", f"as_warm_{one}") for one in places([weather])], axis=0)
        for weather in (NIGHT, NOON)
    }
    everywhere = places()
    noon = {method: by_seed(runs, method, places([NOON])) for method in (SUBTRACTED, NOT_HOT)}
    gated = {method: by_seed(runs, method, everywhere) for method in (SUBTRACTED, BY_SIZE)}
    block = {method: f1(by_seed(runs, method, everywhere)) for method in (SUBTRACTED, BY_BLOCK)}

    def filtered(without: Array, filtered: Array) -> Check:
        # A further filter can only take away: it has to be worth what it costs.
        with_it, plain = f1(filtered), f1(without)
        return Check(
            true=(filtered[:, 1] < without[:, 1]) & (with_it > plain),
            first=with_it, second=plain, premise=without[:, 1] > 0, unit="F1",
        )  # fmt: skip

    return {
        "constant-fails": Check(
            true=seen[CONSTANT], measured=drop[CONSTANT], above=True, premise=changed & seen[CONSTANT],
            reach=(-np.inf, 1),
        ),
        "adaptive-copes": Check(
            true=seen[OVER_MEAN], measured=drop[OVER_MEAN], premise=changed & seen[OVER_MEAN],
            reach=(-np.inf, 1),
        ),
        "small-block-splits": Check(true=pieces[SMALL] > 1, premise=np.isfinite(pieces[SMALL])),
        "large-block-whole": Check(true=pieces[LARGE] == 1, premise=np.isfinite(pieces[LARGE])),
        "enhancement-takes-background": Check(
            true=left[ENHANCED] > left[SUBTRACTED], first=left[ENHANCED], second=left[SUBTRACTED],
            unit="grey levels",
        ),
        "enhancement-misses": Check(
            true=recall[ENHANCED] < recall[SUBTRACTED], first=recall[ENHANCED], second=recall[SUBTRACTED],
            premise=recall[SUBTRACTED] > 0,
        ),
        "combinations-best": Check(
            true=np.minimum(good[SUBTRACTED], good[ENHANCED]) > np.maximum(good[CONSTANT], good[OVER_MEAN]),
            first=np.minimum(good[SUBTRACTED], good[ENHANCED]),
            second=np.maximum(good[CONSTANT], good[OVER_MEAN]),
        ),
        "subtraction-and-constant-good": Check(measured=good[BY_MEAN], above=True, reach=(0, 1)),
        "herd-biases-mean": Check(measured=of("herd", "mean_rise"), above=True),
        "threshold-higher-than-needed": Check(
            true=herd[BY_EMPTY] > herd[BY_MEAN], first=herd[BY_EMPTY], second=herd[BY_MEAN],
        ),
        "median-rises-less": Check(
            true=np.abs(of("herd", "median_rise")) < np.abs(of("herd", "mean_rise")),
            first=of("herd", "median_rise"), second=of("herd", "mean_rise"), unit="grey levels",
        ),
        "median-finds-more": Check(
            true=herd[BY_MEDIAN] > herd[BY_MEAN], first=herd[BY_MEDIAN], second=herd[BY_MEAN],
        ),
        "sun-breaks": Check(measured=warm[NOON], above=True),
        "night-keeps": Check(measured=warm[NIGHT]),
        "too-hot": filtered(noon[SUBTRACTED], noon[NOT_HOT]),
        "size-from-ground": filtered(gated[SUBTRACTED], gated[BY_SIZE]),
        "block-from-distance": Check(
            true=block[BY_BLOCK] > block[SUBTRACTED], first=block[BY_BLOCK], second=block[SUBTRACTED]
        ),
    }  # fmt: skip
