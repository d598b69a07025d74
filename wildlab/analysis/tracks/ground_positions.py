"""Where on the ground a sensor's detections lie, scan by scan, and what those of a scan have in common:
errors of the pose, the mount, the ground and the sensor.

Each error is given as what one standard deviation of it moves every detection's place by, so that all have
variance one. Of a pose whose covariance changes along the flight the six errors keep their identity as the
Schmidt filter keeps it (``bias`` of `wildlab.tracking.kalman`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import (
    Observations,
    assumed_deviations,
    assumed_pose_covariance,
    covariances_of,
    georeference,
    observe,
    pose_errors,
)
from wildlab.analysis.tracks.noise_model import (
    ASSUMED,
    OF_PLATFORM,
    GivenValue,
    GivenValues,
    NoiseModel,
    errors_named,
    errors_of,
)
from wildlab.analysis.tracks.scans import PLACEABLE, PLACED, SLOTS, Scans, predict_scan
from wildlab.errors import WildlabError
from wildlab.flight.manifest import SensorPart
from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image, project
from wildlab.geometry.covariances import level_axes
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import pixels_to_terrain
from wildlab.geometry.uncertainty import GroundJacobians, PoseErrors, ground_jacobians, terrain_jacobians
from wildlab.tracking.filters import thin
from wildlab.tracking.kalman import transition_of_pose, transitions_of_pose
from wildlab.tracking.sensors import POSE
from wildlab.tracking.target_model import Scan, Sees

#: An error of the clock moves a target by its speed, which nobody knows before it is tracked.
UNKNOWN_EFFECT = "clock"


class CorrelatedErrors(NamedTuple):
    """Of one sensor: ``names`` (k,) and for how long each lasts, s, (k,)."""

    names: tuple[str, ...]
    lasting_s: tuple[float, ...]


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
NO_ERRORS = CorrelatedErrors((), ())


def camera_errors(flight: Flight, observed: Observations, beliefs: NoiseModel) -> PoseErrors:
    """What georeferenced pixels may be wrong by, as filters of one target are given.

    That is `pose_errors` with the noise of pixels that the sensor is believed to have. Errors of the pose
    that are considered come on top of a covariance that poses have, and take the place of what is assumed.
    """
    errors = pose_errors(observed)._replace(pixel=np.diag(beliefs.noise[:2] ** 2))
    if observed.poses.covariance is None:
        roots = roots_of_deviations(observed.poses.R_nb, pose_deviations(flight, beliefs))
        return errors._replace(pose=roots @ np.swapaxes(roots, 1, 2))
    pose = np.array(np.broadcast_to(errors.pose, (len(observed.uv), 6, 6)))
    unknown = ~np.isfinite(pose).all(axis=(1, 2))
    on_top = {one.name: one.sd for one in beliefs.considered}
    roots = roots_of_deviations(observed.poses.R_nb, np.array([on_top.get(name, 0.0) for name in POSE]))
    pose += roots @ np.swapaxes(roots, 1, 2)
    if unknown.any():
        # Where the log says nothing for a while, what is stated or usual is taken.
        pose[unknown] = assumed_pose_covariance(observed.poses.R_nb, assumed_deviations(flight))[unknown]
    return errors._replace(pose=pose)


def pose_deviations(flight: Flight, beliefs: NoiseModel) -> Array:
    """(6,) of the errors of `POSE`, m and rad, of poses without a covariance of their own."""
    usual = assumed_deviations(flight)
    sds = {
        name: float(np.radians(usual[key])) if key.endswith("deg") else usual[key]
        for name, key in OF_PLATFORM.items()
    }
    sds |= {one.name: one.sd for one in beliefs.considered if one.name in POSE}
    return np.array([sds[name] for name in POSE])


def roots_of_deviations(R_nb: Array, sd: Array) -> Array:
    """What a standard deviation of each error of `POSE` does to poses.

    Parameters
    ----------
    R_nb
        (N, 3, 3).
    sd
        (6,) from `pose_deviations`.

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


