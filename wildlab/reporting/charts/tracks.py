"""Charts of positions and of one target's tracks beside its truth: map, errors, course, consistency.

Tracks are given by their subject, which has its fixed colour (`wildlab.reporting.figures.COLOURS`), in the
order in which they are drawn; ``names`` says what each is called in the legend. Times, (N,), are seconds
since the first detection, and ``seen``, (N,) bool, tells the frames with a detection from the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatter, MaxNLocator
from numpy.typing import ArrayLike

from wildlab.analysis.georeference import covariances_of
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.errors import SLOWEST_M_S
from wildlab.geometry.covariances import chi2_quantile, ellipse_axes
from wildlab.names import figure_name
from wildlab.reporting.charts.drawing import (
    DASHED,
    TRUTH,
    Array,
    draw_band,
    draw_dots,
    draw_line,
    draw_way,
    finish,
    mark_place,
    name_rows,
    new_strips,
    spread_points,
    without_jumps,
)
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    colour,
    ellipse,
    end_label,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
    plain_numbers,
)

#: A pause in the detections longer than this (seconds) is shaded.
GAP_S = 2.0
#: Dots of so many flights are large enough to be seen alone.
FEW = 20
#: Courses that stay this near to one, degrees, are drawn about it.
STEADY = 60.0
#: Later lines are thinner, so that one which lies on another does not hide it.
_WIDTHS = (2.6, 1.3, 1.3, 1.0)
#: From a number to what it is of.
LEADER = {"arrowstyle": "-", "color": INK, "lw": 0.6}
_SINCE = "time since the first detection (s)"


def track_map(
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    names: Mapping[str, str],
    *,
    measured: ArrayLike | None = None,
    aircraft: ArrayLike | None = None,
) -> Figure:
    """Map of the truth and of tracks, of measurements and of the aircraft's path.

    All are (N, 2 or more), north and east in metres first; they need not be equally long.
    """
    fig, ax = new_figure(5.6, 5.2)
    if aircraft is not None:
        draw_way(ax, aircraft, GREY, "aircraft", width=0.8)
    if measured is not None:
        z = np.asarray(measured, float)
        draw_dots(ax, z[:, 1], z[:, 0], GREY, "single images", rasterized=True)
    for subject, states, look in _looks(tracks, names):
        draw_way(ax, states, colour(subject), **look)
    draw_way(ax, truth, name="truth", **TRUTH)
    way = np.asarray(truth, float)
    start, end = way[np.isfinite(way[:, :2]).all(axis=1)][[0, -1]]
    # Its name is on the side that the way turns away from, but below where all else is below: above is the
    # title.
    ax.margins(0.1)
    low, high = ax.dataLim.intervaly
    ax.plot(start[1], start[0], "o", color=colour("truth"), ms=5)
    mark_place(ax, start, "start", below=bool(end[0] > start[0] or start[0] > high - 0.1 * (high - low)))
    map_axes(ax)
    return finish(fig)


def error_over_time(
    times: ArrayLike,
    seen: ArrayLike,
    errors: Mapping[str, ArrayLike],
    names: Mapping[str, str],
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
    there = np.asarray(times, float)[np.asarray(seen, bool)]
    columns = {subject: _columns(error) for subject, error in errors.items()}
    signed = next(iter(columns.values())).shape[1] == 2
    labels = ("error, north (m)", "error, east (m)") if signed else ("distance from the truth (m)",)
    fig, strips = new_strips(len(labels), 4.6 if signed else 3.6)
    for i, (ax, label) in enumerate(zip(strips, labels, strict=True)):
        if measured is not None:
            draw_dots(ax, times, _columns(measured)[:, i], GREY, "single images", size=3, rasterized=True)
        for subject, e, look in _looks(columns, names):
            draw_line(ax, times, e[:, i], colour(subject), **look)
        ax.axhline(0, color=GREY, lw=0.6)
        mark_gaps(ax, there, GAP_S)
        ax.set_ylabel(label)
        # Short strokes along the lower edge, below all lines, where there are detections.
        bottom, top = ax.get_ylim()
        ax.set_ylim(bottom - 0.06 * (top - bottom), top)
        ax.plot(there, np.full(len(there), 0.025), "|", color=INK, ms=6, alpha=0.35,
                transform=ax.get_xaxis_transform())  # fmt: skip
    return finish(fig, _SINCE)


def speed_and_course(
    times: ArrayLike,
    seen: ArrayLike,
    truth: ArrayLike,
    tracks: Mapping[str, ArrayLike],
    names: Mapping[str, str],
) -> Figure:
    """Speed and course of tracks and of the truth, all (N, 4): north, east, and their rates.

    Courses of what hardly moves are left out, and so are the jumps over north. Where the target keeps its
    course, the axis shows what is near it.
    """
    fig, (fast, course) = new_strips(2, 4.8)
    lines = [(states, {"color": colour(name)} | look) for name, states, look in _looks(tracks, names)]
    lines.append((truth, {"name": "truth"} | TRUTH))
    middle, reach = steady_course([course_of(states) for states, _ in lines])
    top = 0.0
    for states, look in lines:
        speed = np.hypot(*np.asarray(states, float)[:, 2:4].T)
        draw_line(fast, times, speed, **look)
        angle = (course_of(states) - middle + 180) % 360 + middle - 180
        draw_line(course, times, without_jumps(angle), **look)
        # The start, with no idea of the velocity, would press all the rest flat.
        top = max(top, float(np.nanquantile(speed, 0.99)))
    for ax in (fast, course):
        mark_gaps(ax, np.asarray(times, float)[np.asarray(seen, bool)], GAP_S)
    fast.set_ylim(0, 1.2 * top)
    course.set(ylim=(middle - reach, middle + reach), ylabel="course (°)")
    if reach > 180:
        course.set_yticks([0, 90, 180, 270, 360])
    else:
        course.yaxis.set_major_formatter(FuncFormatter(lambda angle, _: f"{angle % 360:g}"))
    return finish(fig, _SINCE, "speed (m/s)")


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
    fig, strips = new_strips(len(values), 2.0 * len(values) + 1.5)
    for ax, (what, series) in zip(strips, values.items(), strict=True):
        highest = high
        for subject, v, look in _looks(series, names):
            y = np.asarray(v, float)
            if np.isfinite(y[~there]).any():
                draw_line(ax, t, y, colour(subject), **look)
            else:
                draw_dots(ax, t, y, colour(subject), look["name"], size=3, rasterized=True)
            highest = max(highest, float(np.nanmax(y)))
        log_band(ax, low, high)
        mark_gaps(ax, t[there], GAP_S)
        ax.set(ylim=(low / 12, 2 * highest), ylabel=what)
    return finish(fig, _SINCE)


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
    for place, name in enumerate(names):
        row = np.sort(values[name].to_numpy(float))
        color = colour(name.split("-")[0])
        draw_dots(
            ax,
            row,
            place + spread_points(len(row), 0.28),
            color,
            size=4.5 if len(values) > FEW else 9.0,
            alpha=0.4,
        )
        ax.plot([np.median(row)] * 2, [place - 0.36, place + 0.36], color=INK, lw=1.6)
        if name in published:
            ax.plot(published[name], place, "D", mfc="white", mec=INK, ms=8, mew=1.6, zorder=5)
    ax.set_xscale("log")
    plain_numbers(ax.xaxis)
    ax.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False))
    name_rows(ax, list(names.values()))
    return finish(fig, label)


def _looks(series: Mapping[str, Any], names: Mapping[str, str]) -> list[tuple[str, Any, dict[str, Any]]]:
    """Subject, values, and name and width of the line of each."""
    return [
        (subject, values, {"name": names[subject], "width": width})
        for width, (subject, values) in zip(_WIDTHS, series.items(), strict=False)
    ]


def _columns(values: ArrayLike) -> Array:
    """(N,) as (N, 1); (N, 2) stays."""
    array = np.asarray(values, float)
    return array.reshape(len(array), -1)


def error_scatter(errors: ArrayLike, color: str = BLUE, reach: float | None = None) -> Figure:
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
    north, east = e.mean(axis=0) if len(e) else (0.0, 0.0)
    # Its name stands away from what lies north and east of it.
    ax.plot(0, 0, "+", color=colour("truth"), ms=13, mew=2)
    mark_place(ax, (0.0, 0.0), "truth", below=bool(north >= 0), aside=-8 if east > 0 else 8)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach))
    map_axes(ax, east="error, east (m)", north="error, north (m)")
    return finish(fig)


def error_shares(series: Mapping[str, tuple[ArrayLike, str]]) -> Figure:
    """Share of points within a distance, one line for each series of errors (N, 2), with its colour."""
    fig, ax = new_figure(4.6, 4.4)
    ax.axhline(90, color=GREY, **DASHED)
    distances = {name: np.sort(np.hypot(*_finite(errors).T)) for name, (errors, _) in series.items()}
    for name, distance in distances.items():
        share = 100 * np.arange(1, len(distance) + 1) / len(distance)
        ax.step(distance, share, where="post", color=series[name][1], label=figure_name(name))
    ax.set(xlim=(0, 1.02 * max(float(one[-1]) for one in distances.values())), ylim=(0, 102))
    return finish(fig, "distance from the truth (m)", "points within that distance (%)")


def errors_by_image(scored: pd.DataFrame) -> Figure:
    """Distance of every point from the truth by image in order of time, with each image's mean."""
    order = scored.groupby("frame_id", sort=False)["time_s"].first().sort_values(kind="stable").index
    place = scored["frame_id"].map({name: i for i, name in enumerate(order)})
    mean = scored.groupby(place)["error_m"].mean()
    fig, ax = new_figure(5.9, 3.0)
    draw_dots(ax, place, scored["error_m"], BLUE, "point", size=6)
    draw_line(ax, mean.index, mean, VERMILLION, "mean of an image")
    ax.set_ylim(0, None)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return finish(fig, "image, in order", "error (m)")


