"""Finding a tarpaulin by its colour, and the mean of many positions: H 4.4.2."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wildlab.detection.colour import Colour, coloured, find_coloured
from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, new_figure
from wildlab.reporting.published import bounds_of, spread_key
from wildlab.simulation.scene.coloured import ColourView
from wildlab.studies.page import Facts
from wildlab.studies.precision_drop import trial
from wildlab.studies.precision_drop.trial import COUNTS, MEAN, SINGLE
from wildlab.studies.protocol import Study, name_metrics


def plot_image(view: ColourView, thresholds: Colour) -> Figure:
    """A rendered image, what of it lies within the limits of colour, and what is accepted."""
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
    return fig


def plot_mean(runs: pd.DataFrame) -> Figure:
    """The error of the mean after so many detections, and what independent errors would give."""
    known = np.array([count for count in COUNTS if runs[MEAN, f"after_{count}"].notna().all()])
    columns = [runs[MEAN, f"after_{count}"] for count in known]
    middle = np.array([column.median() for column in columns])
    fig, ax = new_figure(5.6, 4.2)
    if len(runs) > 1:
        low, high = np.transpose([bounds_of(column) for column in columns])
        label = f"flights, {spread_key(len(runs))}"
        ax.fill_between(known, low, high, color=BLUE, alpha=0.18, lw=0, label=label)
    ax.plot(known, middle, "o-", color=BLUE, label="median flight")
    ax.plot(known, middle[0] / np.sqrt(known / known[0]), ":", color=INK, label="if errors were independent")
    single = float(runs[SINGLE, "median_error"].median())
    ax.axhline(single, color=GREY, lw=1, ls="--", label="a single one")
    ax.set(xscale="log", xlabel="detections in the mean", ylabel="error of the mean (m)", ylim=(0, None))
    ax.set_xticks(known, [str(one) for one in known])
    ax.minorticks_off()
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def answer(facts: Facts) -> list[str]:
    """Whether the mean of many positions is near enough, and whether it is nearer than a single one."""
    return [f"mean-{facts.outcome('within-a-few-metres')}", f"single-{facts.outcome('single-is-inaccurate')}"]


STUDY = Study(
    "precision-drop", trial.SUBJECTS, trial.trial, trial.check_claims, name_metrics(trial.RECORDED), answer
)
