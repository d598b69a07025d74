"""Maps, chart and table of what plans cover, for the studies of rows and of gimbals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from wildlab.evaluation.intervals import mean_share_interval
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.messages.quantities import percent_between
from wildlab.planning.coverage import Coverage
from wildlab.reporting.charts.drawing import draw_way
from wildlab.reporting.charts.forms import Values, draw_fences, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, VERMILLION, map_axes, new_figure

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
    state = np.where(shown.seen, 1.0, np.where(shown.blurred > 0, 0.0, np.nan))
    fig, ax, _ = _nodes_map(
        state, land, fences, cmap=ListedColormap([ORANGE, GREEN]), vmin=0, vmax=1, alpha=0.55
    )
    draw_way(ax, track, VERMILLION, width=0.7)
    map_axes(ax)
    return fig


def age_map(
    values: Array, inside: NDArray[np.bool_], land: Terrain, fences: Sequence[Array], label: str
) -> Figure:
    """A number for each node of the enclosures, north up."""
    fig, ax, image = _nodes_map(np.where(inside, values, np.nan), land, fences, cmap="viridis")
    fig.colorbar(image, ax=ax, location="bottom", label=label, shrink=0.6, aspect=30)
    map_axes(ax)
    return fig


def _nodes_map(
    values: Array, land: Terrain, fences: Sequence[Array], **look: Any
) -> tuple[Figure, Axes, AxesImage]:
    """A value for each node (R, C) of a terrain in colour, with fences."""
    fig, ax = new_figure(5.8, 4.2)
    image = ax.imshow(values, origin="lower", extent=extent(land), interpolation="nearest", **look)
    draw_fences(ax, fences)
    return fig, ax, image


def shares_chart(runs: pd.DataFrame, names: Mapping[str, str], quantities: Mapping[str, str]) -> Figure:
    """Mean shares with their 95 % interval, a row for each subject and a colour for each quantity.

    Parameters
    ----------
    runs
        Columns (subject, name), a row for each flight.
    names, quantities
        Words for subjects and for at most two quantities, by name.
    """
    series = {}
    for (name, words), color in zip(quantities.items(), _COLOURS, strict=False):
        middle, *ends = 100 * np.array([mean_share_interval(runs[who, name]) for who in names]).T
        series[words] = Values(middle, ends, color)
    return rows_chart(
        list(names.values()), series, "share (%)", size=(5.8, 1.1 + 0.3 * len(names)), xlim=(-2, 102)
    )


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
