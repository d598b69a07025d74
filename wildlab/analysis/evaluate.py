"""Ground points against surveyed truth, and the axes that their errors are split along."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.georeference import Observations, covariances_of, truth_of
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import time_blocks
from wildlab.evaluation.outliers import largest_visible
from wildlab.flight.clocks import poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Array, Indices, matrix_to_euler, wrap


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


def recorded_answers(flight: Flight) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Positions that other programs gave for the same detections, scored like ours.

    Parameters
    ----------
    flight
        With detections of the kind ``position``, and truth.

    Returns
    -------
    answers, unlabelled
        Scored tables by program; and the programs that name no target with a truth where they have to.
    """
    detections, frames = flight.table("detections"), flight.table("frames")
    answers, unlabelled = dict[str, pd.DataFrame](), list[str]()
    for program, rows in detections[detections["kind"] == "position"].groupby("source", sort=False):
        names = rows["target_id"].fillna("") if "target_id" in rows else pd.Series("", rows.index)
        known = names.isin(set(flight.table("truth")["target_id"]))
        if flight.manifest.scoring.rule == "labelled" and not known.any():
            unlabelled.append(str(program))
            continue
        at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        points = rows[["detection_id", "frame_id", "north_m", "east_m"]].assign(
            target_id=names, time_s=frames["time_s"].to_numpy(float)[at],
            cov_nn=np.nan, cov_ne=np.nan, cov_ee=np.nan,
        )  # fmt: skip
        answers[str(program)] = score_points(flight, points.reset_index(drop=True))
    return answers, unlabelled


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


def visible_error(flight: Flight, scored: pd.DataFrame) -> float:
    """Half the median spacing of the marks, m: larger errors go to another one, where the nearest counts.

    Parameters
    ----------
    flight
        With truth.
    scored
        From `score_points`.
    """
    offset = flight.manifest.clocks.truth_offset_s
    _, places = truth_at(flight.table("truth"), scored["time_s"].to_numpy(float), offset_s=offset)
    spots = np.nanmedian(places[:, :, :2], axis=1)
    return largest_visible(spots[np.isfinite(spots).all(axis=1)])
