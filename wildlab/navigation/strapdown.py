"""How inertial sensors err, in the terms that data sheets use.

Inertial samples on one line of time, and dead reckoning by them (H 7.18-7.20).

The frame is n, fixed to the ground at its origin, with the Earth's rotation and the lean of the plumb line
where an `Earth` has them (H 5.31-5.33 in ECEF); `flat_earth` gives the equations as H 7.3 prints them.
Inertial samples are instantaneous values, taken as linear in between: a step takes the mean of the values at
its ends, and the attitude half-way. Measurements and wanted times lie where they lie, not at the nearest
sample. Corrections for coning and sculling are left out: between samples at 50 Hz and more, an airframe's
rates are straight lines to well below what its sensors resolve, and vibration that is already averaged or
aliased would not gain from them either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import USUAL_GRAVITY, Array, Earth
from wildlab.navigation import kernels
from wildlab.navigation.kernels import Integers


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


class ImuSamples(NamedTuple):
    """Inertial measurements.

    Attributes
    ----------
    times
        (N,) s, increasing; need not be evenly spaced.
    specific_force, angular_rate
        In b, (N, 3), m/s^2 and rad/s. A row with NaN counts as missing.
    """

    times: Array
    specific_force: Array
    angular_rate: Array


class Gap(NamedTuple):
    """Where inertial samples are missing: the last before, the first after, s."""

    start: float
    end: float


class Timeline(NamedTuple):
    """Nodes of the integration: (K,) times, (K, 3) specific force and rate there.

    ``gap`` (K,) is the length (s) of the gap in which the step that ends at the node lies, 0 where in none.
    ``row_of_node`` (K,) is the output row that the node fills, or -1.
    """

    times: Array
    f: Array
    w: Array
    gap: Array
    row_of_node: Integers


class Measurements(NamedTuple):
    """Measurements in order of time: the node each belongs to, its kind, value, variance and lever arm.

    ``gauss_markov`` (E,) is the first of its three Gauss-Markov error states, -1 where it has none.
    """

    node: Integers
    kind: Integers
    value: Array
    variance: Array
    lever: Array
    gauss_markov: Integers


def checked_imu(imu: ImuSamples) -> ImuSamples:
    """The samples that can be used, as arrays of floats.

    Raises
    ------
    WildlabError
        If shapes do not fit, fewer than two samples are left, or times do not increase.
    """
    t, f, w = (np.asarray(part, float) for part in imu)
    if t.ndim != 1 or f.shape != (len(t), 3) or w.shape != (len(t), 3):
        raise WildlabError(
            f"inertial samples have the shapes {t.shape}, {f.shape} and {w.shape}",
            "give times (N,), specific force (N, 3) and angular rate (N, 3)",
            field="imu",
        )
    whole = np.isfinite(t) & np.isfinite(f).all(axis=1) & np.isfinite(w).all(axis=1)
    t, f, w = t[whole], f[whole], w[whole]
    if len(t) < 2:
        raise WildlabError(
            f"only {len(t)} inertial samples have all their values", "give at least two", field="imu"
        )
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        raise WildlabError(
            f"inertial samples do not go forward in time at {t[back[0] + 1]:.6f} s ({len(back)} such places)",
            "sort them and remove repeated stamps",
            field="imu",
        )
    return ImuSamples(np.ascontiguousarray(t), np.ascontiguousarray(f), np.ascontiguousarray(w))


def find_gaps(times: ArrayLike, max_gap: float) -> list[Gap]:
    """Intervals between samples longer than ``max_gap`` (s)."""
    t = np.asarray(times, float)
    return [Gap(float(t[i]), float(t[i + 1])) for i in np.flatnonzero(np.diff(t) > max_gap)]


def lay_out(imu: ImuSamples, start: float, others: ArrayLike, wanted: ArrayLike, max_gap: float) -> Timeline:
    """Nodes from ``start`` to the last inertial sample.

    Parameters
    ----------
    imu
        As :func:`checked_imu` gives it.
    others
        Times of measurements, s; those outside are left out.
    wanted
        (M,) times of the output rows; those outside are never filled.
    max_gap
        Intervals longer than this (s) are not integrated.
    """
    end = imu.times[-1]
    wanted = np.asarray(wanted, float)
    stamps = np.concatenate([[start], imu.times, np.asarray(others, float), wanted])
    times = np.unique(stamps[(stamps >= start) & (stamps <= end)])
    f, w = (np.stack([np.interp(times, imu.times, column) for column in part.T], axis=-1) for part in imu[1:])
    interval = np.diff(imu.times)
    middle = np.concatenate([times[:1], (times[:-1] + times[1:]) / 2])
    length = interval[np.clip(np.searchsorted(imu.times, middle) - 1, 0, len(interval) - 1)]
    rows = np.full(len(times), -1, np.int64)
    inside = np.flatnonzero((wanted >= start) & (wanted <= end))
    rows[np.searchsorted(times, wanted[inside])] = inside
    return Timeline(times, f, w, np.where(length > max_gap, length, 0.0), rows)


class DeadReckoning(NamedTuple):
    """Position and velocity in n (N, 3), quaternions (N, 4), at the samples; NaN behind the first gap."""

    times: Array
    position: Array
    velocity: Array
    quaternion: Array
    gaps: list[Gap]


def integrate_strapdown(
    imu: ImuSamples,
    position: ArrayLike,
    velocity: ArrayLike,
    quaternion: ArrayLike,
    earth: Earth,
    max_gap: float = 0.1,
) -> DeadReckoning:
    """Dead reckoning from the first inertial sample on.

    Parameters
    ----------
    imu
        N samples, their biases taken off.
    position, velocity, quaternion
        At the first sample: (3,) m in n, (3,) m/s in n, (4,) w, x, y, z from b to n.
    earth
        What pulls, and how n turns: `gravity.local_earth`, or `gravity.flat_earth` as in H.
    max_gap
        Longest interval between samples (s) that is integrated. Behind a longer one nothing is known: the
        rows are NaN, and ``gaps`` says where.

    Returns
    -------
    DeadReckoning

    Raises
    ------
    WildlabError
        For inertial samples that are no such thing; see `timeline.checked_imu`.

    Examples
    --------
    Ten seconds at rest, with accelerometers off by 1 cm/s^2 ahead:

    >>> from wildlab.geometry.frames import flat_earth
    >>> t, earth = np.arange(0, 10.01, 0.1), flat_earth()
    >>> imu = ImuSamples(t, np.tile([0.01, 0, -earth.gravity], (len(t), 1)), np.zeros((len(t), 3)))
    >>> found = integrate_strapdown(imu, np.zeros(3), np.zeros(3), [1, 0, 0, 0], earth, max_gap=0.2)
    >>> (found.position[-1].round(3) + 0.0).tolist()
    [0.5, 0.0, 0.0]
    """
    samples = checked_imu(imu)
    gaps = find_gaps(samples.times, max_gap)
    n = int(np.searchsorted(samples.times, gaps[0].end)) if gaps else len(samples.times)
    q = np.asarray(quaternion, float)
    start = np.concatenate(
        [np.asarray(position, float), np.asarray(velocity, float), q / np.linalg.norm(q), np.zeros(6)]
    )
    states = np.full((len(samples.times), 16), np.nan)
    t, f, w = (part[:n] for part in samples)
    kernels.integrate(t, f, w, earth.as_array(), start, states[:n])
    return DeadReckoning(samples.times, states[:, :3], states[:, 3:6], states[:, 6:10], gaps)
