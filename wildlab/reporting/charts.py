"""Charts that more than one notebook draws: errors about the truth, their distribution, their order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.reporting.figures import BLUE, GREY, INK, VERMILLION, ellipse, end_label, map_axes, new_figure

Array = NDArray[np.float64]


def error_scatter(errors: ArrayLike, title: str, color: str = BLUE, reach: float | None = None) -> Figure:
    """Errors (N, 2) north-east about the truth, with the ellipse that holds 90 % of a normal distribution.

    ``reach`` is the half width of the map in metres, for figures that are to be compared.
    """
    e = _finite(errors)
    fig, ax = new_figure(4.6, 4.4)
    reach = reach or float(max(1.0, 1.15 * np.abs(e).max())) if len(e) else 1.0
    ax.plot(e[:, 1], e[:, 0], ".", color=color, alpha=0.55, ms=6, mec="none")
    if len(e) > 2:
        ellipse(ax, e.mean(axis=0)[::-1], np.cov(e[:, ::-1].T), color=color)
    ax.plot(0, 0, "+", color="black", ms=13, mew=2)
    ax.plot(*e.mean(axis=0)[::-1], "o", mfc="white", mec=color, ms=7, mew=1.6)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.annotate("truth", (0, 0), (8, -14), textcoords="offset points", fontsize=9, color=INK)
    ax.set_title(title)
    map_axes(ax, east="error, east (m)", north="error, north (m)")
    return fig


def error_shares(series: Mapping[str, tuple[ArrayLike, str]], title: str) -> Figure:
    """Share of points within a distance, one line for each series of errors (N, 2), with its colour."""
    fig, ax = new_figure(4.6, 4.4)
    right = 0.0
    ax.axhline(90, color=GREY, lw=0.8, ls=(0, (3, 3)))
    ends = []
    for label, (errors, color) in series.items():
        distance = np.sort(np.hypot(*_finite(errors).T))
        share = 100 * np.arange(1, len(distance) + 1) / len(distance)
        ax.step(distance, share, where="post", color=color)
        right = max(right, float(distance[-1]))
        ends.append((float(np.quantile(distance, 0.5)), label, color))
    # Names stand beside their own line at different heights, so that lines close together keep theirs apart.
    for place, (_, label, color) in enumerate(sorted(ends)):
        level = 62 - 24 * place
        errors = series[label][0]
        x = float(np.quantile(np.hypot(*_finite(errors).T), level / 100))
        end_label(ax, x, level, label, color)
    ax.set_xlim(0, right * 1.02)
    ax.set_ylim(0, 102)
    ax.set_xlabel("distance from the truth (m)")
    ax.set_ylabel("points within that distance (%)")
    ax.set_title(title)
    return fig


def errors_by_image(judged: pd.DataFrame, title: str, color: str = BLUE) -> Figure:
    """Distance of every point from the truth by image in order of time, with each image's mean."""
    order = judged.groupby("frame_id", sort=False)["time_s"].first().sort_values(kind="stable").index
    place = judged["frame_id"].map({name: i for i, name in enumerate(order)})
    mean = judged.groupby(place)["error_m"].mean()
    fig, ax = new_figure(5.9, 3.0)
    ax.plot(place, judged["error_m"], ".", color=color, alpha=0.55, ms=6, mec="none")
    ax.plot(mean.index, mean, color=VERMILLION, lw=1.3)
    end_label(ax, mean.index[-1], float(mean.iloc[-1]), "mean per\nimage", VERMILLION)
    ax.set_ylim(0, None)
    ax.set_xlabel("image, in order")
    ax.set_ylabel("error (m)")
    ax.set_title(title)
    return fig


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return e[np.isfinite(e).all(axis=1)]
