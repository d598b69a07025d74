"""How sensors err: time-correlated errors, clocks that drift, logs that round.

Functions take true values and a generator, and return what a sensor would say. No function here knows what
anyone makes of it.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array
from wildlab.simulation import kernels


def stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of one sensor, independent of those of every other.

    Keyed by the sensor's name rather than by a running number: a new sensor changes nobody else's noise.

    Parameters
    ----------
    seed
        Of the flight, a whole number from 0.
    name
        Of the sensor, or of whatever else is random.

    Returns
    -------
    numpy.random.Generator
        The same numbers for the same seed and name.

    Raises
    ------
    ValueError
        Where the seed is negative.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)))


def gauss_markov(
    count: int, step: float, sd: ArrayLike, correlation_time: ArrayLike, rng: np.random.Generator
) -> Array:
    """A stationary first-order Gauss-Markov process per axis: an error that stands, and slowly drifts.

    The autocorrelation is ``sd^2 exp(-lag / correlation_time)`` from the first sample on: the process starts
    in its stationary distribution.

    Parameters
    ----------
    count
        N samples.
    step
        Time between two, s.
    sd, correlation_time
        Standard deviation (in the error's unit) and correlation time (s), scalars or (K,).
    rng
        Where the random numbers come from; see :func:`stream`.

    Returns
    -------
    (N, K), in the error's unit; K is 1 where both are scalars.

    Raises
    ------
    ValueError
        Where standard deviations and correlation times are not as many, or ``count`` is negative.
    """
    spread, tau = np.broadcast_arrays(np.atleast_1d(np.asarray(sd, float)), np.atleast_1d(correlation_time))
    draws = rng.standard_normal((count, len(spread)))
    kernels.gauss_markov(draws, np.array(spread), np.exp(-step / tau.astype(float)))
    return draws


def with_attitude_error(R_nb: ArrayLike, error: ArrayLike) -> Array:
    """Attitudes as a sensor with an attitude error reports them.

    ``error`` (N, 3) rad is the rotation vector in b for which ``R_true = R_reported Exp(error)``, the sense
    in which a flight's covariances are meant. (N, 3, 3) -> (N, 3, 3).
    """
    return np.asarray(np.asarray(R_nb, float) @ Rotation.from_rotvec(-np.asarray(error, float)).as_matrix())


def rounded(values: ArrayLike, step: float) -> Array:
    """Values as a log of that resolution holds them; a step of 0 leaves them."""
    x = np.asarray(values, float)
    return np.asarray(np.round(x / step) * step) if step > 0 else x.copy()


#: Time that a computer takes for each stamp, s.
SHORTEST_GAP_S = 1e-3


def computer_stamps(
    times: ArrayLike,
    offset: float,
    drift: float,
    latency: float,
    rng: np.random.Generator,
) -> Array:
    """Times as a computer stamps them on arrival: a clock that is off and drifts, and a queue (H 2.5.2).

    Parameters
    ----------
    times
        (N,) true times, s, increasing.
    offset
        How far the clock is ahead at the first of them, s.
    drift
        How much it gains, s/s.
    latency
        Mean delay until the computer looks, s, drawn from an exponential distribution: mostly prompt, now and
        then busy. Nothing overtakes: what arrives behind a late one waits for it.

    Returns
    -------
    (N,) s, strictly increasing.
    """
    t = np.asarray(times, float)
    if len(t) == 0:
        return t.copy()
    ready = t + rng.exponential(latency, len(t)) if latency > 0 else t
    turn = SHORTEST_GAP_S * np.arange(len(t))
    seen = np.maximum.accumulate(ready - turn) + turn
    return np.asarray(seen + offset + drift * (seen - t[0]))
