"""Boats seen from a boat: a motion model for sensors of any rate, and sensors whose clock may be wrong too.

Of the errors that `wildlab.tracking.consider_parameters` knows, a level platform has `NORTH` and `EAST` of
its position (and of the part of the hull that is seen), and `YAW`, its heading. Down moves nothing on a level
sea; its place among the six of a pose is taken by `CLOCK`, the error of the stamp in seconds. `CONSIDERED`
has their names.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking.considering import considering
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.platforms import bearings, measured_from
from wildlab.tracking.predictions import Prediction, predict_range_bearing
from wildlab.tracking.predictions import predict_position as measured_position
from wildlab.tracking.sensors import Sensor

#: Columns of ``H_pose``, rows and columns of the covariance of the errors: m, m, s, rad.
NORTH, EAST, CLOCK, YAW = 0, 1, 2, 5
CONSIDERED = ("platform_north", "platform_east", "clock", "roll", "pitch", "heading")


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
    Prediction of (..., 2) with ``H_pose`` for `CONSIDERED`: that of
    `wildlab.tracking.predictions.predict_position`, and a stamp too early by a little, ahead by the drift.
    """
    return _with_clock(measured_position(position, platform), drift)


def predict_bearing(position: ArrayLike, platform: ArrayLike, drift: ArrayLike) -> Prediction:
    """A target's bearing from north (..., 1), with the same errors; NaN at the platform itself."""
    both = predict_range_bearing(position, platform, 0.0)
    one = Prediction(both.z[..., 1:], both.H_position[..., 1:, :], both.H_pose[..., 1:, :])
    return _with_clock(one, drift)


def _with_clock(seen: Prediction, drift: ArrayLike) -> Prediction:
    moved = np.einsum("...ij,...j->...i", seen.H_position, np.asarray(drift, float))
    pose = np.array(np.broadcast_to(seen.H_pose, (*moved.shape, len(CONSIDERED))))
    pose[..., CLOCK] = moved
    return seen._replace(H_pose=pose)


def positions_from(platform: ArrayLike, drift: ArrayLike) -> Sensor:
    """Positions (N, 2) measured from a platform at (N, 2), with the target's (N, 2) drift relative to it.

    The drift, m/s, is what an error of the clock moves.
    """
    return considering(measured_from(platform), CONSIDERED, velocity=drift)


def bearings_from(platform: ArrayLike, drift: ArrayLike) -> Sensor:
    """Bearings from north (N, 1), likewise."""
    return considering(bearings(platform, 0.0), CONSIDERED, velocity=drift)
