"""Charts and tables of the study of the line of sight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import mean_interval, mean_share_interval
from wildlab.geometry.frames import Array
from wildlab.geometry.line_of_sight import cast_rays, compare_angles
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.visibility import lines_clear
from wildlab.reporting.figures import BLUE, GREEN, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.spread import bounds_of
from wildlab.reporting.text import number, percent, percent_between
from wildlab.studies.line_of_sight.claims import at_heights, hidden
from wildlab.studies.line_of_sight.timing import WAYS, seconds
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    EXACT,
    HEIGHTS,
    INCIDENCES,
    RAYS,
    STEP,
    TOLERANCE,
    WHOLE_RAYS,
    TerrainView,
    settings,
)

_COLOURS = {RAYS: BLUE, WHOLE_RAYS: GREEN, ANGLES: VERMILLION, EXACT: INK}


def agreement_over_height(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Agreement of both algorithms with the exact line of sight."""
    values = {way: 100 * at_heights(runs, way, "agreement") for way in (RAYS, ANGLES)}
    fig, ax = _over_height(values, names, 100.0)
    ax.set_ylabel("correct points (%)")
    return fig


def times_over_height(times: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Time per grid point: the counterpart of F figure 7.1."""
    fig, ax = new_figure(5.6, 3.6)
    for way in WAYS:
        values = 1e6 * seconds(times, way)
        low, high = np.transpose([bounds_of(pd.Series(column)) for column in values.T])
        ax.fill_between(HEIGHTS, low, high, color=_COLOURS[way], alpha=0.15, lw=0)
        ax.plot(HEIGHTS, np.nanmedian(values, axis=0), "o-", color=_COLOURS[way], label=names[way])
    _heights(ax)
    ax.set(yscale="log", ylabel="time per grid point (µs)")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def steps_over_height(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Steps per grid point."""
    values = {way: at_heights(runs, way, "steps") for way in (RAYS, WHOLE_RAYS, ANGLES)}
    fig, ax = _over_height(values, names)
    ax.set(yscale="log", ylabel="steps per grid point")
    return fig


def hidden_over_incidence(runs: pd.DataFrame) -> Figure:
    """Share of the ground that trees hide."""
    fig, ax = new_figure(5.6, 3.2)
    _band(ax, INCIDENCES, 100 * hidden(runs), GREEN, "")
    ax.set(xlabel="incidence, from straight down (°)", ylabel="ground hidden by trees (%)", ylim=(0, None))
    ax.set_xticks(INCIDENCES)
    return fig


def view_map(land: Terrain, view: TerrainView, names: Mapping[str, str]) -> Figure:
    """One view on the map: what is seen, and where each algorithm says something else."""
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
    for ax, (way, clear) in zip(axes, ways.items(), strict=True):
        ax.contour(
            np.linspace(west, furthest, columns), np.linspace(south, most, rows), land.height,
            levels=np.arange(0, 60, 5), colors=GREY, linewidths=0.5,
        )  # fmt: skip
        for which, colour in ((~exact & ~clear, INK), (clear & ~exact, ORANGE), (exact & ~clear, VERMILLION)):
            ax.plot(east[which], north[which], ".", ms=2.2, color=colour)
        ax.plot(view.p_nc[1], view.p_nc[0], "^", color=BLUE, ms=7)
        ax.set_title(f"{names[way]}: {percent(float((clear != exact).mean()))} wrong", fontsize=10)
        ax.set(xlim=(low[1], high[1]), ylim=(low[0], high[0]))
    map_axes(axes[0])
    map_axes(axes[1], north="")
    marks = {"hidden": INK, "wrongly visible": ORANGE, "wrongly hidden": VERMILLION, "camera": BLUE}
    handles = [
        Line2D([], [], marker="o", ls="", color=colour, label=label) for label, colour in marks.items()
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=4)
    return fig


def tables(runs: pd.DataFrame, times: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Shares of grid points by height and tilt, with the 95 % interval of their mean over terrains, and
    median times (µs)."""
    shares = []
    for name, height, tilt in settings():
        row = {"where": f"{height:.0f} m, {tilt:.0f}°", "seen": _share(runs[EXACT, f"seen_{name}"])}
        for way in (RAYS, ANGLES):
            row[way] = _share(runs[way, f"agreement_{name}"])
            wrong = [percent(float(runs[way, f"{what}_{name}"].mean())) for what in ("too_many", "too_few")]
            row[f"{way}-wrong"] = " / ".join(wrong)
        shares.append(row)
    taken = [
        {"height": f"{height} m"} | {way: number(1e6 * float(times[way, height].median()), 2) for way in WAYS}
        for height in HEIGHTS
    ]
    return {"agreement": pd.DataFrame(shares), "times": pd.DataFrame(taken)}


def _share(values: ArrayLike) -> str:
    return percent_between(mean_share_interval(values))


def _over_height(
    values: Mapping[str, Array], names: Mapping[str, str], most: float = np.inf
) -> tuple[Figure, Axes]:
    fig, ax = new_figure(5.6, 3.4)
    for way, each in values.items():
        _band(ax, HEIGHTS, each, _COLOURS[way], names[way], most)
    _heights(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig, ax


def _band(ax: Axes, x: Sequence[float], values: Array, colour: str, label: str, most: float = np.inf) -> None:
    """Mean over terrains and its 95 % interval."""
    if len(values) > 1:
        ends = np.clip([mean_interval(column)[1:] for column in values.T], 0.0, most)
        ax.fill_between(np.asarray(x, float), ends[:, 0], ends[:, 1], color=colour, alpha=0.18, lw=0)
    ax.plot(x, np.nanmean(values, axis=0), "o-", color=colour, label=label)


def _heights(ax: Axes) -> None:
    ax.set(xscale="log", xlabel="height above the ground (m)")
    ax.set_xticks(HEIGHTS, [str(height) for height in HEIGHTS])
    ax.minorticks_off()
