"""Which measurement is whose, way by way: what the fast sums are held against."""

from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array


def association_probabilities_by_enumeration(weights: ArrayLike, missed: ArrayLike) -> Array:
    """The same as `association_probabilities`, way by way: what the fast sums are held against.

    Parameters and result as there; for a handful of targets.
    """
    w, w0 = np.asarray(weights, float), np.asarray(missed, float)
    n, m = w.shape
    found = np.zeros((n, 1 + m))
    # None of the measurements is there once for each target.
    choices = [*range(1, 1 + m), *([0] * n)]
    for way in set(permutations(choices, n)):
        weight = 1.0
        for target, choice in enumerate(way):
            weight *= w0[target] if choice == 0 else w[target, choice - 1]
        for target, choice in enumerate(way):
            found[target, choice] += weight
    return np.asarray(found / found.sum(axis=1, keepdims=True))