def given_of_pixels(flight: Flight, scans: Scans, part: SensorPart, says: str) -> list[GivenValue]:
    """What is assumed of errors that all pixels of an image share; ``says``: who tells how long they last."""
    given, stated = GivenValues(scans.sensor), flight.manifest.uncertainty
    taken = {OF_PLATFORM.get(each) for name in part.considered for each in errors_named(name)}
    own = scans.poses is not None and scans.poses.covariance is not None
    if own:
        given.add("errors of the pose", "as the poses say", "the poses' own")
    for key, value in assumed_deviations(flight).items():
        if key not in _SHARED or key in taken or (own and key not in _OF_THE_MOUNT_AND_GROUND):
            continue
        unit = "°" if key.endswith("deg") else " m"
        given.number(_SHARED[key], unit, getattr(stated, key), value)
    lasts = pose_correlation_time(part)
    words = (
        "another at each scan" if lasts == 0 else "the whole flight" if np.isinf(lasts) else f"{lasts:.3g} s"
    )
    given.add("how long errors of the pose last", words, ASSUMED if lasts == 0 else says)
    return given.values


def errors_of_poses(
    flight: Flight,
    observed: Observations,
    errors: PoseErrors,
    beliefs: NoiseModel,
    lasting_s: float,
) -> tuple[Array, tuple[str, ...]]:
    """What the poses of pixels are wrong by, error by error.

    That is (N, 6, 6), whose columns are what a standard deviation of each error does to a pose, and the names
    of the six.

    Where poses have no covariance of their own and it is stated how long their errors last, these are errors
    of the platform, and those that another sensor on it considers are the same. Else they are the sensor's.
    """
    if observed.poses.covariance is not None:
        return _pose_roots(observed, errors), OF_COVARIANCE
    apart = {one.name for one in beliefs.considered if not one.shared}
    names = (f"{beliefs.sensor}: {name}" if lasting_s == 0 or name in apart else name for name in POSE)
    return roots_of_deviations(observed.poses.R_nb, pose_deviations(flight, beliefs)), tuple(names)


def platform_errors(errors: CorrelatedErrors) -> set[str]:
    """Which errors of `POSE` stand among a sensor's, by whatever name."""
    if OF_COVARIANCE[0] in errors.names:
        return set(POSE)
    return {name.split(": ")[-1] for name in errors.names} & set(POSE)


def counts_twice(errors: CorrelatedErrors, other: CorrelatedErrors) -> bool:
    """Whether errors of the platform that another sensor considers stand among these under other names."""
    return bool((platform_errors(errors) & set(other.names)) - set(errors.names))


