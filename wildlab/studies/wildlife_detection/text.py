"""What the report on the detection of animals says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.evaluation.matching import Rates
from wildlab.evaluation.runs import Interval
from wildlab.studies.wildlife_detection.claims import false_alarms, places, rates_of
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
    PIECES,
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
#: F1 falls by a fifth: as for the claims.
FALL = 0.2
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


def percent(share: float) -> str:
    """A share in per cent; never rounded to all or to none."""
    if not np.isfinite(share):
        return "none"
    if share in (0.0, 1.0):
        return f"{100 * share:.0f} %"
    return f"{min(max(100 * share, 1), 99):.0f} %"


def ranged(one: Interval, digits: int = 2) -> str:
    """A number with its interval."""
    if not np.isfinite(one.low):
        return f"{one.estimate:.{digits}f}"
    return f"{one.estimate:.{digits}f} ({max(one.low, 0):.{digits}f} to {one.high:.{digits}f})"


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


def best_method(spread: pd.DataFrame, weather: str, subjects: Sequence[str]) -> tuple[str, Rates]:
    """The method with the largest F1 in a weather, and its rates."""
    every = {one: rates_of(spread, one, places([weather])) for one in subjects}
    name = max(every, key=lambda one: np.nan_to_num(every[one].f1.estimate))
    return name, every[name]


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the images give."""
    shown = (CONSTANT, ADAPTIVE, SUBTRACTED, ENHANCED)
    night, noon = (best_method(spread, weather, shown) for weather in (NIGHT, NOON))
    fall = night[1].f1.estimate - noon[1].f1.estimate
    worse = (
        f"at a sunny noon the best comes to {noon[1].f1.estimate:.2f} ({NAMES[noon[0]]})"
        if fall > 0.1
        else f"a sunny noon is no worse ({noon[1].f1.estimate:.2f}, {NAMES[noon[0]]})"
    )
    reading, value = best_reading(spread)
    first, second = (FIGURE[one].split(":")[0] for one in (ADAPTIVE, SUBTRACTED))
    best = {one: best_of(spread, one)[0] for one in (ADAPTIVE, SUBTRACTED)}
    level = (
        f"The undefined “level” of an adaptive threshold fits the pictures best as “{READ_AS[reading]}”: a "
        f"mean F1 of {value:.2f} over the printed settings."
        if best[ADAPTIVE] == best[SUBTRACTED]
        else f"The undefined number of an adaptive threshold fits figure {first} best as “"
        f"{READ_AS[best[ADAPTIVE]]}”, and figure {second} as “{READ_AS[best[SUBTRACTED]]}”."
    )
    return [
        f"On a clear night the best of the thesis's settings has an F1 of {night[1].f1.estimate:.2f} "
        f"({NAMES[night[0]]}); {worse}.",
        change_words(spread),
        level,
    ]


def change_words(spread: pd.DataFrame) -> str:
    """What the sun that comes out does to a constant and to an adaptive threshold."""
    f1 = {
        (method, at): rates_of(spread, method, [at]).f1.estimate
        for method in (CONSTANT, ADAPTIVE, SUBTRACTED)
        for at in ("before", "after")
    }
    rise = (spread["ground", "level_after"] - spread["ground", "level_before"]).median()
    said = ", ".join(
        f"{NAMES[method]} from {f1[method, 'before']:.2f} to {f1[method, 'after']:.2f}"
        for method in (CONSTANT, ADAPTIVE, SUBTRACTED)
    )
    drop = {method: f1[method, "before"] - f1[method, "after"] for method in (CONSTANT, ADAPTIVE)}
    both = (
        "the adaptive threshold copes better"
        if drop[CONSTANT] - drop[ADAPTIVE] > 0.05
        else "the adaptive threshold with this level copes no better"
    )
    return f"When the sun comes out, the ground rises by {rise:.0f} grey levels, and F1 goes: {said}; {both}."


def best_of(spread: pd.DataFrame, method: str) -> tuple[str, float]:
    """The reading with the largest F1 of one printed setting, and that."""
    at = [str(height) for height in READ_AT]
    every = {one: rates_of(spread, read_subject(method, one), at).f1.estimate for one in READINGS}
    name = max(every, key=lambda one: np.nan_to_num(every[one]))
    return name, every[name]


def best_reading(spread: pd.DataFrame) -> tuple[str, float]:
    """The reading with the largest mean F1 over the printed settings, and that."""
    at = [str(height) for height in READ_AT]

    def mean(reading: str) -> float:
        found = [rates_of(spread, read_subject(one, reading), at).f1.estimate for one in PRINTED]
        return float(np.mean(np.nan_to_num(found)))

    means = {reading: mean(reading) for reading in READINGS}
    name = max(means, key=lambda one: means[one])
    return name, means[name]


