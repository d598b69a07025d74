"""What charts are drawn with: strips over time, lines, dots, ways, bands and names, each done in one way.

Arrays are (N,), NaN where a line is to break; ways and places are (N, 2 or more), north and east in metres
first. Names go to the legend through `wildlab.names.figure_name`; "" leaves a line out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.names import figure_name
from wildlab.reporting.figures import BLUE, GREEN, GREY, INK, PURPLE, SKY, VERMILLION, new_figure, thinned

Array = NDArray[np.float64]
#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]

#: Colours of lines that have none of their own, in the order in which they come.
LINES = (BLUE, VERMILLION, GREEN, PURPLE, SKY)
#: Lines of a level, an ideal or a limit, and of the truth, which is drawn last so that tracks show through.
DASHED: dict[str, Any] = {"lw": 1.0, "ls": (0, (4, 3))}
TRUTH: dict[str, Any] = {"color": "#000000", "width": 1.1, "ls": (0, (4, 2))}
#: Behind words that lie on lines.
_BOX = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
#: Room that a legend's entry takes besides its text, and each of its letters, inches.
_ENTRY, _LETTER = 0.66, 0.077


def new_strips(count: int, height: float, width: float = 5.9, **subplots: Any) -> tuple[Figure, list[Axes]]:
    """A figure with ``count`` panels one below the other, which share their abscissa."""
    fig, axes = new_figure(width, height, rows=count, sharex=True, squeeze=False, **subplots)
    return fig, list(axes[:, 0])


def draw_line(
    ax: Axes, x: ArrayLike, y: ArrayLike, color: str, name: object = "", *, width: float = 1.2, **look: Any
) -> None:
    """Draw a line with no more points than are seen."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    keep = thinned(len(x))
    ax.plot(x[keep], y[keep], color=color, lw=width, **_label(name), **look)


def draw_dots(
    ax: Axes, x: ArrayLike, y: ArrayLike, color: str, name: object = "", *, size: float = 4.0, **look: Any
) -> None:
    """Draw values that no line joins, all of them."""
    dots: dict[str, Any] = {"ls": "none", "marker": ".", "mec": "none", "alpha": 0.55} | look
    ax.plot(x, y, ms=size, color=color, **_label(name), **dots)


def draw_way(ax: Axes, way: ArrayLike, color: str, name: object = "", **look: Any) -> None:
    """Draw a way on a map."""
    places = np.asarray(way, float)
    draw_line(ax, places[:, 1], places[:, 0], color, name, **look)


def draw_platform(ax: Axes, way: Array, name: object) -> None:
    """Draw from where targets are seen: a way, or a triangle where it stands still."""
    if np.ptp(way, axis=0).max() > 0:
        draw_way(ax, way, GREY, name, width=1.3)
    else:
        ax.plot(way[:1, 1], way[:1, 0], "^", color=GREY, ms=8, **_label(name))


def draw_band(
    ax: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str, name: object = "", **look: Any
) -> None:
    """Fill what lies between two lines."""
    x, low, high = (np.asarray(one, float) for one in (x, low, high))
    keep = thinned(len(x))
    look = {"alpha": 0.2, "lw": 0, "zorder": 3} | look
    ax.fill_between(x[keep], low[keep], high[keep], color=color, **_label(name), **look)


def draw_white_band(ax: Axes, bound: float) -> None:
    """Shade where the autocorrelation of white noise stays."""
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    ax.axhline(0, color=INK, lw=0.6)


def mark_level(ax: Axes, level: float, text: str) -> None:
    """Draw a broken line at a value, and say above it what it is."""
    ax.axhline(level, color=GREY, **DASHED)
    ax.annotate(text, (0.01, level), (0, 3), fontsize=10, xycoords=("axes fraction", "data"),
                textcoords="offset points")  # fmt: skip


def mark_place(ax: Axes, place: ArrayLike, name: str, *, below: bool, aside: float = 0.0) -> None:
    """Write the name of a place (2,) above or below it, on white; ``aside`` points to the right of it."""
    north, east = np.asarray(place, float)[:2]
    ax.annotate(
        name, (east, north), (aside, -7 if below else 7), textcoords="offset points",
        ha="left" if aside else "center", va="top" if below else "bottom", fontsize=10, bbox=_BOX,
    )  # fmt: skip


def name_rows(ax: Axes, names: Sequence[object]) -> None:
    """Name the rows of a chart, the first on top."""
    ax.set_yticks(range(len(names)), [figure_name(name) for name in names])
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)


def without_jumps(angles: ArrayLike) -> Array:
    """Angles (N,), degrees, with NaN after each step over the end of the circle: no line joins them."""
    values = np.array(angles, float)
    values[1:][np.abs(np.diff(values)) > 180] = np.nan
    return values


def with_breaks(times: ArrayLike, values: ArrayLike, longest_s: float) -> tuple[Array, Array]:
    """Times and values (N,) with a NaN wherever two times lie farther apart than ``longest_s``."""
    t, y = np.asarray(times, float), np.asarray(values, float)
    after = np.flatnonzero(np.diff(t) > longest_s) + 1
    return np.insert(t, after, t[after]), np.insert(y, after, np.nan)


def finish(fig: Figure, title: str, xlabel: str = "", ylabel: str = "") -> Figure:
    """Title above the first panel, name of the abscissa below the last one, and the legend below them all.

    The legend has each name once, of whichever panel, and one row where that is wide enough; there is none
    of a single line.
    """
    axes = fig.axes
    if title:
        axes[0].set_title(title)
    if xlabel:
        axes[-1].set_xlabel(xlabel)
    if ylabel:
        axes[0].set_ylabel(ylabel)
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if len(entries) > 1:
        width = _ENTRY * len(entries) + _LETTER * sum(map(len, entries))
        columns = len(entries) if width < fig.get_figwidth() else -(-len(entries) // 2)
        place: Any = "outside lower center"
        columns = min(columns, 4)
        fig.legend(list(entries.values()), list(entries), loc=place, ncols=columns, markerscale=1.5)
    return fig


def _label(name: object) -> dict[str, Any]:
    return {"label": figure_name(name)} if name else {}


def dots_chart(
    names: Sequence[str],
    value: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    label: str,
    title: str,
    goal: float | None = None,
) -> Figure:
    """One dot a flight, with its interval where it has one (NaN where not), on one axis from zero.

    Parameters
    ----------
    names
        Of N flights.
    value, low, high
        (N,).
    label
        Of the axis.
    title
        Of the figure.
    goal
        A value to mark.
    """
    x, left, right = (np.asarray(one, float) for one in (value, low, high))
    fig, ax = new_figure(4.6, 1.3 + 0.36 * len(names))
    rows = np.arange(len(names))
    if goal is not None:
        ax.axvline(goal, color=GREY, **DASHED)
        ax.annotate(f"ideal {goal:g}" if goal else "none", (goal, 1.0), (3, -2), fontsize=10, va="top",
                    xycoords=("data", "axes fraction"), textcoords="offset points")  # fmt: skip
    ax.hlines(rows, left, right, color=BLUE, lw=2.2)
    ax.plot(x, rows, "o", color=BLUE, ms=7)
    name_rows(ax, [name if len(name) <= 24 else f"{name[:22]}…" for name in names])
    ax.set_ylim(top=-0.8)
    ends = np.concatenate([x, left, right, [goal or 0.0, 0.0]])
    lowest, highest = float(np.nanmin(ends)), float(np.nanmax(ends))
    span = highest - lowest or 1.0
    ax.set_xlim(lowest - 0.04 * span, highest + 0.08 * span)
    return finish(fig, title, label)
