"""Charts of positions and of one target's tracks beside its truth: map, errors, course, consistency.

Tracks are given by their subject, which has its fixed colour (`wildlab.reporting.figures.COLOURS`), in the
order in which they are drawn; ``names`` says what each is called in the legend. Times, (N,), are seconds
since the first detection, and ``seen``, (N,) bool, tells the frames with a detection from the others.
"""

from __future__ import annotations

import hashlib
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
from wildlab.analysis.tracks.many import ManyTracks, known_scans
from wildlab.analysis.tracks.single_target import SMOOTHED, SensorTrack
from wildlab.analysis.tracks.tracker import TrackingResult, is_at_rest, whitened
from wildlab.evaluation.consistency import autocorrelation, chi_square_interval, white_bound
from wildlab.evaluation.errors import SLOWEST_M_S
from wildlab.evaluation.identities import Identities
from wildlab.geometry.covariances import ellipse_axes
from wildlab.messages.catalogue import fill, load_texts
from wildlab.messages.quantities import length
from wildlab.names import figure_name
from wildlab.reporting.charts.drawing import (
    DASHED,
    LINES,
    TRUTH,
    Array,
    Curve,
    Shown,
    correlations_chart,
    draw_dots,
    draw_errors,
    draw_line,
    draw_platform,
    draw_way,
    finish,
    fit_map,
    mark_place,
    name_rows,
    new_strips,
    spread_points,
    squares_chart,
    with_breaks,
    without_jumps,
)
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    Powers,
    colour,
    end_label,
    filter_words,
    map_axes,
    mark_gaps,
    new_figure,
    plain_numbers,
    short_words,
    thinned,
)

#: A pause in the detections longer than this (seconds) is shaded.
GAP_S = 2.0
#: Dots of so many flights are large enough to be seen alone.
FEW = 20
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
    xlabel: str = _SINCE,
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
        if len(there) == len(np.asarray(times)):
            continue
        # Short strokes along the lower edge, below all lines, where there are detections.
        bottom, top = ax.get_ylim()
        ax.set_ylim(bottom - 0.06 * (top - bottom), top)
        ax.plot(there, np.full(len(there), 0.025), "|", color=INK, ms=6, alpha=0.35,
                transform=ax.get_xaxis_transform())  # fmt: skip
    return finish(fig, xlabel)


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
    # About the truth's mean course, so that one that is kept to does not jump over north.
    turn = np.radians(course_of(truth))
    turn = turn[np.isfinite(turn)]
    middle = float(np.degrees(np.arctan2(np.sin(turn).sum(), np.cos(turn).sum()))) % 360
    angles = [(course_of(states) - middle + 180) % 360 + middle - 180 for states, _ in lines]
    top = 0.0
    for (states, look), angle in zip(lines, angles, strict=True):
        speed = np.hypot(*np.asarray(states, float)[:, 2:4].T)
        draw_line(fast, times, speed, **look)
        draw_line(course, times, without_jumps(angle), **look)
        # The start, with no idea of the velocity, would press all the rest flat.
        top = max(top, float(np.nanquantile(speed, 0.99)))
    for ax in (fast, course):
        mark_gaps(ax, np.asarray(times, float)[np.asarray(seen, bool)], GAP_S)
    fast.set_ylim(0, 1.2 * top)
    course.set_ylabel("course (°)")
    if np.isfinite(known := np.concatenate(angles)).any():
        low, high = np.nanquantile(known, [0.01, 0.99])
        course.set_ylim(low - 10, high + 10)
    course.yaxis.set_major_formatter(FuncFormatter(lambda angle, _: f"{angle % 360:g}"))
    return finish(fig, _SINCE, "speed (m/s)")


def course_of(states: ArrayLike) -> Array:
    """Courses (N,) of states (N, 4), degrees from 0 to 360; NaN of what hardly moves."""
    x = np.asarray(states, float)
    angle = np.degrees(np.arctan2(x[:, 3], x[:, 2])) % 360
    return np.where(np.hypot(x[:, 2], x[:, 3]) > SLOWEST_M_S, angle, np.nan)


