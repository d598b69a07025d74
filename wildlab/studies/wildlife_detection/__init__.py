"""Finding warm animals on cold and on sun-heated ground: F 3, 7.4, 8.1, 8.4."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.detection.warm import Warm
from wildlab.evaluation.intervals import Interval, mean_interval
from wildlab.evaluation.matching import Rates, rates, shares
from wildlab.evaluation.shares import Check, columns_of
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.forms import Values, draw_picture, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, new_figure
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.wildlife_detection import trial
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
    DetectionScore,
    Picture,
    find,
    judge,
)

#: How many grey levels the ground changes at least where it "changes too much": a tenth of all.
TOO_MUCH = 25.0


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

    of = columns_of(runs)

    cloudy = places([CLOUDY])
    changed = np.abs(of("ground", "level_after") - of("ground", "level_before")) > TOO_MUCH
    drop = {
        method: fall(f1(by_seed(runs, method, ["before"])), f1(by_seed(runs, method, ["after"])))
        for method in (CONSTANT, OVER_MEAN)
    }
    seen = {method: f1(by_seed(runs, method, ["before"])) > 0 for method in drop}
    pieces = {method: of(method, "pieces_offset_65") for method in (SMALL, LARGE)}
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
        "enhancement-takes-background": Check.larger(left[ENHANCED], left[SUBTRACTED], "grey levels"),
        "enhancement-misses": Check.smaller(
            recall[ENHANCED], recall[SUBTRACTED], premise=recall[SUBTRACTED] > 0
        ),
        "combinations-best": Check.larger(
            np.minimum(good[SUBTRACTED], good[ENHANCED]), np.maximum(good[CONSTANT], good[OVER_MEAN])
        ),
        "subtraction-and-constant-good": Check(measured=good[BY_MEAN], above=True, reach=(0, 1)),
        "herd-biases-mean": Check(measured=of("herd", "mean_rise"), above=True),
        "threshold-higher-than-needed": Check.larger(herd[BY_EMPTY], herd[BY_MEAN]),
        "median-rises-less": Check(
            true=np.abs(of("herd", "median_rise")) < np.abs(of("herd", "mean_rise")),
            first=of("herd", "median_rise"), second=of("herd", "mean_rise"), unit="grey levels",
        ),
        "median-finds-more": Check.larger(herd[BY_MEDIAN], herd[BY_MEAN]),
        "sun-breaks": Check(measured=warm[NOON], above=True),
        "night-keeps": Check(measured=warm[NIGHT]),
        "too-hot": filtered(noon[SUBTRACTED], noon[NOT_HOT]),
        "size-from-ground": filtered(gated[SUBTRACTED], gated[BY_SIZE]),
        "block-from-distance": Check.larger(block[BY_BLOCK], block[SUBTRACTED]),
    }  # fmt: skip


_COLOURS = {CONSTANT: BLUE, OVER_MEAN: VERMILLION, SUBTRACTED: GREEN, ENHANCED: PURPLE, BY_SIZE: ORANGE}


def above(picture: Picture, thresholds: Warm) -> NDArray[np.uint8]:
    """The image after threshold: white where it is above (F figures 7.5 to 7.11)."""
    return np.where(trial.above(picture, thresholds), np.uint8(255), np.uint8(0))


def _thresholded(ax: Axes, picture: Picture, thresholds: Warm) -> DetectionScore:
    """Draw the image after a threshold, with its detections: right ones blue, others red."""
    found = find(picture, thresholds)
    judged = judge(picture, found)
    right = {row for rows in judged.rows.values() for row in rows[:1]}
    colors = [SKY if row in right else VERMILLION for row in range(len(found.box))]
    draw_picture(ax, above(picture, thresholds), boxes=found.box, colors=colors, margin=3)
    return judged


def image_by_method(picture: Picture, names: Mapping[str, str]) -> Figure:
    """One image through each method side by side, as in F figures 7.5 to 7.11."""
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    draw_picture(axes.flat[0], picture.grey, "8 bits")
    for ax, method in zip(axes.flat[1:], (CONSTANT, OVER_MEAN, LARGE, SUBTRACTED, ENHANCED), strict=True):
        _counted(ax, picture, method, names)
    return fig


def image_by_sun(before: Picture, after: Picture, names: Mapping[str, str]) -> Figure:
    """A sequence over which the background changes: constant and adaptive threshold (F figures 7.5, 7.6)."""
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    for column, (when, picture) in enumerate((("under clouds", before), ("sun out", after))):
        draw_picture(axes[0, column], picture.grey, f"{when}, 8 bits")
        for row, method in enumerate((CONSTANT, OVER_MEAN), start=1):
            _counted(axes[row, column], picture, method, names)
    return fig


def animal_by_block(picture: Picture) -> Figure:
    """The largest animal with the small and the large block (F figures 7.7, 7.8)."""
    number = max(picture.animals, key=lambda one: picture.animals[one])
    v, u = np.nonzero(picture.view.labels == number)
    fig, axes = new_figure(5.6, 2.9, rows=1, columns=2)
    for ax, method in zip(axes.flat, (SMALL, LARGE), strict=True):
        thresholds = METHODS[method]
        count = len(_thresholded(ax, picture, thresholds).rows[number])
        ax.set_title(f"block {thresholds.block_px} px: {count} detection{'s' * (count != 1)}")
        middle, half = np.array([np.mean(u), np.mean(v)]), 0.9 * max(float(np.ptp(u)), float(np.ptp(v)), 40.0)
        ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] + half, middle[1] - half))
    return fig


def rates_by_weather(
    runs: pd.DataFrame, what: Literal["recall", "false"], names: Mapping[str, str]
) -> Figure:
    """Recall, or false alarms per image, by weather and method with their intervals."""
    series, most = {}, 1.0
    for method in (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_SIZE):
        each = [places([weather]) for weather in WEATHERS]
        if what == "recall":
            found = 100 * np.array([rates_of(runs, method, at).recall for at in each])
        else:
            found = np.array([false_alarms(runs, method, at) for at in each])
        middle, low, high = found.T
        series[names[method]] = Values(middle, (np.maximum(low, 0), high), _COLOURS[method])
        most = max(most, float(middle.max()))
    recall, rows = what == "recall", [names[one] for one in WEATHERS]
    label, limits = (
        ("animals found (%)", (-2, 102)) if recall else ("false alarms per image", (-0.02 * most, None))
    )
    return rows_chart(rows, series, label, size=(5.6, 3.9), apart=0.14, xlim=limits)


def methods_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """F1 of every method by weather."""
    methods = [
        {"method": names[method]}
        | {weather: _ranged(rates_of(runs, method, places([weather])).f1) for weather in WEATHERS}
        for method in (*METHODS, *PROPOSED)
    ]
    return pd.DataFrame(methods)


def _counted(ax: Axes, picture: Picture, method: str, names: Mapping[str, str]) -> None:
    """The image after a method's threshold, with its detections, and how many of them are right."""
    found, invented, missed = _thresholded(ax, picture, METHODS[method]).counts
    said = f"{names[method]}\n{found:.0f} of {found + missed:.0f} found, {invented:.0f} false"
    ax.set_title(said, fontsize=10)


