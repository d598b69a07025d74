"""What a page says of the ground: what became of the rays, and what level ground would have given."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.analysis.evaluate import blocks_of, score_points
from wildlab.analysis.georeference import Observations, georeference
from wildlab.analysis.ground import ground_sentences, on_level, shift_from_level
from wildlab.evaluation.errors import bootstrap_interval
from wildlab.flight.store import Flight
from wildlab.geometry.terrain import Terrain
from wildlab.reporting.report import Report

#: Fewer images than this give no interval.
FEWEST_IMAGES = 6


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
    placed = points["north_m"].notna()
    report.metric("rays_on_ground", "terrain", float(placed.mean()), "1", n=len(points))
    shift = shift_from_level(observations, points)
    if shift.n:
        report.metric("shift_from_level_ground", "terrain", shift.median, "m", n=shift.n)
    if flight.truth is None or not len(flight.truth) or not placed.any():
        return
    flat = georeference(flight, on_level(observations), np.random.default_rng(0))
    here, there = score_points(flight, points), score_points(flight, flat)
    both = here.merge(there, on="detection_id", suffixes=("", "_level"))
    both = both[np.isfinite(both["error_m"]) & np.isfinite(both["error_m_level"])]
    if both.empty:
        return
    # Two distances in place of north and east: what is drawn again and again is the same.
    distances = both[["error_m", "error_m_level"]].to_numpy(float)
    interval = (np.nan, np.nan)
    if both["frame_id"].nunique() >= FEWEST_IMAGES:
        interval = bootstrap_interval(
            _gain, distances, blocks_of(flight, both), np.random.default_rng(0), level=0.95
        )
    medians = np.median(distances, axis=0)
    report.metric("horizontal_error_median", "level-ground", float(medians[1]), "m", n=len(both))
    report.text(level_sentence(float(medians[0]), float(medians[1]), len(both), interval))


def _gain(distances: np.ndarray) -> float:
    """How much less the median of the first column is than that of the second."""
    return float(np.median(distances[:, 1]) - np.median(distances[:, 0]))


def level_sentence(terrain: float, level: float, n: int, interval: tuple[float, float]) -> str:
    """Medians of errors over terrain and on level ground beside one another, and which is nearer for certain.

    Parameters
    ----------
    terrain, level
        Median errors, metres.
    n
        Of so many points, the same on both.
    interval
        Of how much less the first is than the second, 95 %; NaN where there is none.

    Returns
    -------
    str
    """
    said = (
        f"Against the truth, the {n} points that are on both have a median error of {terrain:.2f} m over "
        f"terrain and of {level:.2f} m on level ground"
    )
    low, high = interval
    if np.isnan(low):
        return f"{said}; too few images to tell whether that is chance."
    difference = f"{level - terrain:+.2f} m, 95 % interval {low:+.2f} to {high:+.2f} m"
    if low > 0:
        return f"{said}: the terrain is nearer to it ({difference})."
    if high < 0:
        return (
            f"{said}: level ground is nearer to it ({difference}). Look at the map's reference and its age."
        )
    return f"{said}: which is nearer to it, these images do not decide ({difference})."


def ground_height_words(ground: Terrain | None, assumed: Mapping[str, float]) -> str:
    """How good the terrain's height is taken to be; nothing without terrain.

    Parameters
    ----------
    ground
        The flight's.
    assumed
        Standard deviations that are assumed, by name.

    Returns
    -------
    str
    """
    if ground is None:
        return ""
    if np.isnan(ground.sd):
        return f" The terrain's height is assumed to be good to {assumed['plane_height_m']:g} m."
    return f" The terrain's height is good to {ground.sd:.2g} m, as its map and the resampling have it."
