"""Satellite receivers: two RTK antennas on an airframe, and the single-frequency receiver on a target."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.error_models import gauss_markov
from wildlab.simulation.trajectory import Motion


class PositionErrors(NamedTuple):
    """How far off a receiver's positions are.

    Attributes
    ----------
    correlated_sd
        SDs of the time-correlated error, a first-order Gauss-Markov process, per horizontal axis and in
        height, m: multipath, and of a single-frequency receiver the ionosphere and orbits too.
    correlation_time
        Its correlation time, s.
    noise_sd
        SDs of the white error from fix to fix, likewise, m.
    """

    correlated_sd: tuple[float, float]
    correlation_time: float
    noise_sd: tuple[float, float]


def antenna_motion(motion: Motion, angular_rate: ArrayLike, arm: ArrayLike) -> tuple[Array, Array]:
    """Position and velocity in n of an antenna that is rigidly fixed to b.

    Parameters
    ----------
    motion
        Of b, at N times.
    angular_rate
        Of b against n, in b, (N, 3) rad/s.
    arm
        From b to the antenna, in b, (3,) m.

    Returns
    -------
    (N, 3) m and (N, 3) m/s.
    """
    r = np.asarray(arm, float)
    around = np.cross(np.asarray(angular_rate, float), r)
    return motion.position + motion.R_nb @ r, motion.velocity + np.einsum("nij,nj->ni", motion.R_nb, around)


def position_fixes(
    position: ArrayLike, step: float, errors: PositionErrors, rng: np.random.Generator
) -> Array:
    """Positions as a receiver gives them: with a time-correlated error, and noise from fix to fix.

    Parameters
    ----------
    position
        True positions of the antenna in n, (N, 3) m, ``step`` seconds apart.

    Returns
    -------
    (N, 3) m, in n.
    """
    p = np.asarray(position, float)
    correlated_sd, noise_sd = (
        np.array([sd[0], sd[0], sd[1]]) for sd in (errors.correlated_sd, errors.noise_sd)
    )
    correlated = gauss_markov(len(p), step, correlated_sd, errors.correlation_time, rng)
    return p + correlated + noise_sd * rng.standard_normal(p.shape)
