"""A target at rest, seen again and again: the columns of H tables 5.4 and 5.5, and the filter of H 5.6.1."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.analysis.georeference import covariances_of, errors_of, georeference, observe, score_points
from wildlab.analysis.navigate import navigate_observer
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import autocorrelation
from wildlab.evaluation.errors import summarise
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.reporting.charts.drawing import correlations_chart, draw_band
from wildlab.reporting.charts.flights import poses_between, strips
from wildlab.reporting.charts.tracks import aircraft_map, error_over_time, error_scatter
from wildlab.reporting.figures import BLUE, VERMILLION, colour
from wildlab.simulation.onboard_sensors import as_mounted, mounted_imu
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown
from wildlab.tracking.motion import rest
from wildlab.tracking.run import Start, Track, run_filter
from wildlab.tracking.sensors import positions

#: The observer's poses, and those of one that was given the inertial samples in the axes of the IMU.
OBSERVER, UNCALIBRATED = "observer", "observer-uncalibrated"
#: Navigation source and camera stamps behind each column of the tables.
COLUMNS = {
    "observer": (OBSERVER, "time_s"),
    "pixhawk-autopilot": ("autopilot", "time_s"),
    "without-time-synchronization": (OBSERVER, "time_onboard_s"),
    "without-misalignment-calibration": (UNCALIBRATED, "time_s"),
}

#: The quantities of the tables; ``mae`` is the mean distance from the truth.
TABLE_NAMES = ("mean_north", "mean_east", "sd_north", "sd_east", "mae")
#: A pause in the observations longer than this (seconds) ends a batch.
BATCH_GAP_S = 10.0


def navigate_observers(flight: Flight) -> None:
    """Give a simulated flight the nav sources that the tables need: `OBSERVER` and `UNCALIBRATED`.

    The simulated IMU sits on the airframe turned by the published misalignment, and feels the flight in its
    own axes. `OBSERVER` gets its samples calibrated, turned to the axes of the airframe. `UNCALIBRATED` gets
    them as the IMU gave them, in the belief that they are the airframe's: it aligns itself, estimates biases
    and finds poses with them, while the antennas are where they are on the airframe.

    Raises
    ------
    WildlabError
        Where the flight is not of a twin with known misalignment of the IMU, or has no inertial samples.
    """
    made = flight.manifest.twin
    turn = None if made is None else mounted_imu(load_twin(made.name))
    if turn is None:
        raise WildlabError(
            "how the IMU was turned against the airframe is not known",
            "use a flight of a twin whose autopilot has imu_roll, imu_pitch and imu_yaw",
            file=flight.folder,
            field="twin",
        )
    times, frames = frame_times(flight), flight.table("frames")
    early = frames["time_onboard_s"].to_numpy(float) - frames["time_s"].to_numpy(float)
    times = np.concatenate([times, times + early])
    own_axes = flight.tables | {"imu": as_mounted(flight.table("imu"), turn)}
    uncalibrated = Flight(flight.manifest, flight.nav, own_axes, flight.folder, flight.terrain)
    flight.nav |= {
        OBSERVER: navigate_observer(flight, times).nav,
        UNCALIBRATED: navigate_observer(uncalibrated, times).nav,
    }


def evaluate_columns(flight: Flight, rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """The flight's detections scored once for each column; `navigate_observers` gives the poses."""
    return {
        column: score_points(flight, georeference(observe(flight, source, stamps), rng))
        for column, (source, stamps) in COLUMNS.items()
    }


def filter_errors(scored: pd.DataFrame) -> Track:
    """The filter for an object at rest on the errors of scored points, in order of time.

    A target at rest makes the error of the estimate the estimate of the error: the filter is linear and its
    gains do not depend on where the target is. ``R`` is each point's own ground covariance.
    """
    ordered = scored.sort_values("time_s", kind="stable")
    times, errors, R = ordered["time_s"].to_numpy(float), errors_of(ordered), covariances_of(ordered)
    return run_filter(times, errors, R, positions(), rest, Start(times[0], errors[0], R[0], 0))


def table_numbers(subject: str, scored: pd.DataFrame) -> dict[tuple[str, str], float]:
    """A column of the tables, of scored points: `TABLE_NAMES` of that subject."""
    s = summarise(errors_of(scored))
    values = (s.bias_north, s.bias_east, s.sd_north, s.sd_east, s.mean)
    return {(subject, name): value for name, value in zip(TABLE_NAMES, values, strict=True)}


