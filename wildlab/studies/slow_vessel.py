"""A vessel that mostly drifts, seen in eights: H tables 5.6 and 5.7, and the filter of H 5.6.2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.georeference import errors_of, georeference, observe, score_points
from wildlab.analysis.navigate import navigate_observer
from wildlab.errors import WildlabError
from wildlab.evaluation.errors import summarise
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import with_breaks
from wildlab.reporting.charts.tracks import aircraft_map, error_over_time, positions_map
from wildlab.reporting.figures import colour
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import target_path
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown
from wildlab.studies.static_point import table_numbers
from wildlab.tracking.batch import run_batch
from wildlab.tracking.motion import constant_velocity, in_steps
from wildlab.tracking.run import start_from_first

#: Navigation source behind each column of the tables.
COLUMNS = {"observer": "observer", "pixhawk-autopilot": "autopilot"}
#: What the frames of the part of the flight that figure 5.10 shows are grouped as, and how its subjects end.
SUBSET = "subset"
#: The columns on the whole flight (table 5.6) and on the subset (table 5.7).
SUBJECTS = (*COLUMNS, *(f"{column}-{SUBSET}" for column in COLUMNS))

#: H prints no tuning for this filter. This is the one of H table 7.3, filter 1, which tracks the same kind of
#: vessel from 200 to 300 m: acceleration (m/s^2; H 6.4.2, flight 2 has the same), measurement (m), and
#: position (m) and velocity (m/s) at the start.
SD_ACCELERATION, SD_MEASUREMENT, SD_POSITION_0, SD_VELOCITY_0 = 0.01, 13.0, 13.0, 1.0
#: The camera's interval, s: the filter holds an acceleration that long, with or without a detection. How the
#: thesis cut time here is not printed.
STEP_S = 1 / 7.5
#: What counts as the beginning of a track, s: about one pass over the vessel and the next.
BEGINNING_S = 60.0


class VesselEstimates(NamedTuple):
    """A vessel's estimates at N detections.

    Attributes
    ----------
    times
        (N,) s.
    measured, error
        (N, 2) errors of the detections and of the estimates, north and east, m.
    """

    times: Array
    measured: Array
    error: Array


def evaluate_sources(flight: Flight, rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """The flight's detections on the sea and scored against the vessel's receiver, by column.

    The plane is the detections' own, the sea: what the vessel's receiver says of its height is not used.

    Raises
    ------
    WildlabError
        Where a source has no poses, or no point can be judged.
    """
    detections = flight.table("detections")
    sea = detections.loc[detections["kind"] == "pixel", "plane_down_m"].to_numpy(float)
    return {
        column: score_points(flight, georeference(replace(observe(flight, source), plane_down=sea), rng))
        for column, source in COLUMNS.items()
    }


def subset_of(scored: pd.DataFrame) -> pd.DataFrame:
    """The points of the subset."""
    return scored[scored["group"] == SUBSET]


def track_vessel(scored: pd.DataFrame) -> VesselEstimates:
    """The Kalman filter with constant velocity on scored points, started on the first one with zero speed.

    H 6.2, with the tuning above; an acceleration is held for `STEP_S` at most.
    """
    table = scored.sort_values("time_s", kind="stable")
    times, xy = table["time_s"].to_numpy(float), table[["north_m", "east_m"]].to_numpy(float)
    measured = errors_of(table)
    motion = partial(constant_velocity, sd_acceleration=SD_ACCELERATION)
    (track,) = run_batch(
        times,
        xy[None],
        np.eye(2) * SD_MEASUREMENT**2,
        lambda dt: in_steps(dt, motion, STEP_S),
        start_from_first(times, xy, SD_POSITION_0, SD_VELOCITY_0),
    )
    return VesselEstimates(times, measured, track.x[:, :2] - (xy - measured))


def true_positions(flight: Flight, scored: pd.DataFrame) -> Array:
    """Where the simulated vessel was at scored points, (N, 2) north and east: what no receiver knows.

    Raises
    ------
    WildlabError
        Where the flight is not simulated.
    """
    made = flight.manifest.twin
    if made is None:
        raise WildlabError(
            "only of a simulated vessel is it known where it was", "use a twin", file=flight.folder
        )
    vessel = load_twin(made.name).targets[0]
    return np.asarray(target_path(vessel, made.seed)(scored["time_s"].to_numpy(float))[:, :2])


def speed_in_beginning(flight: Flight, scored: pd.DataFrame) -> float:
    """How fast the simulated vessel went within `BEGINNING_S` of the first of scored points, m/s."""
    begin = float(scored["time_s"].min())
    ends = pd.DataFrame({"time_s": [begin, begin + BEGINNING_S]})
    return float(np.hypot(*np.diff(true_positions(flight, ends), axis=0)[0]) / BEGINNING_S)


def summarise_vessel(flight: Flight, scored: dict[str, pd.DataFrame]) -> dict[tuple[str, str], float]:
    """Everything that is compared over many flights, by (subject, name).

    The names of the tables (m) for `SUBJECTS`. For ``observer`` also ``largest_error``, the mean one of the
    last tenth of the points, the mean one from where the simulated vessel was (m), and shares of points by
    error. The same of the vessel's receiver is ``mae`` of the ``reference``. For ``filter`` the distance
    of the estimate from the receiver (m): the largest within `BEGINNING_S`, the mean, and that at the end.
    """
    result: dict[tuple[str, str], float] = {}
    for column, table in scored.items():
        result |= table_numbers(column, table) | table_numbers(f"{column}-{SUBSET}", subset_of(table))
    table = scored["observer"].sort_values("time_s", kind="stable")
    distance = table["error_m"].to_numpy(float)
    off = table[["north_m", "east_m"]].to_numpy(float) - true_positions(flight, table)
    (whole, errors), (part, _) = (_track_errors(one) for one in (table, subset_of(table)))
    return result | {
        ("observer", "largest_error"): np.nanmax(distance),
        ("observer", "share_below_20_m"): (distance < 20).mean(),
        ("observer", "share_5_to_10_m"): ((distance >= 5) & (distance <= 10)).mean(),
        ("observer", "mean_error_last_tenth"): np.nanmean(distance[-max(1, len(table) // 10) :]),
        ("observer", "mae_without_reference_error"): np.nanmean(np.hypot(*off.T)),
        ("reference", "mae"): np.nanmean(np.hypot(*(off - errors_of(table)).T)),
        ("vessel", "speed_beginning"): speed_in_beginning(flight, table),
        ("vessel", "speed_beginning_subset"): speed_in_beginning(flight, subset_of(table)),
        ("filter", "filter_error_beginning"): whole,
        ("filter", "filter_error_mean"): errors.mean(),
        ("filter", "filter_error_at_end"): errors[-1],
        (f"filter-{SUBSET}", "filter_error_beginning"): part,
    }


def _track_errors(scored: pd.DataFrame) -> tuple[float, Array]:
    """The largest error of a track within `BEGINNING_S`, and all (N,), m."""
    found = track_vessel(scored)
    errors = np.hypot(*found.error.T)
    return float(errors[found.times <= found.times[0] + BEGINNING_S].max()), errors


def navigate_vessel(flight: Flight) -> None:
    """Give a flight the observer's poses as the nav source ``observer``."""
    flight.nav["observer"] = navigate_observer(flight).nav


