"""Charts of the study of animals: the same image through each method, and rates by sun and height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from wildlab.detection.warm import Warm
from wildlab.evaluation.runs import Interval
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, new_figure
from wildlab.reporting.text import percent
from wildlab.studies.wildlife_detection import text as words
from wildlab.studies.wildlife_detection import trial
from wildlab.studies.wildlife_detection.claims import false_alarms, places, rates_of
from wildlab.studies.wildlife_detection.level_text import level_words
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    BY_SIZE,
    CONSTANT,
    ENHANCED,
    LARGE,
    METHODS,
    NOON,
    OVER_MEAN,
    SMALL,
    SUBTRACTED,
    VIEWS,
    WEATHERS,
    DetectionScore,
    Picture,
    find,
    judge,
)

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
_COLOURS = {CONSTANT: BLUE, OVER_MEAN: VERMILLION, SUBTRACTED: GREEN, ENHANCED: PURPLE, BY_SIZE: ORANGE}
_SHORT = {
    CONSTANT: "constant 150",
    ADAPTIVE: "adaptive 451, 150",
    OVER_MEAN: "adaptive 451, mean + 150",
    SMALL: "adaptive 51",
    LARGE: "adaptive 251",
    SUBTRACTED: "subtracted, 251, 65",
    ENHANCED: "enhanced, 251, 160",
    BY_SIZE: "subtracted, sized",
}


def above(picture: Picture, thresholds: Warm) -> NDArray[np.uint8]:
    """The image after threshold: white where it is above (F figures 7.5 to 7.11)."""
    return np.where(trial.above(picture, thresholds), np.uint8(255), np.uint8(0))


def _panel(ax: Axes, image: NDArray[Any], title: str) -> None:
    ax.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    ax.set_title(title, fontsize=10)
    ax.set(xticks=[], yticks=[])
    ax.grid(False)


def _boxes(ax: Axes, picture: Picture, thresholds: Warm, frame: bool = True) -> DetectionScore:
    found = find(picture, thresholds)
    judged = judge(picture, found)
    right = {row for rows in judged.rows.values() for row in rows[:1]}
    rows, columns = picture.counts.shape
    for row, (left, top, width, height) in enumerate(found.box):
        colour = SKY if row in right else VERMILLION
        ax.add_patch(Rectangle((left - 3, top - 3), width + 6, height + 6, fill=False, ec=colour, lw=1.3))
    if frame:
        ax.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    return judged


def _said(judged: DetectionScore) -> str:
    found, invented, missed = judged.counts
    return f"{found:.0f} of {found + missed:.0f} found, {invented:.0f} false"


def methods_shown(picture: Picture, name: str, when: str) -> Shown:
    """One image through each method side by side, as in F figures 7.5 to 7.11."""
    methods = (CONSTANT, OVER_MEAN, LARGE, SUBTRACTED, ENHANCED)
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    _panel(axes.flat[0], picture.grey, f"{when}, 8 bits")
    said = {}
    for ax, method in zip(axes.flat[1:], methods, strict=True):
        _panel(ax, above(picture, METHODS[method]), "")
        said[method] = _said(_boxes(ax, picture, METHODS[method]))
        ax.set_title(f"{_SHORT[method]}\n{said[method]}", fontsize=10)
    every = "; ".join(f"{_SHORT[method]}: {one}" for method, one in said.items())
    return (
        fig, name, f"The same rendered image, {when}, through five methods. {every}.",
        f"{when[0].upper()}{when[1:]}. White: above the threshold. Boxes: detections, blue of animals, red "
        "of something else. Counterpart of F figures 7.5 to 7.11.",
    )  # fmt: skip


def sequence_shown(before: Picture, after: Picture) -> Shown:
    """A sequence over which the background changes: constant and adaptive threshold (F figures 7.5, 7.6)."""
    fig, axes = new_figure(5.6, 8.1, rows=4, columns=2)
    said = []
    for column, (when, picture) in enumerate((("under clouds", before), ("sun out", after))):
        _panel(axes[0, column], picture.grey, f"{when}, 8 bits")
        for row, method in enumerate((CONSTANT, ADAPTIVE, OVER_MEAN), start=1):
            ax = axes[row, column]
            _panel(ax, above(picture, METHODS[method]), "")
            one = _said(_boxes(ax, picture, METHODS[method]))
            ax.set_title(f"{_SHORT[method]}\n{one}", fontsize=10)
            said.append(f"{_SHORT[method]}, {when}: {one}")
    return (
        fig, "sequence", f"The same place under clouds and with the sun out. {'; '.join(said)}.",
        "The window of grey levels was set under clouds and stays. Counterpart of F figures 7.5 and 7.6.",
    )  # fmt: skip


def blocks_shown(picture: Picture, kind: Literal["floor", "offset"], level: float) -> Shown:
    """The largest animal with the small and the large block (F figures 7.7, 7.8)."""
    number = max(picture.animals, key=lambda one: picture.animals[one])
    v, u = np.nonzero(picture.view.labels == number)
    fig, axes = new_figure(5.6, 2.9, rows=1, columns=2)
    said = []
    for ax, method in zip(axes.flat, (SMALL, LARGE), strict=True):
        thresholds = replace(METHODS[method], level=level, level_is=kind)
        _panel(ax, above(picture, thresholds), "")
        judged = _boxes(ax, picture, thresholds, frame=False)
        count = len(judged.rows[number])
        one = f"{count} detection{'s' * (count != 1)} of it"
        ax.set_title(f"{_SHORT[method]}: {one}", fontsize=10)
        middle, half = np.array([np.mean(u), np.mean(v)]), 0.9 * max(float(np.ptp(u)), float(np.ptp(v)), 40.0)
        ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] + half, middle[1] - half))
        said.append(f"{_SHORT[method]}: {one}")
    return (
        fig, f"blocks-{kind}-{level:g}",
        f"One animal after an adaptive threshold, {level_words(kind, level)}. {'; '.join(said)}.",
        f"White: {level_words(kind, level)}; F prints no level for these. Counterpart of F figures 7.7 "
        "and 7.8.",
    )  # fmt: skip


def by_weather_shown(spread: pd.DataFrame) -> list[Shown]:
    """Recall, and false alarms an image, by weather and method with their intervals."""
    methods = (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_SIZE)
    shown: list[Shown] = []
    kinds: tuple[Literal["recall", "false"], ...] = ("recall", "false")
    for what in kinds:
        fig, ax = new_figure(5.6, 3.9)
        values: dict[str, list[float]] = {}
        for k, method in enumerate(methods):
            shift = 0.14 * (k - (len(methods) - 1) / 2)
            values[method] = []
            for row, weather in enumerate(WEATHERS):
                at = places([weather])
                one = (
                    rates_of(spread, method, at).recall
                    if what == "recall"
                    else false_alarms(spread, method, at)
                )
                scale = 100 if what == "recall" else 1
                ax.plot(
                    [scale * max(one.low, 0), scale * one.high],
                    [row + shift] * 2,
                    color=_COLOURS[method],
                    lw=2,
                )
                label = _SHORT[method] if row == 0 else None
                ax.plot(scale * one.estimate, row + shift, "o", color=_COLOURS[method], label=label)
                values[method].append(one.estimate)
        ax.set_yticks(range(len(WEATHERS)), [words.WHEN[one] for one in WEATHERS])
        ax.set_ylim(len(WEATHERS) - 0.5, -0.5)
        if what == "recall":
            ax.set(xlabel="animals found (%)", xlim=(-2, 102))
            of = "Share of animals found"
        else:
            ax.set(xlabel="false alarms an image")
            ax.set_xlim(left=-0.02 * max(float(np.nanmax([*values.values()])), 1.0))
            of = "False alarms an image"
        ax.set_title(words.worst_words(spread, methods, what))
        fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
        said = "; ".join(
            f"{_SHORT[m]} " + ", ".join(percent(v, 0) if what == "recall" else f"{v:.1f}" for v in values[m])
            for m in methods
        )
        shown.append(
            (
                fig, f"weather-{what}",
                f"{of} by weather ({', '.join(words.WHEN[one] for one in WEATHERS)}): {said}.",
                "Bars: 95 % interval over images of all heights.",
            )
        )  # fmt: skip
    return shown


def heights_shown(
    spread: pd.DataFrame, methods: Sequence[str] = (CONSTANT, SUBTRACTED, ENHANCED, BY_SIZE)
) -> Shown:
    """F1 by height without sun."""
    dark = [weather for weather in WEATHERS if weather != NOON]
    fig, ax = new_figure(5.6, 3.4)
    best: dict[int, tuple[str, Interval]] = {}
    for k, method in enumerate(methods):
        found = [rates_of(spread, method, places(dark, [height])).f1 for height in VIEWS]
        x = np.arange(len(VIEWS)) + 0.08 * (k - 1.5)
        ax.vlines(x, [one.low for one in found], [one.high for one in found], color=_COLOURS[method], lw=2)
        ax.plot(x, [one.estimate for one in found], "o-", color=_COLOURS[method], label=_SHORT[method])
        for height, one in zip(VIEWS, found, strict=True):
            if height not in best or one.estimate > best[height][1].estimate:
                best[height] = (method, one)
    ax.set_xticks(range(len(VIEWS)), [f"{height} m" for height in VIEWS])
    ax.set(ylabel="F1", ylim=(-0.02, 1.02), xlabel="height above the ground")
    lowest = min(best, key=lambda one: best[one][1].estimate)
    ax.set_title(f"From {lowest} m the best F1 is {words.ranged(best[lowest][1])}")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    said = ", ".join(f"{height} m {_SHORT[m]} {words.ranged(value)}" for height, (m, value) in best.items())
    return (
        fig, "heights", f"F1 by height without noon's sun; the best are: {said}.",
        "Night, morning and clouds together; bars are 95 % intervals over images.",
    )  # fmt: skip