def summarise_at_rest(scored: dict[str, pd.DataFrame]) -> dict[tuple[str, str], float]:
    """Everything that is compared over many flights, by (subject, name).

    The names of the tables for each column. For the observer also ``largest_error`` and ``smallest_error`` of
    its single images (m), and of the filter on its column ``filter_error_after_first_batch`` and
    ``filter_error_at_end`` (distance of the estimate from the truth, m) and the autocorrelation of its
    innovations, ``lag1_autocorrelation_north`` and ``_east``.
    """
    result: dict[tuple[str, str], float] = {}
    for column, table in scored.items():
        result |= table_numbers(column, table)
    table = scored["observer"].sort_values("time_s", kind="stable")
    track = filter_errors(table)
    distance = np.hypot(*track.x.T)
    pauses = np.flatnonzero(np.diff(table["time_s"]) > BATCH_GAP_S)
    numbers = {
        "largest_error": table["error_m"].max(),
        "smallest_error": table["error_m"].min(),
        "filter_error_after_first_batch": distance[pauses[0] if len(pauses) else -1],
        "filter_error_at_end": distance[-1],
        "lag1_autocorrelation_north": autocorrelation(track.innovation[1:, 0], 1)[1],
        "lag1_autocorrelation_east": autocorrelation(track.innovation[1:, 1], 1)[1],
    }
    return result | {("observer", name): value for name, value in numbers.items()}


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One simulated flight, summarised as by `summarise_at_rest`.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has not the data for the comparison.
    """
    flight = simulate_twin(twin, seed)
    navigate_observers(flight)
    scored = evaluate_columns(flight, np.random.default_rng(seed))
    for column, table in scored.items():
        if not np.isfinite(errors_of(table)).any():
            raise WildlabError(
                f"on the flight of seed {seed} no point was found on the ground ({column})",
                "look at this flight: wildlab simulate",
                file=twin,
            )
    return summarise_at_rest(scored)


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
        Shown(error_scatter(errors[column], color, reach if column in alike else None), name)
        for column, (name, color) in SCATTERS.items()
    ]


def flight_figures(flight: Flight, scored: pd.DataFrame) -> list[Shown]:
    """The path with the places of the observations, and attitude and velocity by both navigation sources."""
    seen = scored["time_s"].to_numpy()
    sources = {name: flight.nav[name] for name in (OBSERVER, "autopilot")}
    nav = flight.nav[OBSERVER]
    path = nav[["north_m", "east_m"]].to_numpy(float)
    at = np.clip(np.searchsorted(nav["time_s"], seen), 0, len(nav) - 1)
    attitudes, velocities = poses_between(sources, seen.min(), seen.max())
    return [
        Shown(aircraft_map(path, path[at], np.zeros((1, 2)), "antenna"), "fig-5-02"),
        Shown(strips(attitudes), "fig-5-03a"),
        Shown(strips(velocities), "fig-5-03b"),
    ]


def filter_figures(scored: pd.DataFrame, bound: float) -> list[Shown]:
    """The filtered position's error with its two-sigma band, and the innovations' autocorrelation.

    ``bound``: what the autocorrelation of white innovations stays below.
    """
    track = filter_errors(scored)
    ordered = scored.sort_values("time_s", kind="stable")
    measured, estimated = np.hypot(*errors_of(ordered).T), np.hypot(*track.x.T)
    predicted = np.sqrt(np.trace(track.P, axis1=1, axis2=2))
    lags = {
        axis: (autocorrelation(track.innovation[1:, i], LAGS), color)
        for i, (axis, color) in enumerate((("north", BLUE), ("east", VERMILLION)))
    }
    index = np.arange(len(measured))
    every, one = np.ones(len(index), bool), {"kf": estimated}
    errors = error_over_time(index, every, one, {"kf": "filtered"}, measured=measured, xlabel="observation")
    draw_band(errors.axes[0], index, 0 * predicted, 2 * predicted, colour("kf"))
    return [
        Shown(errors, "fig-5-06"),
        Shown(correlations_chart({"autocorrelation": lags}, [bound]), "fig-5-07"),
    ]
