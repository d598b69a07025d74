"""What each look of a sensor should see of a target, and what errors that last do to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.scans import Scans, Truth
from wildlab.geometry.attitude_uncertainty import level_axes
from wildlab.geometry.frames import Array
from wildlab.tracking.predictions import (
    POSE,
    Prediction,
    predict_pixel,
    predict_position,
    predict_range_bearing,
)
from wildlab.tracking.sensors import Sensor, difference

_LEVEL = ("platform_north", "platform_east", "heading", "clock")
#: Errors that may be considered, by kind of detection: the columns of ``H_pose``, in this order. Those of a
#: camera's attitude are about level axes and the vertical, see `wildlab.geometry.attitude_uncertainty`.
SLOTS: dict[str, tuple[str, ...]] = {
    "position": _LEVEL,
    "range-bearing": (*_LEVEL, "range_bias"),
    "bearing": _LEVEL,
    "velocity": (),
    "pixel": (*POSE, "clock"),
}


def predict_scan(scans: Scans, position: ArrayLike, velocity: ArrayLike) -> Prediction:
    """What every scan should have seen of a target at (N, 2) moving with (N, 2)."""
    p, v = np.asarray(position, float), np.asarray(velocity, float)
    return _predict(scans, slice(None), p, v, v - scans.platform_velocity)


def sensor_of(scans: Scans, drift: ArrayLike) -> Sensor:
    """The sensor for the filters, with the target's (N, 2) drift relative to the platform, m/s."""
    moves = np.asarray(drift, float)

    def predict(row: int, state: Array) -> Prediction:
        return _predict(scans, row, state[..., :2], state[..., 2:4], moves[row])

    def ray(row: int, z: Array) -> tuple[Array, Array]:
        azimuth = z[scans.elements.index("azimuth")]
        return np.append(scans.platform[row], 0.0), np.array([np.cos(azimuth), np.sin(azimuth), 0.0])

    return Sensor(
        predict,
        scans.angles,
        len(scans.times),
        4 if scans.kind == "velocity" else 2,
        scans.elements,
        SLOTS[scans.kind],
        ray if "azimuth" in scans.elements else None,
    )


def _predict(scans: Scans, rows: int | slice, p: Array, v: Array, drift: Array) -> Prediction:
    """Of the rows, at (..., 2) with the velocity and the drift (..., 2)."""
    if scans.kind == "velocity":
        H = np.broadcast_to(np.eye(2, 4, 2), (*v.shape, 4))
        return Prediction(v, H, np.zeros((*v.shape, 0)))
    if scans.kind == "pixel":
        if scans.poses is None:
            raise AssertionError("pixels have poses")
        taken = scans.poses.take(rows) if isinstance(rows, int) else scans.poses
        seen = predict_pixel(p, taken, scans.plane_down[rows])
        pose = seen.H_pose.copy()
        pose[..., 3:] = pose[..., 3:] @ level_axes(taken.R_nb)
        return _with(seen, pose, seen.z, seen.H_position, drift)
    platform = scans.platform[rows]
    if scans.kind == "position":
        seen = predict_position(p, platform)
        return _with(seen, seen.H_pose[..., _OF_LEVEL], seen.z, seen.H_position, drift)
    seen = predict_range_bearing(p, platform, 0.0)
    return _along(seen, scans, rows, drift)


#: The errors of a level platform among those of a pose.
_OF_LEVEL = [POSE.index(name) for name in _LEVEL[:3]]


def _with(seen: Prediction, pose: Array, z: Array, H: Array, drift: Array) -> Prediction:
    """Derivatives for the clock behind those for the pose."""
    clock = np.einsum("...ij,...j->...i", H, drift)[..., None]
    both = np.broadcast_to(pose, (*clock.shape[:-1], pose.shape[-1]))
    return Prediction(z, H, np.concatenate([both, clock], axis=-1))


def _along(level: Prediction, scans: Scans, rows: int | slice, drift: Array) -> Prediction:
    """Range along the line of sight, bearing and elevation; ``level`` has level range and bearing."""
    r, drop = level.z[..., 0], scans.drop[rows]
    pose = level.H_pose[..., _OF_LEVEL]
    # A height that is not known is none: the range is then taken for level.
    drop = np.where(np.isfinite(drop), drop, 0.0) + 0.0 * r
    slant = np.hypot(r, drop)
    share, turn = (r / slant)[..., None], (drop / slant**2)[..., None]
    H_range, H_bearing = level.H_position[..., 0, :], level.H_position[..., 1, :]
    kept = {
        "azimuth": (level.z[..., 1], H_bearing, pose[..., 1, :]),
        "range": (slant, H_range * share, pose[..., 0, :] * share),
        # Down is below the horizon; elevation counts upwards.
        "elevation": (-np.arctan2(drop, r), H_range * turn, pose[..., 0, :] * turn),
    }
    z = np.stack([kept[name][0] for name in scans.elements], axis=-1)
    H, by_pose = (np.stack([kept[name][i] for name in scans.elements], axis=-2) for i in (1, 2))
    seen = _with(level, by_pose, z, H, drift)
    if "range" not in scans.elements:
        return seen
    bias = np.zeros((*seen.H_pose.shape[:-1], 1))
    bias[..., scans.elements.index("range"), 0] = 1.0
    return seen._replace(H_pose=np.concatenate([seen.H_pose, bias], axis=-1))


def errors_near(scans: Scans, truth: Truth, reach: float) -> tuple[Array, NDArray[np.intp]]:
    """Error (N, m) of the detection of a target at every scan, and which it is.

    The one that names it, where detections do; else the nearest within ``reach`` (m, or rad where there is no
    more than angles). Measured minus expected; NaN and -1 where there is none.
    """
    if scans.kind not in SLOTS:
        return np.full(scans.detections[:, 0].shape, np.nan), np.full(len(scans.times), -1)
    expected = predict_scan(scans, truth.position, truth.velocity).z
    error = difference(scans.detections, expected[:, None], scans.angles)
    if scans.labelled:
        size = np.where(scans.labels == truth.target, 0.0, np.inf)
        size = np.where(np.isfinite(error).all(axis=-1), size, np.inf)
        reach = np.inf
    else:
        size = np.linalg.norm(across(scans, error, expected), axis=-1)
        size = np.where(np.isfinite(size), size, np.inf)
    best = np.argmin(size, axis=1)
    rows = np.arange(len(best))
    near = (size[rows, best] < reach) & np.isfinite(size[rows, best])
    return np.where(near[:, None], error[rows, best], np.nan), np.where(near, best, -1)


def across(scans: Scans, error: Array, expected: Array) -> Array:
    """Errors (N, K, m) in one unit: metres, or radians where the distance is not measured."""
    if scans.kind == "pixel" and scans.poses is not None:
        return error / scans.poses.camera.fx
    if scans.kind != "range-bearing":
        return error
    metres = np.ones((len(expected), 2))
    metres[:, scans.elements.index("azimuth")] = expected[:, scans.elements.index("range")]
    return error * metres[:, None]
