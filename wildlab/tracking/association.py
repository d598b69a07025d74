"""Which detection belongs to a target: validation region and nearest neighbour, H 3.3, 6.2.3, 6.3.2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.measurement import Prediction, difference, on_state


class Nearest(NamedTuple):
    """The detection with the smallest normalised innovation squared."""

    detection: int
    innovation: Array  # (m,)
    S: Array  # (m, m)
    nis: float


def innovation_squared(innovation: ArrayLike, S: ArrayLike) -> Array:
    """NIS (...), H (3.12), of innovations (..., m) with covariances (..., m, m)."""
    v = np.asarray(innovation, float)
    return np.asarray(
        np.einsum("...i,...i->...", v, np.linalg.solve(np.asarray(S, float), v[..., None])[..., 0])
    )


def nearest_detection(
    z: Array, predicted: Array, spread: Array, R: Array, angles: tuple[bool, ...], row: int
) -> Nearest | None:
    """The nearest of K detections (K, m) by NIS, or None where all are NaN.

    Parameters
    ----------
    predicted, spread
        (m,) and (m, m): the expected measurement and its covariance, without noise.
    R
        (K, m, m).
    row
        For the error: an ``S`` that is not positive definite names it.
    """
    there = np.flatnonzero(np.isfinite(z).all(axis=-1))
    if not len(there):
        return None
    innovations = difference(z[there], predicted, angles)
    S = spread + R[there]
    try:
        np.linalg.cholesky(S)
    except np.linalg.LinAlgError as error:
        raise WildlabError(
            f"the innovation covariance S of row {row} is not positive definite",
            "check the covariances of start, motion and measurements",
            field="S",
        ) from error
    nis = innovation_squared(innovations, S)
    best = int(np.argmin(nis))
    return Nearest(int(there[best]), innovations[best], S[best], float(nis[best]))


def distances(
    expected: Prediction, angles: tuple[bool, ...], P: ArrayLike, detections: ArrayLike, R: ArrayLike
) -> Array:
    """NIS (..., K) of K detections against a track, or against many at once.

    What is expected need not come from the sensor that the track is filtered with: H 6.3.2 gates by azimuth
    and elevation what is filtered by pixel.

    Parameters
    ----------
    expected
        Prediction of the sensor at the track's predicted position, (..., m), in the sensor's units.
    angles
        Which elements are angles, see `Sensor`.
    P
        (..., n, n) predicted covariance; north and east, m, are the first two states.
    detections
        (..., K, m), in the sensor's units; NaN where there is none.
    R
        Noise of a detection, (m, m), or anything that fits (..., m, m): one for all K.

    Returns
    -------
    (..., K), NaN where the sensor cannot see the target or a detection is NaN.
    """
    z, P = np.asarray(detections, float), np.asarray(P, float)
    H = on_state(expected.H_position, P.shape[-1])
    S = H @ P @ np.swapaxes(H, -1, -2) + np.asarray(R, float)
    gap = difference(z, expected.z[..., None, :], angles)
    S = np.broadcast_to(S[..., None, :, :], (*gap.shape, gap.shape[-1]))
    nis = np.full(gap.shape[:-1], np.nan)
    whole = np.isfinite(gap).all(axis=-1) & np.isfinite(S).all(axis=(-1, -2))
    nis[whole] = innovation_squared(gap[whole], S[whole])
    return nis


def nearest_within(nis: ArrayLike, gate_probability: float, m: int) -> NDArray[np.int64]:
    """Nearest neighbour within the validation region, H 3.3.

    Parameters
    ----------
    nis
        (..., K), K at least one; NaN where there is nothing to compare.
    gate_probability
        Probability that the target's own measurement is let in, in (0, 1]; 1 is no gate.
    m
        Elements of the measurement.

    Returns
    -------
    (...) index of the smallest NIS along the last axis, -1 where none lies within the gate.

    Raises
    ------
    WildlabError
        For a ``gate_probability`` outside (0, 1].
    """
    d = np.asarray(nis, float)
    d = np.where(np.isnan(d), np.inf, d)
    best = np.argmin(d, axis=-1)
    least = np.take_along_axis(d, best[..., None], axis=-1)[..., 0]
    limit = min(gate_threshold(gate_probability, m), float(np.finfo(float).max))
    return np.asarray(np.where(least <= limit, best, -1))
