"""Parts of a report on tracks of one target: figures of the flight drawn, and numbers over many flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.track import Sighting
from wildlab.evaluation.consistency import ERROR_CONVENTION, chi_square_interval
from wildlab.evaluation.whiteness import Whiteness, innovation_whiteness
from wildlab.reporting.charts.tracks import (
    GAP_S,
    error_over_time,
    innovation_correlations,
    speed_and_course,
    squares_over_time,
    track_map,
)
from wildlab.reporting.report import Report
from wildlab.studies import monte_carlo
from wildlab.studies.linear_vs_nonlinear.trial import ScoredTrack

Array = NDArray[np.float64]

#: Lags of the autocorrelations, in detections: eight seconds of uninterrupted images.
LAGS = 60
#: Words for a legend; a track without one goes by its own name.
NAMES = {
    "kf": "KF, on the ground",
    "ekf": "EKF, on pixels",
    "ukf": "UKF, on pixels",
    "imm": "IMM, on pixels",
    "cv": "constant velocity",
    "singer": "Singer",
    "coloured": "differenced",
    "schmidt": "Schmidt",
}
#: Words for the numbers in a table.
QUANTITIES = {
    "mean north": "mean error north (m)",
    "mean east": "mean error east (m)",
    "mean error": "mean distance (m)",
    "mae georeferenced": "mean distance (m)",
    "nees": "mean NEES",
    "nis": "mean NIS",
}
#: What is said wherever NEES or mean errors stand.
CONVENTIONS = (
    f"Errors here are {ERROR_CONVENTION}; the thesis does not print which way round its mean errors are, so "
    "that their signs cannot be compared. The truth is the target's own single-frequency GPS receiver, as in "
    "the thesis: its error counts as the filter's. NEES is that of the position alone."
)


def published_columns(n: int) -> dict[str, str]:
    """As `wildlab.studies.monte_carlo.published_columns`, for tracks."""
    return monte_carlo.published_columns(n) | {"subject": "filter", "quantity": "quantity"}


def name_of(subject: str) -> str:
    """What a legend calls a track."""
    return NAMES.get(subject, subject)


def names_of(subjects: Iterable[str]) -> dict[str, str]:
    """What a legend calls each of several tracks."""
    return {subject: name_of(subject) for subject in subjects}


def beside_published(
    report: Report, spread: pd.DataFrame, subjects: Sequence[str], names: Sequence[str]
) -> pd.DataFrame:
    """As `wildlab.studies.monte_carlo.beside_published`, in words for tracks."""
    table = monte_carlo.beside_published(report, spread, names_of(subjects), names)
    name, comma, size = (table["quantity"].str.partition(",")[column] for column in range(3))
    return table.assign(quantity=name.replace(QUANTITIES) + comma + size)


def list_numbers(values: Sequence[float], decimals: int = 1) -> str:
    """ "12.8 and 13.0"."""
    words = [f"{value:.{decimals}f}".replace("-", "−") for value in values]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def periods(seen: Sighting) -> int:
    """How many periods with detections there are, `GAP_S` apart or more."""
    return int((np.diff(seen.times[seen.seen]) > GAP_S).sum()) + 1


def on_rows(seen: Sighting, followed: ScoredTrack) -> Array:
    """(N,) NIS at the frames of a sighting, also of a filter that went over its detections alone."""
    nis = followed.scored.nis
    if len(nis) == len(seen.times):
        return nis
    result = np.full(len(seen.times), np.nan)
    result[seen.seen] = nis
    return result


def whiteness_of(followed: ScoredTrack) -> Whiteness:
    """Of a track's innovations, over `LAGS`."""
    return innovation_whiteness(followed.track.innovation, LAGS)


def show_paths(
    report: Report, seen: Sighting, followed: Mapping[str, ScoredTrack], figures: Mapping[str, str]
) -> None:
    """The paths of aircraft and target, and the tracks beside the truth.

    ``figures`` has the number of the thesis's figure for ``paths``, ``tracks``, ``error``, ``speed``,
    ``squares`` and ``correlation``, as ``"6-05"``; what it has not is not drawn.
    """
    share = 100 * seen.seen.mean()
    states = {who: one.track.x for who, one in followed.items()}
    first, *others = [x[:, :2] for x in states.values()]
    apart = [float(np.nanmean(np.hypot(*(other - first).T))) for other in others]
    names = names_of(followed)
    called = list(names.values())
    report.figure(
        track_map(
            seen.truth,
            {},
            {},
            f"Seen {share:.0f} % of the time, in {periods(seen)} periods",
            measured=seen.positions,
            aircraft=seen.poses.p_nc,
        ),
        **_named(
            figures["paths"],
            "Map with the aircraft's path, the target's path and the georeferenced detections near it.",
            "Path of the aircraft, path of the target, and the detections placed on the ground.",
        ),
    )
    report.figure(
        track_map(
            seen.truth,
            states,
            names,
            f"Tracks {list_numbers(apart)} m from {called[0]}"
            if len(apart) > 1
            else f"The tracks are {apart[0]:.1f} m apart on average",
            measured=seen.positions,
        ),
        **_named(
            figures["tracks"],
            f"Map of the tracks by {list_words(called)} beside the target's true path, with the detections.",
            f"Tracks by {list_words(called)}; dots: detections on the ground; dashed: the target's GPS.",
        ),
    )


