"""What charts are drawn with, each in one way: strips over time, lines, dots, ways, bands and names.

And whole charts by their form: lines over a parameter, dots in rows, pictures, fields.

Arrays are (N,), NaN where a line is to break; ways and places are (N, 2 or more), north and east in metres
first. Names go to the legend through `wildlab.names.figure_name`; "" leaves a line out of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import NullLocator
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.georeference import Terrain
from wildlab.names import figure_name
from wildlab.reporting.figures import (
    BLUE,
    END_LABEL,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    ellipse,
    log_band,
    mark_gaps,
    new_figure,
    plain_numbers,
    thinned,
)

Array = NDArray[np.float64]
#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]

#: Colours of lines that have none of their own, in the order in which they come.
LINES = (BLUE, VERMILLION, GREEN, PURPLE, SKY)
#: Lines of a level, an ideal or a limit, and of the truth, which is drawn last so that tracks show through.
DASHED: dict[str, Any] = {"lw": 1.0, "ls": (0, (4, 3))}
TRUTH: dict[str, Any] = {"color": "#000000", "width": 1.1, "ls": (0, (4, 2))}
#: What is shown around a detection, px to each side.
AROUND = 40
#: Behind words that lie on lines.
_BOX = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}


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


class Curve(NamedTuple):
    """Values (N,) over time or else, their colour, name and look; ``dots``: no line joins them."""

    x: ArrayLike
    y: ArrayLike
    color: str
    name: object = ""
    look: Mapping[str, Any] = {}
    dots: bool = False


def squares_chart(
    strips: Mapping[str, Sequence[Curve]],
    dof: float,
    gaps: tuple[ArrayLike, float] = ((), 0.0),
    xlabel: str = "time (s)",
) -> Figure:
    """NEES or NIS on log axes, a strip for each label, with the 95 % band of single values.

    Values far below the band are cut off: they say no more than that they are there. ``gaps``: times with
    values, and the longest pause that is not shaded.
    """
    fig, axes = new_strips(len(strips), 1.8 * len(strips) + 1.5)
    low, high = chi_square_interval(dof)
    for ax, (label, curves) in zip(axes, strips.items(), strict=True):
        for one in curves:
            draw = draw_dots if one.dots else draw_line
            draw(ax, one.x, one.y, one.color, one.name, **one.look)
        log_band(ax, low, high)
        mark_gaps(ax, *gaps)
        values = np.concatenate([np.asarray(one.y, float) for one in curves])
        ax.set(ylim=(low / 12, max(3 * high, 1.5 * float(np.nanquantile(values, 0.999)))), ylabel=label)
    return finish(fig, xlabel)


def correlations_chart(
    strips: Mapping[str, Mapping[str, tuple[ArrayLike, str]]], bounds: Sequence[float]
) -> Figure:
    """Autocorrelations (lags + 1,) with colours by name, a strip for each label, without that at lag zero.

    White noise stays below the bound of its strip.
    """
    fig, axes = new_strips(len(strips), 1.9 * len(strips) + 0.8)
    for ax, (label, lines), bound in zip(axes, strips.items(), bounds, strict=True):
        ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
        ax.axhline(0, color=INK, lw=0.6)
        for name, (values, color) in lines.items():
            later = np.asarray(values, float)[1:]
            draw_line(ax, 1 + np.arange(len(later)), later, color, name)
        ax.set_ylabel(label)
    return finish(fig, "lag (observations)")


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
        gid=END_LABEL,
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


def finish(fig: Figure, xlabel: str = "", ylabel: str = "") -> Figure:
    """Name of the abscissa below the last panel, of the ordinate beside the first, the legend below all.

    The legend has each name once, of whichever panel; there is none of a single line.
    """
    axes = fig.axes
    if xlabel:
        axes[-1].set_xlabel(xlabel)
    if ylabel:
        axes[0].set_ylabel(ylabel)
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if len(entries) > 1:
        # In fewer columns where that is too wide: `wildlab.reporting.figures.fit_text`.
        place: Any = "outside lower center"
        columns = min(len(entries), 4)
        fig.legend(list(entries.values()), list(entries), loc=place, ncols=columns, markerscale=1.5)
    return fig


def _label(name: object) -> dict[str, Any]:
    return {"label": figure_name(name)} if name else {}


Size = tuple[float, float]


class Values(NamedTuple):
    """A line or a row of dots: (N,) values, (2, N) ends of intervals if any, colour, marker or style.

    Without values a line is its band alone.
    """

    middle: ArrayLike | None
    ends: ArrayLike | None = None
    color: str = BLUE
    look: str = ""


def draw_lines(ax: Axes, x: ArrayLike, lines: Mapping[str, Values]) -> None:
    """Draw lines with markers and the bands of their intervals; "" leaves one out of the legend."""
    for name, one in lines.items():
        if one.ends is not None:
            low, high = np.asarray(one.ends, float)
            draw_band(ax, x, low, high, one.color, name if one.middle is None else "", alpha=0.17)
        if one.middle is not None:
            ax.plot(x, one.middle, one.look or "o-", color=one.color, label=figure_name(name))


def lines_chart(
    x: ArrayLike, lines: Mapping[str, Values], xlabel: str, ylabel: str, *, size: Size = (5.6, 3.6),
    ticks: bool = True, **axes: Any,
) -> Figure:  # fmt: skip
    """Lines over a parameter, each with its band.

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
    draw_lines(ax, x, lines)
    ax.set(**axes)
    if axes.get("yscale") == "log":
        plain_numbers(ax.yaxis)
    if ticks:
        ax.set_xticks(np.asarray(x), [f"{one:g}" for one in np.asarray(x, float)])
        ax.xaxis.set_minor_locator(NullLocator())
    return finish(fig, xlabel, ylabel)