def error_map(scored: pd.DataFrame, images: Sequence[object]) -> Figure:
    """Georeferenced points on a map, coloured by their error, with their 90 % ellipses; some images numbered.

    Parameters
    ----------
    scored
        From `wildlab.analysis.evaluate.score_points`.
    images
        Ids of frames, of which the first is number 1.
    """
    # The largest errors lie on top.
    placed = scored[scored["error_m"].notna()].sort_values("error_m", kind="stable")
    north, east = placed["north_m"].to_numpy(float), placed["east_m"].to_numpy(float)
    error = placed["error_m"].to_numpy(float)
    fig, ax = new_figure(5.6, 5.2)
    truth = east - placed["error_east_m"], north - placed["error_north_m"]
    draw_dots(ax, *truth, colour("truth"), "truth", marker="+", mec=colour("truth"), size=6, alpha=1.0)
    cmap = LinearSegmentedColormap.from_list("error", [BLUE, ORANGE, VERMILLION])
    norm = Normalize(0, float(np.quantile(error, 0.98)))
    dots = ax.scatter(east, north, s=9, c=error, cmap=cmap, norm=norm, zorder=3)
    covariance = covariances_of(placed)
    known = np.isfinite(covariance).all(axis=(1, 2))
    if known.any():
        long_axis, short_axis, bearing = ellipse_axes(covariance[known])
        places = np.column_stack([east, north])[known]
        ellipses = EllipseCollection(
            2 * long_axis, 2 * short_axis, 90 - np.degrees(bearing), units="xy", offsets=places,
            offset_transform=ax.transData, facecolors="none", edgecolors=cmap(norm(error[known])), lw=0.7,
            alpha=float(np.clip(60 / known.sum(), 0.25, 1.0)),
        )  # fmt: skip
        ax.add_collection(ellipses)
        # The few largest may leave the map.
        reach = float(np.quantile(long_axis, 0.9))
        ax.update_datalim([places.min(axis=0) - reach, places.max(axis=0) + reach])
        ax.autoscale_view()
    for number, image in enumerate(images, start=1):
        worst = np.flatnonzero(placed["frame_id"] == image)[-1]
        end_label(ax, east[worst], north[worst], str(number), INK, arrowprops=LEADER)
    fig.colorbar(dots, ax=ax, shrink=0.8, extend="max").set_label("error (m)")
    map_axes(ax)
    return finish(fig)


