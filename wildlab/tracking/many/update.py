"""Estimates after a scan: every measurement of the gate in the share in which it is the target's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import wrap
from wildlab.tracking.bending import left_out
from wildlab.tracking.many.hulls import lasting_part

Array = NDArray[np.float64]

#: A target this near to the platform, m, is in no direction.
NEAREST_M = 1.0


class Compared(NamedTuple):
    """T tracks of K kinds beside M measurements of m elements: two of a place, one of a bearing.

    ``innovation`` (T, K, M, m), its covariance ``S`` (T, K, M, m, m), ``likelihood`` (T, K, M), 1/m^2 or
    1/rad, zero outside of the gate, ``H`` (T, K, m, 2) of a place, and ``G`` (T, K, M, m, k): what one
    standard deviation of each shared error makes of an innovation.
    """

    innovation: Array
    S: Array
    likelihood: Array
    H: Array
    G: Array


def compare(
    x: ArrayLike,
    P: ArrayLike,
    offset: ArrayLike,
    noise: ArrayLike,
    z: ArrayLike,
    R: ArrayLike,
    gate: float,
    C: ArrayLike | None = None,
    shared: ArrayLike | None = None,
    correlation: float = 0.0,
    own: slice = slice(0),
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
    C, shared
        (T, K, 4, k) of `Tracks` and (M, 2, k) or (T, M, 2, k) of `Scan`; left out: no error is shared.
    correlation, own
        Share of the variance of the rest that lasts, and which two of the k errors it is, each target's own.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    places, noises = np.asarray(z, float), np.asarray(R, float)
    if C is None or shared is None:
        C, shared = np.zeros((*x.shape, 0)), np.zeros((*places.shape, 0))
    C, moved = np.asarray(C, float), np.asarray(shared, float)
    if places.ndim == 2:
        places, noises, moved = places[None], noises[None], moved[None]
    innovation = places[:, None] - (x[..., :2] + np.asarray(offset, float))[:, :, None]
    alone = np.asarray(noise, float)[:, :, None] + noises[:, None]
    G = C[..., None, :2, :] + moved[:, None]
    if correlation:
        G[..., own] += lasting_part(alone, correlation)
        alone = (1 - correlation) * alone
    S = P[..., None, :2, :2] + alone
    if G.shape[-1]:
        # H (7.34) with both halves of what track and look have in common.
        S = S + G @ np.swapaxes(G, -1, -2) - (C[..., :2, :] @ np.swapaxes(C[..., :2, :], -1, -2))[:, :, None]
    H = np.broadcast_to(np.eye(2), (*x.shape[:2], 2, 2))
    return Compared(innovation, S, likelihoods(innovation, S, gate), H, G)


def likelihoods(innovation: Array, S: Array, gate: float) -> Array:
    """(...) of innovations (..., 2) with covariances (..., 2, 2); zero outside of the gate."""
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    a, b = innovation[..., 0], innovation[..., 1]
    square = (S[..., 1, 1] * a**2 - 2 * S[..., 0, 1] * a * b + S[..., 0, 0] * b**2) / det
    return np.asarray(np.where(square < gate**2, np.exp(-square / 2) / (2 * np.pi * np.sqrt(det)), 0.0))


def compare_bearings(
    x: ArrayLike,
    P: ArrayLike,
    noise: ArrayLike,
    platform: ArrayLike,
    z: ArrayLike,
    R: ArrayLike,
    gate: float,
    C: ArrayLike | None = None,
) -> Compared:
    """The same of M bearings from north, to first order at each track's own place.

    Which part of a hull is seen counts as the angle under which it appears; what lies towards the platform
    changes no bearing. What first order leaves out, which is most where a target is near and its place known
    badly, counts as noise (`wildlab.tracking.bending`); where it is more than the bearing's own, no bearing
    is of that track. A place within `NEAREST_M` of the platform has none.

    Parameters
    ----------
    x, P, noise, gate
        As in `compare`.
    platform
        (2,) where they are measured from.
    z, R
        (M, 1) rad, and (M, 1, 1) rad^2.
    C
        (T, K, 4, k) of `Tracks`; a bearing's own errors are its own.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    to = x[..., :2] - np.asarray(platform, float)
    square = (to**2).sum(axis=-1)
    far = square > NEAREST_M**2
    north, east = to[..., 0], to[..., 1]
    H = np.stack([-east, north], axis=-1)[..., None, :] / np.where(far, square, 1.0)[..., None, None]
    H = np.where(far[..., None, None], H, 0.0)
    bearing = np.asarray(z, float).reshape(-1)
    innovation = np.asarray(wrap(bearing - np.arctan2(east, north)[..., None]), float)
    spread = P[..., :2, :2] + np.asarray(noise, float)
    own = (H @ spread @ np.swapaxes(H, -1, -2))[..., 0, 0]
    D = np.stack(
        [
            np.stack([2 * north * east, east**2 - north**2], axis=-1),
            np.stack([east**2 - north**2, -2 * north * east], axis=-1),
        ],
        axis=-2,
    )
    D = D / np.where(far, square, 1.0)[..., None, None] ** 2
    bent = left_out(spread, D[..., None, :, :])[..., 0]
    variance = np.asarray(R, float).reshape(-1)
    S = own[..., None] + bent + variance
    likelihood = np.exp(-(innovation**2) / S / 2) / np.sqrt(2 * np.pi * S)
    inside = (innovation**2 < gate**2 * S) & far[..., None] & (bent <= variance)
    none = np.zeros((*x.shape, 0))
    G = (H @ np.asarray(none if C is None else C, float)[..., :2, :])[:, :, None]
    G = np.broadcast_to(G, (*innovation.shape, *G.shape[-2:]))
    return Compared(innovation[..., None], S[..., None, None], np.where(inside, likelihood, 0.0), H, G)