def squares_over_time(
    times: ArrayLike,
    seen: ArrayLike,
    values: Mapping[str, Mapping[str, ArrayLike]],
    names: Mapping[str, str],
) -> Figure:
    """NEES or NIS (N,) of tracks, with the band of single values; pauses are shaded.

    Where a track has a value at detections only, it is drawn as dots.

    Parameters
    ----------
    values
        By what they are, which names the axis of their strip, and then by subject; two degrees of freedom.
    """
    there = np.asarray(seen, bool)
    strips: dict[str, list[Curve]] = {what: [] for what in values}
    for what, series in values.items():
        for subject, v, look in _looks(series, names):
            sparse = not np.isfinite(np.asarray(v, float)[~there]).any()
            more = {"size": 3, "rasterized": True} if sparse else {"width": look["width"]}
            strips[what].append(Curve(times, v, colour(subject), look["name"], more, sparse))
    return squares_chart(strips, 2, (np.asarray(times, float)[there], GAP_S), _SINCE)


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
    fig, ax = new_figure(4.6, 4.4)
    draw_errors(ax, errors, color, reach)
    # Its name stands away from what lies north and east of it.
    e = _finite(errors)
    north, east = e.mean(axis=0) if len(e) else (0.0, 0.0)
    mark_place(ax, (0.0, 0.0), "truth", below=bool(north >= 0), aside=-8 if east > 0 else 8)
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
        From `wildlab.analysis.georeference.score_points`.
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


def _finite(errors: ArrayLike) -> Array:
    e = np.asarray(errors, float).reshape(-1, 2)
    return np.asarray(e[np.isfinite(e).all(axis=1)])


SENSOR_COLOURS = (*LINES[:4], ORANGE, LINES[4])
#: Lags of innovations shown, detections; metres beyond the targets' ways that a map shows, as a share.
LAGS, MARGIN = 20, 0.15
#: Where the largest value is this many times the middle one, an axis that is even would show it alone.
UNEVEN = 20.0
#: A pause in the detections longer than this many of its usual intervals is shaded.
PAUSE = 5.0


def slug(*words: str) -> str:
    """A name of a figure; where letters of the words cannot stand in it, a digest tells it from others.

    Examples
    --------
    >>> slug("map", "boat 1"), slug("map", "$") == slug("map", "å")
    ('map-boat-1', False)
    """
    text = "-".join(words).lower()
    plain = "".join(c if c.isalnum() and c.isascii() else "-" for c in text)
    strange = any(c not in " _-" for c in text if not (c.isalnum() and c.isascii()))
    return f"{plain}-{hashlib.sha256(text.encode()).hexdigest()[:6]}" if strange else plain


def map_shown(
    followed: TrackingResult, target: str, name: str, truth: Array, platforms: dict[str, Array]
) -> Shown:
    """The way of one target as each sensor's track by one filter has it; north up, local metres.

    Parameters
    ----------
    truth
        (K, 2) north, east of the target; empty where it is not known.
    platforms
        (N, 2) ways of the platforms, by name.
    """
    mine = [one for one in followed.tracks if (one.target, one.filter) == (target, name)]
    fig, ax = new_figure(5.6, 5.0)
    # Beside the whole way of the platform, a target at rest and its track are a dot.
    at_rest = bool(mine) and all(map(is_at_rest, mine))
    platforms = {} if at_rest else platforms
    for words, way in platforms.items():
        draw_platform(ax, way, words)
    shown = [truth] if len(truth) else []
    for one, tint in zip(mine, SENSOR_COLOURS * len(mine), strict=False):
        x = one.estimate[np.isfinite(one.estimate[:, 0])][:, :2]
        if len(x):
            draw_way(ax, one.estimate, tint, one.sensor, width=1.6)
            shown.append(_middle(x))
    if len(truth):
        draw_way(
            ax, truth, name="truth", **(TRUTH | {"marker": "+", "ms": 13, "mew": 2} if at_rest else TRUTH)
        )
    if shown:
        every = np.concatenate([*shown, *platforms.values()])
        every = every[np.isfinite(every).all(axis=1)]
        if len(every):
            fit_map(ax, every, MARGIN * max(float(np.ptp(every, axis=0).max()), 10.0))
    map_axes(ax)
    finish(fig)
    return captioned(fig, "tracking", "map", slug("map", target), target=target, filter=filter_words(name))


