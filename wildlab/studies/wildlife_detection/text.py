"""What the report on the detection of animals says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pandas as pd

from wildlab.evaluation.matching import Rates
from wildlab.evaluation.runs import Interval, mean_interval, share_interval
from wildlab.reporting.text import percent
from wildlab.studies.wildlife_detection.claims import (
    SAME,
    extremes,
    false_alarms,
    herd_gain,
    over_weathers,
    places,
    rates_of,
    sun_falls,
)
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    BY_BLOCK,
    BY_MEAN,
    BY_MEDIAN,
    BY_SIZE,
    CLOUDY,
    CONSTANT,
    ENHANCED,
    LARGE,
    METHODS,
    MORNING,
    NIGHT,
    NOON,
    NOT_HOT,
    OVER_MEAN,
    PRINTED,
    READ_AT,
    READINGS,
    SMALL,
    SUBTRACTED,
    VIEWS,
    WEATHERS,
    read_subject,
)

NAMES = {
    CONSTANT: "constant, 150",
    ADAPTIVE: "adaptive 451, 150",
    OVER_MEAN: "adaptive 451, 150 above the mean",
    SMALL: "adaptive 51",
    LARGE: "adaptive 251",
    SUBTRACTED: "subtraction + adaptive 251, 65",
    ENHANCED: "enhancement + adaptive 251, 160",
    BY_MEAN: "subtraction + constant, 65",
    BY_MEDIAN: "median subtraction + constant, 65",
    BY_SIZE: "the same, sizes from the ground",
    BY_BLOCK: "the same, block from the distance",
    NOT_HOT: "the same, nothing above 37 °C",
}
WHEN = {
    NIGHT: "clear night",
    MORNING: "clear morning",
    NOON: "sunny noon",
    CLOUDY: "cloudy noon",
}
#: The same in a sentence.
AT = {
    NIGHT: "on a clear night",
    MORNING: "on a clear morning",
    NOON: "at a sunny noon",
    CLOUDY: "at a cloudy noon",
}
READ_AS = {
    "floor": "above the mean of its block, and above the level",
    "offset": "above the mean of its block by the level",
    "white": "the grey of what is found (OpenCV's maxValue): above the mean of its block",
    "off-mean": "taken off the mean (OpenCV's C)",
}
#: F1 falls by a fifth of what it was: as for the claims.
FALL = 0.2
#: From which overlap on two masks are of one method: they differ in a twentieth of what is white.
ALIKE = 0.95
FIGURE = {ADAPTIVE: "7.6: size 451, val 150", SUBTRACTED: "7.10a: level 65", ENHANCED: "7.10b: level 160"}

METHOD = r"""Rendered thermal images of land: rolling ground with grass, sand and rock under the sun of the
hour, stones, trees, and animals of three sizes, from a gondola 15 m above the ground that looks aside, and
from 30 and 60 m (F 7.5.1). The camera is F's. Its image has 256 grey levels by a fixed window, whose middle
lies between ground and animals, as F 3.1 has it; the width, twice what lies between, was chosen. So were the
smallest contour, 50 pixels, and the distance below which two detections are one, 10 pixels: F prints
neither.

A detection is of the animal on whose pixels, or within three of them, its centre lies, and not more than
three times as large; a second one of the same animal counts as a false alarm. Animals of which less than a
quarter shows count neither way. Intervals of rates draw images with replacement; those of false alarms are
Student's."""


def ranged(one: Interval, digits: int = 2) -> str:
    """A number with its interval."""
    if not np.isfinite(one.low):
        return f"{one.estimate:.{digits}f}"
    return f"{one.estimate:.{digits}f} ({max(one.low, 0):.{digits}f} to {one.high:.{digits}f})"


def percent_ranged(one: Interval) -> str:
    """A share in per cent with its interval."""
    if not np.isfinite(one.low):
        return percent(one.estimate, 0)
    return f"{percent(one.estimate, 0)} ({100 * max(one.low, 0):.0f} to {100 * min(one.high, 1):.0f} %)"


def equals(every: dict[str, Interval]) -> list[str]:
    """The one with the largest estimate first, then those that lie within its interval, in order.

    Two that are the same to two digits are never told apart.
    """
    value = {name: float(np.nan_to_num(one.estimate)) for name, one in every.items()}
    order = sorted(value, key=lambda name: -value[name])
    best = every[order[0]]
    least = value[order[0]] - SAME
    if np.isfinite(best.low):
        least = min(best.low, least)
    return [order[0], *(name for name in order[1:] if value[name] >= least)]


def rates_table(spread: pd.DataFrame, subjects: Sequence[str], at: dict[str, list[str]]) -> pd.DataFrame:
    """Recall, false alarms and F1 of each method, one row for each group of images."""
    rows = []
    for subject in subjects:
        for name, own in at.items():
            found = rates_of(spread, subject, own)
            if not found.groups:
                continue
            rows.append(
                {
                    "method": NAMES[subject],
                    "when": name,
                    "recall": ranged(found.recall),
                    "false": ranged(false_alarms(spread, subject, own), 1),
                    "f1": ranged(found.f1),
                    "images": found.groups,
                }
            )
    return pd.DataFrame(rows)


