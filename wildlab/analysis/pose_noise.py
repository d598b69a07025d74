"""How noisy a flight's poses were, from the errors of its known points, and ellipses that know it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.calibrate import fit_flight
from wildlab.analysis.evaluate import blocks_of, errors_of, known_points, score_points
from wildlab.analysis.georeference import (
    Observations,
    assumed_deviations,
    calibrated,
    georeference,
    pose_errors,
)
from wildlab.analysis.track import Sighting
from wildlab.errors import WildlabError
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.pose_noise import PoseNoise, estimate_pose_noise
from wildlab.flight.store import Flight
from wildlab.geometry.attitude_uncertainty import level_axes, tilt_and_heading
from wildlab.geometry.calibration import split_images
from wildlab.geometry.uncertainty import ground_jacobians

Array = NDArray[np.float64]

#: Images nearer in time than this say the same of a pose whose error wanders over tens of seconds, s.
APART_S = 1.0


#: Share of the images that is taken to be far out, where the noise is learnt from clicks.
FAR_OUT = 0.05


def estimate_noise(flight: Flight, observations: Observations, scored: pd.DataFrame) -> PoseNoise:
    """Standard deviations of the poses behind the errors of known points.

    See `wildlab.evaluation.pose_noise`. The prior lies about what was assumed for the ellipses: what the log
    states of its own poses, where it does. A few images may be far out.

    Parameters
    ----------
    flight
        What it states of pixel and ground is assumed.
    observations
        From `observe`, with a calibration applied where there is one.
    scored
        From `score_points`, of these observations.

    Returns
    -------
    PoseNoise

    Raises
    ------
    ValueError
        Where fewer than three images have a usable point.
    """
    o, _ = known_points(flight, observations, scored)
    errors = errors_of(scored.set_index("detection_id").loc[o.table["detection_id"]])
    J = ground_jacobians(o.poses, o.uv, o.plane_down)
    derivatives = J.pose.copy()
    derivatives[:, :, 3:] = J.pose[:, :, 3:] @ level_axes(o.poses.R_nb)
    sd = used_deviations(flight, o)
    plane = sd["plane_height_m"] ** 2 * J.plane[:, :, None] * J.plane[:, None, :]
    assumed = {
        "position_horizontal": sd["position_horizontal_m"],
        "position_vertical": sd["position_vertical_m"],
        "tilt": float(np.radians(sd["tilt_deg"])),
        "heading": float(np.radians(sd["heading_deg"])),
        "pixel": sd["pixel_px"],
    }
    images = o.table["frame_id"].to_numpy()
    return estimate_pose_noise(errors, derivatives, J.pixel, plane, images, assumed, FAR_OUT)


def used_deviations(
    flight: Flight, observations: Observations, assumed: dict[str, float] | None = None
) -> dict[str, float]:
    """The standard deviations that the ellipses of observations really come from.

    Parameters
    ----------
    flight
        The flight.
    observations
        From `observe`.
    assumed
        As for `pose_errors`: takes the place of what the log and the manifest state.

    Returns
    -------
    dict
        By the names of ``USUAL``: those of the poses are the log's own where it has a covariance (root of the
        mean variance), otherwise the manifest's or the usual ones.
    """
    sd = assumed_deviations(flight) | (assumed or {})
    covariance = observations.poses.covariance
    if covariance is None or assumed is not None or not np.isfinite(covariance).any():
        return sd
    own = np.sqrt(np.nanmean(np.diagonal(covariance, axis1=1, axis2=2), axis=0))
    tilt, heading = tilt_and_heading(covariance[:, 3:, 3:], observations.poses.R_nb)
    return sd | {
        "position_horizontal_m": float(np.sqrt((own[:2] ** 2).mean())),
        "position_vertical_m": float(own[2]),
        "tilt_deg": float(np.degrees(np.sqrt(np.nanmean(tilt**2)))),
        "heading_deg": float(np.degrees(np.sqrt(np.nanmean(heading**2)))),
    }


def estimate_from_sighting(flight: Flight, seen: Sighting) -> PoseNoise:
    """Standard deviations of the poses of a camera that followed a target whose positions are known.

    As `estimate_noise`, but the attitude's errors are counted in b, as in H (7.39), and the prior lies about
    what the poses state of themselves. The known positions are taken for exact. Images nearer than `APART_S`
    to the last one are left out.

    Parameters
    ----------
    flight
        What it states of the pixel and of the ground's height is assumed.
    seen
        From `wildlab.analysis.track.sighting`, with truth.

    Returns
    -------
    PoseNoise

    Raises
    ------
    WildlabError
        Where the poses have no covariance, or fewer than three images have a known target.
    """
    if seen.poses.covariance is None:
        raise WildlabError(
            "the poses have no covariance to begin with", "use those of the MEKF: navigate_mekf(flight)"
        )
    rows = np.flatnonzero(seen.seen & np.isfinite(seen.truth[:, :2]).all(axis=1))
    slots = np.floor((seen.times[rows] - seen.times[0]) / APART_S)
    rows = rows[np.unique(slots, return_index=True)[1]]
    if len(rows) < 3:
        raise WildlabError(
            f"the target's position is known in {len(rows)} images", "give a flight with three or more"
        )
    J = ground_jacobians(seen.poses.take(rows), seen.uv[rows], seen.plane_down[rows])
    stated = np.sqrt(np.nanmean(np.diagonal(seen.poses.covariance, axis1=1, axis2=2), axis=0))
    usual = assumed_deviations(flight)
    assumed = {
        "position_horizontal": float(stated[:2].mean()),
        "position_vertical": float(stated[2]),
        "tilt": float(stated[3:5].mean()),
        "heading": float(stated[5]),
        "pixel": usual["pixel_px"],
    }
    plane = usual["plane_height_m"] ** 2 * J.plane[:, :, None] * J.plane[:, None, :]
    errors = seen.positions[rows] - seen.truth[rows, :2]
    return estimate_pose_noise(errors, J.pose, J.pixel, plane, rows, assumed)


def covariance_of(noise: PoseNoise) -> Array:
    """The covariance (6, 6) of a pose with estimated deviations, H (7.39): position in n, attitude in b."""
    level, angle = noise.sd["position_horizontal"], noise.sd["tilt"]
    sd = [level, level, noise.sd["position_vertical"], angle, angle, noise.sd["heading"]]
    return np.diag(np.square(sd))


def as_deviations(noise: PoseNoise | WanderNoise) -> dict[str, float]:
    """Estimated deviations under the names that ``pose_errors`` takes."""
    return {
        "position_horizontal_m": noise.sd["position_horizontal"],
        "position_vertical_m": noise.sd["position_vertical"],
        "tilt_deg": float(np.degrees(noise.sd["tilt"])),
        "heading_deg": float(np.degrees(noise.sd["heading"])),
        "pixel_px": noise.sd["pixel"],
    }


def evaluate_with_estimated_noise(
    flight: Flight,
    observations: Observations,
    scored: pd.DataFrame,
    rng: np.random.Generator,
    source: str | None = None,
    names: tuple[str, ...] = (),
) -> pd.DataFrame:
    """Points scored again with ellipses from pose noise estimated on the other half of the images.

    Parameters
    ----------
    flight, observations, scored
        As for `estimate_noise`.
    rng
        Draws the halves, of whole blocks in time order.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    names
        Parameters that are taken off first: estimated on the other half, too.

    Returns
    -------
    DataFrame
        As from `score_points`.
    """
    half = split_images(blocks_of(flight, scored), rng)
    parts = []
    for seen in (half, ~half):
        placed = observations
        if names:
            placed = calibrated(
                flight, source, observations, fit_flight(flight, observations, scored[seen], source, names)
            )
        learnt = score_points(flight, georeference(flight, _of(placed, scored[seen]), rng))
        deviations = as_deviations(estimate_noise(flight, placed, learnt))
        unseen = _of(placed, scored[~seen])
        parts.append(
            score_points(flight, georeference(flight, unseen, rng, pose_errors(flight, unseen, deviations)))
        )
    return pd.concat(parts, ignore_index=True)


def _of(observations: Observations, scored: pd.DataFrame) -> Observations:
    """The observations of a scored table."""
    return observations.take(observations.table["detection_id"].isin(scored["detection_id"]).to_numpy())
