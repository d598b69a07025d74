"""Charts of the study of the line of sight."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import mean_interval
from wildlab.evaluation.shares import paired_difference
from wildlab.geometry.frames import Array
from wildlab.geometry.line_of_sight import cast_rays, compare_angles
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.visibility import lines_clear
from wildlab.reporting.figures import BLUE, GREEN, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.spread import bounds_of, spread_words
from wildlab.reporting.text import percent
from wildlab.studies.line_of_sight.claims import at_heights, disagreement, hidden
from wildlab.studies.line_of_sight.text import NAMES, time_ratios
from wildlab.studies.line_of_sight.timing import WAYS, seconds
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    EXACT,
    HEIGHTS,
    INCIDENCES,
    RAYS,
    STEP,
    TILT,
    TOLERANCE,
    TREES,
    WHOLE_RAYS,
    TerrainView,
)

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
_COLOURS = {RAYS: BLUE, WHOLE_RAYS: GREEN, ANGLES: VERMILLION, EXACT: INK}
_SHORT = {RAYS: "rays", WHOLE_RAYS: "rays from the camera", ANGLES: "Bresenham", EXACT: "exact"}


def _band(ax: Axes, x: ArrayLike, values: Array, colour: str, label: str, most: float = np.inf) -> Array:
    """Mean over lands and its 95 % interval; (n,) the means."""
    mean = np.nanmean(values, axis=0)
    if len(values) > 1:
        ends = np.clip([mean_interval(column)[1:] for column in values.T], 0.0, most)
        ax.fill_between(np.asarray(x, float), ends[:, 0], ends[:, 1], color=colour, alpha=0.18, lw=0)
    ax.plot(x, mean, "o-", color=colour, label=label)
    return np.asarray(mean)


def _heights(ax: Axes) -> None:
    ax.set(xscale="log", xlabel="height above the ground (m)")
    ax.set_xticks(HEIGHTS, [str(height) for height in HEIGHTS])
    ax.minorticks_off()


def nearer_words(spread: pd.DataFrame) -> str:
    """Which way is nearer to the exact answer: by the interval of the paired difference over lands."""
    ahead = paired_difference(disagreement(spread, ANGLES), disagreement(spread, RAYS))
    if ahead is None or ahead.low <= 0 <= ahead.high:
        return f"{len(spread)} lands do not tell which way is nearer"
    better = NAMES[RAYS if ahead.low > 0 else ANGLES]
    return f"{better[0].upper()}{better[1:]} is nearer to the exact answer"


def agreement_shown(spread: pd.DataFrame) -> Shown:
    """Agreement with the exact line of sight over height."""
    fig, ax = new_figure(5.6, 3.4)
    found = {}
    for way in (RAYS, ANGLES):
        values = 100 * at_heights(spread, way, "agreement")
        found[way] = _band(ax, HEIGHTS, values, _COLOURS[way], _SHORT[way], 100.0)
    _heights(ax)
    ax.set_ylabel("points answered as exactly (%)")
    ax.set_title(nearer_words(spread))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    ends = "; ".join(f"{_SHORT[way]} {each.min():.0f} to {each.max():.0f} %" for way, each in found.items())
    return (
        fig, "agreement", f"Agreement with the exact line of sight at heights of {HEIGHTS[0]} to "
                          f"{HEIGHTS[-1]} m: {ends}.",
        f"The lens {TILT} degrees from straight down; means over lands with their 95 % interval.",
    )  # fmt: skip


def times_shown(times: pd.DataFrame) -> Shown:
    """Time a grid point over height: the counterpart of F figure 7.1."""
    fig, ax = new_figure(5.6, 3.6)
    for way in WAYS:
        values = 1e6 * seconds(times, way)
        low, high = np.transpose([bounds_of(pd.Series(column)) for column in values.T])
        ax.fill_between(HEIGHTS, low, high, color=_COLOURS[way], alpha=0.15, lw=0)
        ax.plot(HEIGHTS, np.nanmedian(values, axis=0), "o-", color=_COLOURS[way], label=_SHORT[way])
    _heights(ax)
    ax.set(yscale="log", ylabel="time a grid point (µs)")
    ratio, band = float(time_ratios(times, RAYS)[-1]), spread_words(len(times)).key
    ax.set_title(f"From {HEIGHTS[-1]} m rays take {ratio:.2g} times Bresenham's time")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    said = "; ".join(
        f"{_SHORT[way]} {1e6 * times[way, HEIGHTS[0]].median():.2g} and "
        f"{1e6 * times[way, HEIGHTS[-1]].median():.2g}"
        for way in WAYS
    )
    return (
        fig, "times", f"Microseconds a grid point at {HEIGHTS[0]} m and at {HEIGHTS[-1]} m: {said}.",
        f"On this machine, compiled; median land{f', and band: {band}' if band else ''}. Counterpart of F "
        "figure 7.1.",
    )  # fmt: skip


def steps_shown(spread: pd.DataFrame) -> Shown:
    """Steps a grid point over height."""
    fig, ax = new_figure(5.6, 3.4)
    found = {}
    for way in (RAYS, WHOLE_RAYS, ANGLES):
        values = at_heights(spread, way, "steps")
        found[way] = _band(ax, HEIGHTS, values, _COLOURS[way], _SHORT[way])
    _heights(ax)
    ax.set(yscale="log", ylabel="steps, or grid points asked")
    most = max(found, key=lambda way: float(found[way][-1]))
    ax.set_title(f"From {HEIGHTS[-1]} m on average {found[most][-1]:.0f} steps a point")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    said = "; ".join(f"{_SHORT[way]} {each[0]:.0f} and {each[-1]:.0f}" for way, each in found.items())
    return (
        fig, "steps", f"Steps a grid point at {HEIGHTS[0]} m and at {HEIGHTS[-1]} m: {said}.",
        "Counted: the same on every machine. Means over lands with their 95 % interval.",
    )  # fmt: skip


def trees_shown(spread: pd.DataFrame) -> Shown:
    """Share hidden by trees over incidence."""
    fig, ax = new_figure(5.6, 3.2)
    mean = _band(ax, INCIDENCES, 100 * hidden(spread), GREEN, "hidden by trees")
    ax.set(xlabel="incidence, from straight down (deg)", ylabel="ground hidden by trees (%)", ylim=(0, None))
    ax.set_xticks(INCIDENCES)
    ax.set_title(f"Trees hide {mean[0]:.0f} % from above and {mean[-1]:.0f} % at {INCIDENCES[-1]} degrees")
    return (
        fig, "trees", f"Share of the ground hidden by trees: {mean[0]:.0f} % straight down, "
                      f"{mean[-1]:.0f} % at {INCIDENCES[-1]} degrees.",
        f"Of what is seen without trees; they are planted on {percent(spread[TREES, 'planted'].mean())} of "
        f"the grid points, and the surface over them covers {percent(spread[TREES, 'covered'].mean())} of "
        "the ground. Mean over lands with its 95 % interval.",
    )  # fmt: skip


def map_shown(land: Terrain, view: TerrainView) -> Shown:
    """One view on the map: what is seen, and where both ways of F say something else."""
    exact = lines_clear(land, view.points, view.p_nc)
    ways = {
        RAYS: cast_rays(land, view.nodes, view.p_nc, STEP, TOLERANCE).clear,
        ANGLES: compare_angles(land, view.nodes, view.p_nc).clear,
    }
    fig, axes = new_figure(5.8, 3.9, columns=2, sharey=True)
    north, east = view.points[:, 0], view.points[:, 1]
    about = np.vstack([view.points, view.p_nc])
    low, high = about.min(axis=0) - 10, about.max(axis=0) + 10
    rows, columns = land.height.shape
    south, most, west, furthest = land.extent
    said = []
    for ax, (way, clear) in zip(axes, ways.items(), strict=True):
        ax.contour(
            np.linspace(west, furthest, columns), np.linspace(south, most, rows), land.height,
            levels=np.arange(0, 60, 5), colors=GREY, linewidths=0.5,
        )  # fmt: skip
        for which, colour in ((~exact & ~clear, INK), (clear & ~exact, ORANGE), (exact & ~clear, VERMILLION)):
            ax.plot(east[which], north[which], ".", ms=2.2, color=colour)
        ax.plot(view.p_nc[1], view.p_nc[0], "^", color=BLUE, ms=7)
        wrong = float((clear != exact).mean())
        ax.set_title(f"{_SHORT[way][0].upper()}{_SHORT[way][1:]}: {percent(wrong)} wrong", fontsize=10)
        ax.set(xlim=(low[1], high[1]), ylim=(low[0], high[0]))
        said.append(f"{_SHORT[way]} {percent(wrong)}")
    map_axes(axes[0])
    map_axes(axes[1], north="")
    marks = {"hidden": INK, "seen by it alone": ORANGE, "missed by it": VERMILLION, "camera": BLUE}
    handles = [
        Line2D([], [], marker="o", ls="", color=colour, label=label) for label, colour in marks.items()
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=4)
    return (
        fig, "map", f"Map of one view. Points answered otherwise than exactly: {', '.join(said)}.",
        f"{len(exact)} grid points in view, of which {percent(float(exact.mean()))} are seen (left "
        f"blank). Contours every 5 m.",
    )  # fmt: skip
