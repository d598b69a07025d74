"""Boats seen from a boat: a motion model for sensors of any rate, and sensors whose clock may be wrong too.

Of the six errors of a pose that `wildlab.tracking.schmidt` considers, a level platform has three: `NORTH` and
`EAST` of its position (and of the part of the hull that is seen), and `YAW`, its heading. The third, down,
moves nothing on a level sea; its place is taken by `CLOCK`, the error of the stamp in seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking.measurement import Prediction, Sensor, predict_range_bearing
from wildlab.tracking.motion import constant_velocity

#: Columns of ``H_pose``, rows and columns of the covariance of the errors: m, m, s, rad.
NORTH, EAST, CLOCK, YAW = 0, 1, 2, 5


def white_acceleration(dt: float, density: float) -> tuple[Array, Array]:
    """Velocity driven by white acceleration, state ``[pN, pE, vN, vE]``.

    Continuous in time: two steps amount to one, so that sensors of different rates assume the same boat.

    Parameters
    ----------
    dt
        s, not negative.
    density
        m/s per square root of a second: the standard deviation of each axis of the velocity that grows in a
        second.
    """
    F, _ = constant_velocity(dt, 0.0)
    Q = density**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return F, np.asarray(np.kron(Q, np.eye(2)), float)


def predict_position(position: ArrayLike, platform: ArrayLike, drift: ArrayLike) -> Prediction:
    """A target's position as a platform measures it: its own position plus what it sees from there.

    Parameters
    ----------
    position, platform
        (..., 2) north, east of the target and of the platform.
    drift
        (..., 2) velocity of the target relative to the platform, m/s: what an error of the clock moves.

    Returns
    -------
    Prediction of (..., 2) with ``H_pose`` for the errors of this module: with ``p = p_hat + dp`` the position
    is measured too far back by ``dp``; with the yaw too small by a little, turned back about the platform by
    it; a stamp too early by a little, ahead by the drift.
    """
    p = np.asarray(position, float)
    offset, drift = np.broadcast_arrays(p - np.asarray(platform, float), np.asarray(drift, float))
    pose = np.zeros((*p.shape, 6))
    pose[..., 0, NORTH] = pose[..., 1, EAST] = -1.0
    pose[..., CLOCK] = drift
    pose[..., 0, YAW], pose[..., 1, YAW] = offset[..., 1], -offset[..., 0]
    return Prediction(p, np.broadcast_to(np.eye(2), (*p.shape, 2)), pose)


def predict_bearing(position: ArrayLike, platform: ArrayLike, drift: ArrayLike) -> Prediction:
    """A target's bearing from north (..., 1), with the same errors; NaN at the platform itself."""
    both = predict_range_bearing(position, platform, 0.0)
    pose = both.H_pose[..., 1:, :].copy()
    pose[..., CLOCK] = np.einsum("...ij,...j->...i", both.H_position[..., 1:, :], np.asarray(drift, float))
    return Prediction(both.z[..., 1:], both.H_position[..., 1:, :], pose)


def positions_from(platform: ArrayLike, drift: ArrayLike) -> Sensor:
    """Positions (N, 2) measured from a platform at (N, 2), with the target's (N, 2) drift relative to it."""
    at, moves = np.asarray(platform, float), np.asarray(drift, float)
    return Sensor(
        lambda row, position: predict_position(position, at[row], moves[row]), (False, False), len(at)
    )


def bearings_from(platform: ArrayLike, drift: ArrayLike) -> Sensor:
    """Bearings from north (N, 1), likewise."""
    at, moves = np.asarray(platform, float), np.asarray(drift, float)
    return Sensor(lambda row, position: predict_bearing(position, at[row], moves[row]), (True,), len(at))
