"""Figures of what wrong poses, flat maps and wrong heights cost."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from wildlab.evaluation.runs import mean_interval
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, VERMILLION, end_label, new_figure
from wildlab.studies.sensitivity.heights import Shift
from wildlab.studies.sensitivity.tables import (
    ATTITUDES_DEG,
    DISTANCES_M,
    IMAGE_CENTRE,
    KOLMARDEN,
    OFFSETS,
    errors_over_image,
    flat_map_errors,
)

_WRONG = {"plane": VERMILLION, "coarse": ORANGE, "level": BLUE}
#: Colours by latitude, degrees.
_LATITUDES = {0.0: GREEN, float(np.degrees(KOLMARDEN[0])): BLUE, 75.0: VERMILLION}


def offsets(errors: Mapping[str, float], printed: Mapping[tuple[str, str], float]) -> Figure:
    """Errors of each offset from 400 m by attitude, and the printed ones; by ``attitude/offset/height``."""
    fig, axes = new_figure(5.9, 4.4, columns=3, sharey=True)
    names = list(OFFSETS)[::-1]
    y = np.arange(len(names))
    for ax, attitude in zip(axes, ATTITUDES_DEG, strict=True):
        keys = [f"{attitude}/{name}/400m" for name in names]
        ax.barh(y, [errors[key] for key in keys], color=BLUE, height=0.6)
        ax.plot([printed[key, "horizontal_error"] for key in keys], y, "o", mfc="white", mec=INK, ms=6)
        ax.set_yticks(y, [name + (" 10 m" if any(OFFSETS[name][3:]) else " 3°") for name in names])
        ax.set(title=attitude, xlim=(0, 39), xlabel="error (m)")
        ax.grid(axis="y", visible=False)
    return fig


def over_image() -> Figure:
    """Contours of the error over the image, by attitude."""
    u, v, errors = errors_over_image()
    largest = max(float(one.max()) for one in errors.values())
    fig, axes = new_figure(5.9, 2.7, columns=3, sharey=True)
    for ax, (attitude, error) in zip(axes, errors.items(), strict=True):
        ax.contourf(u, v, error, levels=np.arange(25, largest + 5, 5), cmap="cividis", vmin=25, vmax=largest)
        lines = ax.contour(u, v, error, levels=[30, 40, 50], colors="white", linewidths=0.8)
        ax.clabel(lines, fmt="%d m", fontsize=10)
        ax.plot(*IMAGE_CENTRE, "+", color="white", ms=9)
        ax.set(title=attitude, xlabel="u (px)")
        ax.set_aspect("equal")
        ax.grid(visible=False)
    axes[0].set_ylabel("v (px)")
    axes[0].invert_yaxis()
    return fig


def flat_map() -> Figure:
    """Errors of a linear conversion of coordinates over the distance, at three latitudes."""
    fig, ax = new_figure(5.6, 3.3)
    for latitude, color in _LATITUDES.items():
        error = flat_map_errors(np.radians(latitude))
        ax.loglog(DISTANCES_M / 1000, error, color=color)
        end_label(ax, DISTANCES_M[-1] / 1000, error[-1], f"{latitude:.0f}° N", color)
    ax.set(xlabel="distance from the origin (km)", ylabel="largest error (m)")
    return fig


def wrong_heights(found: list[Shift], names: Mapping[str, str]) -> Figure:
    """Distance from the true point by pitch and by what is wrong; of a camera straight down it is nothing."""
    fig, ax = new_figure(5.6, 3.4)
    some = [one for one in found if one.pitch < 90]
    pitch = [one.pitch for one in some]
    for name, color in _WRONG.items():
        means = [mean_interval(one.off[name]) for one in some]
        low = [max(one.low, 1e-3) for one in means]
        ax.fill_between(pitch, low, [one.high for one in means], color=color, alpha=0.2, lw=0)
        ax.plot(pitch, [one.estimate for one in means], "o-", color=color, ms=4, label=names[name])
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.legend(loc="upper right")
    ax.set(xlabel="camera below the horizon (degrees)", ylabel="distance from the true point (m)")
    ax.set_xticks(pitch)
    return fig
