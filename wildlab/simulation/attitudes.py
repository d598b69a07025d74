"""The attitude that flies a path: of a fixed wing, which banks, and of a multicopter or a gondola."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.gravity import USUAL_GRAVITY
from wildlab.simulation import kernels
from wildlab.simulation.disturbances import AttitudeDisturbance
from wildlab.simulation.trajectory import FlightPath, Motion, Signal, Trajectory, turned


def coordinated_attitude(
    velocity: ArrayLike,
    acceleration: ArrayLike,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
) -> Array:
    """The attitude in which a fixed wing flies a path: nose into the oncoming air, banked into the turn.

    Coordinated flight: no sideslip and no specific force along y of the body, so that in still air a level
    circle has ``tan(bank) = speed^2 / (gravity * radius)``.

    Parameters
    ----------
    velocity, acceleration
        Of b in n, (N, 3), m/s and m/s^2.
    wind
        Velocity of the air in n, (3,), m/s.
    trim_pitch
        Angle of attack, rad: how far the nose is above the oncoming air.
    gravity
        m/s^2.

    Returns
    -------
    ``R_nb`` (N, 3, 3).
    """
    v, a = (np.ascontiguousarray(part, float) for part in (velocity, acceleration))
    R = np.empty((len(v), 3, 3))
    kernels.coordinated_attitude(v, a, np.array(wind, float), float(trim_pitch), float(gravity), R)
    return R


def fixed_wing_trajectory(
    path: FlightPath,
    *,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
    gusts: AttitudeDisturbance | None = None,
) -> Trajectory:
    """Motion along a path in coordinated flight, and gusts about it.

    Parameters
    ----------
    path
        Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.
    wind, trim_pitch, gravity
        As for :func:`coordinated_attitude`.
    gusts
        Small roll, pitch and yaw (rad) about the body's own axes, as control leaves them; None is none.

    Returns
    -------
    Times (N,) s -> `Motion`.
    """

    def motion(times: Array) -> Motion:
        t = np.asarray(times, float)
        p, v, a = path(t)
        calm = Motion(
            t, p, v, a, coordinated_attitude(v, a, wind=wind, trim_pitch=trim_pitch, gravity=gravity)
        )
        return calm if gusts is None else turned(calm, gusts)

    return motion


def thrust_aligned_trajectory(
    path: FlightPath,
    heading: Signal,
    *,
    trim_pitch: float = 0.0,
    gravity: float = USUAL_GRAVITY,
    gusts: AttitudeDisturbance | None = None,
) -> Trajectory:
    """Motion of what leans no more than its own acceleration asks for, whichever way its nose points.

    A multicopter's thrust points along its specific force, so it leans forward to go faster and sideways to
    turn.

    Parameters
    ----------
    path
        Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.
    heading
        Where the nose points, times (N,) s -> (N,) rad, from north towards east.
    trim_pitch
        Pitch in steady motion, rad: below zero for a multicopter that leans against the air.
    gravity
        m/s^2. With an infinite one it does not lean: a gondola that hangs level but for gusts.
    gusts
        As for :func:`fixed_wing_trajectory`.

    Returns
    -------
    Times (N,) s -> `Motion`.
    """

    def motion(times: Array) -> Motion:
        t = np.asarray(times, float)
        p, v, a = path(t)
        z = np.array([0.0, 0.0, 1.0]) - a / gravity
        z /= np.linalg.norm(z, axis=-1, keepdims=True)
        nose = heading(t)
        ahead = np.stack([np.cos(nose), np.sin(nose), np.zeros(len(t))], axis=-1)
        y = np.cross(z, ahead)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        R = np.stack([np.cross(y, z), y, z], axis=-1) @ euler_to_matrix(0.0, trim_pitch, 0.0)
        calm = Motion(t, p, v, a, R)
        return calm if gusts is None else turned(calm, gusts)

    return motion
