"""Which detection is of which animal: F's rule, and one that gives no animal two detections."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import nearest_within


def mahalanobis_squared(mean: ArrayLike, covariance: ArrayLike, z: ArrayLike, R: ArrayLike) -> Array:
    """Squares of D_M, F (4.19), between A animals and M detections.

    D_M is a root, and F (4.20) compares it with a quantile of the chi-square distribution, which is that of
    its square. It is the square that is compared here. By the letter of (4.20) a gate of 99 % is one of 9.21
    standard deviations, which shuts out next to nothing.

    Parameters
    ----------
    mean, covariance
        (A, n) and (A, n, n); north and east, m, are the first two.
    z
        (M, 2) m.
    R
        (M, 2, 2), or (2, 2) for all, m^2.

    Returns
    -------
    (A, M)
    """
    x, P = np.asarray(mean, float)[:, None, :2], np.asarray(covariance, float)[:, None, :2, :2]
    found = np.asarray(z, float).reshape(-1, 2)
    S = P + np.broadcast_to(np.asarray(R, float), (len(found), 2, 2))
    off = found - x
    return np.asarray(np.einsum("ami,ami->am", off, np.linalg.solve(S, off[..., None])[..., 0]))


def nearest_animal(squared: ArrayLike, gate_probability: float) -> NDArray[np.int64]:
    """F's modified nearest neighbour, F 4.3.1: each *detection* takes its closest track within the gate.

    A track may be taken by several detections, whose likelihoods (4.11) multiplies, and a group of animals
    gets fewer tracks than it has animals: how many tracks there are is no count of animals.

    Parameters
    ----------
    squared
        (A, M) as `mahalanobis_squared` has it.
    gate_probability
        Probability that an animal's own detection is let in, in (0, 1]; 1 is no gate.

    Returns
    -------
    (M,) index of the track, -1 where none lies within the gate.

    Raises
    ------
    WildlabError
        For a probability outside (0, 1].

    Examples
    --------
    >>> print(nearest_animal([[1.0, 4.0, 30.0], [2.0, 90.0, 20.0]], 0.99))
    [ 0  0 -1]
    """
    d = np.asarray(squared, float)
    if not len(d):
        return np.full(d.shape[1], -1)
    return nearest_within(d.T, gate_probability, 2)


def one_to_one(gain: ArrayLike) -> NDArray[np.int64]:
    """The pairs that gain most together, no track and no detection in two of them.

    Parameters
    ----------
    gain
        (A, M) what a pair gains over leaving both alone, such as the logarithm of a ratio of likelihoods; no
        pair is made that gains nothing. Minus infinity outside the gate.

    Returns
    -------
    (M,) index of the track, -1 where there is none.

    Raises
    ------
    WildlabError
        Where a gain is NaN or infinite.

    Examples
    --------
    >>> print(one_to_one([[5.0, 4.0, -1.0], [4.0, 1.0, -1.0]]))
    [ 1  0 -1]
    """
    worth = np.asarray(gain, float)
    if np.isnan(worth).any() or (worth == np.inf).any():
        raise WildlabError(
            "what a pair gains is not a number", "give minus infinity where there is no pair", field="gain"
        )
    A, M = worth.shape
    # A column for each track that stays alone, which gains nothing.
    padded = np.concatenate([np.where(worth > 0, worth, -1.0), np.zeros((A, A))], axis=1)
    rows, columns = linear_sum_assignment(padded, maximize=True)
    found = np.full(M, -1)
    pairs = columns < M
    found[columns[pairs]] = rows[pairs]
    return found
