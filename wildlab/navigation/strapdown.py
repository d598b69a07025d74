"""Dead reckoning: inertial measurements integrated to position, velocity and attitude (H 7.18-7.20).

The frame is n, fixed to the ground at its origin, with the Earth's rotation and the lean of the plumb line
where an `Earth` has them (H 5.31-5.33 in ECEF); `flat_earth` gives the equations as H 7.3 prints them.
A step takes the mean of the measurements at its ends, and the attitude half-way. Corrections for coning and
sculling are left out: between samples at 50 Hz and more, an airframe's rates are straight lines to well below
what its sensors resolve, and vibration that is already averaged or aliased would not gain from them either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.compilation import announced
from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import Earth
from wildlab.navigation import kernels
from wildlab.navigation.timeline import Gap, ImuSamples, checked_imu, find_gaps


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

    >>> from wildlab.geometry.gravity import flat_earth
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
    with announced("the strapdown integration"):
        kernels.integrate(t, f, w, earth.as_array(), start, states[:n])
    return DeadReckoning(samples.times, states[:, :3], states[:, 3:6], states[:, 6:10], gaps)
