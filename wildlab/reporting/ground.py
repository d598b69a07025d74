"""What a page says of the ground: what became of the rays, and what level ground would have given."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.errors import summarise
from wildlab.flight.store import Flight
from wildlab.geometry.terrain import Terrain
from wildlab.pipeline.evaluate import errors_of, score_points
from wildlab.pipeline.georeference import Observations, georeference
from wildlab.pipeline.ground import ground_sentences, on_level, rays_of, shift_from_level
from wildlab.reporting.report import Report

#: Medians that differ by less than this share of the smaller are called alike.
ALIKE = 0.05


def ground_section(report: Report, flight: Flight, observations: Observations, points: pd.DataFrame) -> None:
    """The section on the terrain, and its metrics; nothing where the flight has none.

    Parameters
    ----------
    report
        Is added to.
    flight
        The flight.
    observations, points
        What was put on its ground, and where.
    """
    if observations.terrain is None:
        return
    report.section("The ground", ". ".join(ground_sentences(observations, points)) + ".")
    met = rays_of(observations).counts()
    report.table(
        pd.DataFrame({"became": list(met), "rays": list(met.values())}),
        columns={"became": "what became of the rays", "rays": "rays"},
        digits={"rays": 0},
        caption="Rays of all detections over the terrain. Those that did not meet the ground have no point.",
    )
    report.metric("rays_on_ground", "terrain", float(points["north_m"].notna().mean()), "1", n=len(points))
    shift = shift_from_level(observations, points)
    if shift.n:
        report.metric("shift_from_level_ground", "terrain", shift.median, "m", n=shift.n)
    if flight.truth is None or not len(flight.truth) or not points["north_m"].notna().any():
        return
    level = on_level(observations)
    flat = score_points(flight, georeference(flight, level, np.random.default_rng(0)))
    here = score_points(flight, points)
    both = np.isfinite(flat.set_index("detection_id")["error_m"]) & np.isfinite(
        here.set_index("detection_id")["error_m"]
    )
    if not both.any():
        return
    rows = both.to_numpy()
    on_map, on_plane = summarise(errors_of(here[rows])), summarise(errors_of(flat[rows]))
    report.metric("horizontal_error_median", "level-ground", on_plane.median, "m", n=on_plane.n)
    whose = (
        "surveyed height of each target" if flight.manifest.scoring.rule == "labelled" else "stated height"
    )
    report.text(level_sentence(on_map.median, on_plane.median, on_plane.n, whose))


def level_sentence(terrain: float, level: float, n: int, whose: str) -> str:
    """Medians of errors over terrain and on level ground, beside one another.

    Parameters
    ----------
    terrain, level
        Median errors, metres.
    n
        Of so many points, the same on both.
    whose
        How high the level ground is.

    Returns
    -------
    str
    """
    said = (
        f"Against the truth, {n} points that are on both have a median error of {terrain:.2f} m over terrain "
        f"and of {level:.2f} m on level ground at the {whose}"
    )
    if abs(terrain - level) <= ALIKE * min(terrain, level):
        return f"{said}: alike."
    return f"{said}: the {'terrain' if terrain < level else 'level ground'} is nearer to it on these points."


def ground_height_words(ground: Terrain | None, assumed: Mapping[str, float]) -> str:
    """How good the terrain's height is taken to be; nothing without terrain."""
    if ground is None:
        return ""
    if np.isnan(ground.sd):
        return f" The terrain's height is assumed to be good to {assumed['plane_height_m']:g} m."
    return f" The terrain's height is good to {ground.sd:.2g} m, as its map and the resampling have it."
