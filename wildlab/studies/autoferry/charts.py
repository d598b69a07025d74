"""Figures of boats tracked by several sensors: maps, NEES over time, innovations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from wildlab.analysis.tracks.comparison import FILTERS
from wildlab.analysis.tracks.tracks import SensorTrack
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.whiteness import innovation_whiteness
from wildlab.flight.store import Flight
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    VERMILLION,
    colour,
    log_band,
    map_axes,
    new_figure,
)
from wildlab.studies.autoferry.comparison import IDEAL, Held, stays
from wildlab.studies.page import Shown

Followed = Mapping[str, Sequence[SensorTrack]]
SENSOR_COLOURS = {"lidar": BLUE, "radar": VERMILLION, "ir": PURPLE, "eo": GREEN}
#: Metres beyond the targets' paths that a map shows.
MARGIN_M = 40.0
#: Lags of the innovations shown, detections.
LAGS = 20


def figures(
    flights: Mapping[str, Flight], followed: Followed, held: Held, case: str, names: Mapping[str, str]
) -> list[Shown]:
    """Mean NEES of all tracks, a map of each flight judged, and of one the last boat by the ranging sensors.

    Parameters
    ----------
    flights, followed
        By case.
    held
        The filter whose tracks the maps show; its white counterpart where it is not for a kind of detection.
    case
        Whose NEES and innovations are shown over time.
    names
        Words for sensors and filters.
    """
    drawn = {held.fixed if held.fixed in some else some[0] for some in FILTERS.values()}
    found = [Shown(mean_nees(held.judged, names), "mean-nees")]
    for name in held.judged["case"].unique():
        mine = [one for one in followed[name] if one.filter in drawn]
        found.append(Shown(track_map(flights[name], mine, name, names), "map", f"map-{name}"))
    boat = followed[case][-1].target
    for sensor in ("lidar", "radar"):
        own = [one for one in followed[case] if (one.sensor, one.target) == (sensor, boat)]
        if own:
            pair = [one for one in own if one.filter in ("kf", "coloured")]
            found.append(Shown(nees_chart(own, names), "nees", f"nees-{sensor}"))
            found.append(Shown(innovations_chart(pair, names), "innovations", f"innovations-{sensor}"))
    return found


def mean_nees(tracks: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """The mean NEES of every track by sensor and filter, with the ideal; lost tracks are hollow."""
    fig, ax = new_figure(5.8, 3.8)
    known = tracks[np.isfinite(tracks["anees"])]
    ends, place = [], 0
    for sensor, group in known.groupby("sensor", sort=False):
        left = place
        for name, rows in group.groupby("filter", sort=False):
            spread = np.linspace(-0.22, 0.22, len(rows)) if len(rows) > 1 else np.zeros(1)
            kept, tint = stays(rows), colour(str(name))
            ax.plot((place + spread)[kept], rows["anees"][kept], "o", color=tint, ms=4)
            ax.plot((place + spread)[~kept], rows["anees"][~kept], "o", mec=tint, mfc="white", ms=4)
            place += 1
        ends.append(((left + place - 1) / 2, names[str(sensor)].replace(" ", "\n")))
        place += 1
    ax.axhline(IDEAL, color="black", lw=1)
    ax.annotate(
        "2, ideal",
        (1.0, IDEAL),
        (-2, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        fontsize=10,
    )
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xticks([x for x, _ in ends], [label for _, label in ends])
    ax.grid(axis="x", visible=False)
    ax.set_ylabel("mean NEES of a track")
    for name in ("kf", *FILTERS["position"][1:]):
        ax.plot([], [], "o", color=colour(name), ms=5, label=names[name])
    ax.plot([], [], "o", mec=GREY, mfc="white", ms=5, label="lost")
    fig.legend(loc="outside lower center", ncols=5)
    return fig


def track_map(flight: Flight, followed: Sequence[SensorTrack], case: str, names: Mapping[str, str]) -> Figure:
    """Paths of the boats (black), of the platform (grey) and of each sensor's tracks, in local metres."""
    fig, ax = new_figure(5.8, 5.0)
    truth, (_, nav) = flight.table("truth"), flight.pose_source()
    ends = []
    for name, rows in truth.groupby("target_id", sort=False):
        ax.plot(rows["east_m"], rows["north_m"], color="black", lw=2.4, zorder=2)
        ends.append((float(rows["east_m"].iloc[-1]), float(rows["north_m"].iloc[-1]), str(name)))
    ax.plot(nav["east_m"], nav["north_m"], color=GREY, lw=3)
    ends.append((float(nav["east_m"].iloc[-1]), float(nav["north_m"].iloc[-1]), "own ship"))
    labelled = set()
    for one in followed:
        label = names[one.sensor]
        ax.plot(
            one.estimate[:, 1],
            one.estimate[:, 0],
            color=SENSOR_COLOURS.get(one.sensor, GREY),
            lw=1.3,
            zorder=3,
            label=None if label in labelled else label,
        )
        labelled.add(label)
    for east, north, name in ends:
        own = name == "own ship"
        ax.plot(east, north, "o", color=GREY if own else "black", ms=5, zorder=4)
        place = (6, -14) if own else (6, 5)
        ax.annotate(name, (east, north), place, textcoords="offset points", fontsize=10, zorder=5)
    for limit, column in ((ax.set_xlim, "east_m"), (ax.set_ylim, "north_m")):
        values = np.concatenate([truth[column].to_numpy(), nav[column].to_numpy()])
        limit(values.min() - MARGIN_M, values.max() + MARGIN_M)
    ax.set_title(case.replace("-", " ").capitalize())
    fig.legend(loc="outside lower center", ncols=4)
    map_axes(ax)
    return fig


def nees_chart(followed: Sequence[SensorTrack], names: Mapping[str, str]) -> Figure:
    """NEES of the position over time on a logarithmic axis, one line for each filter, with the 95 % band."""
    fig, ax = new_figure(5.6, 3.6)
    for one in followed:
        ax.plot(one.times, one.nees, color=colour(one.filter), lw=1.3, label=names[one.filter])
    log_band(ax, *chi_square_interval(2))
    values = np.concatenate([one.nees[np.isfinite(one.nees)] for one in followed])
    if len(values):
        # Down to below the band, whose name stands under it.
        ax.set_ylim(np.clip(0.5 * values.min(), 1e-3, 0.02), 2 * max(values.max(), 10.0))
    title = f"{names[followed[0].sensor]}, {followed[0].target}"
    ax.set(title=title, xlabel="time (s)", ylabel="NEES of the position")
    fig.legend(loc="outside lower center", ncols=4)
    return fig


def innovations_chart(followed: Sequence[SensorTrack], names: Mapping[str, str]) -> Figure:
    """Autocorrelation of the innovations, north solid and east dashed, with the band of white noise."""
    fig, ax = new_figure(5.6, 3.6)
    bound = 0.0
    for one in followed:
        white = innovation_whiteness(one.innovation, LAGS)
        bound = max(bound, white.bound)
        for values, style, axis in zip(white.autocorrelation, ("-", "--"), ("north", "east"), strict=True):
            ax.plot(values, style, color=colour(one.filter), label=f"{names[one.filter]}, {axis}")
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    title = f"{names[followed[0].sensor]}, {followed[0].target}"
    ax.set(title=title, xlabel="lag (detections)", ylabel="autocorrelation")
    fig.legend(loc="outside lower center", ncols=2)
    return fig
