"""A target at rest, seen 552 times from 350 m: H 5.6.1."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.analysis.evaluate import errors_of
from wildlab.evaluation.consistency import autocorrelation
from wildlab.flight.store import Flight
from wildlab.reporting.charts.georeferencing import (
    autocorrelation_chart,
    error_scatter,
    filter_chart,
    path_map,
)
from wildlab.reporting.charts.navigation import poses_between, strips
from wildlab.reporting.figures import BLUE, VERMILLION, colour
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study
from wildlab.studies.static_point import trial
from wildlab.studies.static_point.trial import COLUMNS, OBSERVER, filter_errors

#: Lags of the autocorrelations, in observations.
LAGS = 60
#: Figure and colour of the errors of each of `COLUMNS`.
SCATTERS = {
    "observer": ("fig-5-04a", colour("observer")),
    "pixhawk-autopilot": ("fig-5-04b", colour("autopilot")),
    "without-time-synchronization": ("fig-5-05a", VERMILLION),
    "without-misalignment-calibration": ("fig-5-05b", BLUE),
}


def scatter_figures(scored: Mapping[str, pd.DataFrame]) -> list[Shown]:
    """Errors of single images, a figure for each column; all but the last, the largest, to one scale."""
    errors = {column: errors_of(scored[column]) for column in COLUMNS}
    *alike, _ = COLUMNS
    reach = 1.1 * max(float(np.abs(errors[column]).max()) for column in alike)
    return [
        Shown(error_scatter(errors[column], "", color, reach if column in alike else None), name)
        for column, (name, color) in SCATTERS.items()
    ]


def flight_figures(flight: Flight, scored: pd.DataFrame) -> list[Shown]:
    """The path with the places of the observations, and attitude and velocity by both navigation sources."""
    seen = scored["time_s"].to_numpy()
    sources = {name: flight.nav[name] for name in (OBSERVER, "autopilot")}
    attitudes, velocities = poses_between(sources, seen.min(), seen.max())
    return [
        Shown(path_map(flight.nav[OBSERVER], np.sort(seen), "", "antenna"), "fig-5-02"),
        Shown(strips(attitudes, ""), "fig-5-03a"),
        Shown(strips(velocities, ""), "fig-5-03b"),
    ]


def filter_figures(scored: pd.DataFrame, bound: float) -> list[Shown]:
    """The filtered position's error with its two-sigma band, and the innovations' autocorrelation.

    ``bound``: what the autocorrelation of white innovations stays below.
    """
    track = filter_errors(scored)
    ordered = scored.sort_values("time_s", kind="stable")
    measured, estimated = np.hypot(*errors_of(ordered).T), np.hypot(*track.x.T)
    predicted = np.sqrt(np.trace(track.P, axis1=1, axis2=2))
    correlations = {
        axis: autocorrelation(track.innovation[1:, i], LAGS) for i, axis in enumerate(("north", "east"))
    }
    return [
        Shown(filter_chart(measured, estimated, 2 * predicted, ""), "fig-5-06"),
        Shown(autocorrelation_chart(correlations, bound, ""), "fig-5-07"),
    ]


def unit_of(name: str) -> str:
    """The unit of a number of the trial."""
    return "1" if name.startswith("lag1") else "m"


def answer(facts: Facts) -> list[str]:
    """How far a single image is off, then what calibration and clocks are worth."""
    if any(math.isnan(facts.value(column, "mae")) for column in trial.COLUMNS):
        return ["unknown"]
    most = facts.choose("misalignment-matters-most", "first", "unclear")
    return ["located", f"calibration-{most}"]


STUDY = Study("static-point", trial.trial, trial.check_claims, unit_of, answer)
