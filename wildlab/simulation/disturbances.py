"""Band-limited disturbances: smooth random signals with all their derivatives, as sums of sines.

Control errors of an airframe, what gusts leave of its attitude, and how a payload turns against it are such
signals. They are not Gauss-Markov errors (`error_models`): those have no derivative, and no sensor rides on
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation import kernels

_SINES = 16  # enough that a signal does not visibly repeat, few enough to be cheap


@dataclass(frozen=True)
class Disturbance:
    """A sum of sines: a smooth signal with all its derivatives. (K,) each; rad/s, rad."""

    amplitudes: Array
    frequencies: Array
    phases: Array

    def __call__(self, times: ArrayLike, derivative: int = 0) -> Array:
        """The signal or one of its derivatives with respect to time. (N,) s -> (N,)."""
        strength = self.amplitudes * self.frequencies**derivative
        phases = self.phases + derivative * np.pi / 2
        return np.asarray(_summed(times, strength, self.frequencies, phases, 1)[0])

    def with_derivatives(self, times: ArrayLike) -> Array:
        """The signal and its first two derivatives with respect to time. (N,) s -> (3, N)."""
        return _summed(times, self.amplitudes, self.frequencies, self.phases, 3)


def _summed(times: ArrayLike, amplitudes: Array, frequencies: Array, phases: Array, rows: int) -> Array:
    t = np.ascontiguousarray(times, float)
    out = np.empty((rows, len(t)))
    kernels.sum_of_sines(t, amplitudes, frequencies, phases, out)
    return out


def no_disturbance() -> Disturbance:
    """The signal that is zero."""
    return Disturbance(np.zeros(1), np.ones(1), np.zeros(1))


#: Roll, pitch and yaw (rad) about a body's own axes.
AttitudeDisturbance = tuple[Disturbance, Disturbance, Disturbance]


def band_limited_disturbance(
    sd: float, shortest_period: float, longest_period: float, rng: np.random.Generator
) -> Disturbance:
    """A random smooth signal, as an autopilot's control errors are: it never jumps, and never quite repeats.

    Sixteen sines of equal power with random phases, one in each of sixteen equal parts (in log frequency) of
    the band. The mean square over a long time is ``sd`` squared for every draw.

    Parameters
    ----------
    sd
        Standard deviation, in whatever unit the signal has.
    shortest_period, longest_period
        The band, s.
    """
    slots = (np.arange(_SINES) + rng.random(_SINES)) / _SINES
    periods = longest_period * (shortest_period / longest_period) ** slots
    phases = rng.uniform(0.0, 2 * np.pi, _SINES)
    return Disturbance(np.full(_SINES, sd * np.sqrt(2.0 / _SINES)), 2 * np.pi / periods, phases)
