"""How many animals there are: each one's probability of being there, and those that were never found.

Tracks are no count. A track is there with some probability, by what was detected of it and by the images that
should have shown it and did not; and animals that no image could have shown are nowhere among the tracks. The
number of the first has a Poisson-binomial distribution, that of the second a Poisson one where animals are
strewn independently.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

#: What a Poisson distribution leaves out beyond its largest number.
TAIL = 1e-12


class Count(NamedTuple):
    """A number of animals.

    Attributes
    ----------
    mean
        Animals.
    low, high
        The fewest numbers in a row that hold the asked probability.
    probability
        That they hold in fact: more, as numbers are whole.
    """

    mean: float
    low: int
    high: int
    probability: float


def count_probabilities(existence: ArrayLike, unseen: float = 0.0) -> Array:
    """Probability of each number of animals.

    Parameters
    ----------
    existence
        (A,) probability that each track is an animal that is there; independent of each other.
    unseen
        Expected number of animals that were never detected.

    Returns
    -------
    (K,) of 0 to K - 1 animals; sums to one.

    Raises
    ------
    WildlabError
        Where a probability is not from 0 to 1, or the expected number below zero.

    Examples
    --------
    >>> print(count_probabilities([0.5, 1.0]))
    [0.  0.5 0.5]
    """
    r = np.asarray(existence, float).reshape(-1)
    if not ((r >= 0) & (r <= 1)).all() or not 0 <= unseen < np.inf:
        raise WildlabError(
            f"no count from probabilities {np.round(r, 3).tolist()} and {unseen} animals never seen",
            "give probabilities from 0 to 1, and a number of zero or more",
            field="existence",
        )
    p = np.ones(1)
    for one in r:
        p = np.convolve(p, [1 - one, one])
    if unseen > 0:
        numbers = np.arange(int(unseen + 12 * np.sqrt(unseen) + 30))
        logarithm = numbers * np.log(unseen) - unseen - np.cumsum(np.log(np.maximum(numbers, 1)))
        poisson = np.exp(logarithm)
        p = np.convolve(p, poisson[: np.searchsorted(np.cumsum(poisson), 1 - TAIL) + 1])
    return np.asarray(p / p.sum())


def count_interval(probabilities: ArrayLike, probability: float = 0.9) -> Count:
    """Mean and shortest interval of a number of animals.

    Parameters
    ----------
    probabilities
        (K,) of 0 to K - 1 animals, from `count_probabilities`.
    probability
        That the interval shall hold at least, above 0 and below 1.

    Returns
    -------
    Count

    Raises
    ------
    WildlabError
        For a probability outside (0, 1).

    Examples
    --------
    >>> count_interval(count_probabilities([0.9, 0.8, 0.05]), 0.9)
    Count(mean=1.75, low=1, high=2, probability=0.945)
    """
    if not 0 < probability < 1:
        raise WildlabError(
            f"an interval of probability {probability}", "give above 0 and below 1", field="probability"
        )
    p = np.asarray(probabilities, float)
    below = np.concatenate([[0.0], np.cumsum(p)])
    held = below[None, 1:] - below[:-1, None]  # from a row's number to a column's
    length = np.arange(len(p))[None] - np.arange(len(p))[:, None]
    enough = (length >= 0) & (held >= min(probability, below[-1]) - 1e-12)
    shortest = length == length[enough].min()
    low, high = np.unravel_index(int(np.argmax(np.where(enough & shortest, held, -1.0))), held.shape)
    mean = float(np.arange(len(p)) @ p)
    return Count(round(mean, 12), int(low), int(high), round(float(held[low, high]), 12))


def existence_after(existence: ArrayLike, evidence: ArrayLike) -> Array:
    """Rule of Bayes for being there at all.

    Parameters
    ----------
    existence
        (...) probability before the image.
    evidence
        (...) how probable what was seen is if the animal is there, over how probable it is if not. For an
        image without a detection that is the probability of seeing nothing of it, from `weigh_unseen`.

    Returns
    -------
    (...) probability after it.

    Examples
    --------
    >>> print(existence_after(0.5, [1.0, 0.25, 0.0]))
    [0.5 0.2 0. ]
    """
    r, e = np.asarray(existence, float), np.asarray(evidence, float)
    total = 1 - r + r * e
    return np.asarray(np.divide(r * e, total, out=np.zeros(np.broadcast(r, e).shape), where=total > 0))
