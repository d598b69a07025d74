"""Tracking on the ground against tracking in the image: H 6.4.2, on two flights.

The same detections, poses and tuning go through the Kalman filter on georeferenced positions (``kf``) and the
extended one on pixels (``ekf``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.navigate import navigate_observer
from wildlab.analysis.tracks.pixels import (
    CvTuning,
    PixelMeasurements,
    Scored,
    evaluate_measurements,
    evaluate_track,
    read_pixels,
    start,
    track_pixels,
    track_positions,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import innovation_whiteness
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import correlations_chart
from wildlab.reporting.charts.tracks import (
    error_over_time,
    speed_and_course,
    squares_over_time,
    track_map,
    values_over_flights,
)
from wildlab.reporting.figures import colour
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown
from wildlab.tracking.motion import Motion, in_steps
from wildlab.tracking.run import Start, Track

#: Numbers of a flight by (subject, name).
Numbers = dict[tuple[str, str], float]

OBSERVER, AUTOPILOT = "observer", "autopilot"

#: H 6.4.2, in the text: the high-speed target, and the slowly moving one.
FAST = CvTuning(acceleration=0.05, position_0=10.0, velocity_0=10.0, measurement=7.0, pixel=20.0)
SLOW = CvTuning(acceleration=0.01, position_0=10.0, velocity_0=10.0, measurement=10.0, pixel=30.0)


class Case(NamedTuple):
    """What H 6.4.2 says of one of its flights: the source of the poses, and the tuning."""

    source: str
    tuning: CvTuning


CASES = {"fast-vessel": Case(OBSERVER, FAST), "slow-vessel-eight": Case(AUTOPILOT, SLOW)}

#: Elements of the innovation, by subject.
AXES = {"kf": ("north", "east"), "ekf": ("u", "v")}


class ScoredTrack(NamedTuple):
    """One filter's track of a sighting, and how it was scored."""

    track: Track
    scored: Scored


def case_of(twin: str) -> Case:
    """What H 6.4.2 says of the flight that a twin stands for.

    Raises
    ------
    WildlabError
        Where it is none of the two.
    """
    if twin not in CASES:
        raise WildlabError(
            f"the twin {twin!r} is none of the flights of H 6.4.2", f"use one of {', '.join(CASES)}"
        )
    return CASES[twin]


def fly_sighting(twin: str, seed: int, source: str) -> tuple[Flight, PixelMeasurements]:
    """A simulated flight and what its camera saw, with the poses of the observer or of the autopilot."""
    flight = simulate_twin(twin, seed, () if source == OBSERVER else ("imu", "gnss"))
    return flight, sight(flight, source)


def sight(flight: Flight, source: str) -> PixelMeasurements:
    """What the camera of a flight saw; the observer's poses are computed where they are asked for."""
    if source == OBSERVER and OBSERVER not in flight.nav:
        flight.nav[OBSERVER] = navigate_observer(flight).nav
    return read_pixels(flight, source)


def remembered(motion: Motion) -> Motion:
    """A motion model that is asked again and again for the same few steps, and computes each once.

    Steps are rounded to a microsecond, in which nothing that is tracked gets anywhere.
    """
    kept = cache(motion)
    return lambda dt: kept(round(dt, 6))


def as_in_frames(seen: PixelMeasurements, motion: Motion) -> Motion:
    """A motion model that gives after a pause what it would have given predicting at every frame.

    H (6.2) holds its noise over a step, and the thesis predicted as often as the camera took pictures.
    """
    # A pause of n frames is n steps, and not n + 1 where rounding has made it a little longer.
    return remembered(partial(in_steps, motion=motion, longest=1.001 * float(np.median(np.diff(seen.times)))))


def start_on_detections(seen: PixelMeasurements, tuning: CvTuning, n: int = 4, **more: float) -> Start:
    """As `wildlab.analysis.tracks.pixels.start`, its row counted among the detections alone."""
    rows = np.flatnonzero(seen.detected)
    begin = start(seen, tuning, n, **more)
    return begin._replace(row=int(np.searchsorted(rows, begin.row)))


def track_target(seen: PixelMeasurements, tuning: CvTuning) -> dict[str, ScoredTrack]:
    """A sighting through both filters."""
    tracks = {"kf": track_positions(seen, tuning), "ekf": track_pixels(seen, tuning)}
    return {who: ScoredTrack(one, evaluate_track(seen, one, AXES[who])) for who, one in tracks.items()}


def numbers_of(seen: PixelMeasurements, tracks: dict[str, ScoredTrack]) -> Numbers:
    """What is compared over flights: the numbers of `evaluate_track` by filter.

    The subject ``measurements`` has those of `evaluate_measurements`, and ``detections``, how many there are.
    """
    result = {(who, name): value for who, one in tracks.items() for name, value in one.scored.numbers.items()}
    measured = {**evaluate_measurements(seen), "detections": seen.detected.sum()}
    return result | {("measurements", name): value for name, value in measured.items()}


def trial(seed: int, *, twin: str, beside: str) -> Numbers:
    """One simulated flight through both filters; see `numbers_of`.

    Where ``beside`` names the twin of the other flight, its innovations' mean autocorrelation at lag one, on
    a flight of the same seed, is the number ``lag1`` of ``beside``.

    Raises
    ------
    WildlabError
        For a twin that stands for none of the flights, or a flight on which nothing can be tracked.
    """
    case = case_of(twin)
    _, seen = fly_sighting(twin, seed, case.source)
    found = numbers_of(seen, track_target(seen, case.tuning))
    if beside:
        case = case_of(beside)
        _, seen = fly_sighting(beside, seed, case.source)
        other = numbers_of(seen, track_target(seen, case.tuning))
        correlations = [
            abs(other[who, f"lag1_autocorrelation_{axis}"]) for who, axes in AXES.items() for axis in axes
        ]
        found["beside", "lag1"] = float(np.mean(correlations))
    return found


#: The numbers of the thesis's figures, by twin.
FIGURES = {
    twin: {
        part: f"6-{number:02d}"
        for number, part in enumerate(("paths", "errors", "map", "speed", "squares", "correlation"), first)
    }
    for twin, first in (("fast-vessel", 5), ("slow-vessel-eight", 11))
}

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
    paths = track_map(seen.truth, {}, {}, measured=seen.positions, aircraft=seen.poses.p_nc)
    speed = f"fig-{numbers['speed']}" if "speed" in numbers else "speed-and-course"
    return [
        Shown(paths, "paths", f"fig-{numbers['paths']}"),
        Shown(
            track_map(seen.truth, states, called, measured=seen.positions),
            "map",
            f"fig-{numbers['map']}",
        ),
        Shown(
            error_over_time(times, there, errors, called, measured=measured),
            "errors",
            f"fig-{numbers['errors']}",
        ),
        Shown(speed_and_course(times, there, seen.truth, states, called), "speed", speed),
        *(
            Shown(
                squares_over_time(times, there, {what.upper(): values[what]}, called),
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
    lags = {
        f"autocorrelation,\n{axis}": {
            names[who]: (one.autocorrelation[i], colour(who)) for who, one in white.items()
        }
        for i, axis in enumerate(axes)
    }
    bound = max(one.bound for one in white.values())
    return Shown(correlations_chart(lags, [bound] * len(axes)), "correlation", f"fig-{number}")


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
