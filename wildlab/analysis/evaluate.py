"""Ground points against surveyed truth, and the axes that their errors are split along."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.georeference import Observations, covariances_of, truth_of
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import time_blocks
from wildlab.evaluation.outliers import ambiguous, largest_visible
from wildlab.flight.clocks import poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Array, Indices, Mask, matrix_to_euler, wrap
from wildlab.geometry.robust import student_scale


def score_points(flight: Flight, points: pd.DataFrame) -> pd.DataFrame:
    """Errors of ground points against the truth, by the flight's scoring rule.

    ``labelled``: the target that the detection names; points without one are left out. ``nearest``: the
    target nearest to the point, horizontally, among those whose position is known at that time.

    Parameters
    ----------
    flight
        With truth.
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        The points that can be judged, with ``truth_id``, ``error_north_m``, ``error_east_m``, ``error_m``
        (NaN where the ray missed the ground) and ``inside_90`` (whether the truth lies in the 90 % ellipse;
        NaN where there is no ellipse).

    Raises
    ------
    WildlabError
        Where the flight has no truth, or none of its points can be judged.

    Examples
    --------
    >>> from wildlab.analysis.georeference import georeference, observe
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1)
    >>> points = georeference(observe(flight, "truth"), np.random.default_rng(0))
    >>> bool(score_points(flight, points)["error_m"].median() < 20)
    True
    """
    truth = flight.table("truth")
    xy = points[["north_m", "east_m"]].to_numpy(float)
    if flight.manifest.scoring.rule == "labelled":
        where, names = truth_of(flight, points), points["target_id"].to_numpy(str)
    else:
        offset = flight.manifest.clocks.truth_offset_s
        targets, positions = truth_at(truth, points["time_s"].to_numpy(float), offset_s=offset)
        distance = np.linalg.norm(positions[:, :, :2] - xy, axis=2)
        nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=0)
        where, names = positions[nearest, np.arange(len(points))], np.asarray(targets)[nearest]
    known = np.isfinite(where[:, :2]).all(axis=1)
    if not known.any():
        raise WildlabError(
            "no detection can be compared with the truth",
            "name the targets in the detections' target_id, or set the scoring rule to 'nearest'",
            file=flight.folder,
            field="detections.target_id",
        )
    error = (xy - where[:, :2])[known]
    scored = points.iloc[np.flatnonzero(known)]
    covariance = covariances_of(scored)
    inside = inside_ellipse(error, covariance).astype(float)
    inside[~np.isfinite(covariance).all(axis=(1, 2))] = np.nan
    scored = scored.assign(
        truth_id=names[known],
        error_north_m=error[:, 0],
        error_east_m=error[:, 1],
        error_m=np.hypot(*error.T),
        inside_90=inside,
    )
    return scored.reset_index(drop=True)


def errors_of(scored: pd.DataFrame) -> Array:
    """The errors (N, 2) north-east of a scored table.

    Parameters
    ----------
    scored
        From `score_points`.

    Returns
    -------
    (N, 2) m, point minus truth

    Examples
    --------
    >>> errors_of(pd.DataFrame({"error_north_m": [1.0], "error_east_m": [2.0]})).tolist()
    [[1.0, 2.0]]
    """
    return scored[["error_north_m", "error_east_m"]].to_numpy(float)


def recorded_answers(flight: Flight) -> dict[str, pd.DataFrame]:
    """Positions that other programs gave for the same detections, scored like ours, by program.

    A program whose answers name no target, where targets have to be named, is left out: see
    `unlabelled_programs`.

    Parameters
    ----------
    flight
        With detections of the kind ``position``, and truth.

    Returns
    -------
    dict
        Scored tables by program.
    """
    detections = flight.table("detections")
    frames = flight.table("frames")
    answers = {}
    left_out = unlabelled_programs(flight)
    for program, rows in detections[detections["kind"] == "position"].groupby("source", sort=False):
        if program in left_out:
            continue
        at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        points = pd.DataFrame(
            {
                "detection_id": rows["detection_id"].to_numpy(),
                "frame_id": rows["frame_id"].to_numpy(),
                "target_id": rows["target_id"].fillna("").to_numpy() if "target_id" in rows else "",
                "time_s": frames["time_s"].to_numpy(float)[at],
                "north_m": rows["north_m"].to_numpy(float),
                "east_m": rows["east_m"].to_numpy(float),
                "cov_nn": np.nan,
                "cov_ne": np.nan,
                "cov_ee": np.nan,
            }
        )
        answers[str(program)] = score_points(flight, points)
    return answers


def unlabelled_programs(flight: Flight) -> list[str]:
    """Programs whose positions cannot be scored, since none of them names a target that has a truth.

    Parameters
    ----------
    flight
        With detections.

    Returns
    -------
    list of str
    """
    positions = flight.table("detections")
    positions = positions[positions["kind"] == "position"]
    if flight.manifest.scoring.rule != "labelled" or flight.truth is None:
        return []
    names = positions["target_id"] if "target_id" in positions else pd.Series("", positions.index)
    known = names.isin(set(flight.truth["target_id"])).groupby(positions["source"], sort=False).any()
    return [str(program) for program, some in known.items() if not some]


def blocks_of(flight: Flight, table: pd.DataFrame) -> Indices:
    """Which block in time order (N,) each point belongs to: see `wildlab.evaluation.intervals.time_blocks`.

    Parameters
    ----------
    flight
        Says whether its times are times, or merely number the images.
    table
        With ``frame_id`` and ``time_s``, N rows.

    Returns
    -------
    (N,) integers from 0
    """
    times = table["time_s"].to_numpy(float)
    if flight.manifest.time.kind == "utc" and np.isfinite(times).all():
        return time_blocks(times, seconds=True)
    place = pd.Index(flight.table("frames")["frame_id"]).get_indexer(pd.Index(table["frame_id"]))
    return time_blocks(place, seconds=False)


def known_points(observations: Observations, scored: pd.DataFrame) -> tuple[Observations, Array]:
    """The observations that were scored, and the points (N, 3) they should have met.

    North and east are those of the truth, down is the ground that the ray was cut with.
    """
    chosen = observations.of(scored)
    names = scored.set_index("detection_id").loc[chosen.table["detection_id"], "truth_id"].to_numpy()
    where = truth_of(chosen.flight, chosen.table.assign(target_id=names))
    return chosen, np.column_stack([where[:, :2], chosen.plane_down])


#: A camera or a track slower than this has no direction (m/s), and a view nearer to straight down than this
#: share of its height neither.
SLOWEST_M_S = 1.0
STEEPEST = 0.05


def axes_of(observations: Observations, scored: pd.DataFrame) -> dict[str, Array]:
    """Unit vectors (N, 2), north-east, of the axes that a scored table's errors are split along.

    Parameters
    ----------
    observations
        Those that the table was made from.
    scored
        From `score_points`, N rows.

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
    flight = observations.flight
    nav = flight.nav[observations.source]
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
        return np.where((length > least)[:, None], vectors / length[:, None], np.nan)


def _right(axis: Array) -> Array:
    """A quarter turn clockwise, seen from above (north, east)."""
    return np.column_stack([-axis[:, 1], axis[:, 0]])


#: How far headings may lie from their mean, rad, for a flight on one heading: a turned camera and a shifted
#: position then move all points alike.
ONE_HEADING = np.radians(45.0)


def on_one_heading(observations: Observations) -> bool:
    """Whether all images were taken on one heading.

    Parameters
    ----------
    observations
        From `wildlab.analysis.georeference.observe`.

    Returns
    -------
    bool
    """
    R = observations.poses.R_nb[np.isfinite(observations.poses.R_nb).all(axis=(1, 2))]
    yaw = matrix_to_euler(R)[:, 2]
    mean = np.angle(np.exp(1j * yaw).mean()) if len(yaw) else 0.0
    return bool(len(yaw)) and bool(np.abs(wrap(yaw - mean)).max() <= ONE_HEADING)


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

    ambiguous: Mask
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
