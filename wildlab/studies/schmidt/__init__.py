"""The extended and the Schmidt-Kalman filter with one tuning on three flights: H 7.3, 7.4, 7.5.3, 7.5.4."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.navigate import SETTLING_S
from wildlab.evaluation.consistency import Average, average, chi_square_interval, share_inside
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.shares import Check, columns_of
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import finish, new_strips
from wildlab.reporting.charts.forms import Values, draw_lines, plain_numbers
from wildlab.reporting.charts.tracks import (
    error_over_time,
    speed_and_course,
    squares_over_time,
    track_map,
    values_over_flights,
)
from wildlab.reporting.figures import GREEN, GREY, INK, colour
from wildlab.reporting.published import bounds_of
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study
from wildlab.studies.schmidt import trial
from wildlab.studies.schmidt.trial import (
    BOUNDS,
    COVARIANCES,
    CURVE,
    DEGREES,
    ESTIMATED,
    FACTORS,
    FILTERS,
    METRES,
    MORE_NAMES,
    NAMES,
    PUBLISHED,
    SHEET,
    SOURCE,
    SUBJECTS,
    TUNING,
    Compared,
    constant,
)

#: Whose deviations are predicted, and whose poses' errors these are to match.
ORIGINS = {
    "schmidt": (SOURCE, SOURCE),
    "schmidt-data-sheet": (SHEET, SHEET),
    "schmidt-estimated": (ESTIMATED, SOURCE),
}
ANGLES = ("roll", "pitch", "yaw")


class PredictedError(NamedTuple):
    """How well a filter's predicted and true errors match over flights.

    ``median`` of the flights' average NEES; ``drawn``, the mean of one value of each flight with the interval
    of a consistent filter's; ``inside``, the share of flights whose average lies within the bounds of single
    values.
    """

    median: float
    drawn: Average
    inside: float

    @property
    def ratio(self) -> float:
        """How many times as large as predicted errors are on the median flight."""
        return float(np.sqrt(self.median / 2))


def predicted_error(runs: pd.DataFrame, who: str) -> PredictedError:
    """`PredictedError` of a filter over flights, one row each."""
    values = runs[who, "nees"]
    drawn = average(runs[who, "nees_drawn"].to_numpy(float), 2)
    return PredictedError(float(values.median()), drawn, share_inside(values, BOUNDS))


def more_metrics(runs: pd.DataFrame) -> list[tuple[str, str, float]]:
    """Name, subject and value of what is recorded of every filter besides the medians of its numbers."""
    found = {who: predicted_error(runs, who) for who in SUBJECTS}
    return [("mean_of_drawn_nees", who, one.drawn.mean) for who, one in found.items()] + [
        ("error_over_stated", who, one.ratio) for who, one in found.items()
    ]


def mean_deviations(runs: pd.DataFrame, source: str, what: str = "mean_sd") -> dict[str, float]:
    """Mean over the flights of each angle's predicted deviation, or its ``rms`` error, deg."""
    return {axis: float(runs[source, f"{what}_{axis}"].mean()) for axis in ANGLES}


def covariances_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each pose covariance: predicted deviations and true errors (deg), and `PredictedError`."""
    rows = []
    for who in COVARIANCES:
        predicted, true = ORIGINS[who]
        one = predicted_error(runs, who)
        rows.append(
            {
                "who": who,
                **{f"sd_{axis}": value for axis, value in mean_deviations(runs, predicted).items()},
                **{f"rms_{axis}": value for axis, value in mean_deviations(runs, true, "rms").items()},
                "median": one.median,
                "drawn": one.drawn.mean,
                "low": one.drawn.low,
                "high": one.drawn.high,
                "inside": 100 * one.inside,
            }
        )
    return pd.DataFrame(rows)


def filters_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Medians over flights, a row for each filter, with the share of flights within the bounds."""
    columns = ("nees", "nees_predicted", "nis", "mae", "rmse_speed", "rmse_course")
    return pd.DataFrame(
        [
            {"filter": names[who], "inside": 100 * share_inside(runs[who, "nees"], BOUNDS)}
            | {name: float(runs[who, name].median()) for name in columns}
            for who in FILTERS
        ]
    )


