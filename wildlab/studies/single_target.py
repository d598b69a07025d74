"""Figures and tables of one target's tracks: of the flight drawn, and over many flights.

Figures have the keys of their texts (`wildlab.messages.catalogue`), and no titles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.pixels import PixelMeasurements
from wildlab.evaluation.consistency import innovation_whiteness
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.tracks import (
    error_over_time,
    innovation_correlations,
    speed_and_course,
    squares_over_time,
    track_map,
    values_over_flights,
)
from wildlab.studies.page import Shown

if TYPE_CHECKING:
    from wildlab.studies.linear_vs_nonlinear import ScoredTrack

#: Lags of the autocorrelations, in detections: eight seconds of uninterrupted images.
LAGS = 60
#: Columns of `filters_table` besides the filter.
COLUMNS = ("mae", "nees", "nis")


def flights_figures(
    runs: pd.DataFrame,
    published: Mapping[tuple[str, str], float],
    names: Mapping[str, str],
    filters: Sequence[str],
) -> list[Shown]:
    """Mean error and mean NEES of every flight, a row for each filter; ``published`` by subject and name."""
    called = {who: names[who] for who in filters}

    def printed(name: str) -> dict[str, float]:
        return {who: published[who, name] for who in filters if (who, name) in published}

    return [
        Shown(
            values_over_flights(
                pd.DataFrame({who: runs[who, name] for who in filters}), printed(name), called, label, band
            ),
            f"{name}-over-flights",
        )
        for name, label, band in (
            ("mae", "mean distance from the truth (m)", None),
            ("nees", "NEES of the position, mean over a flight", 2),
        )
    ]


def flight_figures(
    seen: PixelMeasurements,
    tracks: Mapping[str, ScoredTrack],
    names: Mapping[str, str],
    numbers: Mapping[str, str],
) -> list[Shown]:
    """The flight drawn: paths, tracks, errors, speed and course, NEES and NIS.

    ``numbers`` has the number of the thesis's figure for ``paths``, ``map``, ``errors``, ``speed`` and
    ``squares``, as ``"6-05"``; the thesis may have none for ``speed``.
    """
    times, there = seen.times - seen.times[0], seen.detected
    called = {who: names[who] for who in tracks}
    states = {who: one.track.x[:, :4] for who, one in tracks.items()}
    errors = {who: np.hypot(*(seen.truth - x)[:, :2].T) for who, x in states.items()}
    measured = np.hypot(*(seen.truth[:, :2] - seen.positions).T)
    values = {
        "nees": {who: one.scored.nees for who, one in tracks.items()},
        "nis": {who: _at_frames(seen, one.scored.nis) for who, one in tracks.items()},
    }
    paths = track_map(seen.truth, {}, {}, "", measured=seen.positions, aircraft=seen.poses.p_nc)
    speed = f"fig-{numbers['speed']}" if "speed" in numbers else "speed-and-course"
    return [
        Shown(paths, "paths", f"fig-{numbers['paths']}"),
        Shown(
            track_map(seen.truth, states, called, "", measured=seen.positions),
            "map",
            f"fig-{numbers['map']}",
        ),
        Shown(
            error_over_time(times, there, errors, called, "", measured=measured),
            "errors",
            f"fig-{numbers['errors']}",
        ),
        Shown(speed_and_course(times, there, seen.truth, states, called, ""), "speed", speed),
        *(
            Shown(
                squares_over_time(times, there, {what.upper(): values[what]}, called, ""),
                what,
                f"fig-{numbers['squares']}{letter}",
            )
            for letter, what in (("a", "nees"), ("b", "nis"))
        ),
    ]


def correlation_figure(
    tracks: Mapping[str, ScoredTrack], names: Mapping[str, str], axes: tuple[str, str], number: str
) -> Shown:
    """Autocorrelation of the innovations of tracks that see the same; ``number`` of the thesis's figure."""
    white = {who: innovation_whiteness(one.track.innovation, LAGS) for who, one in tracks.items()}
    called = {who: names[who] for who in tracks}
    correlations = {who: one.autocorrelation for who, one in white.items()}
    bound = max(one.bound for one in white.values())
    return Shown(
        innovation_correlations(correlations, bound, called, "", axes), "correlation", f"fig-{number}"
    )


def filters_table(runs: pd.DataFrame, names: Mapping[str, str], filters: Sequence[str]) -> pd.DataFrame:
    """Medians over flights, a row for each filter."""
    middle = runs.median()
    return pd.DataFrame(
        [{"filter": names[who], **{name: middle[who, name] for name in COLUMNS}} for who in filters]
    )


def _at_frames(seen: PixelMeasurements, nis: Array) -> Array:
    """(N,) NIS at the frames of a sighting, also of a filter that went over its detections alone."""
    if len(nis) == len(seen.times):
        return nis
    result = np.full(len(seen.times), np.nan)
    result[seen.detected] = nis
    return result
