"""Axes along which the errors of a flight's points are split, and clicks that may be of another mark."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.evaluate import errors_of
from wildlab.analysis.georeference import Observations, covariances_of
from wildlab.evaluation.ambiguity import ambiguous, largest_visible
from wildlab.flight.clocks import poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.robust import student_scale

Array = NDArray[np.float64]

#: A camera or a track slower than this has no direction (m/s), and a view nearer to straight down than this
#: share of its height neither.
SLOWEST_M_S = 1.0
STEEPEST = 0.05


def axes_of(
    flight: Flight, observations: Observations, scored: pd.DataFrame, source: str | None = None
) -> dict[str, Array]:
    """Unit vectors (N, 2), north-east, of the axes that a scored table's errors are split along.

    Parameters
    ----------
    flight
        The flight.
    observations
        Those that the table was made from.
    scored
        From `score_points`, N rows.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Returns
    -------
    dict
        ``north``, ``east``; ``away from the camera`` and ``to the right of the line of sight``, on the
        ground; where the poses have times, ``along the course`` and ``to the right of the course``. NaN where
        a point has no such axis.
    """
    rows = pd.Index(observations.table["detection_id"]).get_indexer(pd.Index(scored["detection_id"]))
    camera = observations.poses.p_nc[rows]
    sight = scored[["north_m", "east_m"]].to_numpy(float) - camera[:, :2]
    drop = observations.plane_down[rows] - camera[:, 2]
    away = _unit(sight, STEEPEST * np.abs(drop))
    one = np.ones(len(scored))
    axes = {
        "north": np.column_stack([one, 0 * one]),
        "east": np.column_stack([0 * one, one]),
        "away from the camera": away,
        "to the right of the line of sight": _right(away),
    }
    nav = flight.pose_source(source)[1]
    if flight.manifest.time.kind == "utc" and "frame_id" not in nav:
        times = scored["time_s"].to_numpy(float)
        after, before = (poses_at(nav, times + shift)[0][:, :2] for shift in (0.5, -0.5))
        track = _unit(after - before, np.full(len(times), SLOWEST_M_S))
        if np.isfinite(track).any():
            axes |= {"along the course": track, "to the right of the course": _right(track)}
    return axes


def _unit(vectors: Array, least: Array) -> Array:
    length = np.hypot(*vectors.T)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where((length > least)[:, None], vectors / length[:, None], np.nan))


def _right(axis: Array) -> Array:
    """A quarter turn clockwise, seen from above (north, east)."""
    return np.column_stack([-axis[:, 1], axis[:, 0]])


class NearestRule(NamedTuple):
    """What the rule of the nearest mark may hide.

    Attributes
    ----------
    ambiguous
        (N,) bool, clicks that may as well be of another mark.
    visible_m
        Errors beyond this go to another mark: half the median spacing of the marks.
    sd_m
        Standard deviation of an error along either axis that this was judged with.
    """

    ambiguous: NDArray[np.bool_]
    visible_m: float
    sd_m: float


def look_at_nearest_rule(flight: Flight, scored: pd.DataFrame) -> NearestRule:
    """Which clicks of a scored table the nearest mark may have got wrong.

    The size of an error is that of the distances to the nearest mark or that of the ellipses, whichever is
    larger: the rule itself makes the former small.

    Parameters
    ----------
    flight
        With truth.
    scored
        From `score_points`, N rows.

    Returns
    -------
    NearestRule
    """
    xy = scored[["north_m", "east_m"]].to_numpy(float)
    offset = flight.manifest.clocks.truth_offset_s
    _, places = truth_at(flight.table("truth"), scored["time_s"].to_numpy(float), offset_s=offset)
    distance = np.sort(np.nan_to_num(np.linalg.norm(places[:, :, :2] - xy, axis=2), nan=np.inf), axis=0)
    second = distance[1] if len(distance) > 1 else np.full(len(xy), np.inf)
    P = covariances_of(scored)
    stated = np.sqrt(np.nanmedian(np.trace(P, axis1=1, axis2=2)) / 2) if np.isfinite(P).any() else 0.0
    found = student_scale((errors_of(scored) ** 2).sum(axis=1))
    sd = float(np.nanmax([found, stated]))
    spots = np.nanmedian(places[:, :, :2], axis=1)
    return NearestRule(
        ambiguous(distance[0], second, sd), largest_visible(spots[np.isfinite(spots).all(axis=1)]), sd
    )