def readings_table(spread: pd.DataFrame) -> pd.DataFrame:
    """F1 and recall of each printed setting with each reading of its level."""
    at = [str(height) for height in READ_AT]
    rows = []
    for reading in READINGS:
        row: dict[str, object] = {"reading": READ_AS[reading]}
        for method in PRINTED:
            found = rates_of(spread, read_subject(method, reading), at)
            row[method] = ranged(found.f1)
        for when in ("before", "after"):
            row[when] = ranged(rates_of(spread, read_subject(ADAPTIVE, reading), [when]).f1)
        rows.append(row)
    return pd.DataFrame(rows)


def readings_words(spread: pd.DataFrame) -> str:
    """Which reading gives what F's pictures show, figure by figure."""
    parts = []
    for method in PRINTED:
        best, value = best_of(spread, method)
        parts.append(f"figure {FIGURE[method]}: “{READ_AS[best]}” (F1 {value:.2f})")
    return (
        "The thesis does not define the level of an adaptive threshold. What finds the animals best under "
        "clouds, as its pictures have it, is, for " + "; for ".join(parts) + "."
    )


def windows_words(windows: pd.DataFrame) -> str:
    """Which width and reading do best in what F's pictures show, and whether the adaptive one then copes."""
    sense = windows[[*PRINTED, "before", "after"]].fillna(0.0).mean(axis=1)
    best = windows.loc[sense.idxmax()]
    rivals = [
        f"“{READ_AS[str(reading)]}” with {windows.loc[own.idxmax(), 'width']:g} times ({own.max():.2f})"
        for reading, own in sense.groupby(windows["reading"])
    ]
    fall = float(best["before"] - best["after"])
    copes = "copes" if fall < FALL else "does not cope"
    same = windows[(windows["width"] == best["width"]) & (windows["reading"] != best["reading"])]
    beside = "".join(
        f"; read the other way, from {row.before:.2f} to {row.after:.2f}" for row in same.itertuples()
    )
    return (
        "The window's width was chosen, and the levels hang on it. The mean F1 of the printed settings and "
        f"of the sequence is largest for {'; for '.join(rivals)} the difference between animals and ground. "
        f"With the best of them the adaptive threshold {copes} when the sun comes out: F1 goes from "
        f"{best['before']:.2f} to {best['after']:.2f}{beside}."
    )


def windows_table(windows: pd.DataFrame) -> pd.DataFrame:
    """The same as a table, readings in words."""
    return windows.assign(reading=windows["reading"].map(READ_AS))


def _pieces(spread: pd.DataFrame, kind: str, level: float) -> tuple[pd.Series, pd.Series]:
    """Detections for each animal with the small and with the large block, of the seeds that have both."""
    small, large = (spread[method, f"pieces_{kind}_{level:g}"] for method in (SMALL, LARGE))
    known = np.isfinite(small) & np.isfinite(large)
    return small[known], large[known]


def level_words(kind: str, level: float) -> str:
    """What a level in its reading is called."""
    if level == 0:
        return "above the mean of the block: no level"
    beside = (
        "above the mean of the block by" if kind == "offset" else "above the mean of the block, and above"
    )
    return f"{beside} {level:g}"


def pieces_table(spread: pd.DataFrame) -> pd.DataFrame:
    """Into how many detections animals fall with F's two blocks, by the reading of the missing level."""
    rows = []
    for kind, level in PIECES:
        small, large = _pieces(spread, kind, level)
        row = {"reading": level_words(kind, level), "seeds": len(small)}
        for name, own in (("small", small), ("large", large)):
            row[name] = f"{own.mean():.2f}" if len(own) else ""
            row[f"{name}_split"] = f"{int((own > 1).sum())}" if len(own) else ""
        rows.append(row)
    return pd.DataFrame(rows)


def pieces_words(spread: pd.DataFrame) -> str:
    """Which reading of the missing level gives what figures 7.7 and 7.8 show, and how often."""
    shown = {}
    for kind, level in PIECES:
        small, large = _pieces(spread, kind, level)
        shown[kind, level] = (int(((small > 1) & (large == 1)).sum()), len(small))
    best = max(shown, key=lambda one: shown[one][0] / max(shown[one][1], 1))
    count, of = shown[best]
    start = "Animals longer than 51 pixels, seen from the gondola; the figures print no level. "
    if not count:
        return f"{start}With no reading of it a small region splits an animal that a large one leaves whole."
    return (
        f"{start}That the small region splits some and the large one none comes on {count} of {of} images "
        f"with “{level_words(*best)}”, more often than with the other readings."
        if sum(value[0] / max(value[1], 1) == count / of for value in shown.values()) == 1
        else f"{start}That the small region splits some and the large one none comes on {count} of {of} "
        "images with more than one reading."
    )