def _middle(x: Array) -> Array:
    """Without the ends that stray."""
    low, high = np.quantile(x, 0.02, axis=0), np.quantile(x, 0.98, axis=0)
    return x[((x >= low) & (x <= high)).all(axis=1)] if len(x) > 50 else x


def squares_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame, what: str) -> Shown:
    """NEES (``"nees"``) or NIS of one target by one sensor over time, by filter, with the band."""
    first, mean, nees = tracks[0], _rows_of(tracks, rows)[what], what == "nees"
    dof = 2.0 if nees else first.dof
    curves: list[Curve] = []
    drawn: dict[str, str] = {}
    for one in tracks:
        values = one.nees if nees else one.nis
        if np.isfinite(values).any():
            t, y = _lines(one, values)
            look = (
                {"width": 1.4, "ls": "--" if one.filter.endswith(SMOOTHED) else "-"}
                if nees
                else {"size": 3.5}
            )
            name = filter_words(one.filter)
            curves.append(Curve(t, np.maximum(y, 1e-4), _tint(one.filter), name, look, not nees))
            drawn[one.filter] = f"{mean[one.filter]:.2f}"
    used = first.times[np.isfinite(first.nis)]
    longest = max(PAUSE * float(np.median(np.diff(used))), 1.0) if len(used) > 2 else np.inf
    label = "NEES of the position" if nees else "NIS of the detections"
    fig = squares_chart({label: curves}, dof, (used, longest))
    return _of_filters(fig, "squares", what, first, drawn, score=what.upper(), dof=f"{dof:g}")


def errors_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> Shown:
    """Distance from the truth over time of one target by one sensor, and the reported standard deviation."""
    first, rmse = tracks[0], _rows_of(tracks, rows)["rmse"].to_dict()
    fig, ax = new_figure(5.8, 3.6)
    drawn: dict[str, str] = {}
    sizes: list[Array] = []
    for one in tracks:
        away = np.hypot(*one.error[:, :2].T)
        there = np.isfinite(away)
        if not there.any():
            continue
        stated = np.sqrt(np.trace(one.covariance[:, :2, :2], axis1=1, axis2=2))
        draw_line(ax, *_lines(one, away), _tint(one.filter), filter_words(one.filter), width=1.5)
        draw_line(ax, *_lines(one, np.where(there, stated, np.nan)), _tint(one.filter), width=1.0, ls=":")
        drawn[one.filter] = length(float(rmse[one.filter]))
        sizes.append(away[there])
    draw_line(ax, [], [], INK, "reported standard deviation", width=1.0, ls=":")
    # One filter that is lost would press all others flat.
    if len(sizes) > 1 and max(map(np.max, sizes)) > UNEVEN * min(map(np.max, sizes)):
        ax.set_yscale("log")
        ax.set_ylim(bottom=max(float(np.quantile(np.concatenate(sizes), 0.01)), 1e-3))
        ax.yaxis.set_major_formatter(Powers())
    else:
        ax.set_ylim(bottom=0)
    finish(fig, "time (s)", "error (m)")
    return _of_filters(fig, "errors", "error", first, drawn)


