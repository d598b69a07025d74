"""Kinds of errors of poses and pixels, and how rough logged positions are."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Which of the six pose errors (north, east, down, two tilts, heading) share a standard deviation. The
#: pixel's (both axes) stands last and is each point's own.
KINDS: dict[str, tuple[int, ...]] = {
    "position_horizontal": (0, 1),
    "position_vertical": (2,),
    "tilt": (3, 4),
    "heading": (5,),
    "pixel": (),
}
#: Standard deviation of the prior on the logarithm: a factor of three either way.
PRIOR = np.log(3.0)
#: Samples in a row of which a parabola leaves one residual.
SAMPLES = 4
#: Samples further apart than this many usual intervals are no neighbours.
NEIGHBOURS = 3.0


def estimate_position_noise(times: ArrayLike, positions: ArrayLike) -> Array:
    """Standard deviation of white noise that makes a smooth motion as rough as logged positions are.

    Residuals of a parabola through each four successive positions, by their root mean square. It is no bound
    on the whole error: of an error that wanders over seconds or minutes, as satellite positions have, only
    what changes between samples is seen, and what is constant not at all. Where a target turns within few
    samples, its motion is in it.

    Parameters
    ----------
    times
        (N,) s; a repeated or earlier stamp is left out.
    positions
        (N, k) m; rows with NaN are left out.

    Returns
    -------
    (k,)
        m, of each axis; NaN where there are no four samples in a row.

    Examples
    --------
    A receiver at rest, positions in steps of a metre, one of them wrong by one:

    >>> estimate_position_noise(range(5), [[0.0], [0.0], [1.0], [0.0], [0.0]]).round(2)
    array([0.67])
    """
    at, z = np.asarray(times, float), np.asarray(positions, float)
    good = np.isfinite(at) & np.isfinite(z).all(axis=1)
    at, z = at[good], z[good]
    later = np.diff(np.maximum.accumulate(at), prepend=-np.inf) > 0 if len(at) else good[:0]
    at, z = at[later], z[later]
    if len(at) < SAMPLES:
        return np.full(z.shape[1], np.nan)
    rows = np.arange(len(at) - SAMPLES + 1)[:, None] + np.arange(SAMPLES)
    steps = np.diff(at)
    rows = rows[np.diff(at[rows], axis=1).max(axis=1) <= NEIGHBOURS * np.median(steps)]
    if not len(rows):
        return np.full(z.shape[1], np.nan)
    # Lagrange's weights of the third divided difference: orthogonal to every parabola.
    apart = at[rows][:, :, None] - at[rows][:, None, :]
    apart[:, range(SAMPLES), range(SAMPLES)] = np.median(steps)
    weights = 1 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    residuals = np.einsum("ns,nsk->nk", weights, z[rows] - z[rows[:, :1]])
    return np.asarray(np.sqrt(np.mean(residuals**2, axis=0)))