def _inverse(S: Array) -> Array:
    """Of covariances of one or two elements."""
    if S.shape[-1] == 1:
        return np.asarray(1 / S)
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] ** 2
    inverse = np.empty_like(S)
    inverse[..., 0, 0], inverse[..., 1, 1] = S[..., 1, 1] / det, S[..., 0, 0] / det
    inverse[..., 0, 1] = inverse[..., 1, 0] = -S[..., 0, 1] / det
    return inverse


class Updated(NamedTuple):
    """(T, K, 4), (T, K, 4, 4), the probabilities of the kinds (T, K), and (T, K, 4, k)."""

    x: Array
    P: Array
    kinds: Array
    C: Array


def update(
    x: ArrayLike,
    P: ArrayLike,
    kinds: ArrayLike,
    own: ArrayLike,
    compared: Compared,
    C: ArrayLike | None = None,
) -> Updated:
    """Merge what every measurement would make of an estimate, one mixture for each kind.

    Shared errors are considered and not estimated, H (7.34)-(7.38): each kind by itself.

    Parameters
    ----------
    x, P, kinds
        (T, K, 4), (T, K, 4, 4) and (T, K) before the scan.
    own
        (T, 1 + M) of `wildlab.tracking.many.existence.after_scan`.
    C
        (T, K, 4, k) of `Tracks`; left out: no error is shared.
    """
    mean, cov, before = np.asarray(x, float), np.asarray(P, float), np.asarray(kinds, float)
    common = np.zeros((*mean.shape, 0)) if C is None else np.asarray(C, float)
    whose, (innovation, S, likelihood, H, G) = np.asarray(own, float), compared
    mixed = np.einsum("tk,tkm->tm", before, likelihood)[:, None]
    # Of a measurement that is the target's, the share of each kind: how likely that kind makes it.
    share = np.divide(likelihood, mixed, out=np.zeros_like(likelihood), where=mixed > 0) * whose[:, None, 1:]
    weight = whose[:, None, 0] + share.sum(axis=-1)
    beta = np.divide(share, weight[..., None], out=np.zeros_like(share), where=weight[..., None] > 0)
    alone = cov[..., :2] - common @ np.swapaxes(common[..., :2, :], -1, -2)
    # Of an estimate's error with each innovation: what is its own, and what both share.
    cross = (alone @ np.swapaxes(H, -1, -2))[:, :, None] + common[:, :, None] @ np.swapaxes(G, -1, -2)
    gain = cross @ _inverse(S)
    step = np.einsum("tkmij,tkmj->tkmi", gain, innovation)
    moved = np.einsum("tkm,tkmi->tki", beta, step)
    weighed = beta[..., None, None] * gain
    shrunk = (weighed @ np.swapaxes(cross, -1, -2)).sum(axis=2)
    spread = np.einsum("tkm,tkmi,tkmj->tkij", beta, step, step) - moved[..., :, None] * moved[..., None, :]
    cov = cov - shrunk + spread
    after = before * weight
    return Updated(
        mean + moved,
        (cov + np.swapaxes(cov, -1, -2)) / 2,
        after / after.sum(axis=1, keepdims=True),
        common - (weighed @ G).sum(axis=2),
    )
