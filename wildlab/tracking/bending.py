"""Whether a track is still certain enough for a linearisation, H 3.4.2: when to end it.

The extended filter takes a measurement for a plane over the region where the target may be. With the second
derivatives ``D_i`` of its elements, an error ``e`` of the position leaves out ``e' D_i e / 2``. For a normal
``e`` with covariance P these have the second moments

``B_ij = (tr(D_i P) tr(D_j P) + 2 tr(D_i P D_j P)) / 4``.

Of a position that is far less certain than one measurement makes it, the filter takes over the measurement,
and what was left out with it: its posterior states the measurement's noise N and lacks B. Where B is larger
than N in some direction, the error that nobody states is larger than the one that is stated, and a new start
on the measurement is nearer to the truth than the update.

A camera at the distance d, with the focal length f in pixels and its axis off the plumb line by a, leaves out
about ``f s^2 sin(a) / d^2`` for a standard deviation s of the position: with a noise of n pixels the bound is
``s = d sqrt(n / (f sin(a)))``, near the geometric mean of the distance and what the noise is on the ground.
Straight down over level ground nothing is bent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.tracking.sensors import Sensor

#: Of the distance over which derivatives are compared, m: small beside any distance to a target, and large
#: beside what rounding does to coordinates of kilometres.
STEP_M = 0.01


def second_derivatives(sensor: Sensor, row: int, state: ArrayLike) -> Array:
    """Second derivatives of what a sensor should see, by differences of its first.

    Parameters
    ----------
    sensor
        From `wildlab.tracking.measurement`.
    row
        Of the run.
    state
        (n,) north, east, m, and velocity where the sensor sees it.

    Returns
    -------
    (m, 2, 2)
        With respect to north and east, in the sensor's units over m^2; NaN where the target is not seen.

    Examples
    --------
    A range of 100 m bends across the line of sight, by one over the range:

    >>> from wildlab.tracking import ranges_bearings
    >>> second_derivatives(ranges_bearings([0.0, 0.0], 0.0), 0, [100.0, 0.0])[0].round(4).tolist()
    [[0.0, 0.0], [0.0, 0.01]]
    """
    at = np.asarray(state, float)
    columns = []
    for axis in range(2):
        step = np.zeros_like(at)
        step[axis] = STEP_M
        ahead, behind = (
            sensor.predict(row, (at + sign * step)[: sensor.states]).H_position[..., :2] for sign in (1, -1)
        )
        columns.append((ahead - behind) / (2 * STEP_M))
    D = np.stack(columns, axis=-1)
    return np.asarray((D + np.swapaxes(D, -1, -2)) / 2)


def left_out(P: ArrayLike, D: ArrayLike) -> Array:
    """Second moments (m, m) of what a linearisation leaves out: B of the module.

    Parameters
    ----------
    P
        (..., 2, 2) m^2, of the position.
    D
        (..., m, 2, 2) from `second_derivatives`.

    Returns
    -------
    (..., m, m), in the measurement's units squared.

    Examples
    --------
    >>> left_out(np.eye(2), [[[0.0, 0.0], [0.0, 2.0]]]).tolist()
    [[3.0]]
    """
    bent = np.asarray(D, float) @ np.asarray(P, float)[..., None, :, :]
    traces = np.trace(bent, axis1=-2, axis2=-1)
    both = traces[..., :, None] * traces[..., None, :]
    return np.asarray((both + 2 * np.einsum("...iab,...jba->...ij", bent, bent)) / 4)


def share_left_out(P: ArrayLike, D: ArrayLike, noise: ArrayLike) -> float:
    """What a linearisation leaves out over what a measurement is uncertain by.

    Parameters
    ----------
    P
        (2, 2) m^2, of the position.
    D
        (m, 2, 2) from `second_derivatives`.
    noise
        (m, m): all that a measurement may be wrong by, N of the module.

    Returns
    -------
    float
        The largest of the variances' ratio over all directions. Above one the track is too uncertain; NaN
        where that cannot be said.
    """
    B, N = left_out(P, D), np.asarray(noise, float)
    if not (np.isfinite(B).all() and np.isfinite(N).all()):
        return float("nan")
    return float(np.linalg.eigvals(np.linalg.solve(N, B)).real.max())
