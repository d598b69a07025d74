"""Figures of the reports on the Schmidt-Kalman filter, with what their titles and alternative texts say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from wildlab.analysis.track import Sighting
from wildlab.evaluation.consistency import ERROR_CONVENTION, share_inside
from wildlab.evaluation.runs import share_interval
from wildlab.evaluation.track_errors import SLOWEST_M_S
from wildlab.reporting.charts.tracks import (
    error_over_time,
    nees_over_flights,
    speed_and_course,
    squares_over_time,
    track_map,
)
from wildlab.reporting.figures import GREEN, GREY, INK, colour, new_figure
from wildlab.reporting.report import Report
from wildlab.reporting.spread import spread_words
from wildlab.studies.schmidt.headline import ORIGINS, curve_table, curve_words, honesty
from wildlab.studies.schmidt.text import WORDS
from wildlab.studies.schmidt.trial import BOUNDS, COVARIANCES, DEGREES, PUBLISHED, Compared

Array = NDArray[np.float64]
BOTH = {who: WORDS[who] for who in PUBLISHED}
#: Of the three pose covariances, beside the curve of the first.
_MARKS = {"schmidt": "D", "schmidt-data-sheet": "s", "schmidt-estimated": "o"}


def nees_over_pose_sd(
    curve: pd.DataFrame, marks: Mapping[str, tuple[float, float, float]], flights: int, title: str
) -> Figure:
    """Median NEES and the share of flights that pass, over the standard deviation stated of the poses.

    Parameters
    ----------
    curve
        From `wildlab.studies.schmidt.text.curve_table`.
    marks
        By subject: stated deviation (deg), median NEES, share of flights.
    flights
        How many there are.
    """
    fig, (upper, lower) = new_figure(5.6, 5.4, rows=2, sharex=True)
    sd = curve["sd"].to_numpy(float)
    color = colour("schmidt")
    upper.axhspan(*BOUNDS, color=GREEN, alpha=0.12, lw=0)
    upper.axhline(2, color=INK, lw=0.8, ls=(0, (4, 2)))
    upper.fill_between(sd, curve["low"], curve["high"], color=color, alpha=0.25, lw=0)
    upper.plot(sd, curve["median"], color=color, marker=".", label="printed covariance, scaled")
    upper.set_yscale("log")
    upper.set_ylabel("mean NEES")
    share = curve["inside"].to_numpy(float)
    limits = np.array([share_interval(round(one * flights), flights)[1:] for one in share])
    lower.fill_between(sd, 100 * limits[:, 0], 100 * limits[:, 1], color=color, alpha=0.25, lw=0)
    lower.plot(sd, 100 * share, color=color, marker=".")
    lower.set_ylim(-4, 104)
    lower.set_ylabel("in the band (%)")
    for who, (at, nees, inside) in marks.items():
        look = {"ls": "none", "marker": _MARKS[who], "mfc": "white", "mec": INK, "ms": 7, "mew": 1.5}
        upper.plot(at, nees, label=ORIGINS[who][0], **look)
        lower.plot(at, 100 * inside, **look)
    for ax in (upper, lower):
        ax.axvspan(DEGREES[0], DEGREES[-1], color=GREY, alpha=0.18, lw=0)
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    upper.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    lower.set_xlabel("stated SD of attitude, mean of roll, pitch and yaw (°)")
    upper.set_title(title)
    fig.legend(loc="outside lower center", ncols=2)
    return fig


def marks_of(spread: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Where the three pose covariances stand: stated deviation (deg), median NEES, share of flights."""
    marks = {}
    for who in COVARIANCES:
        source, one = ORIGINS[who][1], honesty(spread, who)
        sd = np.mean([spread[source, f"mean_sd_{axis}"].mean() for axis in ("roll", "pitch", "yaw")])
        marks[who] = (float(sd), one.median, one.inside)
    return marks


def show_curve(report: Report, spread: pd.DataFrame) -> None:
    """The curve over the poses' standard deviation, and what it says."""
    curve, marks = curve_table(spread), marks_of(spread)
    band = spread_words(len(spread)).key
    title, points = curve_words(spread)
    along = "; ".join(
        f"{row['sd']:.2f}°: NEES {row['median']:.2g}, {100 * row['inside']:.0f} %"
        for row in curve.to_dict("records")
    )
    apart = "; ".join(
        f"{ORIGINS[who][0]}, {sd:.2g}°: NEES {nees:.2g}, {100 * share:.0f} %"
        for who, (sd, nees, share) in marks.items()
    )
    report.figure(
        nees_over_pose_sd(curve, marks, len(spread), title),
        name="nees-over-pose-sd",
        alt="Median NEES and share of flights within the band of single values, over the stated standard "
        f"deviation of the attitude. {title}. {along}. Beside the curve: {apart}.",
        caption=f"{len(spread)} flights. Above: median{f', shaded: {band}' if band else ''}; green: "
        "bounds of single values; dashed: two. Below: flights whose average lies between these bounds, with "
        f"the share's 95 % interval. Grey: the {DEGREES[0]:g} to {DEGREES[-1]:g}° of H 7.5.4.",
    )
    report.points(points)


