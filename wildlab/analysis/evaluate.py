"""Ground points against surveyed truth."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import Observations, covariances_of, truth_of
from wildlab.errors import WildlabError
from wildlab.evaluation.blocks import time_blocks
from wildlab.flight.clocks import truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.ellipses import inside_ellipse

Array = NDArray[np.float64]


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
    >>> points = georeference(flight, observe(flight, "truth"), np.random.default_rng(0))
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


def blocks_of(flight: Flight, table: pd.DataFrame) -> NDArray[np.intp]:
    """Which block in time order (N,) each point belongs to: see `wildlab.evaluation.blocks.time_blocks`.

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


def known_points(
    flight: Flight, observations: Observations, scored: pd.DataFrame
) -> tuple[Observations, Array]:
    """The observations that were scored, and the points (N, 3) they should have met.

    North and east are those of the truth, down is the ground that the ray was cut with.
    """
    chosen = observations.take(observations.table["detection_id"].isin(scored["detection_id"]).to_numpy())
    names = scored.set_index("detection_id").loc[chosen.table["detection_id"], "truth_id"].to_numpy()
    where = truth_of(flight, chosen.table.assign(target_id=names))
    return chosen, np.column_stack([where[:, :2], chosen.plane_down])
