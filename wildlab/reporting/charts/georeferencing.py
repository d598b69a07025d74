"""Charts of georeferenced positions: from where they were seen, how far off they are, and filtered."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from wildlab.geometry.covariances import chi2_quantile
from wildlab.names import figure_name
from wildlab.reporting.charts.drawing import (
    DASHED,
    Array,
    draw_band,
    draw_dots,
    draw_line,
    draw_way,
    finish,
    mark_place,
    with_breaks,
)
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    ORANGE,
    VERMILLION,
    colour,
    ellipse,
    end_label,
    map_axes,
    new_figure,
)

#: A pause in the observations longer than this (seconds) breaks a line.
PAUSE_S = 10.0


def error_scatter(errors: ArrayLike, title: str, color: str = BLUE, reach: float | None = None) -> Figure:
    """Errors (N, 2) north-east about the truth, with the ellipse that holds 90 % of a normal distribution.

    ``reach`` is the half width of the map in metres, for figures that are to be compared.
    """
    e = _finite(errors)
    fig, ax = new_figure(4.6, 4.4)
    far = np.abs(e).max(initial=0.0)
    draw_dots(ax, e[:, 1], e[:, 0], color, size=6)
    if len(e) > 2:
        ellipse(ax, e.mean(axis=0)[::-1], np.cov(e[:, ::-1].T), color=color)
        half = np.sqrt(e.var(axis=0, ddof=1) * chi2_quantile(0.9, 2))
        far = max(far, float((np.abs(e.mean(axis=0)) + half).max()))
    reach = reach or max(1.0, 1.1 * float(far))
    ax.plot(*e.mean(axis=0)[::-1], "o", mfc="white", mec=color, ms=7, mew=1.6)
    _mark_target(ax, "truth", e.mean(axis=0) if len(e) else (0.0, 0.0))
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach))
    map_axes(ax, east="error, east (m)", north="error, north (m)")
    return finish(fig, title)


def error_shares(series: Mapping[str, tuple[ArrayLike, str]], title: str) -> Figure:
    """Share of points within a distance, one line for each series of errors (N, 2), with its colour."""
    fig, ax = new_figure(4.6, 4.4)
    ax.axhline(90, color=GREY, **DASHED)
    distances = {name: np.sort(np.hypot(*_finite(errors).T)) for name, (errors, _) in series.items()}
    for name, distance in distances.items():
        share = 100 * np.arange(1, len(distance) + 1) / len(distance)
        ax.step(distance, share, where="post", color=series[name][1], label=figure_name(name))
    ax.set(xlim=(0, 1.02 * max(float(one[-1]) for one in distances.values())), ylim=(0, 102))
    return finish(fig, title, "distance from the truth (m)", "points within that distance (%)")


def errors_by_image(scored: pd.DataFrame, title: str) -> Figure:
    """Distance of every point from the truth by image in order of time, with each image's mean."""
    order = scored.groupby("frame_id", sort=False)["time_s"].first().sort_values(kind="stable").index
    place = scored["frame_id"].map({name: i for i, name in enumerate(order)})
    mean = scored.groupby(place)["error_m"].mean()
    fig, ax = new_figure(5.9, 3.0)
    draw_dots(ax, place, scored["error_m"], BLUE, "point", size=6)
    draw_line(ax, mean.index, mean, VERMILLION, "mean of an image")
    ax.set_ylim(0, None)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return finish(fig, title, "image, in order", "error (m)")


def path_map(nav: pd.DataFrame, times: ArrayLike, title: str, target: str) -> Figure:
    """The path of a nav table in local metres, the places at ``times`` marked, the target at the origin."""
    at = np.clip(np.searchsorted(nav["time_s"], np.asarray(times, float)), 0, len(nav) - 1)
    path = nav[["north_m", "east_m"]].to_numpy(float)
    fig, ax = new_figure(5.2, 4.6)
    draw_way(ax, path, GREY, width=0.7)
    draw_dots(ax, path[at, 1], path[at, 0], ORANGE, alpha=1.0)
    _mark_target(ax, target)
    map_axes(ax)
    return finish(fig, title)