def errors_of_pixels(
    observed: Observations,
    errors: PoseErrors,
    of_pose: tuple[Array, tuple[str, ...]],
    total: Array,
    lasting_s: float,
) -> tuple[Array, Array, CorrelatedErrors]:
    """What georeferenced pixels have of their own and in common.

    Parameters
    ----------
    observed
        From `observe`, N rows.
    errors
        What they may be wrong by.
    of_pose
        The part of the poses, from `errors_of_poses`.
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
    own = J.pixel @ errors.pixel @ np.swapaxes(J.pixel, -1, -2)
    mount, plane = np.sqrt(np.diag(errors.mount)), np.sqrt(np.asarray(errors.plane))
    shared = np.concatenate(
        [
            # As of other sensors: what is added to the known pose for the true one comes off the place.
            -J.pose @ of_pose[0],
            J.mount * mount,
            (J.plane * np.broadcast_to(plane, len(own))[:, None])[..., None],
        ],
        axis=-1,
    )
    first, rest = shared @ np.swapaxes(shared, 1, 2), total - own
    known = (np.isfinite(first) & np.isfinite(rest)).all(axis=(1, 2))
    for row in np.flatnonzero(known & ~np.isclose(first, rest, rtol=1e-6).all(axis=(1, 2))):
        values, axes = np.linalg.eigh(rest[row])
        whole = (axes * np.maximum(values, 0.0)) @ axes.T
        shared[row] = transition_of_pose(first[row], whole) @ shared[row]
    names = [*of_pose[1], *(f"mount {i}" for i in range(1, 4)), "ground"]
    return own, shared, CorrelatedErrors(tuple(names), (lasting_s,) * 6 + (np.inf,) * 4)


def errors_of_elements(scans: Scans, beliefs: NoiseModel, places: Array) -> tuple[Array, CorrelatedErrors]:
    """What considered errors do to the places (N, K, 2) of detections: (N, K, 2, k), m."""
    stated = errors_of(scans, beliefs)
    if stated is None:
        return np.zeros((*places.shape, 0)), NO_ERRORS
    kept = [i for i, name in enumerate(stated.names) if name != UNKNOWN_EFFECT]
    columns = [SLOTS[scans.kind].index(stated.names[i]) for i in kept]
    sd = np.sqrt(np.diagonal(stated.covariance, axis1=1, axis2=2)[:, kept])
    shared = np.full((*places.shape, len(kept)), np.nan)
    for k in range(places.shape[1]):
        known = np.asarray(np.isfinite(places[:, k]).all(axis=1), bool)
        at = np.where(known[:, None], places[:, k], scans.platform + 1.0)
        seen = predict_scan(scans, at, np.zeros_like(at))
        # The detection is given: what an error adds to it, the place must take away.
        back = np.linalg.pinv(np.nan_to_num(seen.H_position[..., :2])) @ seen.H_pose[..., columns]
        shared[:, k] = np.where(known[:, None, None], back, np.nan) * sd[:, None]
    own = tuple(stated.names[i] if stated.shared[i] else f"{scans.sensor}: {stated.names[i]}" for i in kept)
    times = np.broadcast_to(stated.correlation_time, len(stated.names))[kept]
    return shared, CorrelatedErrors(own, tuple(times.tolist()))


def pose_correlation_time(part: SensorPart) -> float:
    """For how long errors of a camera's pose last, s: as stated, or the shortest time of those considered.

    Zero, another error at each scan, where nobody says: a part of them fades within seconds, and a track that
    took them for constant would be left by its own detections.
    """
    if part.correlation_time_s is not None:
        return float(part.correlation_time_s)
    of_pose = [one for name, one in part.considered.items() if set(errors_named(name)) <= set(POSE)]
    times = [one.correlation_time_s for one in of_pose]
    return min((np.inf if one is None else float(one) for one in times), default=0.0)


def _jacobians(observed: Observations) -> GroundJacobians:
    o = observed
    if o.terrain is None:
        return ground_jacobians(o.poses, o.uv, o.plane_down)
    met = pixels_to_terrain(o.poses, o.uv, o.terrain).points
    return terrain_jacobians(o.poses, o.uv, met, o.terrain.slopes_at(met[:, :2]))


def _pose_roots(observed: Observations, errors: PoseErrors) -> Array:
    """(N, 6, 6) A with A A' the covariance of each row's pose, and each column one error along the flight."""
    covariances = np.broadcast_to(np.asarray(errors.pose, float), (len(observed.uv), 6, 6))
    times = observed.table["time_s"].to_numpy(float)
    known = np.isfinite(times) & np.isfinite(covariances).all(axis=(1, 2))
    roots = np.full((len(times), 6, 6), np.nan)
    if not known.any():
        return roots
    _, first, scan = np.unique(times[known], return_index=True, return_inverse=True)
    own = covariances[known][first]
    sd = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2)[0], 0.0))
    unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
    values, axes = np.linalg.eigh(own[0] * np.outer(unit, unit))
    at = np.empty_like(own)
    at[0] = sd[:, None] * (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    for row, change in enumerate(transitions_of_pose(own)[1:], start=1):
        at[row] = change @ at[row - 1]
    roots[known] = at[scan]
    return roots


def align_errors(
    parts: list[tuple[CorrelatedErrors, list[Array | None]]],
) -> tuple[tuple[float, ...], list[list[Array]]]:
    """Errors of several sensors side by side: those of one name are one error.

    Parameters
    ----------
    parts
        For each sensor its errors, and of each of its scans (M, 2, k); None where they move nothing.

    Returns
    -------
    lasting_s, shared
        (K,) of all errors that move anything, the shorter time where sensors differ; and for each sensor and
        scan (M, 2, K).
    """
    lasting: dict[str, float] = {}
    for errors, scans in parts:
        for i, (name, lasts) in enumerate(zip(*errors, strict=True)):
            if any(one is not None and one[..., i].any() for one in scans):
                lasting[name] = min(lasts, lasting.get(name, np.inf))
    columns = {name: i for i, name in enumerate(lasting)}
    found = []
    for errors, scans in parts:
        kept = [i for i, name in enumerate(errors.names) if name in columns]
        to = [columns[errors.names[i]] for i in kept]
        mine = []
        for one in scans:
            shared = np.zeros((0 if one is None else len(one), 2, len(columns)))
            if one is not None:
                shared[..., to] = one[..., kept]
            mine.append(shared)
        found.append(mine)
    return tuple(lasting.values()), found


#: Looks, and places about the platform, by which it is found how much of the ground an image shows.
MOST_SCANS, PLACES = 50, 4000


def _disc(count: int) -> Array:
    """(count, 2) places of a disc of radius one, evenly spread: a spiral whose turns never fall in line."""
    number = np.arange(count) + 0.5
    angle = np.pi * (3 - np.sqrt(5)) * number
    return np.sqrt(number / count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


_DISC = _disc(PLACES)


class PlacedScans(NamedTuple):
    """Looks of one sensor.

    Attributes
    ----------
    sensor, kind
        Its name, and what it detects.
    scans
        N scans; ``sensor`` of each is ``order``.
    named
        For each scan the targets that its detections name: never given to the tracker.
    interval_s
        The usual time between two.
    without
        How many detections have no place: rays that miss the ground, scans outside of the platform's log.
    errors
        What the detections of a scan have in common, as ``shared`` of each scan has it.
    """

    sensor: str
    kind: str
    scans: list[Scan]
    named: list[frozenset[str]]
    interval_s: float
    without: int
    errors: CorrelatedErrors = NO_ERRORS

    @property
    def bearings(self) -> bool:
        """Whether it measures bearings, which tell no place alone."""
        return self.kind not in PLACED

    def distances(self) -> Array:
        """(D,) m of all detections from the platform; none of bearings."""
        if self.bearings:
            return np.zeros(0)
        return np.concatenate(
            [np.zeros(0), *(np.linalg.norm(one.z - one.platform, axis=1) for one in self.scans)]
        )

    def area(self, far: float) -> float:
        """Square metres that one scan covers: of all around as far as it sees, what its camera shows."""
        disc = float(np.pi * far**2)
        viewed = [one for one in self.scans if one.sees is not None]
        shares = [
            float(one.sees(one.platform + far * _DISC).mean())
            for one in viewed[:: max(len(viewed) // MOST_SCANS, 1)]
            if one.sees is not None
        ]
        return disc * max(float(np.median(shares)), 1 / len(_DISC)) if shares else disc


def place_scans(
    flight: Flight, scans: Scans, beliefs: NoiseModel, order: int, source: str | None, lasting_s: float = 0.0
) -> PlacedScans:
    """The scans of a sensor as places, what each is wrong by alone, and what they have in common.

    Parameters
    ----------
    scans, beliefs
        Of the sensor; noise and considered errors are those of the filters of one target. Bearings have none
        that last.
    order
        Which of the sensors it is.
    lasting_s
        For how long errors of the pose last, of a camera.
    source
        Name of the ``nav`` table, for pixels.

    Raises
    ------
    WildlabError
        Where its detections tell nothing of a place.
    """
    if scans.kind not in PLACEABLE:
        raise WildlabError(
            f"the sensor {scans.sensor!r} detects {scans.kind!r}, which tells nothing of a place",
            f"follow many targets by sensors that detect {', '.join(PLACEABLE)}; name them with --sensor",
            file=flight.folder,
            field="detections.kind",
        )
    shared, errors = np.zeros((*scans.detections.shape[:2], 2, 0)), NO_ERRORS
    if scans.kind == "pixel":
        z, R, shared, errors = _of_pixels(flight, scans, beliefs, source, lasting_s)
    elif scans.kind == "position":
        z = scans.detections
        R = np.broadcast_to(np.diag(beliefs.noise**2), (*z.shape, 2))
    elif scans.kind == "bearing":
        z = scans.detections[..., :1]
        R = np.broadcast_to(np.diag(beliefs.noise[:1] ** 2), (*z.shape, 1))
    else:
        z, R = _of_ranges(scans, beliefs)
    if scans.kind in ("position", "range-bearing"):
        shared, errors = errors_of_elements(scans, beliefs, z)
    usable = np.isfinite(scans.platform).all(axis=1)
    placed, named, without = [], [], 0
    for row in np.flatnonzero(usable):
        there = np.isfinite(scans.detections[row]).all(axis=-1)
        good = there & np.isfinite(z[row]).all(axis=-1) & np.isfinite(R[row]).all(axis=(-2, -1))
        good &= np.isfinite(shared[row]).all(axis=(-2, -1))
        without += int((there & ~good).sum())
        time, platform = float(scans.times[row]), scans.platform[row]
        sees, common = view_of(scans, int(row)), shared[row][good] if errors.names else None
        placed.append(Scan(time, order, platform, z[row][good], R[row][good], sees, common))
        named.append(frozenset(str(one) for one in scans.labels[row] if one))
    without += int(np.isfinite(scans.detections[~usable]).all(axis=-1).sum())
    return PlacedScans(scans.sensor, scans.kind, placed, named, scans.interval_s, without, errors)


def thinned(places: PlacedScans, apart_s: float) -> PlacedScans:
    """Only scans at least so far apart, see `wildlab.tracking.filters.thin`."""
    kept = np.flatnonzero(thin([scan.time for scan in places.scans], apart_s))
    return places._replace(
        scans=[places.scans[row] for row in kept], named=[places.named[row] for row in kept]
    )


def _of_ranges(scans: Scans, beliefs: NoiseModel) -> tuple[Array, Array]:
    """Range on the level and bearing from north as a place; the covariance to first order.

    A range no longer than the drop tells no place: NaN.
    """
    distance, azimuth = scans.detections[..., 0], scans.detections[..., 1]
    drop = np.nan_to_num(scans.drop)[:, None] if len(scans.drop) else 0.0
    with np.errstate(invalid="ignore"):
        level = np.sqrt(np.maximum(distance**2 - drop**2, 0.0))
        level = np.where(level > 0, level, np.nan)
        stretch = distance / level
    c, s = np.cos(azimuth), np.sin(azimuth)
    z = scans.platform[:, None] + np.stack([level * c, level * s], axis=-1)
    J = np.stack(
        [np.stack([stretch * c, -level * s], axis=-1), np.stack([stretch * s, level * c], axis=-1)], axis=-2
    )
    return z, J @ np.diag(beliefs.noise[:2] ** 2) @ np.swapaxes(J, -1, -2)


def _of_pixels(
    flight: Flight, scans: Scans, beliefs: NoiseModel, source: str | None, lasting_s: float
) -> tuple[Array, Array, Array, CorrelatedErrors]:
    """Rays where they meet the ground, what each is wrong by alone, and what the poses do to all."""
    observed = observe(flight, source, clock_shift=beliefs.offset_s)
    assumed = camera_errors(flight, observed, beliefs)
    points = georeference(observed, np.random.default_rng(0), assumed)
    of_pose = errors_of_poses(flight, observed, assumed, beliefs, lasting_s)
    own, shared, errors = errors_of_pixels(observed, assumed, of_pose, covariances_of(points), lasting_s)
    ids = pd.Index(points["detection_id"])
    row = pd.Index(ids[~ids.duplicated()]).get_indexer(pd.Index(scans.ids.ravel()))
    row = np.where(row < 0, -1, np.flatnonzero(~ids.duplicated())[row])
    z = points[["north_m", "east_m"]].to_numpy(float)
    found = [np.where((row < 0).reshape(-1, *[1] * (part.ndim - 1)), np.nan, part[row])
             for part in (z, own, shared)]  # fmt: skip
    z, own, shared = (part.reshape(*scans.ids.shape, *part.shape[1:]) for part in found)
    return z, own, shared, errors


def view_of(scans: Scans, row: int) -> Sees | None:
    """What the image of a scan shows of the plane that targets move on; None where it is of no camera."""
    poses = scans.poses
    if poses is None:
        return None
    down, origin, R_nc = scans.plane_down[row], poses.p_nc[row], poses.R_nc[row]

    def sees(places: Array) -> NDArray[np.bool_]:
        at = np.concatenate([places, np.full((len(places), 1), down)], axis=1)
        return in_image(poses.camera, project(poses.camera, (at - origin) @ R_nc))

    return sees
