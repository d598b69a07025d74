"""Estimates after a scan: every measurement of the gate in the share in which it is the target's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Compared(NamedTuple):
    """T tracks of K kinds beside M measurements of places.

    ``innovation`` (T, K, M, 2), its covariance ``S`` (T, K, M, 2, 2), and ``likelihood`` (T, K, M), 1/m^2:
    zero outside of the gate.
    """

    innovation: Array
    S: Array
    likelihood: Array


def compare(
    x: ArrayLike, P: ArrayLike, offset: ArrayLike, noise: ArrayLike, z: ArrayLike, R: ArrayLike, gate: float
) -> Compared:
    """How far every measurement is from where every track expects one.

    Parameters
    ----------
    x, P
        (T, K, 4) and (T, K, 4, 4).
    offset, noise
        (T, K, 2) from the middle of a target to what is seen, and (T, K, 2, 2) how much that varies.
    z, R
        (M, 2) and (M, 2, 2); or (T, M, 2) and (T, M, 2, 2), where each track has measurements of its own.
    gate
        How many standard deviations it may be.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    places, noises = np.asarray(z, float), np.asarray(R, float)
    if places.ndim == 2:
        places, noises = places[None], noises[None]
    innovation = places[:, None] - (x[..., :2] + np.asarray(offset, float))[:, :, None]
    S = (P[..., :2, :2] + np.asarray(noise, float))[:, :, None] + noises[:, None]
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    a, b = innovation[..., 0], innovation[..., 1]
    square = (S[..., 1, 1] * a**2 - 2 * S[..., 0, 1] * a * b + S[..., 0, 0] * b**2) / det
    likelihood = np.exp(-square / 2) / (2 * np.pi * np.sqrt(det))
    return Compared(innovation, S, np.where(square < gate**2, likelihood, 0.0))


class Updated(NamedTuple):
    """(T, K, 4), (T, K, 4, 4) and the probabilities of the kinds (T, K)."""

    x: Array
    P: Array
    kinds: Array


def update(x: ArrayLike, P: ArrayLike, kinds: ArrayLike, own: ArrayLike, compared: Compared) -> Updated:
    """Merge what every measurement would make of an estimate, one mixture for each kind.

    Parameters
    ----------
    x, P, kinds
        (T, K, 4), (T, K, 4, 4) and (T, K) before the scan.
    own
        (T, 1 + M) of `wildlab.tracking.many.existence.after_scan`.
    """
    mean, cov, before = np.asarray(x, float), np.asarray(P, float), np.asarray(kinds, float)
    whose, (innovation, S, likelihood) = np.asarray(own, float), compared
    mixed = np.einsum("tk,tkm->tm", before, likelihood)[:, None]
    # Of a measurement that is the target's, the share of each kind: how likely that kind makes it.
    share = np.divide(likelihood, mixed, out=np.zeros_like(likelihood), where=mixed > 0) * whose[:, None, 1:]
    weight = whose[:, None, 0] + share.sum(axis=-1)
    beta = np.divide(share, weight[..., None], out=np.zeros_like(share), where=weight[..., None] > 0)
    PH = cov[..., :2]
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    inverse = np.empty_like(S)
    inverse[..., 0, 0], inverse[..., 1, 1] = S[..., 1, 1] / det, S[..., 0, 0] / det
    inverse[..., 0, 1] = inverse[..., 1, 0] = -S[..., 0, 1] / det
    gain = np.einsum("tkij,tkmjl->tkmil", PH, inverse)
    step = np.einsum("tkmij,tkmj->tkmi", gain, innovation)
    moved = np.einsum("tkm,tkmi->tki", beta, step)
    shrunk = np.einsum("tkm,tkmij,tklj->tkil", beta, gain, PH)
    spread = np.einsum("tkm,tkmi,tkmj->tkij", beta, step, step) - moved[..., :, None] * moved[..., None, :]
    cov = cov - shrunk + spread
    after = before * weight
    return Updated(
        mean + moved, (cov + np.swapaxes(cov, -1, -2)) / 2, after / after.sum(axis=1, keepdims=True)
    )