def aircraft_map(aircraft: ArrayLike, seeing: ArrayLike, target: ArrayLike, name: str = "vessel") -> Figure:
    """Paths of aircraft (N, 2) and target (M, 2), north and east, and from where it was seen (K, 2)."""
    path, seen, below = (np.asarray(a, float) for a in (aircraft, seeing, target))
    fig, ax = new_figure(5.2, 4.6)
    draw_way(ax, path, GREY, width=0.9)
    draw_dots(ax, seen[:, 1], seen[:, 0], ORANGE, size=2, alpha=1.0)
    draw_way(ax, below, colour("truth"), width=2.2, marker="+" if len(below) == 1 else "", ms=13, mew=2)
    # Towards the middle of the map, away from title and axis.
    north = np.concatenate([one[:, 0] for one in (path, seen, below)])
    high = bool(below[-1, 0] > (np.nanmin(north) + np.nanmax(north)) / 2)
    mark_place(ax, below[-1], name, below=high, aside=6)
    map_axes(ax)
    return finish(fig)


def positions_map(
    points: ArrayLike,
    reference: ArrayLike,
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
    return finish(fig)


def errors_over_time(
    times: ArrayLike, measured: ArrayLike, estimated: ArrayLike, xlabel: str,
    stated: ArrayLike | None = None, reach: float | None = None,
) -> Figure:  # fmt: skip
    """Distances from the truth (T,) of single images and of the estimate, over times or numbers.

    ``stated`` is what the filter states, from zero on; ``reach`` is the top of the axis in metres, for
    figures that are to be compared.
    """
    t, raw, estimate = (np.array(a, float) for a in (times, measured, estimated))
    fig, ax = new_figure(5.9, 3.5)
    draw_dots(ax, t, raw, GREY, size=3)
    draw_line(ax, t, estimate, BLUE, width=1.5)
    if stated is not None:
        draw_band(ax, t, 0 * t, stated, BLUE)
    known = np.isfinite(estimate)
    end_label(ax, t[-1], float(estimate[known][-1]), "filtered", BLUE)
    end_label(ax, t[-1], float(np.nanmedian(raw)), "single\nimages", GREY)
    ax.set_ylim(0, reach or 1.05 * float(np.nanmax([raw, estimate])))
    return finish(fig, xlabel, "error (m)")


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return np.asarray(e[np.isfinite(e).all(axis=1)])
