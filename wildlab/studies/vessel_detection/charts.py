"""Charts of the study of detection: rates beside the print, one image step by step, and the sweeps."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wildlab.analysis.rendered import judge
from wildlab.detection.floating import find_edges, find_objects
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.evaluation.runs import share_interval
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, new_figure
from wildlab.reporting.text import percent
from wildlab.studies.vessel_detection import text as words
from wildlab.studies.vessel_detection.trial import CUT, SHIP, WHOLE, Image

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)


def rates_shown(spread: pd.DataFrame, published: dict[str, float]) -> Shown:
    """Detection rates over all images with their intervals, beside the published ones (hollow)."""
    fig, ax = new_figure(5.6, 2.9)
    subjects = (SHIP, WHOLE, CUT)
    said = []
    for row, subject in enumerate(subjects):
        found = words.pooled(spread, subject)
        ax.plot([100 * found.low, 100 * found.high], [row, row], color=BLUE, lw=2)
        ax.plot(100 * found.estimate, row, "o", color=BLUE, ms=8, label="here" if row == 0 else None)
        if subject in published:
            label = "published" if row == 0 else None
            ax.plot(100 * published[subject], row, "D", mfc="none", mec=INK, ms=9, label=label)
        said.append(f"{words.NAMES[subject]} {percent(found.estimate)}")
    ax.set_yticks(range(len(subjects)), [words.NAMES[one] for one in subjects])
    ax.set(xlabel="images in which all was found (%)", ylim=(len(subjects) - 0.5, -0.5))
    ax.set_title(f"Found in {said[0].split(' ', 1)[1]} of the images of the ship")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return (
        fig, "rates", f"Share of images in which all was found: {', '.join(said)}.",
        "Bars: 95 % interval, all images of all flights together. Hollow: H 4.4.1.",
    )  # fmt: skip


def steps_shown(image: Image, thresholds: FloatingThresholds) -> Shown:
    """One image as the detector sees it: grey, gradient, steep pixels, and what was found."""
    steps, objects = (
        find_edges(image.counts, None, thresholds),
        find_objects(image.counts, thresholds=thresholds),
    )
    fig, axes = new_figure(5.9, 5.2, rows=2, columns=2)
    panels = (
        ("8 bits", steps.grey, 255), ("Gradient", steps.gradient, 255),
        (f"At {thresholds.gradient:g} and above", steps.steep, 255), ("Found", steps.grey, 255),
    )  # fmt: skip
    for ax, (title, picture, top) in zip(axes.flat, panels, strict=True):
        ax.imshow(picture, cmap="gray", vmin=0, vmax=top, interpolation="nearest")
        ax.set_title(title)
        ax.set(xticks=[], yticks=[])
        ax.grid(False)
    for left, top, width, height in objects.detections.box:
        outline = Rectangle((left - 4, top - 4), width + 8, height + 8, fill=False, ec=ORANGE, lw=1.6)
        axes.flat[3].add_patch(outline)
    axes.flat[3].plot(*objects.detections.uv.T, "+", color=ORANGE, ms=8, mew=1.6)
    rows, columns = image.counts.shape  # boxes and centres may reach beyond the image
    axes.flat[3].set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    judged = judge(image.view, objects)
    found = sum(bool(rows) for rows in judged.found.values())
    vessels = f"{found} of {len(image.view.seen)} vessel{'s' * (len(image.view.seen) != 1)} found"
    pieces = sum(len(rows) for rows in judged.found.values())
    vessels += f" in {pieces} pieces" if pieces > found else ""
    false = f"{judged.false} false alarm{'s' * (judged.false != 1)}"
    name = f"steps-{image.subject}"
    return (
        fig, name,
        f"A rendered thermal image of the sea in four steps: grey levels, gradient, steep pixels, and boxes: "
        f"{vessels}, {false}.",
        f"A rendered image ({words.NAMES[image.subject]}), step by step: {vessels}, {false}. "
        "Counterpart of H figure 4.9.",
    )  # fmt: skip


def heights_shown(heights: pd.DataFrame) -> Shown:
    """Rate against height for small things, with the printed area and with the scaled one."""
    fig, ax = new_figure(5.6, 3.7)
    for colour, (kind, own) in zip(_COLOURS, heights.groupby("kind", sort=False), strict=False):
        ax.plot(own["height_m"], 100 * own["found"], "o-", color=colour, label=str(kind))
        _bars(ax, own, "height_m", colour)
        ax.plot(own["height_m"], 100 * own["scaled"], ":", color=colour)
    ax.plot([], [], ":", color=INK, label="area scaled with height")
    ax.set(xlabel="height (m)", ylabel="found (%)", ylim=(-3, 103))
    longest = max(heights["kind"].unique(), key=lambda kind: words.reach(heights, kind))
    top = words.reach(heights, longest)
    ax.set_title(f"Found up to {top:.0f} m: a {longest}" if top else "None of them is found from any height")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return (
        fig, "heights", f"Share found against height: {words.reach_words(heights)}.",
        f"Bars: 95 % intervals. Straight down or nearly so, seas of many winds. "
        f"{words.scaled_words(heights)}",
    )  # fmt: skip


def _bars(ax: Axes, own: pd.DataFrame, along: str, colour: str) -> None:
    """95 % intervals of the shares ``found``."""
    for at, found, draws in zip(own[along], own["found"], own["draws"], strict=True):
        share = share_interval(round(found * draws), int(draws))
        ax.plot([at, at], [100 * share.low, 100 * share.high], color=colour, alpha=0.35, lw=2)


def contrast_shown(contrast: pd.DataFrame, height: float) -> Shown:
    """Rate against contrast for vessels of several lengths."""
    fig, ax = new_figure(5.6, 3.7)
    for colour, (length, own) in zip(_COLOURS, contrast.groupby("length_m"), strict=False):
        ax.plot(own["excess_k"], 100 * own["found"], "o-", color=colour, label=f"{length:g} m long")
        _bars(ax, own, "excess_k", colour)
    ax.set(xlabel="deck warmer than the sea by (K)", ylabel="found (%)", ylim=(-3, 103))
    halves = contrast[contrast["found"] >= 0.5].groupby("length_m")["excess_k"].min()
    title = (
        f"Every second {halves.idxmin():g} m vessel is found from {halves.min():g} K on"
        if len(halves)
        else "No length is found every second time"
    )
    ax.set_title(title)
    fig.legend(
        *ax.get_legend_handles_labels(), loc="outside lower right", ncols=len(contrast["length_m"].unique())
    )
    said = words.contrast_words(contrast)
    return fig, "contrast", said, f"Bars: 95 % intervals. From {height:.0f} m, without hot engines. {said}"


def weather_shown(weather: pd.DataFrame) -> Shown:
    """False alarms on an empty sea against the wind, with and without glint."""
    fig, ax = new_figure(5.6, 3.0)
    for colour, (_, own) in zip(_COLOURS, weather.groupby("glint"), strict=False):
        glint = float(own["glint"].iloc[0])
        label = f"glint of {glint:g} K" if glint else "no sun"
        own = own.assign(found=own["alarmed"] / own["draws"])
        ax.plot(own["wind"], 100 * own["found"], "o-", color=colour, label=label)
        _bars(ax, own, "wind", colour)
    ax.set(xlabel="wind (m/s)", ylabel="images with a false alarm (%)", ylim=(-3, 103))
    calm = float(weather["false"].max()) == 0
    ax.set_title(
        f"No false alarm in {int(weather['draws'].sum())} images of an empty sea"
        if calm
        else f"Up to {weather['false'].max():.2g} false alarms an image"
    )
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    said = words.weather_words(weather)
    return (
        fig,
        "weather",
        said,
        f"Bars: 95 % intervals. From 100 m, the camera halfway to the horizon. {said}",
    )


def seen_shares(objects: pd.DataFrame) -> Shown:
    """Of cut objects, what showed and whether it was found."""
    fig, ax = new_figure(5.6, 2.6)
    cut = objects[objects["share"] < 1]
    for row, (found, label, colour) in enumerate(((True, "found", BLUE), (False, "missed", VERMILLION))):
        share = 100 * cut[cut["found"].astype(bool) == found]["share"].to_numpy(float)
        aside = np.linspace(-0.25, 0.25, len(share)) if len(share) > 1 else np.zeros(len(share))
        ax.plot(share, row + aside, "o", color=colour, ms=5, label=label)
    ax.set_yticks([0, 1], ["found", "missed"])
    ax.set(xlabel="visible part of the outline (%)", ylim=(1.6, -0.6), xlim=(-2, 102))
    missed = cut[~cut["found"].astype(bool)]
    ax.set_title(
        f"Missed: {len(missed)} of {len(cut)} cut by the border"
        + (f", up to {100 * missed['share'].max():.0f} % visible" if len(missed) else "")
    )
    return (
        fig, "shares",
        f"Visible parts of vessels cut by the border; {len(missed)} of {len(cut)} were missed.",
        "Vessels that the border of the image cuts, on the flight of the figures.",
    )  # fmt: skip
