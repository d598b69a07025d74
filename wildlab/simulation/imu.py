"""Inertial measurement units: what ideal sensors would feel along a trajectory, and what a real unit reads.

The errors are those of a data sheet (H tables A.5 and A.6): white noise whose integral walks (angle and
velocity random walk), a bias that differs from one switching-on to the next and drifts during the run, axes
that are not where they are said to be, a range and a resolution.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import USUAL_GRAVITY, Earth, flat_earth
from wildlab.simulation import kernels
from wildlab.simulation.error_models import gauss_markov
from wildlab.simulation.parameter_groups import Imu
from wildlab.simulation.trajectory import Trajectory

#: The n of a trajectory, by itself.
INERTIAL = flat_earth(USUAL_GRAVITY)

_CHUNK = 16_384  # samples at a time: their motion then fits into the processor's cache
_ASIDE = 4  # samples on either side of a difference of fourth order with a step of two samples


class TriadDataSheet(NamedTuple):
    """Errors of three gyros or accelerometers, in SI units.

    Attributes
    ----------
    random_walk
        Noise density, in the unit of a reading times the root of a second: the SD of the integral after 1 s.
    bias_stability, bias_time
        SD and correlation time (s) of the bias in the run, a first-order Gauss-Markov process.
    turn_on_bias
        SD of the bias that stays from switching on to switching off.
    axis_misalignment, package_misalignment
        As in :func:`misaligned_triad`, rad.
    limit, resolution
        Beyond the one the reading stands still, and it is a multiple of the other.
    """

    random_walk: float
    bias_stability: float
    bias_time: float
    turn_on_bias: float
    axis_misalignment: float
    package_misalignment: float
    limit: float
    resolution: float


def ideal_imu(
    trajectory: Trajectory, rate: float, count: int, earth: Earth = INERTIAL
) -> tuple[Array, Array]:
    """Specific force and angular rate of a body, as ideal sensors feel them.

    The angular rate is a central difference of fourth order over the samples themselves, so that the motion
    is asked for once per sample only. With a step of two samples of 10 ms at most, motion with periods of two
    seconds and more has a relative error of some 1e-7, far below any sensor's.

    Parameters
    ----------
    trajectory
        Of the body in n.
    rate
        Samples per second, Hz, at least 100.
    count
        N samples, the first at time 0.
    earth
        What pulls, and how n turns: by itself n counts as inertial, as it does for the trajectory.

    Returns
    -------
    force
        (N, 3) m/s^2, in the body.
    angular_rate
        (N, 3) rad/s, of the body, in the body.
    """
    force, spin = np.empty((count, 3)), np.empty((count, 3))
    inside = slice(_ASIDE, -_ASIDE)
    for first in range(0, count, _CHUNK):
        some = slice(first, min(first + _CHUNK, count))
        m = trajectory(np.arange(some.start - _ASIDE, some.stop + _ASIDE) / rate)
        R = m.R_nb
        kernels.body_rates(R[:-8], R[2:-6], R[6:-2], R[8:], 2 / rate, spin[some])
        moving = (m.position[inside], m.velocity[inside], m.acceleration[inside])
        kernels.felt_on_earth(R[inside], *moving, earth.as_array(), force[some], spin[some])
    return force, spin


def misaligned_triad(axis: float, package: float, rng: np.random.Generator) -> Array:
    """What three axes that are not where they should be read of a vector: (3, 3), to be multiplied by it.

    Parameters
    ----------
    axis
        Each axis leans towards each of the other two by an angle drawn evenly from -axis to axis, rad.
    package
        All three together are turned about each axis of the package by an angle drawn likewise, rad.
    """
    lean = rng.uniform(-axis, axis, (3, 3))
    np.fill_diagonal(lean, 0.0)
    turned = Rotation.from_rotvec(rng.uniform(-package, package, 3)).as_matrix()
    axes = np.eye(3) + lean
    return np.asarray((axes / np.linalg.norm(axes, axis=1, keepdims=True)) @ turned.T)


def read_triad(true: ArrayLike, rate: float, sheet: TriadDataSheet, rng: np.random.Generator) -> Array:
    """What three gyros or accelerometers read of the true values.

    Parameters
    ----------
    true
        (N, 3), in SI units.
    rate
        Hz.

    Returns
    -------
    (N, 3).
    """
    x = np.ascontiguousarray(true, float)
    triad = misaligned_triad(sheet.axis_misalignment, sheet.package_misalignment, rng)
    turn_on = sheet.turn_on_bias * rng.standard_normal(3)
    drift = gauss_markov(len(x), 1 / rate, [sheet.bias_stability] * 3, sheet.bias_time, rng)
    noise = rng.standard_normal(x.shape)
    limits = np.array([sheet.limit, sheet.resolution])
    kernels.read_triad(x, triad, turn_on, drift, noise, float(sheet.random_walk * np.sqrt(rate)), limits)
    return noise


def triad_data_sheet(imu: Imu, triad: str) -> TriadDataSheet:
    """Of a unit's triad, ``accelerometer`` or ``gyro``."""
    names = ("random_walk", "bias_stability", "bias_time", "turn_on_bias", "range", "resolution")
    own = [getattr(imu, f"{triad}_{name}").si for name in names]
    return TriadDataSheet._make([*own[:4], imu.axis_misalignment.si, imu.package_misalignment.si, *own[4:]])


def read_imu(
    force: ArrayLike, angular_rate: ArrayLike, imu: Imu, stream: Callable[[str], np.random.Generator]
) -> tuple[Array, Array]:
    """Stream of a unit with that data sheet, calibrated to the body: (N, 3) m/s^2 and (N, 3) rad/s.

    ``stream`` gives the random numbers of each triad by its name.
    """
    force, rate = (
        read_triad(true, imu.rate.si, triad_data_sheet(imu, triad), stream(f"{triad}s"))
        for true, triad in ((force, "accelerometer"), (angular_rate, "gyro"))
    )
    return force, rate