def tables(runs: pd.DataFrame, names: Mapping[str, str]) -> dict[str, pd.DataFrame]:
    """Both tables of the page, by the key of their texts."""
    covariances = covariances_table(runs)
    covariances["who"] = covariances["who"].map(names)
    return {"covariances": covariances, "filters": filters_table(runs, names)}


def curve_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each factor on the poses' deviations: ``sd`` (deg, mean of the angles), ``median``,
    ``inside``, and ``low`` and ``high`` of the flights' NEES (`bounds_of`)."""
    one = float(np.mean(list(mean_deviations(runs, SOURCE).values())))
    found = [predicted_error(runs, who) for who in CURVE]
    bounds = [bounds_of(runs[who, "nees"]) for who in CURVE]
    return pd.DataFrame(
        {
            "sd": one * np.array(FACTORS),
            "median": [each.median for each in found],
            "low": [low for low, _ in bounds],
            "high": [high for _, high in bounds],
            "inside": [each.inside for each in found],
        }
    )


Flags = NDArray[np.bool_]

#: Of the time: an airframe turns, and flies straight, in a part that one can speak of.
PART = 0.1
#: An airframe crabs from this angle on, deg; above what tells heading and course apart at all.
CRAB_DEG = 5.0


class Band(NamedTuple):
    """(N,) averages, and the 95 % band (N,) of what a consistent filter's would be."""

    mean: Array
    low: Array
    high: Array

    @property
    def above(self) -> Flags:
        """Which averages are above."""
        return np.asarray(self.mean > self.high)

    @property
    def below(self) -> Flags:
        """Which are below."""
        return np.asarray(self.mean < self.low)

    @property
    def inside(self) -> Flags:
        """Which are neither, and known."""
        return np.asarray((self.mean >= self.low) & (self.mean <= self.high))


def band(spread: pd.DataFrame, who: str, what: str = "nees") -> Band:
    """The time averages of a filter's NEES or NIS on each flight, and their band."""
    worth = np.maximum(spread[who, f"{what}_worth"].to_numpy(float), 1.0)
    limits = np.array([chi_square_interval(2, runs=one) for one in worth])
    return Band(spread[who, what].to_numpy(float), limits[:, 0], limits[:, 1])


