"""How accurate a flight's single positions are, and why: everything that a report on them shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.diagnose import FEWEST_IMAGES, Diagnosis, diagnose
from wildlab.analysis.evaluate import (
    NearestRule,
    axes_of,
    blocks_of,
    errors_of,
    look_at_nearest_rule,
    score_points,
)
from wildlab.analysis.georeference import (
    Observations,
    calibrated,
    covariances_of,
    georeference,
    pose_errors,
)
from wildlab.analysis.pose_noise import estimate_noise, evaluate_with_estimated_noise, used_deviations
from wildlab.evaluation.axes import AlongAxis, split_along
from wildlab.evaluation.blocks import Halves, Labels, compare_halves
from wildlab.evaluation.ellipses import EllipseVerdict, judge_ellipses
from wildlab.evaluation.errors import (
    ErrorSummary,
    Scatter,
    bootstrap_interval,
    scatter_by_image,
    summarise,
)
from wildlab.evaluation.pose_noise import PoseNoise
from wildlab.evaluation.sightings import Averaged, try_averaging
from wildlab.flight.store import Flight

Array = NDArray[np.float64]

#: How many times the images are halved to see what ellipses from learnt noise are worth.
HALVINGS = 5


@dataclass(frozen=True)
class Accuracy:
    """What a flight's points are worth.

    Attributes
    ----------
    observations, points, scored
        What was put on the ground, where, and against the truth: N rows, lost points among them.
    blocks
        (N,) in time order.
    summary, intervals
        Of the errors as they are, and low and high of its figures by name (these images, resampled); none
        below six images.
    lost
        How many of the N points have no position.
    assumed
        The standard deviations that the ellipses come from.
    ellipses
        What they are worth.
    axes, halves
        Errors along axes, and first half beside second.
    diagnosis
        The cause, where six images or more show a known point.
    remaining, averaged
        What the errors are made of once the cause is taken off, and what averaging four images gained; of
        the errors as they are where no cause gained anything for certain; without what is far out.
    noise, learnt
        How noisy the poses were, and the share of the truth that ellipses with noise learnt on the other half
        of the images hold (mean over five halvings); without what is far out.
    nearest, unambiguous
        Where each point is held against the nearest mark: what that may hide, and the diagnosis without
        ambiguous clicks, where enough are left.
    """

    observations: Observations
    points: pd.DataFrame
    scored: pd.DataFrame
    blocks: Labels
    summary: ErrorSummary
    intervals: dict[str, tuple[float, float]]
    lost: int
    assumed: dict[str, float]
    ellipses: EllipseVerdict
    axes: dict[str, AlongAxis]
    halves: Halves
    diagnosis: Diagnosis | None
    remaining: Scatter
    averaged: Averaged | None
    noise: PoseNoise | None
    learnt: float
    nearest: NearestRule | None
    unambiguous: Diagnosis | None

    @property
    def errors(self) -> Array:
        """(N, 2) m, north-east, as they are; NaN where the point is lost."""
        return errors_of(self.scored)


def judge_accuracy(
    flight: Flight,
    observations: Observations,
    rng: np.random.Generator,
    source: str | None = None,
    deviations: dict[str, float] | None = None,
) -> Accuracy:
    """Place a flight's detections, hold them against the truth, and look for the cause of their errors.

    Parameters
    ----------
    flight
        With truth.
    observations
        From `observe`, with a calibration applied or not.
    rng
        Draws halves, blocks, and samples of flat rays.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    deviations
        Standard deviations in place of those that log and manifest state.

    Returns
    -------
    Accuracy

    Raises
    ------
    WildlabError
        Where the flight has no truth, or no detection can be compared with it.
    """
    errors_stated = pose_errors(flight, observations, deviations)
    points = georeference(flight, observations, rng, errors_stated)
    scored = score_points(flight, points)
    errors, blocks = errors_of(scored), blocks_of(flight, scored)
    summary = summarise(errors)
    located = np.isfinite(scored["error_m"]) & np.isfinite(scored["cov_nn"])
    enough = scored.loc[located, "frame_id"].nunique() >= FEWEST_IMAGES
    diagnosis = diagnose(flight, observations, scored, source) if enough else None
    intervals = {}
    if enough:
        figures = {
            "horizontal_error_mean": lambda e: float(np.hypot(*e.T).mean()),
            "horizontal_error_median": lambda e: float(np.median(np.hypot(*e.T))),
            "horizontal_error_p90": lambda e: float(np.quantile(np.hypot(*e.T), 0.9)),
        }
        intervals = {name: bootstrap_interval(f, errors, blocks, rng) for name, f in figures.items()}
    left, of = errors, scored
    if diagnosis is not None and diagnosis.counts:
        left, of = diagnosis.winner.held, diagnosis.scored
    elif diagnosis is not None:
        left, of = errors_of(diagnosis.scored), diagnosis.scored
    if diagnosis is not None:
        left, of = left[diagnosis.inliers], of[diagnosis.inliers]
    averaged = try_averaging(left, of["truth_id"], of["frame_id"], rng) if enough else None
    noise, learnt = _learn_noise(flight, observations, diagnosis, rng, source)
    nearest = look_at_nearest_rule(flight, scored) if flight.manifest.scoring.rule == "nearest" else None
    unambiguous = None
    if nearest is not None and nearest.ambiguous.any():
        clear = scored[~nearest.ambiguous & located]
        if clear["frame_id"].nunique() >= FEWEST_IMAGES:
            unambiguous = diagnose(flight, observations, clear, source)
    return Accuracy(
        observations=observations,
        points=points,
        scored=scored,
        blocks=blocks,
        summary=summary,
        intervals=intervals,
        lost=int((~np.isfinite(scored["error_m"])).sum()),
        assumed=used_deviations(flight, observations, deviations),
        ellipses=judge_ellipses(errors, covariances_of(scored), blocks, rng),
        axes=split_along(errors, axes_of(flight, observations, scored, source), blocks),
        halves=compare_halves(scored["error_m"].to_numpy(float), blocks),
        diagnosis=diagnosis,
        remaining=scatter_by_image(left, of["frame_id"]),
        averaged=averaged,
        noise=noise,
        learnt=learnt,
        nearest=nearest,
        unambiguous=unambiguous,
    )


def _learn_noise(
    flight: Flight,
    observations: Observations,
    diagnosis: Diagnosis | None,
    rng: np.random.Generator,
    source: str | None,
) -> tuple[PoseNoise | None, float]:
    """Noise of the poses once a constant error is taken off, and how honest ellipses from it are."""
    if diagnosis is None:
        return None, float("nan")
    names = diagnosis.calibration.names
    known = diagnosis.scored[diagnosis.inliers].reset_index(drop=True)
    if known["frame_id"].nunique() < FEWEST_IMAGES:
        return None, float("nan")
    inside = [
        evaluate_with_estimated_noise(flight, observations, known, rng, source, names)["inside_90"].mean()
        for _ in range(HALVINGS)
    ]
    noise = noise_without(flight, observations, diagnosis, rng, source)
    return noise, float(np.mean(inside))


def noise_without(
    flight: Flight,
    observations: Observations,
    diagnosis: Diagnosis,
    rng: np.random.Generator,
    source: str | None = None,
) -> PoseNoise:
    """Noise of the poses with the winner's constants taken off, and without what is far out.

    Whether the winner is certain does not matter: what stays the same in all images is no noise, whichever
    cause it has, and left in it would be booked as noise of whatever resembles it.

    Parameters
    ----------
    flight, observations, rng, source
        As for `judge_accuracy`.
    diagnosis
        Of these observations.

    Returns
    -------
    PoseNoise
    """
    known = diagnosis.scored[diagnosis.inliers].reset_index(drop=True)
    placed = observations
    if diagnosis.winner.causes:
        placed = calibrated(flight, source, observations, diagnosis.calibration)
        rows = placed.table["detection_id"].isin(known["detection_id"]).to_numpy()
        known = score_points(flight, georeference(flight, placed.take(rows), rng))
    return estimate_noise(flight, placed, known)
