"""Figures for a notebook: one for each kind of result, in the house style of the reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wildlab.analysis.georeference import covariances_of
from wildlab.api.flights import PointErrors, Points
from wildlab.api.tracks import Consistency, Navigation, Tracked
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.flight.store import Flight
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.flights import error_bands
from wildlab.reporting.charts.tracks import track_map
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    colour,
    ellipse,
    log_band,
    map_axes,
    new_figure,
    png_bytes,
)

#: More ellipses than this cover one another.
MOST_ELLIPSES = 200
_PLACE = ["north_m", "east_m"]


def plot(result: Flight | Points | PointErrors | Tracked | Navigation | Consistency) -> Figure:
    """Draw a result: one figure, which a notebook shows and ``savefig`` writes.

    Maps are in metres from the flight's origin, north up; they do not say where that is.

    Parameters
    ----------
    result
        A flight: paths of its poses and truth. Points, or their errors: each with its 90 % ellipse, and the
        truth. A track: beside the truth and the single detections. Navigation: errors of the attitude within
        two standard deviations. Consistency: NEES and NIS over time with the 95 % band of single values.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    WildlabError
        Where there is nothing of it to draw.

    Examples
    --------
    >>> import wildlab
    >>> figure = wildlab.plot(wildlab.simulate("large-ship"))
    >>> figure.axes[0].get_xlabel()
    'east (m)'
    """
    draw: Callable[[Any], Figure] | None = _DRAWN.get(type(result))
    if draw is None:
        raise WildlabError(
            f"there is no figure of a {type(result).__name__}",
            "give a flight, points, a track, navigation or consistency",
            field="result",
        )
    figure = draw(result)
    # A figure apart from pyplot's state is shown by a notebook only if it says how.
    figure._repr_png_ = partial(png_bytes, figure)  # type: ignore[attr-defined]
    return figure


def _flight(flight: Flight) -> Figure:
    if not flight.nav and flight.truth is None:
        raise WildlabError("the flight has neither poses nor truth", "add nav/<source>.parquet", field="nav")
    fig, ax = new_figure(5.6, 5.2)
    for name, nav in flight.nav.items():
        draw_way(ax, nav[_PLACE], colour(name), name, width=1.0)
    return _map(fig, flight, f"{flight.name}: paths of the aircraft")


def _points(points: Points) -> Figure:
    fig, ax = new_figure(5.6, 5.2)
    north_east = points.table[_PLACE].to_numpy(float)
    swapped = covariances_of(points.table)[:, ::-1, ::-1]  # east first, as the axes have it
    for row in range(0, len(swapped), max(1, -(-len(swapped) // MOST_ELLIPSES))):
        ellipse(ax, north_east[row, ::-1], swapped[row], lw=0.6, alpha=0.5)
    draw_dots(ax, north_east[:, 1], north_east[:, 0], BLUE, "single images, 90 % ellipses", size=3, alpha=1.0)
    return _map(fig, points.flight, "Detections on the ground")


def _map(fig: Figure, flight: Flight, title: str) -> Figure:
    """With the true ways of the targets, a title, and the legend below."""
    (ax,) = fig.axes
    if flight.truth is not None:
        for _, rows in flight.truth.groupby("target_id", sort=False):
            draw_way(ax, rows[_PLACE], colour("truth"), "truth", width=1.1, marker="+" * (len(rows) == 1))
    ax.set_title(title)
    map_axes(ax)
    return finish(fig)


def _track(one: Tracked) -> Figure:
    called = {"schmidt": "Schmidt-Kalman", "ekf": "extended Kalman", "kf": "Kalman"}
    known = np.isfinite(one.truth).any()
    truth = one.truth if known else one.estimate
    fig = track_map(truth, {one.filter: one.estimate}, called, measured=one.measured)
    fig.axes[0].set_title("Track and truth" if known else "Track")
    return fig


def _navigation(one: Navigation) -> Figure:
    if one.errors is None:
        raise WildlabError("there is no pose to compare with", "give the flight a reference", field="nav")
    axes = [f"{name} (deg)" for name in ("roll", "pitch", "yaw")]
    error, sd = (np.degrees(values[:, 6:]) for values in (one.errors.error, one.errors.sd))
    bounds = {one.source: sd} if np.isfinite(sd).any() else {}
    part = (one.errors.times >= one.part[1]) & (one.errors.times < one.part[2])
    bounds = {name: values[part] for name, values in bounds.items()}
    fig = error_bands(one.errors.times[part], {one.source: error[part]}, bounds, axes)
    fig.axes[0].set_title(f"Attitude against {one.reference}")
    return fig


def _consistency(one: Consistency) -> Figure:
    fig, strips = new_figure(5.9, 1.9 * len(one.series) + 0.9, rows=len(one.series), squeeze=False)
    for ax, (name, runs) in zip(strips[:, 0], one.series.items(), strict=True):
        low, high = chi_square_interval(runs[0].dof)
        highest = high
        for run in runs:
            color = BLUE if len(runs) == 1 else GREY
            draw_dots(ax, run.times - run.times[0], run.values, color, size=3, alpha=0.6)
            highest = max(highest, float(np.nanmax(run.values)))
        log_band(ax, low, high)
        ax.set_ylim(low / 12, 2 * highest)
        ax.set_ylabel(name)
    strips[0, 0].set_title("Does the filter know how wrong it is?")
    strips[-1, 0].set_xlabel("time (s)")
    return fig


#: What draws each kind of result.
_DRAWN: Mapping[type, Callable[[Any], Figure]] = {
    Flight: _flight,
    Points: _points,
    PointErrors: lambda errors: _points(errors.points),
    Tracked: _track,
    Navigation: _navigation,
    Consistency: _consistency,
}
