"""A flight's boresight from its own known points, scored on images it has not seen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.evaluate import blocks_of, known_points, score_points
from wildlab.analysis.georeference import (
    Observations,
    calibrated,
    covariances_of,
    georeference,
    observe,
    pose_errors,
    shifting_poses,
)
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.calibration import BORESIGHT, Calibration, calibrate, split_images

Array = NDArray[np.float64]


class Calibrated(NamedTuple):
    """A calibration from all images, and the errors on images that a calibration has not seen.

    Attributes
    ----------
    calibration
        From all images: what to write into the manifest.
    scored
        Every point placed by a calibration from the other half of the images (the first split).
    mean_errors
        Mean error of each split, metres.
    """

    calibration: Calibration
    scored: pd.DataFrame
    mean_errors: Array


def fit_flight(
    flight: Flight,
    observations: Observations,
    scored: pd.DataFrame,
    source: str | None = None,
    estimate: tuple[str, ...] = BORESIGHT,
) -> Calibration:
    """Calibrate on the points of a scored table, weighted with their ground covariances."""
    observations, known = known_points(flight, observations, scored)
    ids = observations.table["detection_id"]
    weights = covariances_of(scored.set_index("detection_id").loc[ids].reset_index())
    return calibrate(
        shifting_poses(flight, source, observations),
        observations.uv,
        known,
        observations.table["frame_id"].to_numpy(),
        estimate,
        weights,
        blocks_of(flight, observations.table),
    )


def calibrate_flight(
    flight: Flight,
    rng: np.random.Generator,
    source: str | None = None,
    estimate: tuple[str, ...] = BORESIGHT,
    splits: int = 20,
) -> Calibrated:
    """Calibrate on a flight's known points, and judge each half of its images by the other half.

    Draws (images, or minutes of them: see :func:`~wildlab.analysis.evaluate.blocks_of`) are halved at random,
    ``splits`` times over; a calibration from one half places the points of the other. A clock offset is
    asked for only where the flight has times.

    Parameters
    ----------
    flight
        With pixel detections, poses and truth.
    rng
        Draws the halves, and samples of flat rays.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    estimate
        What to estimate: see `wildlab.geometry.calibration.calibrate`.
    splits
        How many times the images are halved.

    Returns
    -------
    Calibrated

    Raises
    ------
    WildlabError
        Where fewer than four images show a known point.
    """
    if flight.manifest.time.kind == "sequence":
        estimate = tuple(name for name in estimate if name != "clock")
    observations = observe(flight, source)
    plain = score_points(flight, georeference(flight, observations, rng))
    plain = plain[np.isfinite(plain["error_m"]) & np.isfinite(plain["cov_nn"])]
    if plain["frame_id"].nunique() < 4:
        raise WildlabError(
            "fewer than four images show a known point, too few to calibrate on half of them",
            "label more detections, or add truth",
            file=flight.folder,
            field="detections",
        )
    draws = blocks_of(flight, plain)
    rounds = []
    for _ in range(splits):
        half = split_images(draws, rng)
        parts = [
            _evaluate_unseen(
                flight,
                observations,
                fit_flight(flight, observations, plain[seen], source, estimate),
                plain[~seen],
                source,
                rng,
            )
            for seen in (half, ~half)
        ]
        rounds.append(pd.concat(parts, ignore_index=True))
    return Calibrated(
        fit_flight(flight, observations, plain, source, estimate),
        rounds[0],
        np.array([r["error_m"].mean() for r in rounds]),
    )


def _evaluate_unseen(
    flight: Flight,
    observations: Observations,
    calibration: Calibration,
    unseen: pd.DataFrame,
    source: str | None,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Errors of the unseen points with a calibration applied."""
    rows = observations.table["detection_id"].isin(unseen["detection_id"]).to_numpy()
    placed = calibrated(flight, source, observations.take(rows), calibration)
    return score_points(flight, georeference(flight, placed, rng, pose_errors(flight, placed)))
