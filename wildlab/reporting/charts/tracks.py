"""Charts of a target's tracks by several filters: errors, map, speed and course, consistency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.reporting.figures import (
    GREEN,
    GREY,
    INK,
    colour,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
)

Array = NDArray[np.float64]

#: Periods without measurements longer than this (seconds) are marked.
PAUSE_S = 2.0
#: Points of a line beyond which a figure only grows.
MOST_POINTS = 3000


def track_error_chart(
    times: ArrayLike, seen: ArrayLike, errors: Mapping[str, ArrayLike], words: Mapping[str, str], title: str
) -> Figure:
    """Errors (N, 2) north and east over time by filter, with the detections marked.

    Parameters
    ----------
    times, seen
        (N,) s, and whether there is a detection then.
    words
        What each filter is called.
    """
    t, detected = np.asarray(times, float), np.asarray(seen, bool)
    fig, axes = new_figure(5.9, 4.6, rows=2, sharex=True)
    keep = _thinned(len(t))
    for i, (ax, axis) in enumerate(zip(axes, ("north", "east"), strict=True)):
        for name, error in errors.items():
            ax.plot(t[keep], np.asarray(error, float)[keep, i], lw=1.2, color=colour(name), label=words[name])
        ax.axhline(0, color=GREY, lw=0.6)
        mark_gaps(ax, t[detected], PAUSE_S)
        ax.set_ylabel(f"error, {axis} (m)")
        _ticks(ax, t[detected])
    return _finished(fig, axes, title)


def track_map(
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    measured: ArrayLike,
    words: Mapping[str, str],
    title: str,
) -> Figure:
    """Truth, tracks by filter and georeferenced detections, (N, 2 or more) each: north and east, metres."""
    fig, ax = new_figure(5.6, 5.2)
    z, way = np.asarray(measured, float), np.asarray(truth, float)
    ax.plot(
        z[:, 1],
        z[:, 0],
        ".",
        color=GREY,
        ms=5,
        alpha=0.6,
        mec="none",
        label="single images",
        rasterized=True,
    )
    for name, x in tracks.items():
        x = np.asarray(x, float)
        ax.plot(x[:, 1], x[:, 0], lw=1.2, color=colour(name), label=words[name])
    ax.plot(way[:, 1], way[:, 0], color=colour("truth"), lw=1.6, label="truth")
    known = way[np.isfinite(way[:, :2]).all(axis=1)]
    ax.plot(known[0, 1], known[0, 0], "o", color=colour("truth"), ms=5)
    ax.annotate("start", known[0, 1::-1], (6, 6), textcoords="offset points", fontsize=9, color=INK)
    ax.set_title(title)
    map_axes(ax)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return fig


def speed_course_chart(
    times: ArrayLike,
    seen: ArrayLike,
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    words: Mapping[str, str],
    title: str,
    slowest: float,
) -> Figure:
    """Speed and course over time of the truth and by filter, from states (N, 4).

    Below ``slowest`` m/s the truth has no course.
    """
    t, detected = np.asarray(times, float), np.asarray(seen, bool)
    fig, axes = new_figure(5.9, 4.6, rows=2, sharex=True)
    keep = _thinned(len(t))
    lines = {name: np.asarray(x, float)[keep] for name, x in tracks.items()} | {
        "truth": np.asarray(truth, float)[keep]
    }
    top = 0.0
    for name, x in lines.items():
        speed = np.hypot(x[:, 2], x[:, 3])
        course = np.degrees(np.arctan2(x[:, 3], x[:, 2])) % 360
        course[1:][np.abs(np.diff(course)) > 180] = np.nan  # a jump over north is not a line
        if name == "truth":
            course[speed <= slowest] = np.nan
        top = max(top, float(np.nanquantile(speed, 0.99)))
        for ax, y in zip(axes, (speed, course), strict=True):
            ax.plot(t[keep], y, lw=1.2, color=colour(name), label=words.get(name, name))
    for ax in axes:
        mark_gaps(ax, t[detected], PAUSE_S)
    axes[0].set_ylim(0, 1.2 * top)
    axes[0].set_ylabel("speed (m/s)")
    axes[1].set_ylim(0, 360)
    axes[1].set_yticks([0, 90, 180, 270, 360])
    axes[1].set_ylabel("course (°)")
    return _finished(fig, axes, title)


def consistency_chart(
    times: ArrayLike,
    seen: ArrayLike,
    nis: Mapping[str, ArrayLike],
    nees: Mapping[str, ArrayLike],
    words: Mapping[str, str],
    title: str,
) -> Figure:
    """NIS above and NEES of the position below by filter, with the 95 % band of single values; both (N,)."""
    t, detected = np.asarray(times, float), np.asarray(seen, bool)
    low, high = chi_square_interval(2)
    fig, axes = new_figure(5.9, 5.2, rows=2, sharex=True)
    keep = _thinned(len(t))
    for ax, what, series in zip(axes, ("NIS", "NEES (position)"), (nis, nees), strict=True):
        smallest, largest = low / 3, high * 3
        for name, values in series.items():
            v = np.asarray(values, float)
            if what == "NIS":
                ax.plot(t, v, ".", ms=3, color=colour(name), alpha=0.5, mec="none", rasterized=True)
            else:
                ax.plot(t[keep], v[keep], lw=1.2, color=colour(name), label=words[name])
            smallest = min(smallest, float(np.nanquantile(v, 0.02)))
            largest = max(largest, 1.3 * float(np.nanmax(v)))
        log_band(ax, low, high)
        mark_gaps(ax, t[detected], PAUSE_S)
        ax.set_ylim(smallest, largest)
        ax.set_ylabel(what)
    axes[0].set_title(title)
    axes[-1].set_xlabel("time (s)")
    fig.legend(*axes[1].get_legend_handles_labels(), loc="outside lower right", ncols=len(nees))
    return fig


def nees_over_flights(
    spread: pd.DataFrame, published: Mapping[str, float], words: Mapping[str, str], title: str
) -> Figure:
    """Time-averaged NEES of every flight by filter, on a log axis with the 95 % band of one run.

    Parameters
    ----------
    spread
        One row for each flight, the one drawn first; columns are the filters' names.
    published
        What was printed, for those that have it: a hollow diamond.
    """
    low, high = chi_square_interval(2)
    fig, ax = new_figure(5.9, 0.62 * len(words) + 1.5)
    ax.axvspan(low, high, color=GREEN, alpha=0.13, lw=0, zorder=0)
    for place, name in enumerate(words):
        values = np.sort(spread[name].to_numpy(float))
        color = colour(name.split("-")[0] if name != "inflation" else "kf")
        # Spread out by rank, in a pattern that repeats, so that equal values do not hide one another.
        offset = 0.28 * (2 * ((np.arange(len(values)) * 0.618034) % 1) - 1)
        ax.plot(values, place + offset, ".", color=color, alpha=0.4, ms=4.5, mec="none")
        ax.plot([np.median(values)] * 2, [place - 0.36, place + 0.36], color=INK, lw=1.6)
        if name in published:
            ax.plot(published[name], place, "D", mfc="white", mec=INK, ms=8, mew=1.6, zorder=5)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_yticks(range(len(words)), list(words.values()))
    ax.set_ylim(len(words) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("NEES of the position, mean over a flight")
    ax.set_title(title)
    return fig


def _ticks(ax: Axes, times: Array) -> None:
    """Short marks at the lower edge where there are detections."""
    ax.plot(times, np.zeros(len(times)), "|", color=INK, ms=7, alpha=0.35, transform=ax.get_xaxis_transform())


def _thinned(count: int) -> slice:
    return slice(None, None, max(1, -(-count // MOST_POINTS)))


def _finished(fig: Figure, axes: Sequence[Axes], title: str) -> Figure:
    axes[0].set_title(title)
    axes[-1].set_xlabel("time (s)")
    handles = axes[0].get_legend_handles_labels()
    fig.legend(*handles, loc="outside lower right", ncols=len(handles[0]))
    return fig
