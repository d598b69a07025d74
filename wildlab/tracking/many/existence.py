"""Whether targets are there and can be seen, and how many there are.

Of a target, r is the probability that it exists, v that it can be seen if it does, and d that it is detected
if it can be seen. A measurement is its own with the weight r v d L / c, where L is the density of the
measurement given the target and c that of clutter; it has none with the weight 1 - r v d (H 8.2; Musicki and
Evans, Joint integrated probabilistic data association, IEEE Transactions on Aerospace and Electronic Systems
40, 2004). With v = 1 that is the textbook's; with r = 1 too, joint probabilistic data association.

Tracks are no count: each is there with some probability, so that their number has a Poisson-binomial
distribution; targets never seen, where they are strewn independently, a Poisson one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array


def still_there(existence: ArrayLike, dt: ArrayLike, lifetime: float) -> Array:
    """Probability of existence ``dt`` s later, of targets that are there for ``lifetime`` s in the mean."""
    return np.asarray(np.asarray(existence, float) * np.exp(-np.asarray(dt, float) / lifetime))


def visible_later(visible: ArrayLike, dt: ArrayLike, visible_s: float, hidden_s: float) -> Array:
    """Probability of being visible ``dt`` s later: a Markov process with two states and its mean stays, s.

    Examples
    --------
    After a long time nothing is left of what was known:

    >>> print(visible_later(1.0, [0.0, 1e6], 30.0, 10.0))
    [1.   0.75]
    """
    lasting = visible_s / (visible_s + hidden_s)
    left = np.exp(-np.asarray(dt, float) * (1 / visible_s + 1 / hidden_s))
    return np.asarray(lasting + (np.asarray(visible, float) - lasting) * left)


def weights(
    existence: ArrayLike, visible: ArrayLike, detection: float, likelihood: ArrayLike, clutter: float
) -> tuple[Array, Array]:
    """Weights for `association_probabilities`.

    Parameters
    ----------
    existence, visible
        (T,) r and v.
    detection
        d.
    likelihood
        (T, M) L, 1/m^2; zero outside of the gate.
    clutter
        c, 1/m^2.

    Returns
    -------
    (T, M) of pairs and (T,) of none.
    """
    seen = np.asarray(existence, float) * np.asarray(visible, float) * detection
    return seen[:, None] * np.asarray(likelihood, float) / clutter, np.asarray(1 - seen)


def after_scan(
    existence: ArrayLike, visible: ArrayLike, detection: float, probabilities: ArrayLike
) -> tuple[Array, Array, Array]:
    """What a scan says of existence and visibility.

    Parameters
    ----------
    existence, visible, detection
        r (T,), v (T,) and d before it.
    probabilities
        (T, 1 + M), of `association_probabilities` with `weights`.

    Returns
    -------
    existence, visible
        (T,) after it; visible given that the target exists.
    own
        (T, 1 + M): probabilities that none or each of the measurements is its own, given that it exists.
    """
    r, v = np.asarray(existence, float), np.asarray(visible, float)
    p = np.array(probabilities, float)
    none = 1 - r * v * detection
    unseen = np.divide(r * (1 - v * detection), none, out=np.zeros_like(r), where=none > 0)
    there = p.copy()
    there[:, 0] = p[:, 0] * unseen
    after = there.sum(axis=1)
    own = np.divide(there, after[:, None], out=np.zeros_like(there), where=after[:, None] > 0)
    own[after <= 0, 0] = 1.0
    hidden = np.divide(v * (1 - detection), 1 - v * detection, out=np.ones_like(v), where=v * detection < 1)
    return after, np.asarray(own[:, 1:].sum(axis=1) + own[:, 0] * hidden), own


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
