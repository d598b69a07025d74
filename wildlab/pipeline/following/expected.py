"""What each look of a sensor should see of a target, and what errors that last do to it.

Six errors stand beside a measurement, in the order of `SLOTS` for its kind. On a level platform the third and
fourth of a pose move nothing; the errors of clock and range have their places.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import Array
from wildlab.pipeline.scans import Scans, Truth
from wildlab.tracking.maritime import (
    CLOCK,
    YAW,
    bearings_from,
    positions_from,
    predict_bearing,
    predict_position,
)
from wildlab.tracking.measurement import Prediction, Sensor, difference, predict_pixel, predict_range_bearing

#: The place of the error of a range that is too long.
RANGE = 3
_LEVEL = ("platform_north", "platform_east", "clock", "range", "", "heading")
#: Which errors the six columns of ``H_pose`` are of, "" none.
SLOTS: dict[str, tuple[str, ...]] = {
    "position": _LEVEL,
    "range-bearing": _LEVEL,
    "bearing": _LEVEL,
    "velocity": _LEVEL,
    "pixel": ("platform_north", "platform_east", "platform_down", "roll", "pitch", "heading"),
}


def predict_scan(scans: Scans, position: ArrayLike, velocity: ArrayLike) -> Prediction:
    """What every scan should have seen of a target at (N, 2) moving with (N, 2)."""
    p, v = np.asarray(position, float), np.asarray(velocity, float)
    return _predict(scans, slice(None), p, v, v - scans.platform_velocity)


def sensor_of(scans: Scans, drift: ArrayLike) -> Sensor:
    """The sensor for the readable filters, with the target's (N, 2) drift relative to the platform."""
    moves = np.asarray(drift, float)
    at = np.nan_to_num(scans.platform)
    if scans.kind == "position":
        return positions_from(at, moves)
    if scans.kind == "bearing" and "elevation" not in scans.elements:
        return bearings_from(at, moves)

    def predict(row: int, state: Array) -> Prediction:
        return _predict(scans, row, state[..., :2], state[..., 2:4], moves[row])

    return Sensor(predict, scans.angles, len(scans.times), states=4 if scans.kind == "velocity" else 2)


def _predict(scans: Scans, rows: int | slice, p: Array, v: Array, drift: Array) -> Prediction:
    """Of the rows, at (..., 2) with the velocity and the drift (..., 2)."""
    if scans.kind == "position":
        return predict_position(p, scans.platform[rows], drift)
    if scans.kind == "velocity":
        H = np.broadcast_to(np.eye(2, 4, 2), (*v.shape, 4))
        return Prediction(v, H, np.zeros((*v.shape, 6)))
    if scans.kind == "pixel":
        if scans.poses is None:
            raise AssertionError("pixels have poses")
        taken = scans.poses.take(rows) if isinstance(rows, int) else scans.poses
        return predict_pixel(p, taken, scans.plane_down[rows])
    if scans.elements == ("azimuth",):
        return predict_bearing(p, scans.platform[rows], drift)
    return _along(predict_range_bearing(p, scans.platform[rows], 0.0), scans, rows, drift)


def _along(level: Prediction, scans: Scans, rows: int | slice, drift: Array) -> Prediction:
    """Range along the line of sight, bearing and elevation, of which ``level`` has level range and bearing."""
    r, drop = level.z[..., 0], scans.drop[rows]
    # A height that is not known is none: the range is then taken for level.
    drop = np.where(np.isfinite(drop), drop, 0.0) + 0.0 * r
    slant = np.hypot(r, drop)
    z, H, pose = level.z.copy(), level.H_position.copy(), level.H_pose.copy()
    by_range = level.H_position[..., 0, :], level.H_pose[..., 0, :]
    kept = {"azimuth": (z[..., 1], H[..., 1, :], pose[..., 1, :])}
    share = (r / slant)[..., None]
    along = by_range[1] * share
    along[..., RANGE] = 1.0
    kept["range"] = (slant, by_range[0] * share, along)
    # Down is below the horizon; elevation counts upwards.
    turn = (drop / slant**2)[..., None]
    kept["elevation"] = (-np.arctan2(drop, r), by_range[0] * turn, by_range[1] * turn)
    z, H, pose = (np.stack([kept[name][i] for name in scans.elements], axis=-1 if i == 0 else -2)
                  for i in range(3))  # fmt: skip
    pose = pose.copy()
    pose[..., CLOCK] = np.einsum("...ij,...j->...i", H, drift)
    return Prediction(z, H, pose)


def errors_near(scans: Scans, truth: Truth, reach: float) -> tuple[Array, NDArray[np.intp]]:
    """Error (N, m) of the detection of a target at every scan, and which it is.

    The one that names it, where detections do; else the nearest within ``reach`` (m, or rad where there is no
    more than angles). Measured minus expected; NaN and -1 where there is none.
    """
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


assert _LEVEL.index("heading") == YAW and _LEVEL.index("clock") == CLOCK
