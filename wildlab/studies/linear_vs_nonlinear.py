"""Tracking on the ground against tracking in the image: H 6.4.2, on two flights.

The same detections, poses and tuning go through the Kalman filter on georeferenced positions (``kf``) and the
extended one on pixels (``ekf``).
"""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import numpy as np

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
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin
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
