"""Errors that a look's measurements share move all of them: what one target tells of them serves another.

Given these errors, targets are independent. What each target's measurements tell of them is kept as one
Gaussian, of which a pair that nobody is sure of makes little; and what all others tell, never a target
itself, says where its measurement is to be expected. That is repeated, since all are surer then: belief
propagation between the targets' associations and the errors.

Only the probabilities of association come from it. Estimates are corrected with the errors considered and
not estimated, as of H 7.4: what other targets tell of them would be used again at the next look as if it were
new. Where errors last, places relative to each other are known well nevertheless; where each look has another
error, they are known no better than the places themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.many.update import Compared, likelihoods

Array = NDArray[np.float64]

#: How often what all tell each other is asked again. After the second time little changes.
ROUNDS = 2


def of_all(values: Array, near: NDArray[np.intp], count: int) -> Array:
    """(T, K, G) of measurements by number ``near`` (T, G), -1 none, as (T, K, count); zero elsewhere."""
    dense = np.zeros((*values.shape[:2], count))
    track, place = np.nonzero(near >= 0)
    dense[track, :, near[track, place]] = values[track, :, place]
    return dense


def told_by_others(compared: Compared, weight: Array) -> tuple[Array, Array]:
    """What all other targets tell each one of the shared errors.

    Parameters
    ----------
    compared
        T tracks of K kinds beside M measurements.
    weight
        (T, K, M) how probable it is that a target is there, of that kind, and the measurement its own.

    Returns
    -------
    mean, covariance
        (T, k) and (T, k, k), in standard deviations of the errors.
    """
    nu, S, _, _, G = compared
    k = G.shape[-1]
    probable = weight.sum(axis=(1, 2))
    share = np.divide(
        weight, probable[:, None, None], out=np.zeros_like(weight), where=probable[:, None, None] > 0
    )
    middle = np.einsum("tkm,tkmi->ti", share, nu)
    moved = np.einsum("tkm,tkmij->tij", share, G)
    off = nu - middle[:, None, None]
    alone = S - G @ np.swapaxes(G, -1, -2) + off[..., :, None] * off[..., None, :]
    spread = np.einsum("tkm,tkmij->tij", share, alone)
    spread[probable <= 0] = np.eye(2)
    by_spread = np.swapaxes(np.linalg.solve(spread, moved), -1, -2) * probable[:, None, None]
    information, told = by_spread @ moved, (by_spread @ middle[..., None])[..., 0]
    covariance = np.linalg.inv(np.eye(k) + information.sum(axis=0) - information)
    mean = (covariance @ (told.sum(axis=0) - told)[..., None])[..., 0]
    return mean, covariance


def moved_together(
    compared: Compared,
    near: NDArray[np.intp],
    kinds: Array,
    probabilities: Array,
    gate: float,
    probable: Callable[[Array], Array],
) -> tuple[Compared, Array]:
    """Likelihoods and probabilities of association with one value of each shared error for all targets.

    Parameters
    ----------
    compared
        T tracks of K kinds beside G measurements each, without regard to other targets.
    near
        (T, G) which of M measurements these are, -1 none.
    kinds
        (T, K).
    probabilities
        (T, 1 + M) by `compared`.
    gate
        As in `wildlab.tracking.many.update.compare`.
    probable
        From likelihoods (T, K, M) to probabilities (T, 1 + M).

    Returns
    -------
    compared, probabilities
        The first with other likelihoods, the rest as it was.
    """
    if len(kinds) < 2 or not near.size:
        return compared, probabilities
    nu, S, likelihood, _, G = compared
    alone, count = S - G @ np.swapaxes(G, -1, -2), probabilities.shape[1] - 1
    for _ in range(ROUNDS):
        mine = np.where(near >= 0, np.take_along_axis(probabilities, near + 1, axis=1), 0.0)
        of_kind = kinds[..., None] * likelihood
        of_any = of_kind.sum(axis=1, keepdims=True)
        share = np.divide(of_kind, of_any, out=np.zeros_like(of_kind), where=of_any > 0)
        mean, covariance = told_by_others(compared, share * mine[:, None])
        left = nu - np.einsum("tkmij,tj->tkmi", G, mean)
        spread = alone + G @ covariance[:, None, None] @ np.swapaxes(G, -1, -2)
        likelihood = np.where((near >= 0)[:, None], likelihoods(left, spread, gate), 0.0)
        probabilities = probable(of_all(likelihood, near, count))
    return compared._replace(likelihood=likelihood), probabilities
