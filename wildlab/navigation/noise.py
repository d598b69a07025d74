"""How inertial sensors err, in the terms that data sheets use."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import USUAL_GRAVITY


class ImuNoise(NamedTuple):
    """How an inertial sensor errs, in SI units; alike on all axes.

    Attributes
    ----------
    velocity_random_walk
        White noise of the specific force, m/s/sqrt(s).
    angle_random_walk
        White noise of the angular rate, rad/sqrt(s).
    accelerometer_bias_sd, gyro_bias_sd
        Of the slow part of the bias, m/s^2 and rad/s: its standard deviation after a long time, or, where the
        time is infinite, its random walk in m/s^2/sqrt(s) and rad/s/sqrt(s).
    accelerometer_bias_time, gyro_bias_time
        Correlation time, s (H 7.24); infinite for a random walk.
    """

    velocity_random_walk: float
    angle_random_walk: float
    accelerometer_bias_sd: float
    accelerometer_bias_time: float
    gyro_bias_sd: float
    gyro_bias_time: float


class AxisErrors(NamedTuple):
    """How far the axes of a triad are from where they should be: constants of a flight.

    Alike for gyros and accelerometers, whose errors have nothing to do with each other.

    Attributes
    ----------
    package
        Standard deviation of the angle by which all three axes are turned about each axis of b, rad.
    axis
        Of the angle by which each axis leans towards each of the other two on top of that, rad.
    scale
        Of what the factors are off by, 1.
    """

    package: float
    axis: float = 0.0
    scale: float = 0.0

    def covariance(self) -> Array:
        """Of a triad's nine errors, row by row: it reads ``(I + E)`` times what there is, (9, 9)."""
        P = np.diag(np.full(9, self.package**2 + self.axis**2))
        for i in range(3):
            P[4 * i, 4 * i] = self.scale**2
            for j in range(3):
                if i != j:  # a turn of the whole moves one axis towards the other, and the other away
                    P[3 * i + j, 3 * j + i] = -(self.package**2)
        return P


def with_turn_on(noise: ImuNoise, accelerometer: float, gyro: float) -> ImuNoise:
    """Noise whose biases also differ from one switching-on to the next.

    A constant and a process of first order together are taken as one such process, with the variance of
    both and the spectral density that drives the second: over a flight, a constant that drifts a little.
    Random walks (an infinite time) stay as they are.

    Parameters
    ----------
    noise
        Without the constants. Where the correlation time of a bias is finite, its standard deviation is
        above zero.
    accelerometer, gyro
        Standard deviations of the constant parts of the biases, m/s^2 and rad/s.

    Returns
    -------
    ImuNoise
    """
    biases: list[float] = []
    for sd, time, constant in ((*noise[2:4], accelerometer), (*noise[4:6], gyro)):
        biases += (
            (sd, time)
            if np.isinf(time)
            else (float(np.hypot(sd, constant)), time * (1 + (constant / sd) ** 2))
        )
    return ImuNoise(*noise[:2], *biases)


#: H table A.6; the time is chosen: the minute or so at which Allan deviations of such sensors are lowest.
STIM300 = ImuNoise(
    0.07 / 60, float(np.radians(0.15)) / 60, 0.05e-3 * USUAL_GRAVITY, 100.0, float(np.radians(0.3)) / 3600,
    100.0,
)  # fmt: skip