def herd_words(spread: pd.DataFrame) -> str:
    """What a herd does to mean and median, and what that costs."""
    mean, median = (float(spread["herd", f"{name}_rise"].mean()) for name in ("mean", "median"))
    share = float(spread["herd", "share"].mean())
    found = {one: rates_of(spread, one, ["herd"]) for one in (BY_MEAN, BY_MEDIAN)}
    matter = found[BY_MEDIAN].recall.estimate - found[BY_MEAN].recall.estimate
    cost = (
        f"the median finds {100 * matter:.0f} in a hundred more"
        if matter > 0.005
        else "the median finds no more"
    )
    return (
        f"A herd over {percent(share)} of the image raises the mean by {mean:.1f} grey levels and the "
        f"median by {median:.1f}; {cost}, with F1 of {ranged(found[BY_MEDIAN].f1)} beside "
        f"{ranged(found[BY_MEAN].f1)}."
    )


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


#: What F leaves open about scenes and pictures, its value here, and why.
CHOSEN = (
    ("hours", "night 2, morning 8, noon 13", "before dawn, two hours after sunrise, and when ground is hot"),
    (
        "ground",
        "70 % grass, 20 % sand, 10 % rock",
        "an enclosure: mostly meadow, with trodden and stony places",
    ),
    (
        "relief",
        "2 m standard deviation, hills of some 60 m",
        "gently rolling, so that no hill hides an animal",
    ),
    ("grass", "+12 K in full sun, -4 K at night, 0.5 h", "it evaporates water and radiates freely"),
    ("sand", "+26 K, -3 K, 1 h", "dry and dark ground becomes hottest"),
    ("rock and stones", "+24 K, -0.5 K, 4 h", "they keep the day's heat into the night"),
    ("clouds", "take 75 % of the sun's heat and 80 % of the night's cooling", "the rest is diffuse light"),
    ("air", "288 K, 5 K up and down over the day", "a mild day; the sun is 55 degrees high at noon"),
    ("animals' skin", "35 to 50 % of the way from air to blood", "thick coats keep nearer to the air"),
    ("head and tail", "75 % and 50 % of the trunk's warmth", "extremities are cooler"),
    ("kinds", "rhinoceros 3.2 m, its calf 1.6 m, antelope 1.5 m", "lengths of trunks of such animals"),
    (
        "gondola",
        "15 m above the ground, 45 degrees from straight down",
        "between 3 and 20 m, turned aside (F 8.2)",
    ),
    (
        "window",
        "the middle between ground and animals, twice as wide",
        "F 3.1 sets the middle, and a high contrast",
    ),
    ("smallest contour", "50 pixels", "F 3.2.6: sufficient size; an antelope from 60 m has about 150"),
    ("apart", "10 pixels", "F 3.2.6: detections too close are one"),
    ("sizes from the ground", "0.2 to 8 m2", "half a small antelope's area, twice a rhinoceros'"),
    ("too hot", "mean above 37 degrees C", "no skin is warmer than the blood below it"),
)


#: Where the numbers of each setting are printed, or why they are as they are.
SOURCES = {
    CONSTANT: "F figure 7.5",
    ADAPTIVE: "F figure 7.6",
    SMALL: "F figure 7.7; no level is printed: that of figure 7.10a",
    LARGE: "F figure 7.8; no level is printed: that of figure 7.10a",
    SUBTRACTED: "F figures 7.10a, 7.11a",
    ENHANCED: "F figures 7.10b, 7.11b",
    BY_MEAN: "F 8.1.1; the level is chosen: that of figure 7.10a",
    BY_MEDIAN: "F 8.1.1 proposes it; the level is chosen: that of figure 7.10a",
}


def settings_table() -> pd.DataFrame:
    """F's settings, and where they are printed."""
    rows = []
    for name, one in METHODS.items():
        adaptive = one.threshold == "adaptive"
        rows.append(
            {
                "method": NAMES[name],
                "background": {"none": "as it is"}.get(one.background, one.background),
                "block": f"{one.block_px} px" if adaptive else "",
                "level": f"{one.level:g}",
                "read": READ_AS[one.level_is] if adaptive else "above the level",
                "source": SOURCES[name],
            }
        )
    return pd.DataFrame(rows)


def chosen_table() -> pd.DataFrame:
    """What was chosen for the scenes and the pictures, and why."""
    return pd.DataFrame(CHOSEN, columns=["what", "value", "reason"])
