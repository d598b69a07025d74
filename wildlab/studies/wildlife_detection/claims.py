"""What the pictures give for each sentence of F 3.2, 7.4, 8.1 and 8.4, and rates over all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.matching import Rates, group_draws, percentile, rates, shares
from wildlab.evaluation.runs import Interval, mean_interval
from wildlab.evaluation.shares import Check, paired_difference
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
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
    NIGHT,
    NOON,
    NOT_HOT,
    OVER_MEAN,
    PRINTED,
    READ_AT,
    SMALL,
    SUBTRACTED,
    TRIED,
    VIEWS,
    WEATHERS,
    WIDTHS,
    read_subject,
)

Array = NDArray[np.float64]
#: How many grey levels the ground changes at least where it "changes too much": a tenth of all.
TOO_MUCH = 25.0
#: Rates are printed to two digits: what is nearer is never told apart.
SAME = 0.005
#: The reading of figures 7.7 and 7.8 for the claims, that of `METHODS`.
CLAIMED = "pieces_offset_65"


def places(weathers: Iterable[str] = tuple(WEATHERS), heights: Iterable[int] = tuple(VIEWS)) -> list[str]:
    """Names of pictures: of those weathers, from those heights."""
    tall = list(heights)
    return [f"{weather}_{height}" for weather in weathers for height in tall]


def counts_of(spread: pd.DataFrame, subject: str, at: Sequence[str]) -> Array:
    """(images, 3) found, invented and missed of all seeds; an image that was not looked at has no row."""
    named = [[(subject, f"{name}_{one}") for name in COUNTS] for one in at]
    rows = [spread[one].to_numpy(float) for one in named if one[0] in spread.columns]
    table = np.concatenate([np.zeros((0, 3)), *rows])
    return np.asarray(table[np.isfinite(table).all(axis=1)])


def rates_of(spread: pd.DataFrame, subject: str, at: Sequence[str]) -> Rates:
    """Precision, recall and F1 over all images, with intervals over images."""
    return rates(counts_of(spread, subject, at))


def false_alarms(spread: pd.DataFrame, subject: str, at: Sequence[str]) -> Interval:
    """How many an image, with the interval of the mean, which ends at zero."""
    invented = counts_of(spread, subject, at)[:, 1]
    if len(invented) < 2:
        return Interval(float(invented.mean()) if len(invented) else np.nan, np.nan, np.nan)
    found = mean_interval(invented)
    return Interval(found.estimate, max(found.low, 0.0), found.high)


def by_seed(spread: pd.DataFrame, subject: str, at: Sequence[str]) -> Array:
    """(seeds, 3) sums of found, invented and missed."""
    return np.stack(
        [spread[[(subject, f"{name}_{one}") for one in at]].to_numpy(float).sum(axis=1) for name in COUNTS],
        axis=1,
    )


def f1(counts: Array) -> Array:
    """(...) of (..., 3) counts: zero where nothing was found, NaN where there was nothing."""
    return np.asarray(shares(counts)[..., 2])


def fall_interval(before: Array, after: Array) -> Interval:
    """By which part the F1 of all seeds' images falls, with an interval over seeds drawn with replacement.

    Parameters
    ----------
    before, after
        (S, 3) found, invented and missed of each seed, in its images before and after.

    Returns
    -------
    Interval
        1 is all of it; without limits where seeds are too few, NaN where nothing was found before.
    """
    estimate = float(fall(f1(before.sum(axis=0)), f1(after.sum(axis=0))))
    weights = group_draws(len(before))
    if weights is None or not np.isfinite(estimate):
        return Interval(estimate, np.nan, np.nan)
    drawn = fall(f1(weights @ before), f1(weights @ after))
    # A seed that found nothing before, drawn alone, has no fall.
    drawn = np.where(np.isfinite(drawn), drawn, np.nan)
    return Interval(estimate, percentile(drawn, 2.5), percentile(drawn, 97.5))


def sun_falls(spread: pd.DataFrame, subject: str) -> Interval:
    """By which part the F1 of a subject falls when the sun comes out, with its interval over seeds."""
    return fall_interval(*(by_seed(spread, subject, [at]) for at in ("before", "after")))


def herd_gain(spread: pd.DataFrame) -> Interval:
    """Share of a herd's animals that the median finds more than the mean; without limits of one seed."""
    median, mean = (_recall(by_seed(spread, one, ["herd"])) for one in (BY_MEDIAN, BY_MEAN))
    found = paired_difference(median, mean)
    return found or Interval(float(np.nanmean(median - mean)), np.nan, np.nan)


def over_weathers(
    spread: pd.DataFrame, subjects: Sequence[str], of: Literal["recall", "false"]
) -> dict[str, Array]:
    """(seeds,) recall, or false alarms an image, by weather: each seed's mean over subjects."""
    found = {}
    for weather in WEATHERS:
        counts = [by_seed(spread, one, places([weather])) for one in subjects]
        each = [_recall(one) if of == "recall" else one[:, 1] / len(VIEWS) for one in counts]
        found[weather] = np.asarray(np.mean(each, axis=0))
    return found


