"""A target at rest, seen again and again: the columns of H tables 5.4 and 5.5, and the filter of H 5.6.1."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.pipeline.georeference import covariances_of, georeference, observe
from wildlab.pipeline.judge import errors_of, judge
from wildlab.tracking.kalman import Filtered, filter_at_rest

#: Navigation source and camera stamps behind each column of the tables.
COLUMNS = {
    "pixhawk-autopilot": ("autopilot", "time_s"),
    "without-time-synchronization": ("autopilot", "time_onboard_s"),
    "without-misalignment-calibration": ("autopilot-uncalibrated", "time_s"),
}


def judge_columns(flight: Flight, rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """The flight's detections judged once for each column that the flight has the data for."""
    frames = flight.table("frames")
    return {
        column: judge(flight, georeference(flight, observe(flight, source, stamps), rng))
        for column, (source, stamps) in COLUMNS.items()
        if source in flight.nav and stamps in frames
    }


def filter_errors(judged: pd.DataFrame) -> Filtered:
    """The filter for an object at rest on the errors of judged points, in order of time.

    A target at rest makes the error of the estimate the estimate of the error: the filter is linear and its
    gains do not depend on where the target is. ``R`` is each point's own ground covariance.
    """
    ordered = judged.sort_values("time_s", kind="stable")
    return filter_at_rest(errors_of(ordered), covariances_of(ordered))
