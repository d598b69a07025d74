"""Angles of a gimbal against north and the horizon, from what MAVLink and PX4 say of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.clocks import between
from wildlab.flight.readers.logs.log import Stream
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix

Array = NDArray[np.float64]

#: GIMBAL_DEVICE_FLAGS: yaw is held against north; it is given against the vehicle; it is given against north.
YAW_LOCK, YAW_VEHICLE, YAW_NORTH = 16, 32, 64
#: No angle is further from zero than two turns.
_LARGEST_DEG = 720.0


def device_angles(q: ArrayLike, flags: ArrayLike, heading_deg: ArrayLike) -> dict[str, Array]:
    """Angles of a gimbal device.

    Parameters
    ----------
    q
        (N, 4) w, x, y, z; roll and pitch against the horizon, yaw against what the flags say.
    flags
        (N,) of the device; where they do not say what yaw counts from, it is north if yaw is held there, and
        the vehicle if not, as the first devices had it.
    heading_deg
        (N,) yaw of the vehicle, NaN where it is not known.

    Returns
    -------
    dict
        ``roll_world_deg``, ``pitch_world_deg``, ``yaw_world_deg``, (N,) each; NaN where they are not known.
    """
    turns, said = np.asarray(q, float), np.asarray(flags).astype(np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.isfinite(turns).all(axis=1) & (np.abs(np.linalg.norm(turns, axis=1) - 1) < 0.5)
    turns = np.where(good[:, None], turns, [1.0, 0.0, 0.0, 0.0])
    angles = np.where(good[:, None], np.degrees(matrix_to_euler(quaternion_to_matrix(turns))), np.nan)
    north = np.where(said & (YAW_NORTH | YAW_VEHICLE), said & YAW_NORTH, said & YAW_LOCK) > 0
    yaw = np.where(north, angles[:, 2], wrapped(angles[:, 2] + np.asarray(heading_deg, float)))
    return {"roll_world_deg": angles[:, 0], "pitch_world_deg": angles[:, 1], "yaw_world_deg": yaw}


def heading_at(poses: Stream | None, times_s: ArrayLike, clock: str = "time_s") -> Array:
    """Yaw of the vehicle at times (N,) of a clock of its poses, deg; NaN where they do not reach."""
    at = np.asarray(times_s, float)
    found = np.full(len(at), np.nan)
    finite = np.isfinite(at)
    if poses is not None and poses.used.any() and finite.any():
        yaw = np.unwrap(poses.columns["yaw_deg"][poses.used], period=360.0)
        stamps = poses.columns[clock][poses.used]
        found[finite] = between(stamps, yaw[:, None], at[finite], "poses")[:, 0]
    return found


def unturned(angles: Mapping[str, Array]) -> dict[str, NDArray[np.bool_]]:
    """Reason -> (N,) rows without all three angles, as `make_stream` takes them."""
    turns = np.stack([angles[f"{name}_world_deg"] for name in ("roll", "pitch", "yaw")])
    with np.errstate(invalid="ignore"):
        return {"an angle is not known": np.asarray(~(np.abs(turns) <= _LARGEST_DEG).all(axis=0))}


def wrapped(angle_deg: ArrayLike) -> Array:
    """Angles (N,) in [-180, 180) deg."""
    return np.asarray((np.asarray(angle_deg, float) + 180.0) % 360.0 - 180.0)
