"""Where a track of one sensor starts: at rest, on a detection, as uncertain as that leaves it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.analysis.following.consider_parameters import errors_of
from wildlab.analysis.following.expected import SLOTS, errors_near, sensor_of
from wildlab.analysis.following.noise_model import NoiseModel, TargetModel
from wildlab.analysis.scans import Scans, Truth
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.tracking.initiation import start_from_rays
from wildlab.tracking.records import Start


def start_near(
    scans: Scans, truth: Truth, beliefs: NoiseModel, targets: TargetModel, others: Sequence[Truth] = ()
) -> Start | None:
    """A start at the first detection within reach of the target's true place; None where there is none.

    One that lies nearer to one of the ``others`` is not taken. The detection itself is not used up: the start
    is as uncertain as the search was wide, and the detection is the first that the filter is given.
    """
    reach = targets.reach(scans.kind)
    error, nearest = errors_near(scans, truth, reach)
    taken = nearest >= 0
    for other in others:
        beside, its = errors_near(scans, other, reach)
        rival = (its == nearest) & (np.linalg.norm(beside, axis=1) < np.linalg.norm(error, axis=1))
        taken &= ~rival
    rows = np.flatnonzero(taken & np.isfinite(scans.platform).all(axis=1))
    for row in rows:
        z = scans.detections[row, nearest[row]]
        place = place_of(scans, int(row), z, beliefs)
        if place is None:
            continue
        x, P = place
        if scans.kind == "position":
            P = np.eye(2) * reach**2
        elif scans.kind == "bearing" and len(z) == 1:
            ahead = np.array([np.cos(z[0]), np.sin(z[0])])
            right = np.array([-ahead[1], ahead[0]])
            P = beliefs.range_sd_m**2 * np.outer(ahead, ahead)
            P += (beliefs.range_m * reach) ** 2 * np.outer(right, right)
        return at_rest(float(scans.times[row]), x, P, targets)
    return None


def start_first(scans: Scans, own: Array, beliefs: NoiseModel, targets: TargetModel) -> Start | None:
    """A start on the first usable row of ``own`` (N, m), which is used up; None where there is none.

    Bearings whose distance nobody knows start where the first of them meet that cross.
    """
    if scans.elements == ("azimuth",) and not np.isfinite(beliefs.range_m):
        return _start_from_rays(scans, own, beliefs, targets)
    for row in np.flatnonzero(np.isfinite(own).all(axis=1) & np.isfinite(scans.platform).all(axis=1)):
        place = place_of(scans, int(row), own[row], beliefs)
        if place is not None:
            return at_rest(float(scans.times[row]), *place, targets, int(row))
    return None


def _start_from_rays(scans: Scans, own: Array, beliefs: NoiseModel, targets: TargetModel) -> Start | None:
    there = np.asarray(np.isfinite(scans.platform).all(axis=1))
    usable = np.where(there[:, None], own, np.nan)
    sensor = sensor_of(scans, np.zeros_like(scans.platform))
    try:
        return start_from_rays(
            scans.times, usable, np.diag(beliefs.white**2), sensor, sd_velocity=targets.start_speed_m_s
        )
    except WildlabError:
        return None  # all near parallel, or they settle on no place


def at_rest(time: float, place: Array, P: Array, targets: TargetModel, row: int = -1) -> Start:
    """A start at rest, with the covariance (2, 2) of the place."""
    both = np.zeros((4, 4))
    both[:2, :2], both[2:, 2:] = P, np.eye(2) * targets.start_speed_m_s**2
    return Start(time, np.concatenate([place, np.zeros(2)]), both, row)


def place_of(scans: Scans, row: int, z: Array, beliefs: NoiseModel) -> tuple[Array, Array] | None:
    """North and east that a measurement (m,) says, with what noise and considered errors leave uncertain.

    None where it does not say: a velocity, a ray that meets no ground, a bearing whose distance nobody knows.
    """
    place = _place(scans, row, z, beliefs)
    if place is None or not np.isfinite(place).all():
        return None
    R = np.diag(beliefs.white**2)
    if scans.kind == "bearing" and len(z) == 1:
        ahead = np.array([np.cos(z[0]), np.sin(z[0])])
        right = np.array([-ahead[1], ahead[0]])
        across = beliefs.range_m * float(beliefs.white[0])
        P = beliefs.range_sd_m**2 * np.outer(ahead, ahead) + across**2 * np.outer(right, right)
        return place, P
    seen = sensor_of(scans, np.zeros_like(scans.platform)).predict(row, np.append(place, [0.0, 0.0]))
    H = seen.H_position[:, :2]
    errors = errors_of(scans, beliefs)
    if errors is not None and np.isfinite(errors.covariance[row]).all():
        G = seen.H_pose[:, [SLOTS[scans.kind].index(name) for name in errors.names]]
        R = R + G @ errors.covariance[row] @ G.T
    if not np.isfinite(H).all():
        return None
    inverse = np.linalg.pinv(H)
    return place, np.asarray(inverse @ R @ inverse.T)


def _place(scans: Scans, row: int, z: Array, beliefs: NoiseModel) -> Array | None:
    if scans.kind == "position":
        return np.asarray(z[:2])
    if scans.kind == "pixel" and scans.poses is not None:
        ground = georeference_pixels(scans.poses.take(np.array([row])), z[None], scans.plane_down[[row]])
        return np.asarray(ground[0, :2])
    if scans.kind == "velocity":
        return None
    elements = dict(zip(scans.elements, z, strict=True))
    drop = float(np.nan_to_num(scans.drop[row]))
    if "range" in elements:
        r = float(np.sqrt(max(elements["range"] ** 2 - drop**2, 0.0)))
    elif "elevation" in elements:
        below = np.tan(-elements["elevation"])
        r = drop / below if below * drop > 0 else np.nan
    else:
        r = beliefs.range_m
    azimuth = elements["azimuth"]
    return np.asarray(scans.platform[row] + r * np.array([np.cos(azimuth), np.sin(azimuth)]))
