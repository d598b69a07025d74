"""What the detections of a look have in common: errors of the pose, the mount, the ground and the sensor.

Each is told as what one standard deviation of it moves every detection's place by, so that all have variance
one. Of a pose whose covariance changes along the flight the six errors keep their identity as `wildlab
track`'s filters keep it (``bias`` of `wildlab.tracking.schmidt`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.following.consider_parameters import errors_of
from wildlab.analysis.following.expected import SLOTS, predict_scan
from wildlab.analysis.following.noise_model import ASSUMED, STATED, NoiseModel, ToldValue, errors_named
from wildlab.analysis.georeference import (
    Observations,
    assumed_deviations,
    assumed_pose_covariance,
    pose_errors,
)
from wildlab.analysis.scans import Scans
from wildlab.flight.following import SensorPart
from wildlab.flight.store import Flight
from wildlab.geometry.attitude_uncertainty import level_axes
from wildlab.geometry.terrain import pixels_to_terrain
from wildlab.geometry.terrain_uncertainty import terrain_jacobians
from wildlab.geometry.uncertainty import PoseErrors, ground_jacobians
from wildlab.tracking.predictions import POSE
from wildlab.tracking.schmidt import transition_of_pose, transitions_of_pose

Array = NDArray[np.float64]

#: An error of the clock moves a target by its speed, which nobody knows before it is tracked.
UNKNOWN_EFFECT = "clock"


class LastingErrors(NamedTuple):
    """Of one sensor: ``names`` (k,) and for how long each lasts, s, (k,)."""

    names: tuple[str, ...]
    lasting_s: tuple[float, ...]


#: Angles of `wildlab.analysis.georeference.USUAL`.
_DEGREES = {"roll": "tilt_deg", "pitch": "tilt_deg", "heading": "heading_deg"}
_METRES = {
    "platform_north": "position_horizontal_m",
    "platform_east": "position_horizontal_m",
    "platform_down": "position_vertical_m",
}
_OF_PLATFORM = _METRES | _DEGREES
_SHARED = {
    "position_horizontal_m": "error of the camera's position, SD of north and of east",
    "position_vertical_m": "error of the camera's height, SD",
    "tilt_deg": "error of the tilt, SD of each level axis",
    "heading_deg": "error of the heading, SD",
    "misalignment_deg": "error of the mount, SD of each axis",
    "plane_height_m": "error of the ground's height, SD",
}
_OF_THE_MOUNT_AND_GROUND = ("misalignment_deg", "plane_height_m")
#: Errors of a pose that has a covariance of its own, of which no single one has a name.
OF_COVARIANCE = tuple(f"pose {i}" for i in range(1, 7))
#: None at all.
NO_ERRORS = LastingErrors((), ())


def told_errors(flight: Flight, observed: Observations, beliefs: NoiseModel) -> PoseErrors:
    """What georeferenced pixels may be wrong by, as filters of one target are told.

    That is `pose_errors` with the noise of pixels that the sensor is believed to have. Errors of the pose
    that are considered come on top of a covariance that poses have, and take the place of what is assumed.
    """
    errors = pose_errors(flight, observed)._replace(pixel=np.diag(beliefs.noise[:2] ** 2))
    if observed.poses.covariance is None:
        roots = stated_roots(observed.poses.R_nb, stated_deviations(flight, beliefs))
        return errors._replace(pose=roots @ np.swapaxes(roots, 1, 2))
    pose = np.array(np.broadcast_to(errors.pose, (len(observed.uv), 6, 6)))
    unknown = ~np.isfinite(pose).all(axis=(1, 2))
    on_top = {one.name: one.sd for one in beliefs.considered}
    roots = stated_roots(observed.poses.R_nb, np.array([on_top.get(name, 0.0) for name in POSE]))
    pose += roots @ np.swapaxes(roots, 1, 2)
    if unknown.any():
        # Where the log says nothing for a while, what is stated or usual is taken.
        pose[unknown] = assumed_pose_covariance(observed.poses.R_nb, assumed_deviations(flight))[unknown]
    return errors._replace(pose=pose)


def stated_deviations(flight: Flight, beliefs: NoiseModel) -> Array:
    """(6,) of the errors of `POSE`, m and rad, of poses without a covariance of their own."""
    usual = assumed_deviations(flight)
    found = [np.radians(usual[key]) if name in _DEGREES else usual[key] for name, key in _OF_PLATFORM.items()]
    sds = dict(zip(_OF_PLATFORM, found, strict=True))
    sds |= {one.name: one.sd for one in beliefs.considered if one.name in POSE}
    return np.array([sds[name] for name in POSE])


def stated_roots(R_nb: Array, sd: Array) -> Array:
    """What a standard deviation of each error of `POSE` does to poses.

    Parameters
    ----------
    R_nb
        (N, 3, 3).
    sd
        (6,) from `stated_deviations`.

    Returns
    -------
    (N, 6, 6)
        A column for each error: position in n, m, and rotation vector in b, rad. Times its transpose it is
        the covariance. Errors of the attitude are about the axes of `level_axes`: one of the heading stays
        one, whichever way the body lies.
    """
    roots = np.zeros((len(R_nb), 6, 6))
    roots[:, :3, :3] = np.diag(sd[:3])
    roots[:, 3:, 3:] = level_axes(R_nb) * sd[3:]
    return roots


def said_of_pixels(flight: Flight, scans: Scans, part: SensorPart | None) -> list[ToldValue]:
    """What is believed of the errors that all pixels of an image share, and who says so."""
    said, stated = [], flight.manifest.uncertainty
    stated_names = {} if part is None else part.considered
    taken = {_OF_PLATFORM.get(each) for name in stated_names for each in errors_named(name)}
    own = scans.poses is not None and scans.poses.covariance is not None
    if own:
        said.append(ToldValue(scans.sensor, "errors of the pose", "as the poses say", "the poses' own"))
    for key, value in assumed_deviations(flight).items():
        if key not in _SHARED or key in taken or (own and key not in _OF_THE_MOUNT_AND_GROUND):
            continue
        unit = "°" if key.endswith("deg") else " m"
        source = ASSUMED if getattr(stated, key) is None else STATED
        said.append(ToldValue(scans.sensor, _SHARED[key], f"{value:.3g}{unit}", source))
    lasts = lasting_of(part)
    words = (
        "another at each look" if lasts == 0 else "the whole flight" if np.isinf(lasts) else f"{lasts:.3g} s"
    )
    said.append(
        ToldValue(scans.sensor, "how long errors of the pose last", words, ASSUMED if lasts == 0 else STATED)
    )
    return said


class OfPose(NamedTuple):
    """Errors of the poses: ``roots`` (N, 6, 6) whose columns are what a standard deviation of each does to a
    pose, and the ``names`` of the six."""

    roots: Array
    names: tuple[str, ...]


def of_poses(
    flight: Flight,
    observed: Observations,
    errors: PoseErrors,
    beliefs: NoiseModel,
    lasting_s: float,
) -> OfPose:
    """What the poses of pixels are wrong by, error by error.

    Where poses have no covariance of their own and it is stated how long their errors last, these are errors
    of the platform, and those that another sensor on it considers are the same. Else they are the sensor's.
    """
    if observed.poses.covariance is not None:
        return OfPose(_pose_roots(observed, errors), OF_COVARIANCE)
    apart = {one.name for one in beliefs.considered if not one.shared}
    names = (f"{beliefs.sensor}: {name}" if lasting_s == 0 or name in apart else name for name in POSE)
    return OfPose(stated_roots(observed.poses.R_nb, stated_deviations(flight, beliefs)), tuple(names))


def of_platform(errors: LastingErrors) -> set[str]:
    """Which errors of `POSE` stand among a sensor's, by whatever name."""
    if OF_COVARIANCE[0] in errors.names:
        return set(POSE)
    return {name.split(": ")[-1] for name in errors.names} & set(POSE)


