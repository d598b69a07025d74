"""Charts and tables of the study of animals: the same image through each method, rates by sun and height."""

from __future__ import annotations

from collections.abc import Mapping
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
from wildlab.studies.wildlife_detection import trial
from wildlab.studies.wildlife_detection.claims import false_alarms, places, rates_of
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    BY_SIZE,
    CONSTANT,
    ENHANCED,
    LARGE,
    METHODS,
    NOON,
    OVER_MEAN,
    PRINTED,
    PROPOSED,
    READ_AT,
    READINGS,
    SMALL,
    SUBTRACTED,
    VIEWS,
    WEATHERS,
    DetectionScore,
    Picture,
    find,
    judge,
    read_subject,
)

_COLOURS = {CONSTANT: BLUE, OVER_MEAN: VERMILLION, SUBTRACTED: GREEN, ENHANCED: PURPLE, BY_SIZE: ORANGE}


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


def image_by_method(picture: Picture, names: Mapping[str, str]) -> Figure:
    """One image through each method side by side, as in F figures 7.5 to 7.11."""
    methods = (CONSTANT, OVER_MEAN, LARGE, SUBTRACTED, ENHANCED)
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    _panel(axes.flat[0], picture.grey, "8 bits")
    for ax, method in zip(axes.flat[1:], methods, strict=True):
        _thresholded(ax, picture, method, names)
    return fig


def image_by_sun(before: Picture, after: Picture, names: Mapping[str, str]) -> Figure:
    """A sequence over which the background changes: constant and adaptive threshold (F figures 7.5, 7.6)."""
    fig, axes = new_figure(5.6, 8.1, rows=4, columns=2)
    for column, (when, picture) in enumerate((("under clouds", before), ("sun out", after))):
        _panel(axes[0, column], picture.grey, f"{when}, 8 bits")
        for row, method in enumerate((CONSTANT, ADAPTIVE, OVER_MEAN), start=1):
            _thresholded(axes[row, column], picture, method, names)
    return fig


def animal_by_block(picture: Picture, kind: Literal["floor", "offset"], level: float) -> Figure:
    """The largest animal with the small and the large block (F figures 7.7, 7.8)."""
    number = max(picture.animals, key=lambda one: picture.animals[one])
    v, u = np.nonzero(picture.view.labels == number)
    fig, axes = new_figure(5.6, 2.9, rows=1, columns=2)
    for ax, method in zip(axes.flat, (SMALL, LARGE), strict=True):
        thresholds = replace(METHODS[method], level=level, level_is=kind)
        _panel(ax, above(picture, thresholds), "")
        count = len(_boxes(ax, picture, thresholds, frame=False).rows[number])
        ax.set_title(f"block {thresholds.block_px} px: {count} detection{'s' * (count != 1)}")
        middle, half = np.array([np.mean(u), np.mean(v)]), 0.9 * max(float(np.ptp(u)), float(np.ptp(v)), 40.0)
        ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] + half, middle[1] - half))
    return fig


def rates_by_weather(
    runs: pd.DataFrame, what: Literal["recall", "false"], names: Mapping[str, str]
) -> Figure:
    """Recall, or false alarms per image, by weather and method with their intervals."""
    methods = (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_SIZE)
    fig, ax = new_figure(5.6, 3.9)
    most = 1.0
    for k, method in enumerate(methods):
        shift = 0.14 * (k - (len(methods) - 1) / 2)
        for row, weather in enumerate(WEATHERS):
            at = places([weather])
            if what == "recall":
                one, scale = rates_of(runs, method, at).recall, 100
            else:
                one, scale = false_alarms(runs, method, at), 1
            ends = [scale * max(one.low, 0), scale * one.high]
            ax.plot(ends, [row + shift] * 2, color=_COLOURS[method], lw=2)
            label = names[method] if row == 0 else None
            ax.plot(scale * one.estimate, row + shift, "o", color=_COLOURS[method], label=label)
            most = max(most, one.estimate)
    ax.set_yticks(range(len(WEATHERS)), [names[one] for one in WEATHERS])
    ax.set_ylim(len(WEATHERS) - 0.5, -0.5)
    if what == "recall":
        ax.set(xlabel="animals found (%)", xlim=(-2, 102))
    else:
        ax.set_xlabel("false alarms per image")
        ax.set_xlim(left=-0.02 * most)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def f1_by_height(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """F1 by height without sun."""
    dark = [weather for weather in WEATHERS if weather != NOON]
    fig, ax = new_figure(5.6, 3.4)
    for k, method in enumerate((CONSTANT, SUBTRACTED, ENHANCED, BY_SIZE)):
        found = [rates_of(runs, method, places(dark, [height])).f1 for height in VIEWS]
        x = np.arange(len(VIEWS)) + 0.08 * (k - 1.5)
        ax.vlines(x, [one.low for one in found], [one.high for one in found], color=_COLOURS[method], lw=2)
        ax.plot(x, [one.estimate for one in found], "o-", color=_COLOURS[method], label=names[method])
    ax.set_xticks(range(len(VIEWS)), [f"{height} m" for height in VIEWS])
    ax.set(ylabel="F1", ylim=(-0.02, 1.02), xlabel="height above the ground")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def tables(runs: pd.DataFrame, names: Mapping[str, str]) -> dict[str, pd.DataFrame]:
    """F1 of every method by weather, and of the printed settings by what their level may mean."""
    methods = [
        {"method": names[method]}
        | {weather: _ranged(rates_of(runs, method, places([weather])).f1) for weather in WEATHERS}
        for method in (*METHODS, *PROPOSED)
    ]
    heights = [str(height) for height in READ_AT]
    readings = [
        {"reading": names[reading]}
        | {one: _ranged(rates_of(runs, read_subject(one, reading), heights).f1) for one in PRINTED}
        | {
            when: _ranged(rates_of(runs, read_subject(ADAPTIVE, reading), [when]).f1)
            for when in ("before", "after")
        }
        for reading in READINGS
    ]
    return {"methods": pd.DataFrame(methods), "readings": pd.DataFrame(readings)}


def _thresholded(ax: Axes, picture: Picture, method: str, names: Mapping[str, str]) -> None:
    """The image after a method's threshold, with its detections."""
    _panel(ax, above(picture, METHODS[method]), "")
    found, invented, missed = _boxes(ax, picture, METHODS[method]).counts
    ax.set_title(
        f"{names[method]}\n{found:.0f} of {found + missed:.0f} found, {invented:.0f} false", fontsize=10
    )


def _ranged(one: Interval) -> str:
    if not np.isfinite(one.low):
        return f"{one.estimate:.2f}"
    return f"{one.estimate:.2f} ({max(one.low, 0):.2f} to {one.high:.2f})"
