"""The loop of resampling, compiled; a test holds it against `numpy.searchsorted`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array


@compiled
def pick(cumulative: Array, points: Array) -> NDArray[np.int64]:
    """Which particle each point falls on: the first whose cumulative weight lies above it.

    Both (A, N) and (A, M), ascending along the last axis, the points in [0, 1) and the last weight 1. One
    walk along both replaces a search for each point.
    """
    rows, wanted = points.shape
    found = np.empty((rows, wanted), np.int64)
    for a in range(rows):
        i = 0
        for k in range(wanted):
            while cumulative[a, i] <= points[a, k]:
                i += 1
            found[a, k] = i
    return found
