"""Maps of what a plan covers, for the studies of rows and of gimbals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.coverage import Coverage
from wildlab.reporting.figures import GREEN, INK, ORANGE, VERMILLION, map_axes, new_figure

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
#: What the colours of `coverage_map` mean.
COLOURS_SAID = "Green is seen sharply at least once, orange only blurred; black are the fences, red the way."


def extent(land: Terrain) -> tuple[float, float, float, float]:
    """West, east, south and north edges of the nodes' cells, metres, as `imshow` wants them."""
    south, north, west, east = land.extent
    half = land.step / 2
    return west - half, east + half, south - half, north + half


def coverage_map(
    shown: Coverage, land: Terrain, fences: Sequence[Array], track: Array, title: str, *, wide: float = 5.8
) -> Figure:
    """Where a plan sees the ground sharply, and where only blurred; fences and the way: `COLOURS_SAID`."""
    fig, ax = new_figure(wide, 0.72 * wide)
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
    ax.set_title(title)
    ax.grid(False)
    map_axes(ax)
    return fig


def age_map(
    values: Array, inside: NDArray[np.bool_], land: Terrain, fences: Sequence[Array], title: str, label: str
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
    ax.set_title(title)
    ax.grid(False)
    map_axes(ax)
    return fig


def land_map(land: Terrain, fences: Sequence[Array], title: str) -> Figure:
    """Heights of the land, with the fences, north up."""
    fig, ax = new_figure(5.8, 4.0)
    image = ax.imshow(land.height, origin="lower", extent=extent(land), cmap="gist_earth", alpha=0.8)
    for fence in fences:
        closed = np.concatenate([fence, fence[:1]])
        ax.plot(closed[:, 1], closed[:, 0], color=INK, lw=1.2)
    fig.colorbar(image, ax=ax, location="bottom", label="height (m)", shrink=0.6, aspect=30)
    ax.set_title(title)
    ax.grid(False)
    map_axes(ax)
    return fig