def first_case(seed: int, twin: str) -> float:
    """Mean error (m) of a single image with the observer's pose on a flight of H 5.6.1's twin."""
    flight = simulate_twin(twin, seed)
    navigate_vessel(flight)
    rng = np.random.default_rng(seed)
    return summarise(errors_of(score_points(flight, georeference(observe(flight, "observer"), rng)))).mean


def trial(seed: int, *, twin: str, first: str) -> dict[tuple[str, str], float]:
    """One simulated flight, summarised as by `summarise_vessel`, and ``mae`` of the ``first-case``.

    ``first`` is the twin of the first case, which flies with the same seed and so with the same kind of luck.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has not the data for the comparison.
    """
    flight = simulate_twin(twin, seed)
    navigate_vessel(flight)
    scored = evaluate_sources(flight, np.random.default_rng(seed))
    return summarise_vessel(flight, scored) | {("first-case", "mae"): first_case(seed, first)}


_PLACE = ["north_m", "east_m"]


def map_figures(flight: Flight, scored: Mapping[str, pd.DataFrame]) -> list[Shown]:
    """Positions of the whole flight and of its subset beside the receiver's path, and the aircraft's path."""
    table = scored["observer"]
    receiver = flight.table("truth").sort_values("time_s")
    vessel = receiver[_PLACE].to_numpy()
    parts = {column: subset_of(scored[column]) for column in COLUMNS}
    during = receiver["time_s"].between(*parts["observer"]["time_s"].agg(["min", "max"]))
    meanwhile = vessel[during.to_numpy()]
    points = {column: part[_PLACE].to_numpy() for column, part in parts.items()}
    together = np.vstack([*points.values(), meanwhile])
    bounds = (together.min(axis=0) - 5, together.max(axis=0) + 5)
    nav = flight.nav["observer"]
    path = nav[_PLACE].to_numpy()
    at = np.clip(np.searchsorted(nav["time_s"], table["time_s"]), 0, len(nav) - 1)
    return [
        Shown(positions_map(table[_PLACE].to_numpy(), vessel, colour("observer")), "fig-5-11"),
        *(
            Shown(positions_map(points[column], meanwhile, colour(source), bounds), name)
            for name, (column, source) in zip(("fig-5-10a", "fig-5-10b"), COLUMNS.items(), strict=True)
        ),
        Shown(aircraft_map(path, path[at], vessel), "fig-5-09"),
    ]


#: A longer pause in the observations breaks a line, s.
PAUSE_S = 10.0


def track_figures(scored: pd.DataFrame) -> list[Shown]:
    """Errors of single images and of the track over time, on the subset and on the whole flight."""
    tracks = {"fig-5-12a": track_vessel(subset_of(scored)), "fig-5-12b": track_vessel(scored)}
    errors = {name: (np.hypot(*one.measured.T), np.hypot(*one.error.T)) for name, one in tracks.items()}
    reach = 1.05 * max(float(values.max()) for both in errors.values() for values in both)
    shown = []
    for name, one in tracks.items():
        # A pause in the observations breaks the line.
        (times, raw), (_, estimate) = (with_breaks(one.times, values, PAUSE_S) for values in errors[name])
        every, own = np.ones(len(times), bool), {"kf": estimate}
        fig = error_over_time(times / 60, every, own, {"kf": "filtered"}, measured=raw, xlabel="time (min)")
        fig.axes[0].set_ylim(0, reach)
        shown.append(Shown(fig, name))
    return shown