def by_weather() -> dict[str, list[str]]:
    """Names of images by weather, in words."""
    return {words: places([weather]) for weather, words in WHEN.items()}


def by_height() -> dict[str, list[str]]:
    """Names of images without sun by height, in words."""
    dark = [weather for weather in WEATHERS if weather != NOON]
    return {f"{height} m": places(dark, [height]) for height in VIEWS}


def best_methods(spread: pd.DataFrame, weather: str) -> tuple[list[str], Rates]:
    """Of F's settings that with the largest F1 in a weather, those not told from it, and its rates."""
    every = {one: rates_of(spread, one, places([weather])) for one in METHODS}
    names = equals({one: found.f1 for one, found in every.items()})
    return names, every[names[0]]


def _best_words(names: Sequence[str], found: Rates) -> str:
    """An F1 with its interval, whose it is, and how many are not told from it; `ties_words` names them."""
    first, *more = (f"“{NAMES[one]}”" for one in names)
    tied = f" ({more[0] if len(more) == 1 else f'{len(more)} more'} not told from it)" if more else ""
    return f"{ranged(found.f1)} with {first}{tied}"


def ties_words(spread: pd.DataFrame) -> str:
    """Which setting is best in each weather, and which are not told from it, by name."""
    parts = []
    for weather in WHEN:
        (first, *more), found = best_methods(spread, weather)
        tied = f", not told from {', '.join(f'“{NAMES[one]}”' for one in more)}" if more else ""
        parts.append(f"{AT[weather]} {ranged(found.f1)} with “{NAMES[first]}”{tied}")
    return f"The largest F1 is {'; '.join(parts)}."


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the images give."""
    night, noon = (best_methods(spread, weather) for weather in (NIGHT, NOON))
    dark, bright = night[1].f1, noon[1].f1
    if bright.high < dark.low:
        beside = f"at a sunny noon the best comes only to {_best_words(*noon)}"
    elif bright.low > dark.high:
        beside = f"at a sunny noon it is more: {_best_words(*noon)}"
    else:
        beside = f"at a sunny noon it is not told from {_best_words(*noon)}"
    read: dict[str, list[str]] = {}
    for method in PRINTED:
        words = " or ".join(f"“{READ_AS[one]}”" for one in best_of(spread, method)[0])
        read.setdefault(words, []).append(FIGURE[method].split(":")[0])
    level = "; ".join(
        f"as {words} with the numbers of figure{'s' * (len(figures) > 1)} {', '.join(figures)}"
        for words, figures in read.items()
    )
    if not all(np.isfinite(best_of(spread, method)[1].estimate) for method in PRINTED):
        level = "nan"
    return [
        f"On a clear night the best of {len(METHODS)} settings has an F1 of {_best_words(*night)}; {beside}.",
        change_words(spread),
        f"Read in {len(READINGS)} ways, the undefined level of an adaptive threshold finds most in these "
        f"rendered images {level}. What the thesis's own pictures show was not measured.",
    ]


def tiles(spread: pd.DataFrame) -> list[tuple[str, str]]:
    """Numbers and labels: recall by night and at noon, and false alarms, with their intervals."""
    night, noon = (rates_of(spread, SUBTRACTED, places([weather])).recall for weather in (NIGHT, NOON))
    alarms = false_alarms(spread, SUBTRACTED, places([NOON]))

    def beside(words: str) -> str:
        return f" ({words.split('(', 1)[1]}" if "(" in words else ""

    return [
        (
            percent(night.estimate, 0),
            f"of the animals found on a clear night{beside(percent_ranged(night))}: subtraction and adaptive "
            "threshold",
        ),
        (
            percent(noon.estimate, 0),
            f"of them found at a sunny noon{beside(percent_ranged(noon))}, by the same",
        ),
        (f"{alarms.estimate:.1f}", f"false alarms an image at that noon{beside(ranged(alarms, 1))}"),
    ]


def masks_words(spread: pd.DataFrame) -> str:
    """Whether the constant and the adaptive threshold, its level read as a floor, are one method here."""
    own = spread[[key for key in spread.columns if key[0] == "masks"]].to_numpy(float)
    alike = own[np.isfinite(own)]
    same, of = int((alike == 1).sum()), len(alike)
    share = share_interval(same, of)
    start = (
        f"With its level as a floor, {NAMES[ADAPTIVE]} gives the same mask as {NAMES[CONSTANT]}, pixel for "
        f"pixel, in {same} of {of} images ({100 * share.low:.0f} to {100 * share.high:.0f} %); on average "
        f"{percent(float(alike.mean()), 0)} of what either makes white is white in both."
    )
    verdict = (
        "Read so it is the constant threshold under another name"
        if alike.mean() >= ALIKE
        else "So the two differ"
    )
    return f"{start} {verdict}; claims on it are judged with its level above the mean of the block."


def change_words(spread: pd.DataFrame) -> str:
    """What the sun that comes out does to a constant and to an adaptive threshold."""
    shown = (CONSTANT, OVER_MEAN, SUBTRACTED)
    found = {(one, at): rates_of(spread, one, [at]).f1 for one in shown for at in ("before", "after")}
    rise = (spread["ground", "level_after"] - spread["ground", "level_before"]).median()
    said = "; ".join(
        f"{NAMES[one]} from {ranged(found[one, 'before'])} to {ranged(found[one, 'after'])}" for one in shown
    )
    lost = (
        f"the adaptive threshold {copes_words(sun_falls(spread, OVER_MEAN))}, "
        f"the constant one {copes_words(sun_falls(spread, CONSTANT))}"
    )
    way = "rises" if rise >= 0 else "falls"
    moved = f"{way} by {abs(rise):.0f} grey levels"
    return f"When the sun comes out, the ground {moved}, and F1 goes: {said}; {lost}."


def copes_words(lost: Interval) -> str:
    """Whether a threshold copes that loses such a part of its F1, as far as the interval tells it."""
    if not np.isfinite(lost.estimate):
        return "cannot be said to cope, as it found nothing before"
    part = f"{percent(lost.estimate, 0)} of it" if lost.estimate > SAME else "nothing"
    if not np.isfinite(lost.low):
        return f"loses {part} (too few flights to say whether it copes)"
    part += f" ({100 * max(lost.low, 0):.0f} to {100 * max(lost.high, 0):.0f} %)"
    if lost.high < FALL:
        return f"copes and loses {part}"
    return (
        f"does not cope and loses {part}"
        if lost.low >= FALL
        else f"loses {part}: whether it copes is not told"
    )


def best_of(spread: pd.DataFrame, method: str) -> tuple[list[str], Interval]:
    """The reading with the largest F1 of one printed setting, those not told from it, and that F1."""
    at = [str(height) for height in READ_AT]
    every = {one: rates_of(spread, read_subject(method, one), at).f1 for one in READINGS}
    names = equals(every)
    return names, every[names[0]]


def herd_words(spread: pd.DataFrame) -> str:
    """What a herd does to mean and median, and what that costs."""
    mean, median = (_change(spread["herd", f"{name}_rise"]) for name in ("mean", "median"))
    share = float(spread["herd", "share"].mean())
    found = {one: rates_of(spread, one, ["herd"]) for one in (BY_MEAN, BY_MEDIAN)}
    gain = herd_gain(spread)
    many = f"{abs(100 * gain.estimate):.0f} in a hundred {'more' if gain.estimate >= 0 else 'fewer'}"
    if abs(gain.estimate) < SAME:
        cost = "the median finds as many"
    elif gain.low > 0 or gain.high < 0:
        cost = f"the median finds {many}"
    else:
        cost = f"that the median finds {many} is not told from chance"
    within = (
        f" ({100 * gain.low:+.0f} to {100 * gain.high:+.0f})".replace("-", "−")
        if np.isfinite(gain.low)
        else ""
    )
    return (
        f"A herd over {percent(share, 0)} of the image changes the mean by {mean} grey levels and the "
        f"median by {median}; {cost}{within}, with F1 of {ranged(found[BY_MEDIAN].f1)} beside "
        f"{ranged(found[BY_MEAN].f1)}."
    )


def _change(values: pd.Series) -> str:
    """The mean of changes with its sign, and Student's interval where there is one."""
    low, high = mean_interval(values)[1:] if values.notna().sum() > 1 else (np.nan, np.nan)
    beside = f" ({low:+.1f} to {high:+.1f})" if np.isfinite(low) else ""
    return f"{values.mean():+.1f}{beside}".replace("-", "−")


def worst_words(spread: pd.DataFrame, methods: Sequence[str], of: Literal["recall", "false"]) -> str:
    """In which weather the fewest animals are found, or most false alarms come, where it is told."""
    few, come = ("Fewest animals", "are found") if of == "recall" else ("Most false alarms", "come")
    weathers = extremes(over_weathers(spread, methods, of), -1.0 if of == "recall" else 1.0)
    if len(weathers) > 2:
        return f"In no one weather clearly the {few.lower()} {come}"
    return f"{few} {come} {' or '.join(words for key, words in AT.items() if key in weathers)}"


def sun_words(spread: pd.DataFrame) -> str:
    """How much of the ground is as warm as animals, by weather."""
    parts = []
    for weather, words in WHEN.items():
        one = np.nanmean([spread["ground", f"as_warm_{at}"].to_numpy(float) for at in places([weather])])
        parts.append(f"{words} {one:.2g}")
    return (
        "Pixels of anything else that are as warm as the middle one of the animals' pixels, for each pixel "
        "of an animal: " + ", ".join(parts) + "."
    )