def show_errors(
    report: Report, seen: Sighting, followed: Mapping[str, ScoredTrack], figures: Mapping[str, str]
) -> None:
    """Errors in position over time, and speed and course; ``figures`` as in `show_paths`."""
    times, names = seen.times - seen.times[0], names_of(followed)
    errors = {who: np.hypot(*(seen.truth - one.track.x[:, :4])[:, :2].T) for who, one in followed.items()}
    means = [one.scored.numbers["mae"] for one in followed.values()]
    at_end = [float(e[np.isfinite(e)][-1]) for e in errors.values()]
    report.figure(
        error_over_time(
            times,
            seen.seen,
            errors,
            names,
            f"{list_numbers(means)} m off on average",
            measured=np.hypot(*(seen.truth[:, :2] - seen.positions).T),
        ),
        **_named(
            figures["error"],
            f"Distance of each track from the truth over time; at the end {list_numbers(at_end)} metres.",
            f"Distance from the truth; at the end {list_numbers(at_end)} m. Strokes at the bottom: "
            "frames with a detection; grey: no detections.",
        ),
    )
    speeds = [one.scored.numbers["rmse_speed"] for one in followed.values()]
    name = figures.get("speed", "")
    report.figure(
        speed_and_course(
            times,
            seen.seen,
            seen.truth,
            {who: one.track.x[:, :4] for who, one in followed.items()},
            names,
            f"Speed {list_numbers(speeds, 2)} m/s off (RMS)",
        ),
        **_named(
            name,
            "Estimated speed and course of each track over time beside those of the target's GPS.",
            "Speed and course; dashed: from the target's GPS positions over ten seconds; grey: no "
            "detections. Courses below 0.2 m/s are left out.",
            "speed-and-course",
        ),
    )


def show_consistency(
    report: Report, seen: Sighting, followed: Mapping[str, ScoredTrack], figures: Mapping[str, str]
) -> None:
    """NEES and NIS over time with the 95 % band; ``figures`` as in `show_paths`."""
    times, bounds = seen.times - seen.times[0], chi_square_interval(2)
    nees = {who: one.scored.nees for who, one in followed.items()}
    nis = {who: on_rows(seen, one) for who, one in followed.items()}
    band = f"Green: 95 % band of one run, {bounds[0]:.3f} to {bounds[1]:.2f}; grey: no detections."
    for letter, what, values in (("a", "NEES", nees), ("b", "NIS", nis)):
        means = [one.scored.numbers[what.lower()] for one in followed.values()]
        report.figure(
            squares_over_time(
                times,
                seen.seen,
                {what: values},
                names_of(followed),
                f"Mean {what} {list_numbers(means)}; consistent is 2",
            ),
            **_named(
                figures["squares"],
                f"{what} of each track over time on a logarithmic axis, with the band of a "
                "consistent filter.",
                band,
                letter=letter,
            ),
        )


def show_correlations(
    report: Report,
    followed: Mapping[str, ScoredTrack],
    figures: Mapping[str, str],
    axes: tuple[str, str],
    letter: str = "",
) -> None:
    """Autocorrelation of the innovations of tracks that see the same; ``figures`` as in `show_paths`."""
    white = {who: whiteness_of(one) for who, one in followed.items()}
    bound = max(one.bound for one in white.values())
    at_one = [float(np.abs(one.autocorrelation[:, 1]).max()) for one in white.values()]
    report.figure(
        innovation_correlations(
            {who: one.autocorrelation for who, one in white.items()},
            bound,
            names_of(followed),
            f"Up to {list_numbers(at_one, 2)} at lag one; white is below {bound:.2f}",
            axes,
        ),
        **_named(
            figures["correlation"],
            f"Autocorrelation of the innovations, {axes[0]} and {axes[1]}, against the lag, with the "
            "band of white noise.",
            "Autocorrelation of the innovations, largest magnitude at lag one in the title; grey: where "
            "white noise stays with 95 %. Lags count detections.",
            letter=letter,
        ),
    )


def list_words(words: Sequence[str]) -> str:
    """ "one, another and a third"."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def _named(number: str, alt: str, caption: str, otherwise: str = "", letter: str = "") -> dict[str, Any]:
    """Arguments of `Report.figure` for the counterpart of a figure of H, or for one that H has not."""
    if not number:
        return {"name": otherwise, "alt": alt, "caption": caption}
    chapter, of = number.split("-")
    counterpart = f"Counterpart of H figure {chapter}.{int(of)}."
    return {"name": f"fig-{number}{letter}", "alt": alt, "caption": f"{caption} {counterpart}"}