def counted_twice(errors: LastingErrors, other: LastingErrors) -> bool:
    """Whether errors of the platform that another sensor considers stand among these under other names."""
    return bool((of_platform(errors) & set(other.names)) - set(errors.names))


def of_pixels(
    observed: Observations, errors: PoseErrors, of_pose: OfPose, total: Array, lasting_s: float
) -> tuple[Array, Array, LastingErrors]:
    """What georeferenced pixels have of their own and in common.

    Parameters
    ----------
    observed
        From `observe`, N rows.
    errors
        What they may be wrong by.
    of_pose
        The part of the poses, from `of_poses`.
    total
        (N, 2, 2) covariances of their places by these, m^2: where they are of samples, what is in common is
        stretched to it.
    lasting_s
        For how long errors of the pose last; those of the mount and the ground stay.

    Returns
    -------
    R, shared
        (N, 2, 2) of each alone and (N, 2, k), in m.
    errors
        The k of them.
    """
    J = _jacobians(observed)
    own = J["pixel"] @ errors.pixel @ np.swapaxes(J["pixel"], -1, -2)
    mount, plane = np.sqrt(np.diag(errors.mount)), np.sqrt(np.asarray(errors.plane))
    shared = np.concatenate(
        [
            # As of other sensors: what is added to the known pose for the true one comes off the place.
            -J["pose"] @ of_pose.roots,
            J["mount"] * mount,
            (J["plane"] * np.broadcast_to(plane, len(own))[:, None])[..., None],
        ],
        axis=-1,
    )
    first, rest = shared @ np.swapaxes(shared, 1, 2), total - own
    known = (np.isfinite(first) & np.isfinite(rest)).all(axis=(1, 2))
    for row in np.flatnonzero(known & ~np.isclose(first, rest, rtol=1e-6).all(axis=(1, 2))):
        values, axes = np.linalg.eigh(rest[row])
        whole = (axes * np.maximum(values, 0.0)) @ axes.T
        shared[row] = transition_of_pose(first[row], whole, "bias") @ shared[row]
    names = [*of_pose.names, *(f"mount {i}" for i in range(1, 4)), "ground"]
    return own, shared, LastingErrors(tuple(names), (lasting_s,) * 6 + (np.inf,) * 4)


