"""Motion of a body: position, velocity, acceleration and attitude, and the rates and forces that go with it.

A path is a function of time that gives position, velocity and acceleration in closed form (`loiter`,
`waypoint_courses`). The attitude follows from it by the physics of flight (`attitudes`), so that inertial
sensors can be simulated from the same motion without contradiction. Frame n counts as inertial, as in
H 5.2.2: the Earth's rotation is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array

#: Times (N,) in s -> position, velocity, acceleration in n, (N, 3) each, in m, m/s, m/s^2.
FlightPath = Callable[[Array], tuple[Array, Array, Array]]
#: Times (N,) in s -> something of shape (N, ...).
Signal = Callable[[Array], Array]

GRAVITY = 9.81  # m/s^2, where nothing better is known


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


def move(path: FlightPath, attitude: Signal, times: ArrayLike) -> Motion:
    """The motion at given times, (N,) s."""
    t = np.asarray(times, float)
    p, v, a = path(t)
    return Motion(t, p, v, a, attitude(t))


def angular_rates(attitude: Signal, times: ArrayLike, step: float = 0.01) -> Array:
    """Angular rate of b against n, in b. (N,) s -> (N, 3) rad/s.

    By a central difference of fourth order of the attitude, which is known in closed form: for motion with
    periods of two seconds and more the error is below 1e-8 of the rate's own size.
    """
    t = np.asarray(times, float)

    def mean_rate(h: float) -> Array:
        turn = np.swapaxes(attitude(t - h), -1, -2) @ attitude(t + h)
        return np.asarray(Rotation.from_matrix(turn).as_rotvec() / (2 * h))

    return (4 * mean_rate(step) - mean_rate(2 * step)) / 3


def specific_forces(motion: Motion, gravity: float = GRAVITY) -> Array:
    """What ideal accelerometers feel, in b. (N, 3) m/s^2."""
    force = motion.acceleration - np.array([0.0, 0.0, gravity])
    return np.asarray((np.swapaxes(motion.R_nb, -1, -2) @ force[..., None])[..., 0])
