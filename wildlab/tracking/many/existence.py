"""Whether a target is there, and whether it can be seen: joint integrated data association with visibility.

Of a target, r is the probability that it exists, v that it can be seen if it does, and d that it is detected
if it can be seen. A measurement is its own with the weight r v d L / c, where L is the density of the
measurement given the target and c that of clutter; it has none with the weight 1 - r v d (H 8.2; Musicki and
Evans, Joint integrated probabilistic data association, IEEE Transactions on Aerospace and Electronic Systems
40, 2004). With v = 1 that is the textbook's; with r = 1 too, joint probabilistic data association.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
