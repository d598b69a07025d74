"""Motion of a body: position, velocity, acceleration and attitude, and the rates and forces that go with it.

A path is a function of time that gives position, velocity and acceleration in closed form (`loiter`,
`waypoint_courses`). The attitude follows from it by the physics of flight (`attitudes`), so that inertial
sensors can be simulated from the same motion without contradiction. Frame n counts as inertial, as in
H 5.2.2: the Earth's rotation is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import USUAL_GRAVITY
from wildlab.simulation import kernels
from wildlab.simulation.disturbances import AttitudeDisturbance

#: Times (N,) in s -> position, velocity, acceleration in n, (N, 3) each, in m, m/s, m/s^2.
FlightPath = Callable[[Array], tuple[Array, Array, Array]]
#: Times (N,) in s -> something of shape (N, ...).
Signal = Callable[[Array], Array]


@dataclass(frozen=True)
class Motion:
    """What an airframe does at N times.

    Attributes
    ----------
    times
        (N,) s.
    position, velocity, acceleration
        Of b in n, (N, 3), in m, m/s and m/s^2.
    R_nb
        (N, 3, 3).
    """

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    R_nb: Array


#: Times (N,) in s -> the motion at these times.
Trajectory = Callable[[Array], Motion]


def turned(motion: Motion, disturbance: AttitudeDisturbance) -> Motion:
    """The motion of a body in the same place, turned about the axes of the first one by small angles."""
    R = np.empty_like(motion.R_nb)
    roll, pitch, yaw = (angle(motion.times) for angle in disturbance)
    kernels.turn(np.ascontiguousarray(motion.R_nb), roll, pitch, yaw, R)
    return replace(motion, R_nb=R)


def attitude_along(trajectory: Trajectory) -> Signal:
    """Of a trajectory the attitude alone.

    Parameters
    ----------
    trajectory
        Times (N,) s -> `Motion`.

    Returns
    -------
    Times (N,) s -> ``R_nb`` (N, 3, 3).
    """
    return lambda times: trajectory(times).R_nb


def angular_rates(attitude: Signal, times: ArrayLike, step: float = 0.01) -> Array:
    """Angular rate of b against n, in b.

    By a central difference of fourth order of the attitude, which is known in closed form: for motion with
    periods of two seconds and more the error is below 1e-8 of the rate's own size.

    Parameters
    ----------
    attitude
        Times (N,) s -> ``R_nb`` (N, 3, 3); asked up to two steps before and after each time.
    times
        (N,) s.
    step
        Of the difference, s.

    Returns
    -------
    (N, 3) rad/s, in b.
    """
    t = np.asarray(times, float)
    rates = np.empty((len(t), 3))
    R = [np.ascontiguousarray(attitude(t + steps * step)) for steps in (-2, -1, 1, 2)]
    kernels.body_rates(R[0], R[1], R[2], R[3], step, rates)
    return rates


def specific_forces(motion: Motion, gravity: float = USUAL_GRAVITY) -> Array:
    """What ideal accelerometers feel: the acceleration less gravity.

    Parameters
    ----------
    motion
        Of b at N times.
    gravity
        m/s^2, straight down in n.

    Returns
    -------
    (N, 3) m/s^2, in b.
    """
    force = motion.acceleration - np.array([0.0, 0.0, gravity])
    return np.asarray((np.swapaxes(motion.R_nb, -1, -2) @ force[..., None])[..., 0])