def show_flights(report: Report, spread: pd.DataFrame, published: Mapping[tuple[str, str], float]) -> None:
    """NEES of every flight by filter."""
    share = {who: 100 * share_inside(spread[who, "nees"], BOUNDS) for who in WORDS}
    middle = {who: spread[who, "nees"].median() for who in WORDS}
    report.figure(
        nees_over_flights(
            pd.DataFrame({who: spread[who, "nees"] for who in WORDS}),
            {who: published[who, "nees"] for who in PUBLISHED},
            WORDS,
            f"Flights within the band of single values:\nSchmidt {share['schmidt']:.0f} %, extended "
            f"{share['ekf']:.0f} %",
        ),
        name="nees-over-flights",
        alt=f"Mean NEES of {len(spread)} flights on a logarithmic axis, a row for each filter. Medians: "
        + ", ".join(f"{WORDS[who]} {middle[who]:.1f} ({share[who]:.0f} % within)" for who in WORDS)
        + ".",
        caption="A dot is a flight, the stroke their median; green: 95 % bounds of single values, the "
        "the lenient band; hollow diamonds: published.",
    )


def show_drawn(report: Report, compared: Compared, first: int) -> None:
    """The flight drawn: counterparts of four figures of H, from 7.``first`` on."""
    seen, tracks, scored, _ = compared
    t = seen.times - seen.times[0]
    states = {who: tracks[who].x[:, :4] for who in PUBLISHED}
    numbers = {who: scored[who].numbers for who in PUBLISHED}
    errors = {who: seen.truth[:, :2] - states[who][:, :2] for who in PUBLISHED}
    words = drawn_words(numbers, errors)
    nis = {who: scored[who].nis for who in PUBLISHED}
    nees = {who: scored[who].nees for who in PUBLISHED}
    figures = {
        "errors": error_over_time(t, seen.seen, errors, BOTH, words["errors"][0]),
        "map": _map(seen, states, words["map"][0]),
        "speed": speed_and_course(t, seen.seen, seen.truth, states, BOTH, words["speed"][0]),
        "squares": squares_over_time(
            t, seen.seen, {"NIS": nis, "NEES (position)": nees}, BOTH, words["squares"][0]
        ),
    }
    captions = {
        "errors": f"Errors are {ERROR_CONVENTION}; strokes below: detections.",
        "map": "Local metres. The truth is a GPS receiver's on board the vessel.",
        "speed": f"Black: the receiver's positions ten seconds apart; no course below {SLOWEST_M_S:g} m/s.",
        "squares": f"NIS at every detection, NEES at every frame; errors are {ERROR_CONVENTION}.",
    }
    for number, (name, figure) in enumerate(figures.items(), first):
        report.figure(
            figure,
            name=f"fig-7-{number}",
            alt=words[name][1],
            caption=f"{captions[name]} Counterpart of H figure 7.{number}.",
        )


def _map(seen: Sighting, states: Mapping[str, Array], title: str) -> Figure:
    return track_map(seen.truth, states, BOTH, title, measured=seen.positions[seen.seen])


def drawn_words(
    numbers: Mapping[str, Mapping[str, float]], errors: Mapping[str, Array]
) -> dict[str, tuple[str, str]]:
    """Title and alternative text of each figure of the flight drawn.

    Parameters
    ----------
    numbers
        By filter what `wildlab.studies.schmidt.trial.evaluate` gives; courses in radians.
    errors
        By filter (N, 2), m.
    """

    def of(name: str, factor: float = 1.0) -> tuple[Any, Any]:
        return tuple(factor * numbers[who][name] for who in ("ekf", "schmidt"))  # type: ignore[return-value]

    (mae, mae_s), (speed, speed_s) = of("mae"), of("rmse_speed")
    (course, course_s), (time, time_s) = of("rmse_course", 180 / np.pi), of("fraction_nees_inside", 100)
    far, far_s = (float(np.nanmax(np.hypot(*errors[who].T))) for who in ("ekf", "schmidt"))
    return {
        "errors": (
            f"Mean error: extended {mae:.1f} m, Schmidt {mae_s:.1f} m",
            f"Position errors north and east over time. Extended filter {mae:.1f} m on average and "
            f"{far:.0f} m at most, Schmidt filter {mae_s:.1f} m and {far_s:.0f} m.",
        ),
        "map": (
            f"At most {far:.0f} m (extended) and {far_s:.0f} m (Schmidt) off",
            "Map of the true path, the tracks of both filters and the positions of single images, in local "
            f"metres. The extended filter is {far:.0f} m off at most, the Schmidt filter {far_s:.0f} m.",
        ),
        "speed": (
            f"RMS error: extended {speed:.2f} m/s and {course:.0f}°,\nSchmidt {speed_s:.2f} m/s and "
            f"{course_s:.0f}°",
            "Speed and course over time of the truth and both filters. RMS errors: extended "
            f"{speed:.2f} m/s and {course:.0f} degrees, Schmidt {speed_s:.2f} m/s and {course_s:.0f} "
            "degrees.",
        ),
        "squares": (
            f"Time with NEES within the band:\nextended {time:.0f} %, Schmidt {time_s:.0f} %",
            "NIS and NEES over time on logarithmic axes. NEES within the 95 % band: extended filter "
            f"{time:.0f} % of the time, Schmidt filter {time_s:.0f} %.",
        ),
    }