def of_elements(scans: Scans, beliefs: NoiseModel, places: Array) -> tuple[Array, LastingErrors]:
    """What considered errors do to the places (N, K, 2) of detections: (N, K, 2, k), m."""
    stated = errors_of(scans, beliefs)
    if stated is None:
        return np.zeros((*places.shape, 0)), NO_ERRORS
    kept = [i for i, name in enumerate(stated.names) if name != UNKNOWN_EFFECT]
    names = [stated.names[i] for i in kept]
    columns = [SLOTS[scans.kind].index(name) for name in names]
    sd = np.sqrt(np.diagonal(stated.covariance, axis1=1, axis2=2)[:, kept])
    shared = np.full((*places.shape, len(kept)), np.nan)
    for k in range(places.shape[1]):
        known = np.asarray(np.isfinite(places[:, k]).all(axis=1), bool)
        at = np.where(known[:, None], places[:, k], scans.platform + 1.0)
        seen = predict_scan(scans, at, np.zeros_like(at))
        # The detection is given: what an error adds to it, the place must take away.
        back = np.linalg.pinv(np.nan_to_num(seen.H_position[..., :2])) @ seen.H_pose[..., columns]
        shared[:, k] = np.where(known[:, None, None], back, np.nan) * sd[:, None]
    times = np.broadcast_to(np.asarray(stated.correlation_time, float), len(stated.names))
    common = stated.shared or (True,) * len(stated.names)
    own = tuple(name if common[i] else f"{scans.sensor}: {name}" for i, name in zip(kept, names, strict=True))
    return shared, LastingErrors(own, tuple(float(times[i]) for i in kept))


def lasting_of(part: SensorPart | None) -> float:
    """For how long errors of a camera's pose last, s: as stated, or the shortest time of those considered.

    Zero, another error at each look, where nobody says: a part of them fades within seconds, and a track that
    took them for constant would be left by its own detections.
    """
    if part is None:
        return 0.0
    if part.correlation_time_s is not None:
        return float(part.correlation_time_s)
    of_pose = [one for name, one in part.considered.items() if set(errors_named(name)) <= set(POSE)]
    times = [one.correlation_time_s for one in of_pose]
    return min((np.inf if one is None else float(one) for one in times), default=0.0)


def _jacobians(observed: Observations) -> dict[str, Array]:
    o = observed
    if o.terrain is None:
        J = ground_jacobians(o.poses, o.uv, o.plane_down)
        return {"pixel": J.pixel, "pose": J.pose, "mount": J.mount, "plane": J.plane}
    met = pixels_to_terrain(o.poses, o.uv, o.terrain).points
    on = terrain_jacobians(o.poses, o.uv, met, o.terrain.slopes_at(met[:, :2]))
    return {"pixel": on.pixel, "pose": on.pose, "mount": on.mount, "plane": on.height}


def _pose_roots(observed: Observations, errors: PoseErrors) -> Array:
    """(N, 6, 6) A with A A' the covariance of each row's pose, and each column one error along the flight."""
    covariances = np.broadcast_to(np.asarray(errors.pose, float), (len(observed.uv), 6, 6))
    times = observed.table["time_s"].to_numpy(float)
    known = np.isfinite(times) & np.isfinite(covariances).all(axis=(1, 2))
    roots = np.full((len(times), 6, 6), np.nan)
    if not known.any():
        return roots
    _, first, look = np.unique(times[known], return_index=True, return_inverse=True)
    own = covariances[known][first]
    sd = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2)[0], 0.0))
    unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, axes = np.linalg.eigh(own[0] * np.outer(unit, unit))
    at = np.empty_like(own)
    at[0] = sd[:, None] * (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    for row, change in enumerate(transitions_of_pose(own, "bias")[1:], start=1):
        at[row] = change @ at[row - 1]
    roots[known] = at[look]
    return roots


def laid_out(
    parts: list[tuple[LastingErrors, list[Array | None]]],
) -> tuple[tuple[float, ...], list[list[Array]]]:
    """Errors of several sensors side by side: those of one name are one error.

    Parameters
    ----------
    parts
        For each sensor its errors, and of each of its looks (M, 2, k); None where they move nothing.

    Returns
    -------
    lasting_s, shared
        (K,) of all errors that move anything, the shorter time where sensors differ; and for each sensor and
        look (M, 2, K).
    """
    lasting: dict[str, float] = {}
    for errors, looks in parts:
        for i, (name, lasts) in enumerate(zip(*errors, strict=True)):
            if any(one is not None and one[..., i].any() for one in looks):
                lasting[name] = min(lasts, lasting.get(name, np.inf))
    columns = {name: i for i, name in enumerate(lasting)}
    found = []
    for errors, looks in parts:
        kept = [i for i, name in enumerate(errors.names) if name in columns]
        to = [columns[errors.names[i]] for i in kept]
        mine = []
        for one in looks:
            shared = np.zeros((0 if one is None else len(one), 2, len(columns)))
            if one is not None:
                shared[..., to] = one[..., kept]
            mine.append(shared)
        found.append(mine)
    return tuple(lasting.values()), found