def apart(one: ArrayLike, other: ArrayLike) -> Array:
    """By which share of the smaller two positive numbers differ."""
    a, b = np.asarray(one, float), np.asarray(other, float)
    return np.asarray(np.maximum(a, b) / np.minimum(a, b) - 1)


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What every flight gives for each claim, by the claim's id; a study asks for its own.

    Parameters
    ----------
    spread
        What `trial.summarise` gives, one row for each flight.
    """

    of = columns_of(spread)

    def smaller(second: str, first: str, name: str, unit: str, premise: Flags | None) -> Check:
        """True where ``second`` has less of it than ``first``."""
        return Check.larger(of(first, name), of(second, name), unit, premise)

    def pose(name: str) -> Array:
        return of(SOURCE, name)

    ekf, schmidt, noisier = (band(spread, who) for who in ("ekf", "schmidt", "ekf-60-pixels"))
    nis = {who: band(spread, who, "nis") for who in ("ekf", "schmidt")}
    size = {who: np.hypot(of(who, "mean_north"), of(who, "mean_east")) for who in ("ekf", "schmidt")}
    # What the poses move the target by in the image, against what 30 white pixels leave of a period's mean.
    periods = of("flight", "pauses") + 1
    off = pose("shift_px") > TUNING.pixel / np.sqrt(of("flight", "detections") / periods)
    paused, turning = of("flight", "pauses") >= 1, of("flight", "turning")
    turns = (turning >= PART) & (turning <= 1 - PART)
    moves, drifts = of("flight", "moving") > 0.5, off & paused
    settled = of("flight", "settled") > SETTLING_S
    # Where nothing falls two deviations off, no innovation covariance about the pixel noise is too small.
    far = pose("largest_shift_px") > 2 * TUNING.pixel
    off_yaw, off_others = (
        pose("difference_yaw"),
        np.maximum(pose("difference_roll"), pose("difference_pitch")),
    )
    out_yaw, out_others = pose("outside_yaw"), np.maximum(pose("outside_roll"), pose("outside_pitch"))
    without, half, full = (of(constant(DEGREES[1], metres), "nees") for metres in (0.0, *METRES))
    inside = {who: of(who, "fraction_nees_inside") for who in ("ekf", "schmidt")}
    degrees = [of(constant(one), "fraction_nees_inside") for one in (DEGREES[0], DEGREES[-1])]
    difference = np.maximum(
        apart(of("schmidt-attitude-only", "nees"), schmidt.mean),
        apart(of("schmidt-position-only", "nees"), ekf.mean),
    )
    return {
        # NEES, on average
        "schmidt-nees-inside": Check(true=schmidt.inside),
        "ekf-nees-above": Check(true=ekf.above, premise=off),
        "schmidt-pessimistic": Check(true=schmidt.below),
        "ekf-needs-more-noise": Check(true=ekf.above & ~noisier.above & np.isfinite(noisier.mean)),
        "attitude-makes-the-difference": Check(true=ekf.mean > 2 * schmidt.mean, measured=difference),
        "position-negligible-below": Check(measured=apart(without, half), premise=off),
        "position-matters-from": Check(measured=apart(without, full), above=True, premise=off),
        "schmidt-fits": Check(true=schmidt.inside & nis["schmidt"].inside),
        # NEES, single values
        "ekf-overconfident-between": Check(
            measured=of("ekf", "fraction_above_predicted"), above=True, premise=drifts, reach=(0, 1)
        ),
        "ekf-overconfident-in-every-pause": Check(true=of("ekf", "pauses_above") == 1, premise=drifts),
        "schmidt-inside-mostly": Check(measured=1 - inside["schmidt"]),
        "ekf-hardly-inside": Check(measured=inside["ekf"], premise=off),
        "one-to-two-degrees": Check(measured=1 - np.minimum(*degrees)),
        # Errors
        "schmidt-more-accurate": smaller("schmidt", "ekf", "mae", "m", off),
        "accuracy-comparable": Check(measured=apart(of("schmidt", "mae"), of("ekf", "mae")), premise=off),
        "schmidt-mean-error-smaller": Check.larger(size["ekf"], size["schmidt"], "m", off),
        "ekf-mean-error-smaller": Check.larger(size["schmidt"], size["ekf"], "m", off),
        "ekf-drifts-more": smaller("schmidt", "ekf", "mae_predicted", "m", drifts),
        "ekf-drifts-more-at-first": smaller("schmidt", "ekf", "mae_first_pause", "m", drifts),
        "schmidt-oscillates-less": smaller("schmidt", "ekf", "oscillation", "m", off & turns),
        "speed-better": smaller("schmidt", "ekf", "rmse_speed", "m/s", off),
        "speed-better-at-first": smaller("schmidt", "ekf", "rmse_speed_start", "m/s", drifts),
        "schmidt-speed-lower": smaller("schmidt", "ekf", "mean_speed", "m/s", off),
        "course-better": smaller("schmidt", "ekf", "rmse_course", "deg", off & moves),
        "course-better-at-first": smaller("schmidt", "ekf", "rmse_course_start", "deg", drifts & moves),
        # NIS
        "nis-similar": Check(measured=apart(nis["ekf"].mean, nis["schmidt"].mean)),
        "nis-differs": Check(measured=apart(nis["ekf"].mean, nis["schmidt"].mean), above=True, premise=off),
        "nis-small": Check(measured=np.maximum(nis["ekf"].mean, nis["schmidt"].mean)),
        "nis-mean-inside": Check(true=nis["ekf"].inside & nis["schmidt"].inside),
        "nis-inside": Check(
            measured=1 - np.minimum(of("ekf", "fraction_nis_inside"), of("schmidt", "fraction_nis_inside"))
        ),
        "schmidt-nis-inside-mostly": Check(measured=1 - of("schmidt", "fraction_nis_inside")),
        "nis-of-ekf-larger": smaller("schmidt", "ekf", "nis", "", off),
        "ekf-nis-too-large": Check(measured=of("ekf", "fraction_nis_above"), above=True, premise=far),
        "high-nis-after-pauses": Check(
            measured=np.minimum(of("ekf", "nis_top_after_pauses"), of("schmidt", "nis_top_after_pauses")),
            above=True,
            premise=of("flight", "pauses") >= 2,
            reach=(0, 1),
        ),
        # The poses
        "covariance-constant": Check(measured=pose("sd_spread"), premise=settled),
        "yaw-errors-largest": Check.larger(off_yaw, off_others, "deg"),
        "yaw-errors-outside": Check(
            true=out_yaw > out_others,
            premise=of("flight", "crab") > CRAB_DEG,
            first=100 * out_yaw,
            second=100 * out_others,
            unit="%",
        ),
        "largest-errors-in-turns": Check.larger(
            pose("difference_turning"), pose("difference_straight"), "deg", turns
        ),
    }  # fmt: skip


#: Of the three pose covariances, beside the curve of the first.
_MARKS = {"schmidt": "D", "schmidt-data-sheet": "s", "schmidt-estimated": "o"}


def nees_over_pose_sd(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Median NEES and the share of flights that pass, over the predicted deviation of the attitude."""
    curve, flights = curve_table(runs), len(runs)
    fig, (upper, lower) = new_strips(2, 5.4, 5.6)
    sd, share, color = curve["sd"], curve["inside"], colour("schmidt")
    upper.axhspan(*BOUNDS, color=GREEN, alpha=0.12, lw=0)
    upper.axhline(2, color=INK, lw=0.8, ls=(0, (4, 2)))
    line = Values(curve["median"], curve[["low", "high"]].T, color, ".-")
    draw_lines(upper, sd, {"published covariance, scaled": line})
    upper.set_yscale("log")
    limits = np.array([share_interval(round(one * flights), flights)[1:] for one in share])
    draw_lines(lower, sd, {"": Values(100 * share, 100 * limits.T, color, ".-")})
    lower.set(ylim=(-4, 104), ylabel="in the band (%)")
    for who in COVARIANCES:
        at = float(np.mean(list(mean_deviations(runs, ORIGINS[who][0]).values())))
        one = predicted_error(runs, who)
        look: dict[str, Any] = {
            "ls": "none",
            "marker": _MARKS[who],
            "mfc": "white",
            "mec": INK,
            "ms": 7,
            "mew": 1.5,
        }
        upper.plot(at, one.median, label=names[who], **look)
        lower.plot(at, 100 * one.inside, **look)
    for ax in (upper, lower):
        ax.axvspan(DEGREES[0], DEGREES[-1], color=GREY, alpha=0.18, lw=0)
        ax.set_xscale("log")
        plain_numbers(ax.xaxis)
    plain_numbers(upper.yaxis)
    return finish(fig, "", "predicted SD of attitude, mean of roll, pitch and yaw (°)", "mean NEES")


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


