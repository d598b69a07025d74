"""A flight known in closed form, and sensors that err exactly as the filters are told they do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from wildlab.geometry.frames import matrix_to_quaternion, rotation_vector_to_matrix
from wildlab.navigation.aiding import Aiding, positions
from wildlab.navigation.mekf import InitialState
from wildlab.navigation.strapdown import ImuNoise, ImuSamples
from wildlab.simulation.error_models import gauss_markov
from wildlab.simulation.trajectory import Motion, angular_rates, coordinated_attitude, specific_forces

SPEED, GRAVITY = 18.0, 9.81
#: Turns: from, to (s), rate (rad/s). Straight in between.
TURNS = ((90.0, 130.0, 0.2), (160.0, 190.0, -0.25), (225.0, 250.0, 0.2), (280.0, 300.0, -0.2))
LEVERS = np.array([[0.6, 0.1, -0.2], [-0.9, -0.1, -0.1]])
NOISE = ImuNoise(2e-3, 2e-4, 0.05, 200.0, 1e-3, 300.0)
START_SD = np.repeat([0.5, 0.3, 0.03, NOISE.accelerometer_bias_sd, NOISE.gyro_bias_sd], 3)
GNSS_SD = 0.02


class Flight(NamedTuple):
    motion: Motion
    imu: ImuSamples


def heading(times, derivative=0):
    """Smooth steps between turn rates."""
    t, edge, total = np.asarray(times, float), 1.0, 0.0
    for begin, end, rate in TURNS:
        for where, sign in ((begin, rate / 2), (end, -rate / 2)):
            x = (t - where) / edge
            if derivative == 0:
                total = total + sign * edge * np.logaddexp(x, -x)
            elif derivative == 1:
                total = total + sign * np.tanh(x)
            else:
                total = total + sign / edge / np.cosh(x) ** 2
    return total


def attitude(times):
    velocity, acceleration = moved(times)
    return coordinated_attitude(velocity, acceleration, trim_pitch=0.04, gravity=GRAVITY)


def moved(times):
    psi, rate = heading(times), heading(times, 1)
    along = np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)], axis=-1)
    across = np.stack([-np.sin(psi), np.cos(psi), np.zeros_like(psi)], axis=-1)
    climb = 0.2 * np.array([0.0, 0.0, 1.0])
    velocity = SPEED * along + climb * np.sin(0.1 * times)[:, None]
    return velocity, SPEED * rate[:, None] * across + 0.1 * climb * np.cos(0.1 * times)[:, None]


def fly(duration=330.0, step=0.01) -> Flight:
    """Straight flight and turns, and what ideal sensors measure."""
    times = np.arange(0, duration, step)
    velocity, acceleration = moved(times)
    position = cumulative_simpson(velocity, x=times, axis=0, initial=0)
    motion = Motion(times, position, velocity, acceleration, attitude(times))
    return Flight(motion, ImuSamples(times, specific_forces(motion, GRAVITY), angular_rates(attitude, times)))


def spoil(flight: Flight, rng: np.random.Generator, noise: ImuNoise = NOISE) -> tuple[ImuSamples, np.ndarray]:
    """Inertial measurements as bad as the noise says, and their biases (N, 6)."""
    n, step = len(flight.imu.times), flight.imu.times[1] - flight.imu.times[0]
    biases = gauss_markov(n, step, np.repeat(noise[2::2], 3), np.repeat(noise[3::2], 3), rng)
    white = rng.standard_normal((n, 6)) * np.repeat(noise[:2], 3) / np.sqrt(step)
    _, f, w = flight.imu
    return ImuSamples(flight.imu.times, f + (biases + white)[:, :3], w + (biases + white)[:, 3:]), biases


def fixes(flight: Flight, rng: np.random.Generator, every=20, sd=GNSS_SD, outage=(0.0, 0.0)) -> list[Aiding]:
    """Positions of two antennas."""
    motion = flight.motion
    rows = np.arange(every, len(motion.times), every)
    rows = rows[(motion.times[rows] < outage[0]) | (motion.times[rows] > outage[1])]
    antennas = []
    for lever in LEVERS:
        at = motion.position[rows] + motion.R_nb[rows] @ lever
        antennas.append(positions(motion.times[rows], at + sd * rng.standard_normal(at.shape), sd, lever))
    return antennas


def begin(flight: Flight, biases: np.ndarray, rng: np.random.Generator) -> InitialState:
    """A start that is as wrong as its covariance says."""
    error = START_SD * rng.standard_normal(15)
    error[9:] = biases[0]  # the estimate of the biases is zero
    R = flight.motion.R_nb[0] @ rotation_vector_to_matrix(-error[6:9])
    p, v = flight.motion.position[0] - error[:3], flight.motion.velocity[0] - error[3:6]
    state = np.concatenate([p, v, matrix_to_quaternion(R), np.zeros(6)])
    return InitialState(0.0, state, np.diag(START_SD**2))
