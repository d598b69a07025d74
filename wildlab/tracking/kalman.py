"""The Kalman filter, H (3.5) and (3.7), as functions without a state of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Update(NamedTuple):
    """What a measurement did: the new estimate, the innovation with its covariance, and the gain."""

    x: Array  # (..., n)
    P: Array  # (..., n, n)
    innovation: Array  # (..., m)
    S: Array  # (..., m, m)
    gain: Array  # (..., n, m)


def predict(x: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Prior estimate (..., n) and covariance (..., n, n), H (3.5a)-(3.5b); any leading axes."""
    prior = F @ P @ np.swapaxes(F, -1, -2) + Q
    return _times(F, x), (prior + np.swapaxes(prior, -1, -2)) / 2


def update(x: Array, P: Array, z: Array, H: Array, R: Array) -> Update:
    """Posterior after a measurement ``z`` (..., m) = H x + noise with covariance ``R``.

    H (3.5c)-(3.5h), Joseph form.
    """
    return correct(x, P, z - _times(H, x), H, R)


def correct(x: Array, P: Array, innovation: Array, H: Array, R: Array) -> Update:
    """Posterior of the extended filter, H (3.7d)-(3.7h), Joseph form; any leading axes.

    Parameters
    ----------
    innovation
        (..., m) measurement minus prediction, angles wrapped.
    H
        (..., m, n) derivative of the prediction at ``x``.
    R
        (..., m, m).
    """
    S = H @ P @ np.swapaxes(H, -1, -2) + R
    gain = np.asarray(np.swapaxes(np.linalg.solve(S, H @ P), -1, -2), float)
    kept = np.eye(x.shape[-1]) - gain @ H
    posterior = kept @ P @ np.swapaxes(kept, -1, -2) + gain @ R @ np.swapaxes(gain, -1, -2)
    posterior = (posterior + np.swapaxes(posterior, -1, -2)) / 2
    return Update(x + _times(gain, innovation), posterior, innovation, S, gain)


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


class Filtered(NamedTuple):
    """Estimates after each of T measurements; rows of measurements with NaN carry the estimate on."""

    x: Array  # (T, n)
    P: Array  # (T, n, n)
    innovation: Array  # (T, m), NaN at the first and where there was no measurement
    S: Array  # (T, m, m)


def filter_at_rest(measurements: ArrayLike, R: ArrayLike) -> Filtered:
    """Position of an object at rest: F = I, Q = 0 (H 5.6.1), started on the first measurement.

    Parameters
    ----------
    measurements
        (T, m) positions in order of time, m; rows with NaN are not used.
    R
        (T, m, m) their covariances, m^2; rows with NaN are not used either.

    Returns
    -------
    Filtered
        Estimates and covariances after each row, NaN before the first used.
    """
    z, R = np.asarray(measurements, float), np.asarray(R, float)
    T, m = z.shape
    usable = np.flatnonzero(np.isfinite(z).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))
    x, P = np.full((T, m), np.nan), np.full((T, m, m), np.nan)
    innovation, S = x.copy(), P.copy()
    if not len(usable):
        return Filtered(x, P, innovation, S)
    state, spread, unmoved = z[usable[0]], R[usable[0]], np.eye(m)
    known = set(usable[1:].tolist())
    for t in range(usable[0], T):
        if t in known:
            state, spread = predict(state, spread, unmoved, np.zeros((m, m)))
            step = update(state, spread, z[t], unmoved, R[t])
            state, spread, innovation[t], S[t] = step.x, step.P, step.innovation, step.S
        x[t], P[t] = state, spread
    return Filtered(x, P, innovation, S)