def aircraft_map(
    aircraft: ArrayLike, seeing: ArrayLike, target: ArrayLike, title: str, name: str = "vessel"
) -> Figure:
    """Paths of aircraft (N, 2) and target (M, 2), north and east, and from where it was seen (K, 2)."""
    path, seen, below = (np.asarray(a, float) for a in (aircraft, seeing, target))
    fig, ax = new_figure(5.2, 4.6)
    draw_way(ax, path, GREY, width=0.9)
    draw_dots(ax, seen[:, 1], seen[:, 0], ORANGE, size=2, alpha=1.0)
    draw_way(ax, below, colour("truth"), width=2.2)
    # Towards the middle of the map, away from title and axis.
    north = np.concatenate([one[:, 0] for one in (path, seen, below)])
    high = bool(below[-1, 0] > (np.nanmin(north) + np.nanmax(north)) / 2)
    mark_place(ax, below[-1], name, below=high, aside=6)
    map_axes(ax)
    return finish(fig, title)


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
    xy = np.asarray(points, float)
    fig, ax = new_figure(4.6, 4.6)
    draw_dots(ax, xy[:, 1], xy[:, 0], color, zorder=3)
    draw_way(ax, reference, colour("truth"))
    if bounds is not None:
        low, high = (np.asarray(b, float) for b in bounds)
        ax.set(xlim=(low[1], high[1]), ylim=(low[0], high[0]))
    map_axes(ax)
    return finish(fig, title)


def filter_chart(raw: ArrayLike, estimate: ArrayLike, stated: ArrayLike, title: str) -> Figure:
    """Distances from the truth (T,) of measurements and of the estimate, with what the filter states."""
    measured, filtered = np.asarray(raw, float), np.asarray(estimate, float)
    index = np.arange(len(measured))
    fig, ax = new_figure(5.9, 3.6)
    draw_dots(ax, index, measured, GREY, size=3)
    draw_line(ax, index, filtered, BLUE)
    draw_band(ax, index, 0 * filtered, stated, BLUE)
    end_label(ax, index[-1], float(filtered[-1]), "filtered", BLUE)
    end_label(ax, index[-1], float(np.median(measured)), "single\nimages", GREY)
    ax.set_ylim(0, 1.05 * float(np.max(measured)))
    return finish(fig, title, "observation", "distance from the truth (m)")


def errors_over_time(
    times: ArrayLike, measured: ArrayLike, estimated: ArrayLike, title: str, reach: float | None = None
) -> Figure:
    """Distances from the truth (T,) of single images and of the estimate, over minutes.

    ``reach`` is the top of the axis in metres, for figures that are to be compared.
    """
    t, raw, estimate = (np.array(a, float) for a in (times, measured, estimated))
    fig, ax = new_figure(5.9, 3.4)
    draw_dots(ax, t / 60, raw, GREY, size=3)
    broken, line = with_breaks(t, estimate, PAUSE_S)
    draw_line(ax, broken / 60, line, BLUE, width=1.8)
    end_label(ax, t[-1] / 60, float(estimate[-1]), "filtered", BLUE)
    end_label(ax, t[-1] / 60, float(np.median(raw)), "single\nimages", GREY)
    ax.set_ylim(0, reach if reach is not None else 1.05 * float(max(raw.max(), estimate.max())))
    return finish(fig, title, "time (min)", "distance from the reference (m)")


def autocorrelation_chart(series: Mapping[str, ArrayLike], bound: float, title: str) -> Figure:
    """Autocorrelations by lag, one line for each series, with the band that white noise stays in."""
    fig, ax = new_figure(5.9, 3.4)
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    for (name, values), color in zip(series.items(), (BLUE, VERMILLION), strict=True):
        r = np.asarray(values, float)
        draw_line(ax, np.arange(len(r)), r, color)
        end_label(ax, len(r) - 1, float(r[-1]), name, color)
    return finish(fig, title, "lag (observations)", "autocorrelation")


def _mark_target(ax: Axes, name: str, taken: ArrayLike = (0.0, 0.0)) -> None:
    """A cross at the origin, and its name beside it, away from what lies north and east of it."""
    north, east = np.asarray(taken, float)
    ax.plot(0, 0, "+", color=colour("truth"), ms=13, mew=2)
    side, aside = ("right", -8) if east > 0 else ("left", 8)
    above, up = ("bottom", 6) if north < 0 else ("top", -6)
    ax.annotate(name, (0, 0), (aside, up), textcoords="offset points", fontsize=10, ha=side, va=above)


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return np.asarray(e[np.isfinite(e).all(axis=1)])
