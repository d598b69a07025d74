"""How the camera turns against the airframe that carries it, for a while after the bank has changed.

No sensor explains this error, and its cause is not known; a gimbal or an airframe that gives would make such
a one. What is known of it is that images err more where the attitude varies (H 6.4.2, 7.5.2), and that they
do so with either navigation system (H table 5.6), so that it belongs to neither. Its parameters are fitted; a
twin's file says to which tables.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation import kernels
from wildlab.simulation.disturbances import band_limited_disturbance
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.trajectory import Motion, Signal, Trajectory

#: Samples of the bank per second, Hz: many within the two seconds that an airframe takes to roll.
_RATE = 10.0


def recent_change(values: ArrayLike, step: float, memory: float) -> Array:
    """How much a signal has changed lately: its standard deviation over an exponentially fading past.

    It is zero while the signal stands still. After a jump it rises to half of the jump, at 0.7 of the memory,
    and fades with half the rate of the memory.

    Parameters
    ----------
    values
        (N,) samples; before the first one the signal stood still.
    step
        Time between two, s.
    memory
        Time in which the weight of a sample falls to 1/e, s.

    Returns
    -------
    (N,), in the unit of the values.

    Raises
    ------
    ValueError
        Where ``step`` or ``memory`` is not positive.

    Examples
    --------
    >>> recent_change([0.0, 0.0, 1.0], 0.1, 10.0)[:2]
    array([0., 0.])
    """
    from scipy.signal import lfilter  # brings scipy.stats along, which takes long

    if not (step > 0 and memory > 0):
        raise ValueError("step and memory must be positive")
    x = np.asarray(values, float)
    if not len(x):
        return x.copy()
    kept = np.exp(-step / memory)
    off = x - x[0]  # the filters start at rest
    mean, square = (lfilter([1 - kept], [1.0, -kept], moment) for moment in (off, off**2))
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def camera_sway(twin: TwinParameters, trajectory: Trajectory, seed: int) -> Signal | None:
    """Small angles of the camera against the airframe: a smooth error whose size follows the bank's changes.

    About each axis it is ``share`` times `recent_change` of the bank times a band-limited signal of unit
    standard deviation, all three independent.

    Parameters
    ----------
    twin
        Its ``camera_sway``.
    trajectory
        Of the airframe.
    seed
        Of the flight.

    Returns
    -------
    Times (N,) s within the flight -> (N, 3) rad, roll, pitch and yaw about the airframe's axes; None of a
    twin without such an error.
    """
    sway = twin.camera_sway
    if sway is None:
        return None
    grid = np.arange(int(twin.flight.duration.si * _RATE) + 2) / _RATE
    R = trajectory(grid).R_nb
    size = sway.share.si * recent_change(np.arctan2(R[:, 2, 1], R[:, 2, 2]), 1 / _RATE, sway.memory.si)
    rng = stream(seed, "camera sway")
    band = (sway.shortest_period.si, sway.longest_period.si)
    axes = [band_limited_disturbance(1.0, *band, rng) for _ in range(3)]

    def angles(times: Array) -> Array:
        t = np.asarray(times, float)
        return np.asarray(np.interp(t, grid, size)[:, None] * np.stack([axis(t) for axis in axes], axis=-1))

    return angles


def camera_motion(twin: TwinParameters, trajectory: Trajectory, times: Array, seed: int) -> Motion:
    """The airframe's motion as it would be if the camera were fixed to it: its own, turned by `camera_sway`.

    Parameters
    ----------
    twin, trajectory, seed
        As for `camera_sway`.
    times
        Of the exposures, (N,) s.
    """
    motion = trajectory(times)
    sway = camera_sway(twin, trajectory, seed)
    if sway is None:
        return motion
    roll, pitch, yaw = (np.ascontiguousarray(angle) for angle in sway(times).T)
    R = np.empty_like(motion.R_nb)
    kernels.turn(np.ascontiguousarray(motion.R_nb), roll, pitch, yaw, R)
    return Motion(motion.times, motion.position, motion.velocity, motion.acceleration, R)
