"""How wrong poses and places are: of sightings beside the truth, and of poses from held-out points."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis.evaluate import errors_of, known_points
from wildlab.analysis.georeference import (
    Observations,
    assumed_deviations,
)
from wildlab.analysis.navigate import AXES, PLACES, NavigationErrors, errors_against
from wildlab.analysis.navigation_inputs import VELOCITY
from wildlab.analysis.tracks.pixels import PixelMeasurements
from wildlab.errors import WildlabError
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.errors import SLOWEST_M_S
from wildlab.evaluation.pose_noise import PoseNoise, estimate_pose_noise
from wildlab.flight.clocks import poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.attitude_uncertainty import level_axes, tilt_and_heading
from wildlab.geometry.frames import Array, Indices, matrix_to_euler, wrap
from wildlab.geometry.uncertainty import ground_jacobians

#: A time without detections that is longer is a pause, s.
PAUSE_S = 2.0
#: From this bank on an airframe turns, rad.
TURNING = np.radians(20.0)
#: Columns of `wildlab.analysis.navigate.NavigationErrors` that are a pose's, and their names.
_POSE = [0, 1, 2, 6, 7, 8]
NAMES = (*PLACES, *AXES)


def pauses(seen: PixelMeasurements) -> list[Indices]:
    """Rows of the frames of each pause, from the first to the last without a detection.

    Parameters
    ----------
    seen
        From `wildlab.analysis.tracks.pixels.read_pixels`.

    Returns
    -------
    list of (K,) arrays
        In order of time; empty where no two detections are further apart than `PAUSE_S`.
    """
    rows = np.flatnonzero(seen.detected)
    long = np.flatnonzero(np.diff(seen.times[rows]) > PAUSE_S)
    return [np.arange(rows[i] + 1, rows[i + 1]) for i in long]


def pose_numbers(own: NavigationErrors) -> dict[str, float]:
    """What poses state of themselves and how far they are off; m and degrees.

    Parameters
    ----------
    own
        Errors of a nav source against the true poses of the camera's airframe, at the frames:
        ``errors_against(flight.nav["truth"], flight.nav[source], seen.times)``.

    Returns
    -------
    dict
        ``mean_sd_north`` to ``mean_sd_yaw``, means of what is stated, and ``rms_north`` to ``rms_yaw``.
    """
    numbers = {}
    for i, name in zip(_POSE, NAMES, strict=True):
        numbers[f"mean_sd_{name}"] = shown(name, mean(own.sd[:, i]))
        numbers[f"rms_{name}"] = shown(name, rms(own.error[:, i]))
    return numbers


def premise_numbers(
    flight: Flight, seen: PixelMeasurements, source: str, own: NavigationErrors
) -> dict[str, float]:
    """What sentences on the poses speak of; degrees.

    Parameters
    ----------
    flight
        With the nav sources ``autopilot`` and ``source``.
    seen
        With the poses of that source.
    own
        As for `pose_numbers`.

    Returns
    -------
    dict
        ``sd_spread``: the range that nine of ten of a stated deviation lie in over its median, of the
        coordinate or angle that changes most. ``difference_roll`` to ``difference_yaw``: RMS against the
        autopilot; ``outside_...``: share beyond two deviations. ``difference_turning`` and
        ``..._straight``: roll's, while the airframe turns and not. ``shift_px``: RMS over detections and both
        axes of what the pose's error moves the target by in the image; ``largest_shift_px``: the farthest
        that it does.
    """
    sd = own.sd[np.isfinite(own.sd[:, 0])][:, _POSE]
    low, middle, high = np.quantile(sd, (0.05, 0.5, 0.95), axis=0)
    numbers = {"sd_spread": float(((high - low) / middle).max())}
    beside = errors_against(flight.nav["autopilot"], flight.nav[source], seen.times)
    for i, name in enumerate(AXES, 6):
        off = beside.error[:, i]
        beyond = np.where(np.isfinite(off), np.abs(off) > 2 * beside.sd[:, i], np.nan)
        numbers[f"difference_{name}"] = shown(name, rms(off))
        numbers[f"outside_{name}"] = mean(beyond)
    turns = np.abs(matrix_to_euler(seen.poses.R_nb)[:, 0]) > TURNING
    for word, rows in (("turning", turns), ("straight", ~turns)):
        numbers[f"difference_{word}"] = shown("roll", rms(beside.error[rows, 6]))
    rows = np.flatnonzero(seen.detected)
    J = ground_jacobians(seen.poses.take(rows), seen.uv[rows], seen.plane_down[rows])
    shift = np.linalg.solve(J.pixel, J.pose @ own.error[rows][:, _POSE, None])
    far = np.hypot(*shift[:, :, 0].T)
    return numbers | {"shift_px": rms(shift.ravel()), "largest_shift_px": float(np.nanmax(far))}


def flight_numbers(flight: Flight, seen: PixelMeasurements) -> dict[str, float]:
    """How a twin was flown, and over what.

    Parameters
    ----------
    flight
        With the nav source ``truth`` and inertial samples.
    seen
        What its camera saw.

    Returns
    -------
    dict
        ``detections``, ``pauses``; shares of the frames in which the airframe is ``turning`` and the target
        ``moving`` faster than `SLOWEST_M_S`; ``crab`` (deg), RMS of heading minus course on straight legs;
        ``settled``, for how long (s) there were inertial samples when the target was first seen.
    """
    nav = flight.nav["truth"]
    p, R, _ = poses_at(nav, seen.times)
    roll, _, yaw = matrix_to_euler(R).T
    north, east = (np.interp(seen.times, nav["time_s"], nav[name]) for name in VELOCITY[:2])
    turns = np.abs(roll) > TURNING
    crab = wrap(yaw - np.arctan2(east, north))[~turns & np.isfinite(p[:, 0])]
    return {
        "detections": float(seen.detected.sum()),
        "pauses": float(len(pauses(seen))),
        "turning": float(turns.mean()),
        "moving": mean(np.hypot(*seen.truth[:, 2:].T) > SLOWEST_M_S),
        "crab": float(np.degrees(rms(crab))),
        "settled": float(seen.times[0] - flight.table("imu")["time_s"].iloc[0]),
    }


def shown(name: str, value: float) -> float:
    """A number of a pose for a reader: angles (by their name) in degrees, coordinates as they are."""
    return float(np.degrees(value)) if name in AXES else value


def mean(values: ArrayLike) -> float:
    """Mean of the known values; NaN where there is none."""
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    return float(known.mean()) if len(known) else float("nan")


def rms(values: ArrayLike) -> float:
    """Root mean square of the known values; NaN where there is none."""
    return float(np.sqrt(mean(np.square(np.asarray(values, float)))))


#: Images nearer in time than this say the same of a pose whose error wanders over tens of seconds, s.
APART_S = 1.0


#: Share of the images that is taken to be far out, where the noise is learnt from clicks.
FAR_OUT = 0.05


def estimate_noise(observations: Observations, scored: pd.DataFrame) -> PoseNoise:
    """Standard deviations of the poses behind the errors of known points.

    See `wildlab.evaluation.pose_noise`. The prior lies about what was assumed for the ellipses: what the log
    states of its own poses, where it does. A few images may be far out.

    Parameters
    ----------
    observations
        From `observe`, with a calibration applied where there is one. What their flight states of pixel and
        ground is assumed.
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
    o, _ = known_points(observations, scored)
    errors = errors_of(scored.set_index("detection_id").loc[o.table["detection_id"]])
    J = ground_jacobians(o.poses, o.uv, o.plane_down)
    derivatives = J.pose.copy()
    derivatives[:, :, 3:] = J.pose[:, :, 3:] @ level_axes(o.poses.R_nb)
    sd = used_deviations(o)
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


def used_deviations(observations: Observations, assumed: dict[str, float] | None = None) -> dict[str, float]:
    """The standard deviations that the ellipses of observations really come from.

    Parameters
    ----------
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
    sd = assumed_deviations(observations.flight) | (assumed or {})
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


def estimate_from_sighting(flight: Flight, seen: PixelMeasurements) -> PoseNoise:
    """Standard deviations of the poses of a camera that followed a target whose positions are known.

    As `estimate_noise`, but the attitude's errors are counted in b, as in H (7.39), and the prior lies about
    what the poses state of themselves. The known positions are taken for exact. Images nearer than `APART_S`
    to the last one are left out.

    Parameters
    ----------
    flight
        What it states of the pixel and of the ground's height is assumed.
    seen
        From `wildlab.analysis.tracks.pixels.read_pixels`, with truth.

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
    rows = np.flatnonzero(seen.detected & np.isfinite(seen.truth[:, :2]).all(axis=1))
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
