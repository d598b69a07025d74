"""Charts of one target's tracks beside its truth: map, errors, speed and course, consistency, innovations.

Tracks are given by their subject, which has its fixed colour (`wildlab.reporting.figures.COLOURS`), in the
order in which they are drawn; ``names`` says what each is called in the legend. Times, (N,), are seconds
since the first detection, and ``seen``, (N,) bool, tells the frames with a detection from the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatter
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.track_errors import SLOWEST_M_S
from wildlab.names import figure_name
from wildlab.reporting.figures import (
    GREEN,
    GREY,
    INK,
    colour,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
    thinned,
)

Array = NDArray[np.float64]

#: A pause in the detections longer than this (seconds) is shaded.
GAP_S = 2.0
#: Dots of so many flights are large enough to be seen alone.
FEW = 20
#: Courses that stay this near to one, degrees, are drawn about it.
STEADY = 60.0
#: Later lines are thinner, so that one which lies on another does not hide it.
_WIDTHS = (2.6, 1.3, 1.3, 1.0)
#: The truth is drawn last and broken, so that the tracks show through.
_TRUTH = {"color": colour("truth"), "lw": 1.1, "ls": (0, (4, 2)), "label": "truth"}
#: Single measurements, and values at single detections.
_DOTS = {"ls": "none", "marker": ".", "mec": "none", "rasterized": True}
#: Room that a legend's entry takes besides its text, and each of its letters, inches.
_ENTRY, _LETTER = 0.66, 0.077


def track_map(
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    names: Mapping[str, str],
    title: str,
    *,
    measured: ArrayLike | None = None,
    aircraft: ArrayLike | None = None,
) -> Figure:
    """Map of the truth and of tracks, of measurements and of the aircraft's path.

    All are (N, 2 or more), north and east in metres first; they need not be equally long.
    """
    fig, ax = new_figure(5.6, 5.2)
    if aircraft is not None:
        path = np.asarray(aircraft, float)
        ax.plot(path[:, 1], path[:, 0], color=GREY, lw=0.8, label="aircraft")
    if measured is not None:
        z = np.asarray(measured, float)
        ax.plot(z[:, 1], z[:, 0], color=GREY, ms=4, alpha=0.5, label="single images", **_DOTS)
    for width, (subject, states) in zip(_WIDTHS, tracks.items(), strict=False):
        x = np.asarray(states, float)
        ax.plot(x[:, 1], x[:, 0], color=colour(subject), lw=width, label=figure_name(names[subject]))
    way = np.asarray(truth, float)
    ax.plot(way[:, 1], way[:, 0], **_TRUTH)
    _mark_start(ax, way[np.isfinite(way[:, :2]).all(axis=1)])
    ax.set_title(title)
    _legend(fig, ax)
    map_axes(ax)
    return fig


def error_over_time(
    times: ArrayLike,
    seen: ArrayLike,
    errors: Mapping[str, ArrayLike],
    names: Mapping[str, str],
    title: str,
    *,
    measured: ArrayLike | None = None,
) -> Figure:
    """Errors of tracks in metres over time, with strokes at the detections; pauses are shaded.

    Parameters
    ----------
    errors
        Distances from the truth, (N,), or errors north and east, (N, 2), which get a strip each.
    measured
        The same of the measurements themselves.
    """
    t, there = np.asarray(times, float), np.asarray(seen, bool)
    columns = {subject: _columns(error) for subject, error in errors.items()}
    signed = next(iter(columns.values())).shape[1] == 2
    labels = ("error, north (m)", "error, east (m)") if signed else ("distance from the truth (m)",)
    fig, strips = new_figure(5.9, 4.6 if signed else 3.6, rows=len(labels), sharex=True, squeeze=False)
    keep = thinned(len(t))
    for i, (ax, label) in enumerate(zip(strips[:, 0], labels, strict=True)):
        if measured is not None:
            z = _columns(measured)[:, i]
            ax.plot(t, z, color=GREY, ms=3, alpha=0.5, label="single images", **_DOTS)
        for width, (subject, e) in zip(_WIDTHS, columns.items(), strict=False):
            ax.plot(t[keep], e[keep, i], color=colour(subject), lw=width, label=figure_name(names[subject]))
        ax.axhline(0, color=GREY, lw=0.6)
        mark_gaps(ax, t[there], GAP_S)
        ax.set_ylabel(label)
        _strokes(ax, t[there])
    return _finished(fig, strips[:, 0], title)


def speed_and_course(
    times: ArrayLike,
    seen: ArrayLike,
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    names: Mapping[str, str],
    title: str,
) -> Figure:
    """Speed and course of tracks and of the truth, all (N, 4): north, east, and their rates.

    Courses of what hardly moves are left out, and so are the jumps over north. Where the target keeps its
    course, the axis shows what is near it.
    """
    t = np.asarray(times, float)
    fig, (fast, course) = new_figure(5.9, 4.8, rows=2, sharex=True)
    keep = thinned(len(t))
    looks = [
        {"color": colour(subject), "lw": width, "label": figure_name(names[subject])}
        for width, subject in zip(_WIDTHS, tracks, strict=False)
    ]
    top, courses = 0.0, [course_of(states) for states in (*tracks.values(), truth)]
    middle, reach = steady_course(courses)
    for states, look in zip((*tracks.values(), truth), (*looks, _TRUTH), strict=True):
        x = np.asarray(states, float)[keep]
        speed = np.hypot(x[:, 2], x[:, 3])
        angle = (course_of(states)[keep] - middle + 180) % 360 + middle - 180
        angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
        fast.plot(t[keep], speed, **look)
        course.plot(t[keep], angle, **look)
        # The start, with no idea of the velocity, would press all the rest flat.
        top = max(top, float(np.nanquantile(speed, 0.99)))
    for ax in (fast, course):
        mark_gaps(ax, t[np.asarray(seen, bool)], GAP_S)
    fast.set_ylim(0, 1.2 * top)
    fast.set_ylabel("speed (m/s)")
    course.set_ylim(middle - reach, middle + reach)
    if reach > 180:
        course.set_yticks([0, 90, 180, 270, 360])
    else:
        course.yaxis.set_major_formatter(FuncFormatter(lambda angle, _: f"{angle % 360:g}"))
    course.set_ylabel("course (°)")
    return _finished(fig, (fast, course), title)


def course_of(states: ArrayLike) -> Array:
    """Courses (N,) of states (N, 4), degrees from 0 to 360; NaN of what hardly moves."""
    x = np.asarray(states, float)
    angle = np.degrees(np.arctan2(x[:, 3], x[:, 2])) % 360
    return np.where(np.hypot(x[:, 2], x[:, 3]) > SLOWEST_M_S, angle, np.nan)


def steady_course(courses: Sequence[Array]) -> tuple[float, float]:
    """The course that several (N,), the last one the truth's, keep to, and how far an axis about it reaches;
    180 and a little more than that where they do not keep to one. Degrees."""
    truth = np.radians(courses[-1][np.isfinite(courses[-1])])
    middle = float(np.degrees(np.arctan2(np.sin(truth).sum(), np.cos(truth).sum()))) % 360
    off = np.abs((np.concatenate(courses) - middle + 180) % 360 - 180)
    off = off[np.isfinite(off)]
    spread = float(np.quantile(off, 0.98)) if len(off) else 180.0
    return (middle, max(10.0, 1.4 * spread)) if spread < STEADY else (180.0, 185.0)


def squares_over_time(
    times: ArrayLike,
    seen: ArrayLike,
    values: Mapping[str, Mapping[str, ArrayLike]],
    names: Mapping[str, str],
    title: str,
) -> Figure:
    """NEES or NIS (N,) of tracks on log axes, with the 95 % band of single values; pauses are shaded.

    Where a track has a value at detections only, it is drawn as dots. Values far below the band are cut off:
    they say no more than that they are there.

    Parameters
    ----------
    values
        By what they are, which names the axis of their strip, and then by subject; two degrees of freedom.
    """
    t, there = np.asarray(times, float), np.asarray(seen, bool)
    low, high = chi_square_interval(2)
    fig, strips = new_figure(5.9, 2.0 * len(values) + 1.5, rows=len(values), sharex=True, squeeze=False)
    keep = thinned(len(t))
    for ax, (what, series) in zip(strips[:, 0], values.items(), strict=True):
        highest = high
        for width, (subject, v) in zip(_WIDTHS, series.items(), strict=False):
            y = np.asarray(v, float)
            look = {"color": colour(subject), "label": figure_name(names[subject])}
            if np.isfinite(y[~there]).any():
                ax.plot(t[keep], y[keep], lw=width, **look)
            else:
                ax.plot(t, y, ms=3, alpha=0.6, **look, **_DOTS)
            highest = max(highest, float(np.nanmax(y)))
        log_band(ax, low, high)
        mark_gaps(ax, t[there], GAP_S)
        ax.set_ylim(low / 12, 2 * highest)
        ax.set_ylabel(what)
    return _finished(fig, strips[:, 0], title)


def values_over_flights(
    values: pd.DataFrame,
    published: Mapping[str, float],
    names: Mapping[str, str],
    label: str,
    band: int | None = None,
) -> Figure:
    """A positive number of every flight by filter, on a log axis.

    Parameters
    ----------
    values
        One row for each flight; columns are the filters' names.
    published
        What was printed, for those that have it: a hollow diamond.
    names
        Of the filters, from top to bottom.
    label
        Of the axis.
    band
        Degrees of freedom of NEES or NIS, whose 95 % band of one run is shaded; left out, nothing is.
    """
    fig, ax = new_figure(5.9, 0.62 * len(names) + 1.5)
    if band is not None:
        ax.axvspan(*chi_square_interval(band), color=GREEN, alpha=0.13, lw=0, zorder=0)
    size = 4.5 if len(values) > FEW else 9.0
    for place, name in enumerate(names):
        row = np.sort(values[name].to_numpy(float))
        color = colour(name.split("-")[0] if name != "inflation" else "kf")
        # Spread out by rank, in a pattern that repeats, so that equal values do not hide one another.
        offset = 0.28 * (2 * ((np.arange(len(row)) * 0.618034) % 1) - 1)
        ax.plot(row, place + offset, ".", color=color, alpha=0.4, ms=size, mec="none")
        ax.plot([np.median(row)] * 2, [place - 0.36, place + 0.36], color=INK, lw=1.6)
        if name in published:
            ax.plot(published[name], place, "D", mfc="white", mec=INK, ms=8, mew=1.6, zorder=5)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False))
    ax.set_yticks(range(len(names)), [figure_name(name) for name in names.values()])
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(label)
    return fig


def innovation_correlations(
    series: Mapping[str, ArrayLike],
    bound: float,
    names: Mapping[str, str],
    title: str,
    axes: tuple[str, ...] = ("north", "east"),
) -> Figure:
    """Autocorrelations (m, lags + 1) of innovations, one strip for each of the m elements.

    Parameters
    ----------
    bound
        What white noise stays below.
    axes
        What the elements are called.
    """
    fig, strips = new_figure(5.9, 2.1 * len(axes) + 0.6, rows=len(axes), sharex=True, squeeze=False)
    for i, (ax, name) in enumerate(zip(strips[:, 0], axes, strict=True)):
        ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
        ax.axhline(0, color=INK, lw=0.6)
        for width, (subject, r) in zip(_WIDTHS, series.items(), strict=False):
            y = np.asarray(r, float)[i]
            ax.plot(np.arange(len(y)), y, color=colour(subject), lw=width, label=figure_name(names[subject]))
        ax.set_ylabel(f"autocorrelation,\n{name}")
    return _finished(fig, strips[:, 0], title, "lag (detections)")


def _mark_start(ax: Axes, way: Array) -> None:
    """A dot where a way (N, 2 or more) begins, and its name on the side that the way turns away from, but
    below where all else is below: above is the title."""
    north, east = way[0, 0], way[0, 1]
    ax.margins(0.1)
    low, high = ax.dataLim.intervaly
    below = way[-1, 0] > north or north > high - 0.1 * (high - low)
    ax.plot(east, north, "o", color=colour("truth"), ms=5)
    ax.annotate(
        "start",
        (east, north),
        (0, -7 if below else 7),
        textcoords="offset points",
        ha="center",
        va="top" if below else "bottom",
        fontsize=10,
        color=INK,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
    )


def _columns(values: ArrayLike) -> Array:
    """(N,) as (N, 1); (N, 2) stays."""
    array = np.asarray(values, float)
    return array.reshape(len(array), -1)


def _strokes(ax: Axes, times: Array) -> None:
    """Short strokes along the lower edge, below all lines, where there are detections."""
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom - 0.06 * (top - bottom), top)
    edge = ax.get_xaxis_transform()
    ax.plot(times, np.full(len(times), 0.025), "|", color=INK, ms=6, alpha=0.35, transform=edge)


def _finished(
    fig: Figure, strips: Sequence[Axes], title: str, xlabel: str = "time since the first detection (s)"
) -> Figure:
    strips[0].set_title(title)
    strips[-1].set_xlabel(xlabel)
    _legend(fig, strips[-1])
    return fig


def _legend(fig: Figure, ax: Axes) -> None:
    """The names of an axes' lines below the figure, in one row where that is wide enough."""
    handles, labels = ax.get_legend_handles_labels()
    width = _ENTRY * len(labels) + _LETTER * sum(map(len, labels))
    columns = len(labels) if width < fig.get_figwidth() else -(-len(labels) // 2)
    fig.legend(handles, labels, loc="outside lower center", ncols=columns, markerscale=2)
