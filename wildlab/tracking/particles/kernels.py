"""The loops over particles that numpy goes through several times, compiled; tests hold them against numpy."""

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


@compiled
def take(x: Array, chosen: NDArray[np.int64]) -> Array:
    """The chosen particles (A, M) of each animal's (A, N, n): (A, M, n)."""
    rows, wanted = chosen.shape
    n = x.shape[2]
    found = np.empty((rows, wanted, n))
    for a in range(rows):
        for k in range(wanted):
            i = chosen[a, k]
            for c in range(n):
                found[a, k, c] = x[a, i, c]
    return found


@compiled
def weighted_moments(x: Array, w: Array) -> tuple[Array, Array]:
    """Means (A, n) and covariances (A, n, n) of particles (A, N, n) with weights (A, N), F (4.12)-(4.13)."""
    rows, particles, n = x.shape
    mean, covariance, off = np.zeros((rows, n)), np.zeros((rows, n, n)), np.empty(n)
    for a in range(rows):
        for i in range(particles):
            for c in range(n):
                mean[a, c] += w[a, i] * x[a, i, c]
        for i in range(particles):
            for c in range(n):
                off[c] = x[a, i, c] - mean[a, c]
                for d in range(c + 1):
                    covariance[a, c, d] += w[a, i] * off[c] * off[d]
        for c in range(n):
            for d in range(c):
                covariance[a, d, c] = covariance[a, c, d]
    return mean, covariance
