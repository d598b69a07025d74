"""Finding a tarpaulin by its colour, and the mean of many positions: H 4.4.2."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wildlab.detection.colour import coloured, find_coloured
from wildlab.reporting.charts.forms import Values, draw_picture, lines_chart
from wildlab.reporting.figures import GREY, INK, ORANGE, new_figure
from wildlab.reporting.published import bounds_of, spread_key
from wildlab.simulation.scene.coloured import ColourView
from wildlab.studies.page import Facts
from wildlab.studies.precision_drop import trial
from wildlab.studies.precision_drop.trial import COUNTS, LIMITS, MEAN, SINGLE
from wildlab.studies.protocol import Study


def plot_image(view: ColourView) -> Figure:
    """A rendered image, what of it lies within the limits of colour, and what is accepted."""
    found = find_coloured(view.image, np.ones(view.labels.shape, bool), LIMITS)
    hsv = np.asarray(cv2.cvtColor(view.image, cv2.COLOR_RGB2HSV), np.uint8)
    fig, axes = new_figure(5.8, 2.3, columns=2)
    height, width = view.labels.shape
    across, down = LIMITS.border_px
    panels = {"Image": view.image, "Within the limits": coloured(hsv, LIMITS)}
    for ax, (title, picture) in zip(axes, panels.items(), strict=True):
        draw_picture(ax, picture, title, limits=(0, 1))
        inner = (width - 1 - 2 * across, height - 1 - 2 * down)
        ax.add_patch(Rectangle((across, down), *inner, fill=False, ec=ORANGE, lw=1, ls="--"))
    axes[0].plot(*found.uv.T, "o", mfc="none", mec="white", ms=20, mew=1.6)
    return fig


def plot_mean(runs: pd.DataFrame) -> Figure:
    """The error of the mean after so many detections, and what independent errors would give."""
    known = np.array([count for count in COUNTS if runs[MEAN, f"after_{count}"].notna().all()])
    columns = [runs[MEAN, f"after_{count}"] for count in known]
    middle = np.array([column.median() for column in columns])
    lines = {
        "median flight": Values(middle),
        "if errors were independent": Values(middle[0] / np.sqrt(known / known[0]), color=INK, look=":"),
        "a single one": Values(0 * middle + runs[SINGLE, "median_error"].median(), color=GREY, look="--"),
    }
    if len(runs) > 1:
        band = Values(None, np.transpose([bounds_of(column) for column in columns]))
        lines = {f"flights, {spread_key(len(runs))}": band} | lines
    x, y = "detections in the mean", "error of the mean (m)"
    return lines_chart(known, lines, x, y, size=(5.6, 4.2), xscale="log", ylim=(0, None))


def answer(facts: Facts) -> list[str]:
    """Whether the mean of many positions is near enough, and whether it is nearer than a single one."""
    return [f"mean-{facts.outcome('within-a-few-metres')}", f"single-{facts.outcome('single-is-inaccurate')}"]


STUDY = Study("precision-drop", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
