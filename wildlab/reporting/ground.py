"""What a page says of a flight's terrain: what level ground would have given instead, against the truth."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.evaluate import blocks_of, score_points
from wildlab.analysis.georeference import Observations, georeference
from wildlab.analysis.ground import on_level, shift_from_level
from wildlab.evaluation.errors import bootstrap_interval
from wildlab.flight.store import Flight
from wildlab.messages.message import Message
from wildlab.messages.page_texts import load_texts, measure
from wildlab.reporting.report import Report
from wildlab.reporting.wording import Wording

#: Fewer images than this give no interval.
FEWEST_IMAGES = 6


def terrain_section(report: Report, flight: Flight, observations: Observations, points: pd.DataFrame) -> None:
    """The section on the terrain, and its metrics; nothing where the flight has none.

    Parameters
    ----------
    report
        Is added to.
    flight
        The flight.
    observations, points
        What was georeferenced, and where it lies.
    """
    if observations.terrain is None:
        return
    placed = points["north_m"].notna()
    report.metric("rays_on_ground", "terrain", float(placed.mean()), "1", n=len(points))
    shift = shift_from_level(observations, points)
    if shift.n:
        report.metric("shift_from_level_ground", "terrain", shift.median, "m", n=shift.n)
    message = Message(
        "terrain-shift", {"shift": measure(shift.median, "m"), "most": measure(shift.largest, "m")}
    )
    both = _errors_on_both(flight, observations, points) if placed.any() else None
    if both is not None:
        medians = np.median(both[["error_m", "error_m_level"]].to_numpy(float), axis=0)
        report.metric("horizontal_error_median", "level-ground", float(medians[1]), "m", n=len(both))
        message = terrain_message(float(medians[0]), float(medians[1]), _gain_interval(flight, both))
    wording = Wording(report, load_texts("georeferencing"))
    report.section("Terrain", " ".join(wording.messages([message])))


def _errors_on_both(flight: Flight, observations: Observations, points: pd.DataFrame) -> pd.DataFrame | None:
    """Points with an error over terrain (``error_m``) and on level ground (``error_m_level``)."""
    if flight.truth is None or not len(flight.truth):
        return None
    flat = georeference(flight, on_level(observations), np.random.default_rng(0))
    both = score_points(flight, points).merge(
        score_points(flight, flat), on="detection_id", suffixes=("", "_level")
    )
    both = both[np.isfinite(both["error_m"]) & np.isfinite(both["error_m_level"])]
    return None if both.empty else both


def _gain_interval(flight: Flight, both: pd.DataFrame) -> tuple[float, float]:
    """Of how much less the median error over terrain is, 95 %; NaN for too few images."""
    if both["frame_id"].nunique() < FEWEST_IMAGES:
        return np.nan, np.nan
    # Two distances in place of north and east: what is drawn again and again is the same.
    distances = both[["error_m", "error_m_level"]].to_numpy(float)
    rng = np.random.default_rng(0)
    return bootstrap_interval(_gain, distances, blocks_of(flight, both), rng, level=0.95)


def _gain(distances: np.ndarray) -> float:
    """How much less the median of the first column is than that of the second."""
    return float(np.median(distances[:, 1]) - np.median(distances[:, 0]))


def terrain_message(terrain: float, level: float, interval: tuple[float, float]) -> Message:
    """Which is nearer to the truth, by the interval of the difference of median errors.

    Parameters
    ----------
    terrain, level
        Median errors, metres.
    interval
        Of how much less the first is than the second, 95 %; NaN where there is none.

    Examples
    --------
    >>> terrain_message(2.0, 5.0, (1.0, 4.0)).key, terrain_message(2.0, 5.0, (-1.0, 4.0)).key
    ('terrain-nearer', 'terrain-undecided')
    """
    low, high = interval
    key = "terrain-nearer" if low > 0 else "level-nearer" if high < 0 else "terrain-undecided"
    return Message(key, {"terrain": measure(terrain, "m"), "level": measure(level, "m")})