def _ranged(one: Interval) -> str:
    if not np.isfinite(one.low):
        return f"{one.estimate:.2f}"
    return f"{one.estimate:.2f} ({max(one.low, 0):.2f} to {one.high:.2f})"


#: An F1 from which on a method is called usable: half of what it reports, or of what is there, is right.
USABLE = 0.5


def answer(facts: Facts) -> list[str]:
    """Background subtraction by night and in full sun, then whether another method is usable there."""
    by_night, in_sun = (facts.value(SUBTRACTED, f"f1_{weather}") for weather in ("night", "noon"))
    if math.isnan(by_night + in_sun):
        return ["unknown"]
    return [f"sun-{_in_sun(facts)}", f"noon-{_at_noon(facts)}"]


def _in_sun(facts: Facts) -> str:
    """What intervals over images show of background subtraction."""
    night, noon = (
        [facts.value(SUBTRACTED, f"f1_{weather}", end) for end in ("low", "high")]
        for weather in ("night", "noon")
    )
    if noon[1] < USABLE:
        return "breaks" if noon[1] < night[0] else "low"
    if night[0] >= USABLE and noon[0] >= USABLE:
        return "costs" if noon[1] < night[0] else "harmless"
    return "open"


def _at_noon(facts: Facts) -> str:
    """Whether any method is usable in full sun."""
    known = [one for one in (*METHODS, *PROPOSED) if not math.isnan(facts.value(one, "f1_noon"))]
    if any(facts.value(one, "f1_noon", "low") >= USABLE for one in known):
        return "usable"
    return "unusable" if all(facts.value(one, "f1_noon", "high") < USABLE for one in known) else "open"


STUDY = Study("wildlife-detection", trial.trial, check_claims, trial.RECORDED.get, answer)