def rows_chart(
    rows: Sequence[str], series: Mapping[str, Values], xlabel: str, *, size: Size, apart: float = 0.24,
    **axes: Any,
) -> Figure:  # fmt: skip
    """Dots with their intervals, as `draw_rows` draws them; ``axes`` are of `Axes.set`."""
    fig, ax = new_figure(*size)
    draw_rows(ax, rows, series, apart)
    ax.set(**axes)
    return finish(fig, xlabel)


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


def draw_errors(ax: Axes, errors: ArrayLike, color: str, reach: float | None = None) -> None:
    """Draw errors (N, 2) north-east about the truth, their mean, and the ellipse that holds 90 % of a normal
    distribution; ``reach`` is the half width in metres, for panels that are to be compared."""
    e = np.asarray(errors, float).reshape(-1, 2)
    e = e[np.isfinite(e).all(axis=1)]
    draw_dots(ax, e[:, 1], e[:, 0], color, size=6)
    far = float(np.abs(e).max(initial=0.0))
    if len(e) > 2:
        ellipse(ax, e.mean(axis=0)[::-1], np.cov(e[:, ::-1].T), color=color)
        half = np.sqrt(e.var(axis=0, ddof=1) * chi2_quantile(0.9, 2))
        far = max(far, float((np.abs(e.mean(axis=0)) + half).max()))
    ax.plot(*e.mean(axis=0)[::-1], "o", mfc="white", mec=color, ms=7, mew=1.6)
    ax.plot(0, 0, "+", color=TRUTH["color"], ms=13, mew=2)
    reach = reach or max(1.0, 1.1 * far)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach))


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


def sightings_chart(sightings: pd.DataFrame, images: Mapping[int, NDArray[Any]]) -> Figure:
    """What the camera saw around detections, five side by side.

    Parameters
    ----------
    sightings
        ``u_px``, ``v_px`` and ``line``, which stands above it.
    images
        (H, W) or (H, W, 3) by the row of the sightings; others are left out.
    """
    fig, axes = new_figure(
        7.2, 1.7 * -(-len(images) // 5), rows=-(-len(images) // 5), columns=5, squeeze=False
    )
    for ax in axes.flat[len(images) :]:
        ax.set_axis_off()
    for ax, row in zip(axes.flat, sorted(images), strict=False):
        u, v, line = sightings[["u_px", "v_px", "line"]].iloc[row]
        draw_picture(ax, images[row], line, limits=None, boxes=[(u, v, 0, 0)], colors=[SKY], margin=12)
        ax.set(xlim=(u - AROUND, u + AROUND), ylim=(v + AROUND, v - AROUND), facecolor=GREY)
    return fig


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


def draw_cells(ax: Axes, values: Any, east: float, north: float, step: float, **look: Any) -> Any:
    """Draw cells (R, C) whose rows run north; east and north are the middle of the first."""
    rows, columns = values.shape
    left, low = east - step / 2, north - step / 2
    extent = (left, left + columns * step, low, low + rows * step)
    return ax.imshow(values, origin="lower", extent=extent, interpolation="nearest", **look)


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
