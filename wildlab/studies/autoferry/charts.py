"""Figures of a report on boats followed by several sensors: maps, NEES over time, innovations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from wildlab.analysis.following.sensor_tracks import FILTERS, SensorTrack
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
from wildlab.studies.autoferry.comparison import IDEAL, stays
from wildlab.studies.autoferry.text import FILTER_WORDS, SENSOR_WORDS, map_counts, nees_title, signed

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]

SENSOR_COLOURS = {"lidar": BLUE, "radar": VERMILLION, "ir": PURPLE, "eo": GREEN}
#: Metres beyond the targets' ways that a map shows.
MARGIN_M = 40.0
#: Lags of the innovations shown, detections.
LAGS = 20


def on_maps(fixed: str) -> dict[str, str]:
    """The filter that a map shows of each kind of detection: the fixed one, or white where it has none."""
    return {kind: fixed if fixed in names else names[0] for kind, names in FILTERS.items()}


def map_shown(
    case: str, flight: Flight, followed: Sequence[SensorTrack], tracks: pd.DataFrame, fixed: str
) -> Shown:
    """The map of a flight, with how many of its tracks stay with their boat."""
    drawn = on_maps(fixed)
    counts = map_counts(case, tracks, drawn)
    words = case.replace("-", " ").capitalize()
    filters = "; ".join(f"{kind}s: {FILTER_WORDS[name]}" for kind, name in drawn.items())
    mine = [one for one in followed if one.filter in drawn.values()]
    lines = counts.split(", ")
    split = ",\n".join(", ".join(lines[i : i + 2]) for i in range(0, len(lines), 2))
    return (
        track_map(flight, mine, f"{words}: tracks that stay\n{split}"),
        f"map-{case}",
        f"Map of {case}: the ways of the boats and the platform, and the track of each boat by each sensor. "
        f"Tracks that stay with their boat: {counts}.",
        f"Shown of {filters}. Tracks that leave the surroundings are cut off.",
    )


def nees_shown(sensor: str, followed: Sequence[SensorTrack], tracks: pd.DataFrame) -> Shown:
    """NEES over time of one boat by one sensor, with how much of the time it is inside the band.

    ``tracks`` are the rows of that boat and sensor.
    """
    share = tracks.set_index("filter")["fraction_nees_inside"]
    n = tracks.set_index("filter")["compared"]
    inside = ", ".join(
        f"{FILTER_WORDS[one.filter]} {100 * share[one.filter]:.0f} % of {n[one.filter]} scans"
        for one in followed
    )
    words = SENSOR_WORDS.get(sensor, sensor)
    best = " and ".join(FILTER_WORDS[str(name)] for name in share.index[share == share.max()])
    said = f"most often inside is {best}" if best else "no track"
    if best and not stays(tracks).any():
        said = f"no track stays;\nmost often inside is {best}"
    return (
        nees_chart(followed, f"{words.capitalize()}: {said}"),
        f"nees-{sensor}",
        f"NEES over time by {words} on a logarithmic axis. Time inside the 95 percent band: {inside}.",
        f"Inside the band: {inside}. H draws its own flights so in figures 7.6 and 7.21.",
    )


def innovations_shown(sensor: str, followed: Sequence[SensorTrack], tracks: pd.DataFrame) -> Shown:
    """Autocorrelation of the innovations with white noise assumed, and differenced; arguments as above."""
    pair = [one for one in followed if one.filter in ("kf", "coloured")]
    axes = tracks.set_index("filter")[["lag1_autocorrelation_north", "lag1_autocorrelation_east"]]
    far = {one.filter: max(axes.loc[one.filter], key=abs) for one in pair}
    words = SENSOR_WORDS.get(sensor, sensor)
    before, after = (signed(far[name]) for name in ("kf", "coloured"))
    title = f"{words.capitalize()}: {before} at lag one, differenced {after}"
    return (
        innovations_chart(pair, title),
        f"innovations-{sensor}",
        f"Autocorrelation of the innovations by {words}, white noise assumed and differenced, over {LAGS} "
        "lags, with the band of white noise.",
        "In the title: the axis with the larger value at lag one. Grey: where white noise stays with 95 %. "
        "H draws its own flights so in figures 7.7 and 7.12.",
    )


def mean_nees_shown(tracks: pd.DataFrame, found: pd.DataFrame, fixed: str) -> Shown:
    """The mean NEES of every track by sensor and filter, with what is ideal; lost tracks are hollow.

    ``found`` are the outcomes of the filter held fixed, of the sensors that are of use.
    """
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
        ends.append(((left + place - 1) / 2, SENSOR_WORDS.get(str(sensor), str(sensor)).replace(" ", "\n")))
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
    for words in dict.fromkeys(FILTER_WORDS.values()):
        name = next(key for key, value in FILTER_WORDS.items() if value == words)
        ax.plot([], [], "o", color=colour(name), ms=5, label=words)
    ax.plot([], [], "o", mec=GREY, mfc="white", ms=5, label="lost")
    fig.legend(loc="outside lower center", ncols=5)
    title = nees_title(found, fixed)
    ax.set_title(title)
    lost = int((~stays(known)).sum())
    return (
        fig,
        "mean-nees",
        "Mean NEES of every track on a logarithmic axis by sensor and filter, beside the ideal of two; "
        f"{lost} of {len(known)} are of lost tracks. {title.replace(chr(10), ' ')}.",
        f"One dot for each boat and scenario; {lost} of {len(known)} hollow: lost. White noise: blue for "
        "positions, vermillion for bearings.",
    )


def track_map(flight: Flight, followed: Sequence[SensorTrack], title: str) -> Figure:
    """Ways of the boats (black), of the platform (grey) and of each sensor's tracks, in local metres."""
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
        label = SENSOR_WORDS.get(one.sensor, one.sensor)
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
    ax.set_title(title)
    fig.legend(loc="outside lower center", ncols=4)
    map_axes(ax)
    return fig


def nees_chart(followed: Sequence[SensorTrack], title: str) -> Figure:
    """NEES of the position over time on a logarithmic axis, one line for each filter, with the 95 % band."""
    fig, ax = new_figure(5.6, 3.6)
    for one in followed:
        ax.plot(one.times, one.nees, color=colour(one.filter), lw=1.3, label=FILTER_WORDS[one.filter])
    log_band(ax, *chi_square_interval(2))
    values = np.concatenate([one.nees[np.isfinite(one.nees)] for one in followed])
    if len(values):
        # Down to below the band, whose name stands under it.
        ax.set_ylim(np.clip(0.5 * values.min(), 1e-3, 0.02), 2 * max(values.max(), 10.0))
    ax.set(title=title, xlabel="time (s)", ylabel="NEES of the position")
    fig.legend(loc="outside lower center", ncols=4)
    return fig


def innovations_chart(followed: Sequence[SensorTrack], title: str) -> Figure:
    """Autocorrelation of the innovations, north solid and east dashed, with the band of white noise."""
    fig, ax = new_figure(5.6, 3.6)
    bound = 0.0
    for one in followed:
        white = innovation_whiteness(one.innovation, LAGS)
        bound = max(bound, white.bound)
        for values, style, axis in zip(white.autocorrelation, ("-", "--"), ("north", "east"), strict=True):
            ax.plot(values, style, color=colour(one.filter), label=f"{FILTER_WORDS[one.filter]}, {axis}")
    ax.axhspan(-bound, bound, color=GREY, alpha=0.18, lw=0)
    ax.set(title=title, xlabel="lag (detections)", ylabel="autocorrelation")
    fig.legend(loc="outside lower center", ncols=2)
    return fig