def extremes(values: dict[str, Array], sign: float) -> list[str]:
    """The name with the largest mean of ``sign`` times its values, then those not told from it.

    Two are told apart where Student's interval of their difference, seed by seed, does not have zero in it.
    """
    known = {name: sign * own[np.isfinite(own)] for name, own in values.items()}
    mean = {name: float(own.mean()) if len(own) else -np.inf for name, own in known.items()}
    first, *others = sorted(mean, key=lambda name: -mean[name])
    apart = {name: paired_difference(sign * values[first], sign * values[name]) for name in others}
    # A hair: the same numbers in another order may differ in their last digit.
    return [first, *(name for name, one in apart.items() if one is None or one.low <= 1e-9)]


def fall(before: ArrayLike, after: ArrayLike) -> Array:
    """By which part an F1 falls: 1 is all of it. NaN where it was zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(1 - np.asarray(after, float) / np.asarray(before, float))


def _recall(counts: Array) -> Array:
    return np.asarray(shares(counts)[..., 1])


def over_windows(spread: pd.DataFrame) -> pd.DataFrame:
    """The printed settings with windows of several widths, over all seeds.

    Parameters
    ----------
    spread
        One row for each seed.

    Returns
    -------
    DataFrame
        ``width``, ``reading``; F1 of each of `PRINTED` under clouds, and of `ADAPTIVE` in the sequence
        ``before`` and ``after`` the sun came out; ``mean`` of these five, NaN as zero; ``tied`` whether that
        is not told from the largest, by seeds drawn with replacement or to two digits; ``fall``,
        ``fall_low`` and ``fall_high`` of the sequence.
    """
    at = [str(height) for height in READ_AT]
    weights = group_draws(len(spread))
    rows, drawn = [], []
    for width in WIDTHS:
        for reading in TRIED:
            counts = {
                one: by_seed(spread, read_subject(one, reading, width), at) for one in PRINTED
            } | {
                one: by_seed(spread, read_subject(ADAPTIVE, reading, width), [one])
                for one in ("before", "after")
            }  # fmt: skip
            rates = {name: float(f1(own.sum(axis=0))) for name, own in counts.items()}
            lost = fall_interval(counts["before"], counts["after"])
            rows.append(
                {"width": width, "reading": reading, **rates, "mean": np.nan_to_num([*rates.values()]).mean()}
                | dict(zip(("fall", "fall_low", "fall_high"), lost, strict=True))
            )
            if weights is not None:
                drawn.append(np.mean([np.nan_to_num(f1(weights @ own)) for own in counts.values()], axis=0))
    table = pd.DataFrame(rows)
    best = int(table["mean"].idxmax())
    told = [percentile(drawn[best] - one, 2.5) > 0 for one in drawn] or [False] * len(table)
    far = table["mean"].max() - table["mean"] >= SAME
    return table.assign(tied=~(np.array(told) & far))


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What the pictures of each seed give for each claim, by the claim's id.

    Parameters
    ----------
    spread
        What `wildlab.studies.wildlife_detection.trial.trial` gives, one row for each seed.
    """

    def of(subject: str, name: str) -> Array:
        return spread[subject, name].to_numpy(float)

    cloudy = places([CLOUDY])
    changed = np.abs(of("ground", "level_after") - of("ground", "level_before")) > TOO_MUCH
    drop = {
        method: fall(f1(by_seed(spread, method, ["before"])), f1(by_seed(spread, method, ["after"])))
        for method in (CONSTANT, OVER_MEAN)
    }
    seen = {method: f1(by_seed(spread, method, ["before"])) > 0 for method in drop}
    pieces = {method: of(method, CLAIMED) for method in (SMALL, LARGE)}
    left = {
        method: np.mean([of(method, f"background_{one}") for one in cloudy], axis=0)
        for method in (SUBTRACTED, ENHANCED)
    }
    recall = {method: _recall(by_seed(spread, method, cloudy)) for method in (SUBTRACTED, ENHANCED)}
    herd = {method: _recall(by_seed(spread, method, ["herd"])) for method in (BY_MEAN, BY_MEDIAN, BY_EMPTY)}
    good = {
        method: f1(by_seed(spread, method, cloudy))
        for method in (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_MEAN)
    }
    warm = {
        weather: np.nanmean([of("ground", f"as_warm_{one}") for one in places([weather])], axis=0)
        for weather in (NIGHT, NOON)
    }
    everywhere = places()
    noon = {method: by_seed(spread, method, places([NOON])) for method in (SUBTRACTED, NOT_HOT)}
    gated = {method: by_seed(spread, method, everywhere) for method in (SUBTRACTED, BY_SIZE)}
    block = {method: f1(by_seed(spread, method, everywhere)) for method in (SUBTRACTED, BY_BLOCK)}

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
