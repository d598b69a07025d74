"""A target at rest, seen again and again: the columns of H tables 5.4 and 5.5, and the filter of H 5.6.1."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.evaluate import errors_of, score_points
from wildlab.analysis.georeference import covariances_of, georeference, observe
from wildlab.analysis.navigate import navigate_observer
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import autocorrelation
from wildlab.evaluation.errors import summarise
from wildlab.evaluation.shares import Check, columns_of
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.simulation.onboard_sensors import as_mounted, mounted_imu
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.kalman import Filtered, filter_at_rest

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


def filter_errors(scored: pd.DataFrame) -> Filtered:
    """The filter for an object at rest on the errors of scored points, in order of time.

    A target at rest makes the error of the estimate the estimate of the error: the filter is linear and its
    gains do not depend on where the target is. ``R`` is each point's own ground covariance.
    """
    ordered = scored.sort_values("time_s", kind="stable")
    return filter_at_rest(errors_of(ordered), covariances_of(ordered))


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


def differ(one: ArrayLike, other: ArrayLike) -> NDArray[np.float64]:
    """By what share of the smaller one two errors differ, flight by flight."""
    first, second = np.asarray(one, float), np.asarray(other, float)
    return np.asarray(np.abs(first - second) / np.minimum(first, second))


def check_claims(spread: pd.DataFrame, bound: float) -> dict[str, Check]:
    """What the flights give for each claim of H 5.6.1, by the claim's id.

    Parameters
    ----------
    spread
        What `summarise_at_rest` gives, one row for each flight.
    bound
        What the autocorrelation of white innovations stays below.
    """

    of = columns_of(spread)

    mae, autopilot = of("observer", "mae"), of("pixhawk-autopilot", "mae")
    late, turned_ = of("without-time-synchronization", "mae"), of("without-misalignment-calibration", "mae")
    sensors, care = np.abs(autopilot - mae), np.minimum(late, turned_) - mae
    lag1 = np.minimum(*(of("observer", f"lag1_autocorrelation_{axis}") for axis in ("north", "east")))
    return {
        "observer-autopilot-comparable": Check(
            measured=differ(mae, autopilot), first=mae, second=autopilot, unit="m"
        ),
        "synchronisation-matters": Check.larger(late, mae, "m"),
        "misalignment-matters-most": Check(
            true=turned_ > np.maximum(mae, late), first=turned_, second=late, unit="m"
        ),
        "calibration-before-sensors": Check.larger(care, sensors, "m"),
        "innovations-coloured": Check(true=lag1 > bound),
        "metre-after-first-batch": Check(measured=of("observer", "filter_error_after_first_batch")),
        "half-metre-at-end": Check(measured=of("observer", "filter_error_at_end")),
        "mean-within-two-metres": Check(
            measured=np.hypot(of("observer", "mean_north"), of("observer", "mean_east"))
        ),
        "single-errors-above-thirty": Check(measured=of("observer", "largest_error"), above=True),
        "best-below-thirty-centimetres": Check(measured=of("observer", "smallest_error")),
    }
