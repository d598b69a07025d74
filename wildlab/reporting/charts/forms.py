"""Whole charts by their form, one call each: lines over a parameter, dots in rows, pictures, fields.

Names are words for the legend or the ticks; labels of axes have their units. What a form leaves out a caller
adds to the figure's axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.terrain import Terrain
from wildlab.names import figure_name
from wildlab.reporting.charts.drawing import Array, draw_band, draw_dots, draw_way, finish, name_rows
from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, new_figure

Size = tuple[float, float]


class Values(NamedTuple):
    """A line or a row of dots: (N,) values, (2, N) ends of intervals if any, colour, marker or style.

    Without values a line is its band alone.
    """

    middle: ArrayLike | None
    ends: ArrayLike | None = None
    color: str = BLUE
    look: str = ""


def draw_lines(ax: Axes, x: ArrayLike, lines: Mapping[str, Values], *, bars: bool = False) -> None:
    """Draw lines with markers and the bands of their intervals, or bars; "" leaves one out of the legend."""
    for name, one in lines.items():
        if one.ends is not None:
            low, high = np.asarray(one.ends, float)
            if bars:
                ax.vlines(x, low, high, color=one.color, alpha=0.35, lw=2)
            else:
                draw_band(ax, x, low, high, one.color, name if one.middle is None else "", alpha=0.17)
        if one.middle is not None:
            ax.plot(x, one.middle, one.look or "o-", color=one.color, label=figure_name(name))


def lines_chart(
    x: ArrayLike, lines: Mapping[str, Values], xlabel: str, ylabel: str, *, size: Size = (5.6, 3.6),
    ticks: bool = True, bars: bool = False, **axes: Any,
) -> Figure:  # fmt: skip
    """Lines over a parameter, each with its band, or with ``bars``.

    Parameters
    ----------
    x, lines
        (N,), and the lines by their names.
    ticks
        Whether every value of ``x`` has its tick.
    **axes
        Of `Axes.set`: scales and limits.
    """
    fig, ax = new_figure(*size)
    draw_lines(ax, x, lines, bars=bars)
    ax.set(**axes)
    if axes.get("yscale") == "log":
        plain_numbers(ax.yaxis)
    if ticks:
        ax.set_xticks(np.asarray(x), [f"{one:g}" for one in np.asarray(x, float)])
        ax.xaxis.set_minor_locator(NullLocator())
    return finish(fig, "", xlabel, ylabel)


def rows_chart(
    rows: Sequence[str], series: Mapping[str, Values], xlabel: str, *, size: Size, apart: float = 0.24,
    **axes: Any,
) -> Figure:  # fmt: skip
    """Dots with their intervals, as `draw_rows` draws them; ``axes`` are of `Axes.set`."""
    fig, ax = new_figure(*size)
    draw_rows(ax, rows, series, apart)
    ax.set(**axes)
    return finish(fig, "", xlabel)


def draw_rows(ax: Axes, rows: Sequence[str], series: Mapping[str, Values], apart: float) -> None:
    """Draw dots with their intervals, a row for each of R names from the top, a colour for each series.

    ``apart``: between two series in a row, rows; a marker ``D`` is hollow, for what is published.
    """
    for k, (name, one) in enumerate(series.items()):
        at = np.arange(len(rows)) + apart * (k - (len(series) - 1) / 2)
        if one.ends is not None:
            ax.hlines(at, *np.asarray(one.ends, float), color=one.color, lw=2)
        look: dict[str, Any] = {"mfc": "white", "mew": 1.6, "ms": 7} if one.look == "D" else {"ms": 5}
        dots = np.asarray(one.middle, float)
        ax.plot(dots, at, one.look or "o", color=one.color, ls="none", label=figure_name(name), **look)
    name_rows(ax, rows)


def spread_points(count: int, width: float) -> Array:
    """(N,) from minus to plus ``width``, in a pattern that repeats, so that equal values stand apart."""
    return np.asarray(width * (2 * ((np.arange(count) * 0.618034) % 1) - 1))


def draw_errors(ax: Axes, errors: ArrayLike, color: str, title: str, reach: float | None = None) -> None:
    """Draw errors (N, 2), upwards and to the right, and their mean; axes reach as far each way."""
    e = np.asarray(errors, float)
    e = e[np.isfinite(e).all(axis=1)]
    draw_dots(ax, e[:, 1], e[:, 0], color, size=7)
    ax.plot(*e.mean(axis=0)[::-1], "+", color=INK, ms=12, mew=2)
    reach = reach or 1.1 * float(np.abs(e).max())
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), title=title)


#: Signs of places in an image: style, colour and size.
_MARKS = (("x", VERMILLION, 9), ("+", BLUE, 12), ("o", ORANGE, 9))


def draw_marks(ax: Axes, places: Mapping[str, ArrayLike]) -> None:
    """Mark up to three places (2,) px in an image, each in its own way."""
    for (name, at), (sign, color, size) in zip(places.items(), _MARKS, strict=False):
        ax.plot(*np.asarray(at), sign, mfc="none", mec=color, ms=size, mew=1.8, label=figure_name(name))


def draw_picture(
    ax: Axes, image: NDArray[Any], title: str = "", *, limits: tuple[float, float] | None = (0, 255),
    boxes: Iterable[ArrayLike] = (), colors: Sequence[str] = (), margin: float = 4.0,
) -> None:  # fmt: skip
    """Draw an image (H, W) without ticks, and boxes (left, top, width, height) px in their colours.

    ``limits`` are black and white, None: all but a few of the image's own values lie between; ``margin`` is
    the room about a box, px.
    """
    low, high = np.quantile(image, (0.005, 0.998)) if limits is None else limits
    ax.imshow(image, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
    for box, color in zip(boxes, colors, strict=True):
        left, top, width, height = np.asarray(box, float)
        corner, size = (left - margin, top - margin), (width + 2 * margin, height + 2 * margin)
        ax.add_patch(Rectangle(corner, *size, fill=False, ec=color, lw=1.6))
    ax.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5), xticks=[], yticks=[])
    ax.grid(visible=False)
    ax.set_title(title)


def fields_chart(
    u: Array, v: Array, fields: Mapping[str, Array], levels: ArrayLike, lines: ArrayLike, fmt: str,
    mark: ArrayLike, size: Size,
) -> Figure:  # fmt: skip
    """Contours of values over the pixels of an image, a panel for each field by its title.

    ``lines`` are the levels with a line and their value; a cross is at ``mark``, px.
    """
    fig, axes = new_figure(*size, columns=len(fields), sharey=True, squeeze=False)
    filled = np.asarray(levels, float)
    for ax, (title, values) in zip(axes[0], fields.items(), strict=True):
        ax.contourf(u, v, values, levels=filled, cmap="cividis", vmin=filled[0], vmax=filled[-1])
        drawn = ax.contour(u, v, values, levels=lines, colors="white", linewidths=0.8)
        ax.clabel(drawn, fmt=fmt, fontsize=10)
        ax.plot(*np.asarray(mark), "+", color="white", ms=9)
        ax.set(title=title, xlabel="u (px)", aspect="equal")
        ax.grid(visible=False)
    axes[0, 0].set_ylabel("v (px)")
    axes[0, 0].invert_yaxis()
    return fig


def draw_fences(ax: Axes, fences: Iterable[Array]) -> None:
    """Draw the borders (K, 2) of enclosures on a map."""
    for fence in fences:
        draw_way(ax, np.concatenate([fence, fence[:1]]), INK)
    ax.grid(visible=False)


def draw_heights(ax: Axes, terrain: Terrain, step: float = 5.0, every: int = 1) -> None:
    """Draw contours of a terrain on a map, metres apart, from one in so many of its nodes."""
    south, north, west, east = terrain.extent
    heights = terrain.height[::every, ::every]
    at = np.linspace(west, east, heights.shape[1]), np.linspace(south, north, heights.shape[0])
    levels = np.arange(0, float(np.nanmax(heights)) + step, step)
    ax.contour(*at, heights, levels=levels, colors=GREY, linewidths=0.4, alpha=0.6)


def fit_map(ax: Axes, points: ArrayLike, margin: float) -> None:
    """Let a map show all places (N, 2), with so many metres about them."""
    places = np.asarray(points, float)[:, :2]
    (south, west), (north, east) = places.min(axis=0) - margin, places.max(axis=0) + margin
    ax.set(xlim=(west, east), ylim=(south, north))


def plain_numbers(axis: Any) -> None:
    """Write the numbers of a logarithmic axis out."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
