"""Noise that is correlated in time, in the target's motion or in its measurements: H 7.2, 7.5.1, 7.5.2.

Three filters on the same georeferenced detections: constant velocity (``cv``, the benchmark), Singer's model
(``singer``), and constant velocity with differenced measurements (``coloured``).
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from wildlab.analysis.tracks.pixels import CvTuning, PixelMeasurements, evaluate_track, track_positions
from wildlab.errors import WildlabError
from wildlab.studies.linear_vs_nonlinear import (
    OBSERVER,
    Numbers,
    ScoredTrack,
    as_in_frames,
    fly_sighting,
    numbers_of,
    remembered,
    start_on_detections,
)
from wildlab.tracking.filters import run_coloured
from wildlab.tracking.motion import singer, singer_variance
from wildlab.tracking.run import Track, run_filter
from wildlab.tracking.sensors import positions

SUBJECTS = ("cv", "singer", "coloured")


class SingerTuning(NamedTuple):
    """Parameters of Singer's model, H (7.1)-(7.2), and the standard deviation of the acceleration at the
    start, m/s^2."""

    max_acceleration: float
    alpha: float
    p_max: float
    p_zero: float
    acceleration_0: float

    @property
    def variance(self) -> float:
        """Of the acceleration, (m/s^2)^2."""
        return singer_variance(self.max_acceleration, self.p_max, self.p_zero)


class FilterTunings(NamedTuple):
    """A column of filters of H tables 7.1 and 7.3."""

    cv: CvTuning
    singer: SingerTuning


#: No filter here works on pixels.
_NO_PIXELS = float("nan")
#: H table 7.1.
FAST = FilterTunings(
    CvTuning(acceleration=0.05, position_0=10.0, velocity_0=100.0, measurement=7.0, pixel=_NO_PIXELS),
    SingerTuning(max_acceleration=0.01, alpha=0.1, p_max=0.05, p_zero=0.7, acceleration_0=0.01),
)
#: H table 7.3. Its P(0) of filter 2 prints 0.01 for the acceleration, where table 7.1 prints 0.01^2: taken as
#: printed, a variance, (0.1 m/s^2)^2.
DRIFTING = FilterTunings(
    CvTuning(acceleration=0.01, position_0=13.0, velocity_0=1.0, measurement=13.0, pixel=_NO_PIXELS),
    SingerTuning(max_acceleration=0.002, alpha=0.1, p_max=0.05, p_zero=0.7, acceleration_0=0.1),
)
TUNINGS = {"fast-vessel": FAST, "drifting-vessel": DRIFTING}

#: What H 7.5.1 says would help: half the noise of differenced measurements, and more process noise, here a
#: standard deviation three times as large. How much is not said; both are chosen.
LESS_NOISE, MORE_ACCELERATION = 0.5, 3.0
#: H's variations, beside the filters that it tabulates.
VARIED = ("coloured-less-noise", "cv-more-acceleration")
#: The beginning in which filter 3 is said to converge more slowly, s: the first period with detections, and
#: the pause behind it.
BEGINNING_S = 60.0


def tuning_of(twin: str) -> FilterTunings:
    """The tuning of the flight that a twin stands for.

    Raises
    ------
    WildlabError
        Where it is none of the two.
    """
    if twin not in TUNINGS:
        raise WildlabError(
            f"the twin {twin!r} is none of the flights of H 7.5.1 and 7.5.2",
            f"use one of {', '.join(TUNINGS)}",
        )
    return TUNINGS[twin]


def track_by_singer(seen: PixelMeasurements, tuning: FilterTunings) -> Track:
    """Filter 2: Singer's motion, over the detections alone.

    The model is continuous in time, so that the frames in between change nothing.
    """
    motion = partial(singer, alpha=tuning.singer.alpha, variance=tuning.singer.variance)
    begin = start_on_detections(seen, tuning.cv, 6, sd_acceleration=tuning.singer.acceleration_0)
    rows = seen.detected
    return run_filter(
        seen.times[rows], seen.positions[rows], np.eye(2) * tuning.cv.measurement**2, positions(),
        remembered(motion), begin, output_times=seen.times,
    )  # fmt: skip


def track_by_differences(seen: PixelMeasurements, tuning: FilterTunings) -> Track:
    """Filter 3: differences of measurements a second apart at most, H (7.7)-(7.12); over detections alone."""
    rows = seen.detected
    return run_coloured(
        seen.times[rows], seen.positions[rows], np.eye(2) * tuning.cv.measurement**2,
        as_in_frames(seen, tuning.cv.motion), start_on_detections(seen, tuning.cv), output_times=seen.times,
    )  # fmt: skip


def track_target(seen: PixelMeasurements, tuning: FilterTunings) -> dict[str, ScoredTrack]:
    """A sighting through the three filters."""
    tracks = {
        "cv": track_positions(seen, tuning.cv),
        "singer": track_by_singer(seen, tuning),
        "coloured": track_by_differences(seen, tuning),
    }
    return {subject: ScoredTrack(one, evaluate_track(seen, one)) for subject, one in tracks.items()}


def track_varied(seen: PixelMeasurements, tuning: FilterTunings) -> dict[str, ScoredTrack]:
    """The variations of `VARIED`."""
    less = tuning.cv._replace(measurement=LESS_NOISE * tuning.cv.measurement)
    more = tuning.cv._replace(acceleration=MORE_ACCELERATION * tuning.cv.acceleration)
    tracks = (track_by_differences(seen, tuning._replace(cv=less)), track_positions(seen, more))
    return {
        subject: ScoredTrack(track, evaluate_track(seen, track))
        for subject, track in zip(VARIED, tracks, strict=True)
    }


def beginnings(seen: PixelMeasurements, tracks: dict[str, ScoredTrack]) -> Numbers:
    """RMS error of the speed (m/s) within `BEGINNING_S` of the first frame, by filter."""
    rows = seen.times - seen.times[0] <= BEGINNING_S
    speed = np.hypot(*seen.truth[rows, 2:].T)
    result: Numbers = {}
    for who, one in tracks.items():
        apart = np.hypot(*one.track.x[rows, 2:4].T) - speed
        known = apart[np.isfinite(apart)]
        value = float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
        result[who, "rmse_speed_beginning"] = value
    return result


def trial(seed: int, *, twin: str) -> Numbers:
    """One simulated flight with the observer's poses through the three filters, by `numbers_of`.

    Raises
    ------
    WildlabError
        For a twin that stands for none of the flights, or a flight on which nothing can be tracked.
    """
    tuning = tuning_of(twin)
    _, seen = fly_sighting(twin, seed, OBSERVER)
    tracks = track_target(seen, tuning)
    return numbers_of(seen, tracks | track_varied(seen, tuning)) | beginnings(seen, tracks)


#: The numbers of the thesis's figures, by twin.
FIGURES = {
    "fast-vessel": {
        "paths": "7-02",
        "map": "7-03",
        "errors": "7-04",
        "speed": "7-05",
        "squares": "7-06",
        "correlation": "7-07",
    },
    "drifting-vessel": {
        "paths": "7-08",
        "map": "7-09",
        "errors": "7-10",
        "squares": "7-11",
        "correlation": "7-12",
    },
}
