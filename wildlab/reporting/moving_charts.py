"""Charts of a target that moves: its path below the aircraft's, georeferenced positions, errors over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.reporting.figures import BLUE, GREY, ORANGE, colour, end_label, map_axes, new_figure

Array = NDArray[np.float64]
#: A pause in the observations longer than this (seconds) breaks a line.
PAUSE_S = 10.0


def aircraft_map(
    aircraft: ArrayLike, seeing: ArrayLike, target: ArrayLike, title: str, name: str = "vessel"
) -> Figure:
    """Paths of aircraft (N, 2) and target (M, 2), north and east, and from where it was seen (K, 2)."""
    path, seen, below = (np.asarray(a, float) for a in (aircraft, seeing, target))
    fig, ax = new_figure(5.2, 4.6)
    ax.plot(path[:, 1], path[:, 0], color=GREY, lw=0.5, alpha=0.7)
    ax.plot(seen[:, 1], seen[:, 0], ".", color=ORANGE, ms=2)
    ax.plot(below[:, 1], below[:, 0], color=colour("truth"), lw=2.2)
    ax.annotate(
        name,
        below[-1, ::-1],
        (6, 6),
        textcoords="offset points",
        fontsize=9.5,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
    )
    ax.set_title(title)
    map_axes(ax)
    return fig


def positions_map(
    points: ArrayLike,
    reference: ArrayLike,
    title: str,
    color: str,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
) -> Figure:
    """Georeferenced positions (N, 2) and the target's path (M, 2), north and east.

    ``bounds`` are the lowest and highest north and east of the map, for figures that are to be compared.
    """
    xy, path = np.asarray(points, float), np.asarray(reference, float)
    fig, ax = new_figure(4.6, 4.6)
    ax.plot(xy[:, 1], xy[:, 0], ".", color=color, ms=4, alpha=0.5, mec="none", zorder=3)
    ax.plot(path[:, 1], path[:, 0], color=colour("truth"), lw=1.1)
    if bounds is not None:
        low, high = (np.asarray(b, float) for b in bounds)
        ax.set_xlim(low[1], high[1])
        ax.set_ylim(low[0], high[0])
    ax.set_title(title)
    map_axes(ax)
    return fig


def errors_over_time(
    times: ArrayLike, measured: ArrayLike, estimated: ArrayLike, title: str, reach: float | None = None
) -> Figure:
    """Distances from the truth (T,) of single images and of the estimate, over minutes.

    ``reach`` is the top of the axis in metres, for figures that are to be compared.
    """
    t, raw, estimate = (np.array(a, float) for a in (times, measured, estimated))
    fig, ax = new_figure(5.9, 3.4)
    ax.plot(t / 60, raw, ".", color=GREY, ms=3, alpha=0.5, mec="none")
    breaks = np.flatnonzero(np.diff(t) > PAUSE_S) + 1
    line = np.insert(estimate, breaks, np.nan)
    ax.plot(np.insert(t, breaks, np.nan) / 60, line, color=BLUE, lw=1.8)
    end, middle = float(estimate[-1]), float(np.median(raw))
    top = reach if reach is not None else 1.05 * float(max(raw.max(), estimate.max()))
    near = abs(end - middle) < 0.12 * top
    end_label(ax, t[-1] / 60, end + (0.06 * top if near and end >= middle else 0), "filtered", BLUE)
    end_label(ax, t[-1] / 60, middle - (0.09 * top if near and end >= middle else 0), "single\nimages", GREY)
    ax.set_ylim(0, top)
    ax.set_xlabel("time (min)")
    ax.set_ylabel("distance from the reference (m)")
    ax.set_title(title)
    return fig
