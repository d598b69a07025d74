"""A vessel that mostly drifts, seen in eights: H 5.6.2."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.reporting.charts.georeferencing import aircraft_map, errors_over_time, positions_map
from wildlab.reporting.figures import colour
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study
from wildlab.studies.slow_vessel import trial
from wildlab.studies.slow_vessel.trial import COLUMNS, subset_of, track_vessel

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
        Shown(positions_map(table[_PLACE].to_numpy(), vessel, "", colour("observer")), "fig-5-11"),
        *(
            Shown(positions_map(points[column], meanwhile, "", colour(source), bounds), name)
            for name, (column, source) in zip(("fig-5-10a", "fig-5-10b"), COLUMNS.items(), strict=True)
        ),
        Shown(aircraft_map(path, path[at], vessel, ""), "fig-5-09"),
    ]


def track_figures(scored: pd.DataFrame) -> list[Shown]:
    """Errors of single images and of the track over time, on the subset and on the whole flight."""
    tracks = {"fig-5-12a": track_vessel(subset_of(scored)), "fig-5-12b": track_vessel(scored)}
    errors = {name: (np.hypot(*one.measured.T), np.hypot(*one.error.T)) for name, one in tracks.items()}
    reach = 1.05 * max(float(values.max()) for both in errors.values() for values in both)
    return [
        Shown(errors_over_time(one.times, *errors[name], "", reach), name) for name, one in tracks.items()
    ]


def unit_of(name: str) -> str:
    """The unit of a number of the trial."""
    return "1" if name.startswith("share") else "m/s" if name.startswith("speed") else "m"


def answer(facts: Facts) -> list[str]:
    """How far a single image is off, then whether a track is nearer, by the intervals of both medians."""
    track = ("filter", "filter_error_mean")
    if math.isnan(facts.value("observer", "mae") + facts.value("reference", "mae") + facts.value(*track)):
        return ["unknown"]
    track_is = {"less": "nearer", "more": "farther"}.get(facts.compare(track, ("observer", "mae")), "unclear")
    return ["located", f"track-{track_is}"]


STUDY = Study("slow-vessel", trial.trial, trial.check_claims, unit_of, answer)