def whiteness_shown(tracks: Sequence[SensorTrack], elements: Sequence[str]) -> Shown | None:
    """Autocorrelation of the whitened innovations of one target by one sensor; None of too few."""
    first = tracks[0]
    white = {one.filter: found for one in tracks if len(found := whitened(one)) > LAGS + 2}
    if not white:
        return None
    series = {name: [autocorrelation(column, LAGS) for column in found.T] for name, found in white.items()}
    far = {
        name: f"{max((r[1] for r in columns), key=abs):+.2f}".replace("-", "−")
        for name, columns in series.items()
    }
    labels = [f"element {i + 1}" for i in range(len(elements))] if len(elements) > 1 else elements
    strips = {
        f"autocorrelation,\n{label}": {
            filter_words(name): (columns[i], _tint(name)) for name, columns in series.items()
        }
        for i, label in enumerate(labels)
    }
    fig = correlations_chart(strips, [white_bound(max(map(len, white.values())))] * len(strips))
    return _of_filters(fig, "whiteness", "whiteness", first, far, lags=str(LAGS))


def captioned(fig: Figure, page: str, key: str, name: str, **values: Any) -> Shown:
    """A figure with its name, and its title, alternative text and caption out of a page's catalogue."""
    text = load_texts(page).figures[key]
    title, alt, caption = (fill(one, {}, values) for one in (text.title, text.alt, text.caption))
    fig.axes[0].set_title(title)
    return fig, name, alt, caption


def _of_filters(
    fig: Figure, key: str, what: str, first: SensorTrack, drawn: Mapping[str, str], **values: str
) -> Shown:
    """A figure of one target by one sensor, with a number of each filter; titles have no room for many."""
    brief = [f"{short_words(name)} {value}" for name, value in drawn.items()]
    values |= {
        "of": f"{first.target} by {first.sensor}",
        "brief": " · ".join(brief[:3]) + (" …" if len(brief) > 3 else ""),
        "each": "; ".join(f"{filter_words(name)} {value}" for name, value in drawn.items()),
    }
    return captioned(fig, "tracking", key, slug(what, first.sensor, first.target), **values)


def _tint(name: str) -> str:
    return colour(name.removesuffix(SMOOTHED))


