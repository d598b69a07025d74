"""Charts of the study of the precision drop: an image step by step, and the mean as detections come."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wildlab.detection.colour import Colour, coloured, find_coloured
from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, new_figure
from wildlab.reporting.spread import bounds_of, spread_words
from wildlab.simulation.scene.coloured import ColourView
from wildlab.studies.precision_drop.trial import COUNTS, MEAN, SINGLE

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]


def image_shown(view: ColourView, thresholds: Colour, name: str, what: str, counterpart: str) -> Shown:
    """A rendered image, and what of it lies within the limits of colour."""
    found = find_coloured(view.image, np.ones(view.labels.shape, bool), thresholds)
    hsv = np.asarray(cv2.cvtColor(view.image, cv2.COLOR_RGB2HSV), np.uint8)
    fig, axes = new_figure(5.8, 2.3, columns=2)
    axes[0].imshow(view.image, interpolation="nearest")
    axes[1].imshow(coloured(hsv, thresholds), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    height, width = view.labels.shape
    across, down = thresholds.border_px
    for ax, title in zip(axes, ("Image", "Within the limits"), strict=True):
        inner = (width - 1 - 2 * across, height - 1 - 2 * down)
        frame = Rectangle((across, down), *inner, fill=False, ec=ORANGE, lw=1, ls="--")
        ax.add_patch(frame)
        ax.set(xticks=[], yticks=[], title=title, xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
        ax.grid(False)
    axes[0].plot(*found.uv.T, "o", mfc="none", mec="white", ms=20, mew=1.6)
    said = f"{'one region is' if len(found) else 'nothing is'} accepted"
    return (
        fig, name,
        f"A rendered colour image, {what}, and beside it in white what of it lies within the limits of hue, "
        f"saturation and value; {said}.",
        f"A rendered image, {what}: {said}. Dashed: a centre outside of this is not accepted. {counterpart}",
    )  # fmt: skip


def mean_shown(spread: pd.DataFrame) -> Shown:
    """The error of the mean after so many detections, beside what independent ones would give."""
    known = np.array([count for count in COUNTS if spread[MEAN, f"after_{count}"].notna().all()])
    columns = [spread[MEAN, f"after_{count}"] for count in known]
    middle = np.array([column.median() for column in columns])
    fig, ax = new_figure(5.6, 3.4)
    if len(spread) > 1:
        low, high = np.transpose([bounds_of(column) for column in columns])
        ax.fill_between(
            known, low, high, color=BLUE, alpha=0.18, lw=0, label=f"flights, {spread_words(len(spread)).key}"
        )
    ax.plot(known, middle, "o-", color=BLUE, label="median flight")
    ax.plot(known, middle[0] / np.sqrt(known / known[0]), ":", color=INK, label="if errors were independent")
    ax.axhline(
        float(spread[SINGLE, "median_error"].median()), color=GREY, lw=1, ls="--", label="a single one"
    )
    ax.set(xscale="log", xlabel="detections in the mean", ylabel="error of the mean (m)", ylim=(0, None))
    ax.set_xticks(known, [str(one) for one in known])
    ax.minorticks_off()
    ax.set_title(f"The mean of {known[-1]} is {middle[-1]:.1f} m off on the median flight")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return (
        fig, "mean",
        f"Error of the mean position against the number of detections: {middle[0]:.1f} m after {known[0]}, "
        f"{middle[-1]:.1f} m after {known[-1]} on the median flight.",
        "Detections in a row, wherever they begin. H gathers about 75 before each drop.",
    )  # fmt: skip