_SHARES = ("outside", "sd_spread", "turning", "moving", "detections", "pauses")
#: Errors this many times as large as predicted, or less, are called nearly as predicted.
NEARLY = 1.5


def unit_of(name: str) -> str:
    """The unit of a number of the trial; those that `NAMES` has not are of poses and of the flight."""
    known = NAMES | MORE_NAMES
    if name in known:
        return known[name]
    if name.endswith("_px"):
        return "px"
    if name == "settled":
        return "s"
    if name.startswith(_SHARES):
        return "1"
    return "m" if name.endswith(("north", "east", "down")) else "deg"


def consistency_of(facts: Facts, who: str) -> str:
    """What one moment of each flight says of a filter, as the end of a text's key."""
    mean, flights = facts.value(who, "mean_of_drawn_nees"), facts.value(who, "mean_of_drawn_nees", "n")
    if math.isnan(mean) or math.isnan(flights):
        return "unknown"
    low, high = chi_square_interval(2, runs=int(flights))
    if low <= mean <= high:
        # So few flights that errors `NEARLY` times as large, or as small, would not show decide nothing.
        return "consistent" if math.sqrt(low / 2) > 1 / NEARLY and math.sqrt(high / 2) < NEARLY else "few"
    if 1 / NEARLY < math.sqrt(mean / 2) < NEARLY:
        return "nearly"
    return "overconfident" if mean > high else "conservative"


def answer(facts: Facts) -> list[str]:
    """The Schmidt filter with poses as a calibration flight gave them, then the extended filter."""
    return [
        f"schmidt-{consistency_of(facts, 'schmidt-estimated')}",
        f"ekf-{consistency_of(facts, 'ekf')}",
    ]


STUDY = Study("schmidt", trial.trial, check_claims, unit_of, answer)