def _rows_of(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> pd.DataFrame:
    """What is known of these tracks, by filter."""
    mine = (rows["sensor"] == tracks[0].sensor) & (rows["target"] == tracks[0].target)
    return rows[mine].set_index("filter")


def _lines(one: SensorTrack, values: Array) -> tuple[Array, Array]:
    """Times and values (K,) of the looks that have one, thinned; NaN between one track and the next."""
    rows = np.flatnonzero(np.isfinite(values))
    rows = rows[thinned(len(rows))]
    new = np.flatnonzero(np.diff(np.searchsorted(one.starts, rows, side="right"))) + 1
    return np.insert(one.times[rows], new, np.nan), np.insert(values[rows], new, np.nan)


#: Tracks that have a colour and a name of their own in a map: the longest.
MOST_NAMED = 6
#: Letters of a target's name in a chart.
LONGEST_NAME = 14
#: Looks farther apart than so many usual ones are no line.
LONG_PAUSE = 8.0


def ways_of(followed: ManyTracks) -> dict[int, Array]:
    """(L, 3) times and places of every track, the longest first."""
    ways: dict[int, list[tuple[float, float, float]]] = {}
    for look in followed.shown:
        for identity, x in zip(look.identity, look.x, strict=True):
            ways.setdefault(int(identity), []).append((look.time, float(x[0]), float(x[1])))
    longest = sorted(ways, key=lambda name: (-len(ways[name]), name))
    return {name: np.array(ways[name]) for name in longest}


def parted(way: Array, times: list[float]) -> Array:
    """A way (L, 3) of times and places, with a row of NaN wherever it misses some of the times."""
    # Several sensors may look at one time.
    order = np.searchsorted(np.unique(times), way[:, 0])
    return np.asarray(np.insert(way, np.flatnonzero(np.diff(order) > 1) + 1, np.nan, axis=0))


def short_name(name: object) -> str:
    """A target's name as far as there is room for it."""
    text = str(name)
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"


def colours_of(followed: ManyTracks) -> dict[object, str]:
    """By identity: the longest tracks have a colour of their own in every chart, the others that of ink."""
    names = list(ways_of(followed))
    own = dict(zip(names, SENSOR_COLOURS[:MOST_NAMED], strict=False))
    return {name: own.get(name, INK) for name in names}


def tracks_shown(followed: ManyTracks, lives: Identities | None = None) -> Shown:
    """Where every track went, in local metres, north up, beside the true ways."""
    false = set() if lives is None else {name for name, life in lives.tracks.items() if life.false}
    fig, ax = new_figure(5.6, 5.4)
    for way in followed.truth.values():
        draw_way(ax, way, name="truth", zorder=3, **TRUTH)
    if followed.scans:
        draw_platform(ax, np.array([scan.platform for scan in followed.scans]), "platform")
    ways, tints = ways_of(followed), colours_of(followed)
    times = [look.time for look in followed.shown]
    for identity, way in ways.items():
        # Where a track is absent for a while no line says where it was.
        tint, named = tints[identity], tints[identity] != INK
        name = f"track {identity}" if named else "other tracks"
        draw_way(ax, parted(way, times)[:, 1:], tint, name, width=1.8 if named else 1.0)
        begins = {"marker": "x", "ms": 6} if identity in false else {"marker": "o", "ms": 5 if named else 3}
        ax.plot(way[:1, 2], way[:1, 1], color=tint, **begins)
    map_axes(ax)
    finish(fig)
    values = {"tracks": len(ways), "targets": len(followed.truth), "most": MOST_NAMED}
    return captioned(fig, "tracking-many", "map", "map", **values)


def identities_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """Which track is on each target, over time."""
    names = [name for name, life in lives.targets.items() if life.visible]
    fig, ax = new_figure(5.8, 1.6 + 0.5 * len(names))
    times, tints = _times_of(followed), colours_of(followed)
    for row, name in enumerate(names):
        on = [one.get(name) for one in lives.followed]
        for identity in dict.fromkeys(one for one in on if one is not None):
            mine = np.array([one == identity for one in on])
            ax.plot(times[mine], np.full(int(mine.sum()), row), "|", color=tints[identity], ms=11, mew=1.6)
    name_rows(ax, [short_name(name) for name in names])
    finish(fig, "time since the first look (s)")
    values = {"changes": lives.swaps + lives.breaks, "targets": len(names), "most": MOST_NAMED}
    return captioned(fig, "tracking-many", "identities", "identities", **values)


def wrong_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """GOSPA at each look, and how many targets are missed and tracks false."""
    fig, (upper, lower) = new_strips(2, 4.2, 5.8)
    times = _times_of(followed)
    distance, missed, false = (
        np.array([getattr(one, part) for one in lives.gospa]) for part in ("distance", "n_missed", "n_false")
    )
    draw_dots(upper, times, distance, SENSOR_COLOURS[0], alpha=1.0)
    upper.axhline(distance.mean(), color=INK, lw=1.2, ls="--")
    pause = LONG_PAUSE * float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    # Over a pause no line says what nobody looked at.
    draw: dict[str, Any] = {"width": 1.4, "drawstyle": "steps-mid"}
    draw_line(lower, *with_breaks(times, missed, pause), SENSOR_COLOURS[0], "targets missed", **draw)
    draw_line(lower, *with_breaks(times, -false, pause), VERMILLION, "tracks on nothing", **draw)
    most = max(int(missed.max()), int(false.max()), 1)
    lower.set(ylabel="how many", ylim=(-most - 0.5, most + 0.5))
    lower.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    lower.yaxis.set_major_formatter(lambda value, _: f"{abs(value):.0f}")
    mark_gaps(upper, times, pause)
    finish(fig, "time since the first look (s)", "GOSPA (m)")
    values = {
        "mean": f"{distance.mean():.1f}",
        "cutoff": f"{followed.cutoff_m:g}",
        "looks": len(times),
        "missed": int((missed > 0).sum()),
        "false": int((false > 0).sum()),
    }
    return captioned(fig, "tracking-many", "gospa", "gospa", **values)


def _times_of(followed: ManyTracks) -> Array:
    """(N,) s since the first look, of the looks at which true places are known."""
    times = np.array([scan.time for scan in followed.scans])
    return np.asarray((times - times[0])[known_scans(followed)])
