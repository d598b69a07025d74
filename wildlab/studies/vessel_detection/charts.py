"""Figures of the detection of vessels: rates, one image step by step, and the sweeps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wildlab.detection.floating import find_edges, find_objects
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.evaluation.runs import share_interval
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, new_figure
from wildlab.studies.monte_carlo import pooled_share
from wildlab.studies.vessel_detection.trial import CUT, SHIP, WHOLE, Image

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)


def plot_rates(
    runs: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Detection rates over all images with their intervals; ``published`` by subject and name."""
    fig, ax = new_figure(5.6, 2.9)
    subjects = (SHIP, WHOLE, CUT)
    for row, subject in enumerate(subjects):
        found = pooled_share(runs, subject, "detection_rate")[0]
        ax.plot([100 * found.low, 100 * found.high], [row, row], color=BLUE, lw=2)
        ax.plot(100 * found.estimate, row, "o", color=BLUE, ms=8, label="here" if row == 0 else None)
        printed = published.get((subject, "detection_rate"))
        if printed is not None:
            label = "published" if row == 0 else None
            ax.plot(100 * printed, row, "D", mfc="none", mec=INK, ms=9, label=label)
    ax.set_yticks(range(len(subjects)), [names[one] for one in subjects])
    ax.set(xlabel="images in which all was found (%)", ylim=(len(subjects) - 0.5, -0.5))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return fig


def plot_steps(image: Image, thresholds: FloatingThresholds) -> Figure:
    """One image as the detector sees it: grey, gradient, steep pixels, and what was found."""
    steps = find_edges(image.counts, None, thresholds)
    found = find_objects(image.counts, thresholds=thresholds).detections
    fig, axes = new_figure(5.9, 5.2, rows=2, columns=2)
    panels = {
        "8 bits": steps.grey,
        "Gradient": steps.gradient,
        f"At {thresholds.gradient:g} and above": steps.steep,
        "Found": steps.grey,
    }
    for ax, (title, picture) in zip(axes.flat, panels.items(), strict=True):
        ax.imshow(picture, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        ax.set_title(title)
        ax.set(xticks=[], yticks=[])
        ax.grid(False)
    for left, top, width, height in found.box:
        outline = Rectangle((left - 4, top - 4), width + 8, height + 8, fill=False, ec=ORANGE, lw=1.6)
        axes.flat[3].add_patch(outline)
    axes.flat[3].plot(*found.uv.T, "+", color=ORANGE, ms=8, mew=1.6)
    rows, columns = image.counts.shape  # boxes and centres may reach beyond the image
    axes.flat[3].set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    return fig


def plot_sweep(sweep: pd.DataFrame, along: str, group: str, xlabel: str, ylabel: str, label: str) -> Figure:
    """Shares ``found`` of ``draws`` with their 95 % intervals, a line for each ``group``.

    ``label`` is what a group is called, with its value as ``{}``. A column ``scaled`` is dotted.
    """
    fig, ax = new_figure(5.6, 3.7)
    for colour, (value, own) in zip(_COLOURS, sweep.groupby(group, sort=False), strict=False):
        ax.plot(own[along], 100 * own["found"], "o-", color=colour, label=label.format(value))
        for at, found, draws in zip(own[along], own["found"], own["draws"], strict=True):
            share = share_interval(round(found * draws), int(draws))
            ax.plot([at, at], [100 * share.low, 100 * share.high], color=colour, alpha=0.35, lw=2)
        if "scaled" in own:
            ax.plot(own[along], 100 * own["scaled"], ":", color=colour)
    if "scaled" in sweep:
        ax.plot([], [], ":", color=INK, label="area scaled with height")
    ax.set(xlabel=xlabel, ylabel=ylabel, ylim=(-3, 103))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return fig


def plot_cut_shares(objects: pd.DataFrame) -> Figure:
    """The visible part of each object that the border cuts, found and missed."""
    fig, ax = new_figure(5.6, 2.6)
    cut = objects[objects["share"] < 1]
    for row, (found, colour) in enumerate(((True, BLUE), (False, VERMILLION))):
        share = 100 * cut[cut["found"].astype(bool) == found]["share"].to_numpy(float)
        aside = np.linspace(-0.25, 0.25, len(share)) if len(share) > 1 else np.zeros(len(share))
        ax.plot(share, row + aside, "o", color=colour, ms=5)
    ax.set_yticks([0, 1], ["found", "missed"])
    ax.set(xlabel="visible part of the outline (%)", ylim=(1.6, -0.6), xlim=(-2, 102))
    return fig
