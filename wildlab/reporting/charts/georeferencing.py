"""Charts of georeferenced positions: from where they were seen, how far off they are, and filtered."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from wildlab.reporting.figures import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    colour,
    ellipse,
    end_label,
    map_axes,
    new_figure,
)

Array = NDArray[np.float64]

#: A pause in the observations longer than this (seconds) breaks a line.
PAUSE_S = 10.0


def error_scatter(errors: ArrayLike, title: str, color: str = BLUE, reach: float | None = None) -> Figure:
    """Errors (N, 2) north-east about the truth, with the ellipse that holds 90 % of a normal distribution.

    ``reach`` is the half width of the map in metres, for figures that are to be compared.
    """
    e = _finite(errors)
    fig, ax = new_figure(4.6, 4.4)
    reach = reach or float(max(1.0, 1.15 * np.abs(e).max())) if len(e) else 1.0
    ax.plot(e[:, 1], e[:, 0], ".", color=color, alpha=0.55, ms=6, mec="none")
    if len(e) > 2:
        ellipse(ax, e.mean(axis=0)[::-1], np.cov(e[:, ::-1].T), color=color)
    ax.plot(0, 0, "+", color="black", ms=13, mew=2)
    ax.plot(*e.mean(axis=0)[::-1], "o", mfc="white", mec=color, ms=7, mew=1.6)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.annotate("truth", (0, 0), (8, -14), textcoords="offset points", fontsize=10, color=INK)
    ax.set_title(title)
    map_axes(ax, east="error, east (m)", north="error, north (m)")
    return fig


def error_shares(series: Mapping[str, tuple[ArrayLike, str]], title: str) -> Figure:
    """Share of points within a distance, one line for each series of errors (N, 2), with its colour."""
    fig, ax = new_figure(4.6, 4.4)
    right = 0.0
    ax.axhline(90, color=GREY, lw=0.8, ls=(0, (3, 3)))
    ends = []
    for label, (errors, color) in series.items():
        distance = np.sort(np.hypot(*_finite(errors).T))
        share = 100 * np.arange(1, len(distance) + 1) / len(distance)
        ax.step(distance, share, where="post", color=color)
        right = max(right, float(distance[-1]))
        ends.append((float(np.quantile(distance, 0.5)), label, color))
    # Names stand beside their own line at different heights, so that lines close together keep theirs apart.
    for place, (_, label, color) in enumerate(sorted(ends)):
        level = 62 - 24 * place
        errors = series[label][0]
        x = float(np.quantile(np.hypot(*_finite(errors).T), level / 100))
        end_label(ax, x, level, label, color)
    ax.set_xlim(0, right * 1.02)
    ax.set_ylim(0, 102)
    ax.set_xlabel("distance from the truth (m)")
    ax.set_ylabel("points within that distance (%)")
    ax.set_title(title)
    return fig


def errors_by_image(scored: pd.DataFrame, title: str, color: str = BLUE) -> Figure:
    """Distance of every point from the truth by image in order of time, with each image's mean."""
    order = scored.groupby("frame_id", sort=False)["time_s"].first().sort_values(kind="stable").index
    place = scored["frame_id"].map({name: i for i, name in enumerate(order)})
    mean = scored.groupby(place)["error_m"].mean()
    fig, ax = new_figure(5.9, 3.0)
    ax.plot(place, scored["error_m"], ".", color=color, alpha=0.55, ms=6, mec="none")
    ax.plot(mean.index, mean, color=VERMILLION, lw=1.3)
    end_label(ax, mean.index[-1], float(mean.iloc[-1]), "mean per\nimage", VERMILLION)
    ax.set_ylim(0, None)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("image, in order")
    ax.set_ylabel("error (m)")
    ax.set_title(title)
    return fig


def path_map(nav: pd.DataFrame, times: ArrayLike, title: str, target: str = "target") -> Figure:
    """The path of a nav table in local metres, the places at ``times`` marked, the target at the origin."""
    at = np.clip(np.searchsorted(nav["time_s"], np.asarray(times, float)), 0, len(nav) - 1)
    fig, ax = new_figure(5.2, 4.6)
    ax.plot(nav["east_m"], nav["north_m"], color=GREY, lw=0.7)
    ax.plot(nav["east_m"].to_numpy()[at], nav["north_m"].to_numpy()[at], ".", color=ORANGE, ms=4)
    ax.plot(0, 0, "k+", ms=13, mew=2)
    ax.annotate(target, (0, 0), (10, -4), textcoords="offset points", fontsize=10)
    ax.set_title(title)
    map_axes(ax)
    return fig


def aircraft_map(
    aircraft: ArrayLike, seeing: ArrayLike, target: ArrayLike, title: str, name: str = "vessel"
) -> Figure:
    """Paths of aircraft (N, 2) and target (M, 2), north and east, and from where it was seen (K, 2)."""
    path, seen, below = (np.asarray(a, float) for a in (aircraft, seeing, target))
    fig, ax = new_figure(5.2, 4.6)
    ax.plot(path[:, 1], path[:, 0], color=GREY, lw=0.9)
    ax.plot(seen[:, 1], seen[:, 0], ".", color=ORANGE, ms=2)
    ax.plot(below[:, 1], below[:, 0], color=colour("truth"), lw=2.2)
    # Towards the middle of the map, away from title and axis.
    north = np.concatenate([one[:, 0] for one in (path, seen, below)])
    high = below[-1, 0] > (np.nanmin(north) + np.nanmax(north)) / 2
    ax.annotate(
        name,
        below[-1, ::-1],
        (6, -6 if high else 6),
        textcoords="offset points",
        va="top" if high else "bottom",
        fontsize=10,
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


def filter_chart(raw: ArrayLike, estimate: ArrayLike, stated: ArrayLike, title: str) -> Figure:
    """Distances from the truth (T,) of measurements and of the estimate, with what the filter states."""
    index = np.arange(len(np.asarray(raw)))
    fig, ax = new_figure(5.9, 3.6)
    ax.plot(index, raw, ".", color=GREY, ms=3, alpha=0.6)
    ax.plot(index, estimate, color=BLUE)
    ax.fill_between(index, 0, np.asarray(stated), color=BLUE, alpha=0.15, lw=0)
    end_label(ax, index[-1], float(np.asarray(estimate)[-1]), "filtered", BLUE)
    end_label(ax, index[-1], float(np.median(np.asarray(raw))), "single\nimages", GREY)
    ax.set_ylim(0, 1.05 * float(np.max(np.asarray(raw))))
    ax.set_xlabel("observation")
    ax.set_ylabel("distance from the truth (m)")
    ax.set_title(title)
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


def autocorrelation_chart(series: Mapping[str, ArrayLike], bound: float, title: str) -> Figure:
    """Autocorrelations by lag, one line for each series, with the band that white noise stays in."""
    fig, ax = new_figure(5.9, 3.4)
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    ends = sorted(((float(np.asarray(r)[-1]), name) for name, r in series.items()), reverse=True)
    for (name, values), color in zip(series.items(), (BLUE, VERMILLION), strict=True):
        r = np.asarray(values, float)
        ax.plot(np.arange(len(r)), r, color=color)
        end_label(ax, len(r) - 1, r[-1] + (0.06 if name == ends[0][1] else -0.06), name, color)
    ax.set_xlabel("lag (observations)")
    ax.set_ylabel("autocorrelation")
    ax.set_title(title)
    return fig


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return np.asarray(e[np.isfinite(e).all(axis=1)])
