"""Charts of tracks beside their truth: map, error, speed and course, consistency, innovations.

Tracks are given by their subject, which has its fixed colour (`wildlab.reporting.figures.COLOURS`), in the
order in which they are drawn; `NAMES` has the words of the legend. Times are in seconds.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.track_errors import SLOWEST_M_S
from wildlab.reporting.figures import (
    GREY,
    INK,
    colour,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
)

Array = NDArray[np.float64]

#: A pause in the detections longer than this (seconds) is shaded.
GAP_S = 2.0
#: Words for a legend; a subject without one goes by its own name.
NAMES = {
    "kf": "KF, on the ground",
    "ekf": "EKF, on pixels",
    "ukf": "UKF, on pixels",
    "imm": "IMM, on pixels",
    "cv": "constant velocity",
    "singer": "Singer",
    "coloured": "differenced",
    "schmidt": "Schmidt",
}
#: Later lines are thinner, so that one which lies on another does not hide it.
_WIDTHS = (2.6, 1.3, 1.3, 1.0)


def name_of(subject: str) -> str:
    """What a legend calls a track."""
    return NAMES.get(subject, subject)


def track_map(
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    title: str,
    *,
    measured: ArrayLike | None = None,
    aircraft: ArrayLike | None = None,
    target: str = "true path",
) -> Figure:
    """Map of tracks (N, 2 or more) north, east, of the truth, of measurements and of the aircraft's path."""
    fig, ax = new_figure(5.6, 5.2)
    if aircraft is not None:
        path = np.asarray(aircraft, float)
        ax.plot(path[:, 1], path[:, 0], color=GREY, lw=0.8, label="aircraft")
    if measured is not None:
        z = np.asarray(measured, float)
        ax.plot(z[:, 1], z[:, 0], ".", color=GREY, ms=3, alpha=0.45, mec="none", label="single images")
    for width, (subject, states) in zip(_WIDTHS, tracks.items(), strict=False):
        x = np.asarray(states, float)
        ax.plot(x[:, 1], x[:, 0], color=colour(subject), lw=width, label=name_of(subject))
    true = np.asarray(truth, float)
    ax.plot(true[:, 1], true[:, 0], color="black", lw=1.1, ls=(0, (4, 2)), label=target)
    ax.set_title(title)
    _legend(fig, ax)
    map_axes(ax)
    return fig


def error_over_time(
    times: ArrayLike,
    errors: Mapping[str, ArrayLike],
    seen: ArrayLike,
    title: str,
    *,
    measured: ArrayLike | None = None,
) -> Figure:
    """Distances (N,) of tracks from the truth; ``seen`` (N,) bool, the frames with a detection, are marked.

    ``measured`` (N,): the distances of the measurements themselves.
    """
    t, there = np.asarray(times, float), np.asarray(seen, bool)
    fig, ax = new_figure(5.9, 3.6)
    highest = max(float(np.nanmax(np.asarray(e, float))) for e in errors.values())
    if measured is not None:
        z = np.asarray(measured, float)
        ax.plot(t, z, ".", color=GREY, ms=3, alpha=0.5, mec="none", label="single images")
        highest = max(highest, float(np.nanmax(z)))
    for width, (subject, e) in zip(_WIDTHS, errors.items(), strict=False):
        ax.plot(t, np.asarray(e, float), color=colour(subject), lw=width, label=name_of(subject))
    ax.plot(t[there], np.full(there.sum(), -0.05 * highest), "|", color="black", ms=6, label="detected")
    ax.set_ylim(-0.1 * highest, 1.05 * highest)
    ax.set_xlabel("time since the first detection (s)")
    ax.set_ylabel("distance from the truth (m)")
    ax.set_title(title)
    _legend(fig, ax)
    return fig


def speed_and_course(
    times: ArrayLike, truth: ArrayLike, tracks: Mapping[str, ArrayLike], seen: ArrayLike, title: str
) -> Figure:
    """Speed and course of tracks and of the truth, all (N, 4): north, east, and their rates.

    Courses of what hardly moves are left out, and so are the jumps from 180 to -180 degrees.
    """
    t = np.asarray(times, float)
    fig, (fast, course) = new_figure(5.9, 4.8, rows=2, sharex=True)
    lines = [(name_of(s), colour(s), x) for s, x in tracks.items()] + [("truth", "black", truth)]
    for width, (name, color, states) in zip((*_WIDTHS[: len(tracks)], 1.1), lines, strict=True):
        x = np.asarray(states, float)
        speed = np.hypot(x[:, 2], x[:, 3])
        style = (0, (4, 2)) if name == "truth" else "-"
        fast.plot(t, speed, color=color, lw=width, ls=style, label=name)
        with np.errstate(invalid="ignore"):
            angle = np.where(speed > SLOWEST_M_S, np.degrees(np.arctan2(x[:, 3], x[:, 2])), np.nan)
            angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
        course.plot(t, angle, color=color, lw=width, ls=style)
    true = np.asarray(truth, float)
    # The start, with no idea of the velocity, would press all the rest flat.
    fast.set_ylim(0, 2.5 * max(0.4, float(np.nanmax(np.hypot(true[:, 2], true[:, 3])))))
    course.set_ylim(-190, 190)
    course.set_yticks([-180, -90, 0, 90, 180])
    for ax in (fast, course):
        mark_gaps(ax, t[np.asarray(seen, bool)], GAP_S)
    fast.set_ylabel("speed (m/s)")
    course.set_ylabel("course (°)")
    course.set_xlabel("time since the first detection (s)")
    fast.set_title(title)
    _legend(fig, fast)
    return fig


def squares_over_time(
    times: ArrayLike,
    values: Mapping[str, ArrayLike],
    seen: ArrayLike,
    bounds: tuple[float, float],
    title: str,
    what: str,
) -> Figure:
    """NEES or NIS (N,) of tracks with the band that a consistent filter stays in; pauses are shaded.

    Where a track has a value at detections only, it is drawn as dots. ``what`` names the axis. Values far
    below the band are cut off: they say no more than that they are there.
    """
    t, there = np.asarray(times, float), np.asarray(seen, bool)
    fig, ax = new_figure(5.9, 3.6)
    highest = bounds[1]
    for width, (subject, v) in zip(_WIDTHS, values.items(), strict=False):
        y = np.asarray(v, float)
        dots = not np.isfinite(y[~there]).any()
        style = {"ls": "none", "marker": ".", "ms": 3, "mec": "none", "alpha": 0.7} if dots else {"lw": width}
        ax.plot(t, y, color=colour(subject), label=name_of(subject), **style)
        highest = max(highest, float(np.nanmax(y)))
    log_band(ax, *bounds)
    mark_gaps(ax, t[there], GAP_S)
    ax.set_ylim(bounds[0] / 12, 2 * highest)
    ax.set_xlabel("time since the first detection (s)")
    ax.set_ylabel(what)
    ax.set_title(title)
    _legend(fig, ax)
    return fig


def innovation_correlations(
    series: Mapping[str, ArrayLike], bound: float, title: str, axes: tuple[str, ...] = ("north", "east")
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
            ax.plot(np.arange(len(y)), y, color=colour(subject), lw=width, label=name_of(subject))
        ax.set_ylabel(f"autocorrelation,\n{name}")
    strips[-1, 0].set_xlabel("lag (detections)")
    strips[0, 0].set_title(title)
    _legend(fig, strips[0, 0])
    return fig


def _legend(fig: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)), markerscale=2)
