"""Figures of the extended and the Schmidt-Kalman filter on one flight and over many."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from wildlab.evaluation.runs import share_interval
from wildlab.reporting.charts.tracks import (
    error_over_time,
    speed_and_course,
    squares_over_time,
    track_map,
    values_over_flights,
)
from wildlab.reporting.figures import GREEN, GREY, INK, colour, new_figure
from wildlab.studies.page import Shown
from wildlab.studies.schmidt.pose_covariances import ORIGINS, curve_table, mean_deviations, predicted_error
from wildlab.studies.schmidt.trial import BOUNDS, COVARIANCES, DEGREES, FILTERS, PUBLISHED, Compared

#: Of the three pose covariances, beside the curve of the first.
_MARKS = {"schmidt": "D", "schmidt-data-sheet": "s", "schmidt-estimated": "o"}


def nees_over_pose_sd(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Median NEES and the share of flights that pass, over the predicted deviation of the attitude."""
    curve, flights = curve_table(runs), len(runs)
    fig, (upper, lower) = new_figure(5.6, 5.4, rows=2, sharex=True)
    sd, share = curve["sd"].to_numpy(float), curve["inside"].to_numpy(float)
    color = colour("schmidt")
    upper.axhspan(*BOUNDS, color=GREEN, alpha=0.12, lw=0)
    upper.axhline(2, color=INK, lw=0.8, ls=(0, (4, 2)))
    upper.fill_between(sd, curve["low"], curve["high"], color=color, alpha=0.25, lw=0)
    upper.plot(sd, curve["median"], color=color, marker=".", label="published covariance, scaled")
    upper.set_yscale("log")
    upper.set_ylabel("mean NEES")
    limits = np.array([share_interval(round(one * flights), flights)[1:] for one in share])
    lower.fill_between(sd, 100 * limits[:, 0], 100 * limits[:, 1], color=color, alpha=0.25, lw=0)
    lower.plot(sd, 100 * share, color=color, marker=".")
    lower.set_ylim(-4, 104)
    lower.set_ylabel("in the band (%)")
    for who in COVARIANCES:
        at = float(np.mean(list(mean_deviations(runs, ORIGINS[who][0]).values())))
        one = predicted_error(runs, who)
        look = {"ls": "none", "marker": _MARKS[who], "mfc": "white", "mec": INK, "ms": 7, "mew": 1.5}
        upper.plot(at, one.median, label=names[who], **look)
        lower.plot(at, 100 * one.inside, **look)
    for ax in (upper, lower):
        ax.axvspan(DEGREES[0], DEGREES[-1], color=GREY, alpha=0.18, lw=0)
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    upper.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    lower.set_xlabel("predicted SD of attitude, mean of roll, pitch and yaw (°)")
    fig.legend(loc="outside lower center", ncols=2)
    return fig


def nees_of_flights(
    runs: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """NEES of every flight, a row for each filter; ``published`` by subject and name."""
    return values_over_flights(
        pd.DataFrame({who: runs[who, "nees"] for who in FILTERS}),
        {who: published[who, "nees"] for who in PUBLISHED},
        names,
        "NEES of the position, mean over a flight",
        band=2,
    )


def flight_figures(compared: Compared, first: int, names: Mapping[str, str]) -> list[Shown]:
    """The flight drawn: counterparts of four figures of H, from 7.``first`` on."""
    seen, tracks, scored, _ = compared
    t = seen.times - seen.times[0]
    states = {who: tracks[who].x[:, :4] for who in PUBLISHED}
    errors = {who: seen.truth[:, :2] - states[who][:, :2] for who in PUBLISHED}
    squares = {
        "NIS": {who: scored[who].nis for who in PUBLISHED},
        "NEES (position)": {who: scored[who].nees for who in PUBLISHED},
    }
    figures = {
        "errors": error_over_time(t, seen.seen, errors, names, ""),
        "map": track_map(seen.truth, states, names, "", measured=seen.positions[seen.seen]),
        "speed": speed_and_course(t, seen.seen, seen.truth, states, names, ""),
        "squares": squares_over_time(t, seen.seen, squares, names, ""),
    }
    return [Shown(fig, text, f"fig-7-{n}") for n, (text, fig) in enumerate(figures.items(), first)]
