"""Maps, chart and table of what plans cover, for the studies of rows and of gimbals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.evaluation.runs import mean_share_interval
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.messages.quantities import percent_between
from wildlab.planning.coverage import Coverage
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, VERMILLION, map_axes, new_figure

#: Quantities of `means_table` that are no shares: hectares, minutes and seconds in their units.
_SCALES = {"ground": 1e-4, "outside": 1e-4, "time": 1 / 60, "in_sight": 1.0}
_COLOURS = (BLUE, ORANGE)


def extent(land: Terrain) -> tuple[float, float, float, float]:
    """West, east, south and north edges of the nodes' cells, metres, as `imshow` wants them."""
    south, north, west, east = land.extent
    half = land.step / 2
    return west - half, east + half, south - half, north + half


def coverage_map(shown: Coverage, land: Terrain, fences: Sequence[Array], track: Array) -> Figure:
    """Where a plan sees the ground sharply (green), and where only blurred (orange); fences and path."""
    fig, ax = new_figure(5.8, 4.2)
    state = np.full(shown.looks.shape, np.nan)
    state[(shown.blurred > 0) & ~shown.seen] = 0
    state[shown.seen] = 1
    colours = ListedColormap([ORANGE, GREEN])
    ax.imshow(
        state, origin="lower", extent=extent(land), cmap=colours, vmin=0, vmax=1, alpha=0.55,
        interpolation="nearest",
    )  # fmt: skip
    ax.plot(track[:, 1], track[:, 0], color=VERMILLION, lw=0.7)
    for fence in fences:
        closed = np.concatenate([fence, fence[:1]])
        ax.plot(closed[:, 1], closed[:, 0], color=INK, lw=1.4)
    ax.grid(False)
    map_axes(ax)
    return fig


def age_map(
    values: Array, inside: NDArray[np.bool_], land: Terrain, fences: Sequence[Array], label: str
) -> Figure:
    """A number for each node of the enclosures, north up."""
    fig, ax = new_figure(5.8, 4.0)
    image = ax.imshow(
        np.where(inside, values, np.nan), origin="lower", extent=extent(land), cmap="viridis",
        interpolation="nearest",
    )  # fmt: skip
    for fence in fences:
        closed = np.concatenate([fence, fence[:1]])
        ax.plot(closed[:, 1], closed[:, 0], color=INK, lw=1.2)
    fig.colorbar(image, ax=ax, location="bottom", label=label, shrink=0.6, aspect=30)
    ax.grid(False)
    map_axes(ax)
    return fig


def shares_chart(runs: pd.DataFrame, names: Mapping[str, str], quantities: Mapping[str, str]) -> Figure:
    """Mean shares with their 95 % interval, a row for each subject and a colour for each quantity.

    Parameters
    ----------
    runs
        Columns (subject, name), a row for each flight.
    names, quantities
        Words for subjects and for at most two quantities, by name.
    """
    fig, ax = new_figure(5.8, 1.1 + 0.3 * len(names))
    rows = np.arange(len(names))[::-1]
    for k, (name, words) in enumerate(quantities.items()):
        found = 100 * np.array([mean_share_interval(runs[who, name]) for who in names])
        ends = np.where(np.isnan(found), found[:, :1], found)
        at = rows + 0.12 * (len(quantities) - 1) * (1 - 2 * k)
        ax.hlines(at, ends[:, 1], ends[:, 2], color=_COLOURS[k], lw=2)
        ax.plot(ends[:, 0], at, "o", color=_COLOURS[k], label=words)
    ax.set_yticks(rows, list(names.values()))
    ax.set(xlabel="share (%)", xlim=(-2, 102), ylim=(-0.6, len(names) - 0.4))
    ax.grid(visible=False, axis="y")
    if len(quantities) > 1:
        fig.legend(loc="outside lower center", ncols=len(quantities))
    return fig


def means_table(runs: pd.DataFrame, names: Mapping[str, str], quantities: Sequence[str]) -> pd.DataFrame:
    """Means over flights, a row for each subject: shares with their 95 % interval, areas in hectares, times
    in minutes, times in sight in seconds."""
    rows = []
    for who, words in names.items():
        row: dict[str, object] = {"plan": words}
        for name in quantities:
            if name in _SCALES:
                row[name] = _SCALES[name] * float(runs[who, name].mean())
            else:
                row[name] = percent_between(mean_share_interval(runs[who, name]))
        rows.append(row)
    return pd.DataFrame(rows)
