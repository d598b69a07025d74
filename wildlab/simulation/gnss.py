"""Satellite receivers: two RTK antennas on an airframe, and the single-frequency receiver on a target."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.sensors import gauss_markov
from wildlab.simulation.trajectory import Motion


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


def fixes(
    position: ArrayLike,
    step: float,
    rng: np.random.Generator,
    *,
    wander: tuple[float, float],
    wander_time: float,
    noise: tuple[float, float],
) -> Array:
    """Positions as a receiver gives them: an error that wanders, and noise from fix to fix.

    Parameters
    ----------
    position
        True positions of the antenna in n, (N, 3) m, ``step`` seconds apart.
    wander
        SD of the correlated error, per horizontal axis and in height, m; an RTK receiver's is multipath, a
        single-frequency receiver's the ionosphere and orbits as well.
    wander_time
        Its correlation time, s.
    noise
        SD of the uncorrelated error, likewise, m.

    Returns
    -------
    (N, 3) m.
    """
    p = np.asarray(position, float)
    spread = np.array([wander[0], wander[0], wander[1]])
    wandering = gauss_markov(len(p), step, spread, wander_time, rng)
    return p + wandering + np.array([noise[0], noise[0], noise[1]]) * rng.standard_normal(p.shape)
