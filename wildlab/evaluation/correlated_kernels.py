"""Points whose image's pose error is partly new and partly wanders, weighed image by image; compiled.

What a search for causes does most: a likelihood of thousands of images, for each of hundreds of trial noises.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled

Array = NDArray[np.float64]


@compiled
def _factorise(A: Array) -> float:
    """Replace the lower half of A (n, n) by that of its Cholesky factor; the logarithm of the determinant."""
    n, logarithm = A.shape[0], 0.0
    for j in range(n):
        for i in range(j, n):
            value = A[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(value) if i == j else value / A[j, j]
        logarithm += 2 * np.log(A[j, j])
    return logarithm


@compiled
def _forward(L: Array, B: Array) -> None:
    """Replace B (n, K) by the inverse of the lower factor L (n, n) times B."""
    for i in range(L.shape[0]):
        for k in range(i):
            for c in range(B.shape[1]):
                B[i, c] -= L[i, k] * B[k, c]
        for c in range(B.shape[1]):
            B[i, c] /= L[i, i]


@compiled
def _backward(L: Array, B: Array) -> None:
    """Replace B (n, K) by the inverse of the transposed lower factor times B."""
    for i in range(L.shape[0] - 1, -1, -1):
        for k in range(i + 1, L.shape[0]):
            for c in range(B.shape[1]):
                B[i, c] -= L[k, i] * B[k, c]
        for c in range(B.shape[1]):
            B[i, c] /= L[i, i]


@compiled
def weigh_chain(
    G: Array, own: Array, B: Array, image: NDArray[np.int64], rho: Array, share: float
) -> tuple[Array, Array, float]:
    """What the weighed products of B need: with W (N, 2, K) and T (M, 12, K) they are ``W'W - T'T``.

    Parameters
    ----------
    G
        (N, 2, 6) of each point by its image's pose errors, each in its own standard deviation. Points are in
        the order of their images.
    own
        (N, 2, 2) covariance of what is each point's own.
    B
        (N, 2, K).
    image
        (N,) number of the image, from 0 to M - 1, none left out.
    rho
        (M - 1, 6) correlation of what wanders from one image to the next, below 1.
    share
        Of the variance of pose errors that wanders.

    Returns
    -------
    W, T, logarithm of the determinant of the covariance
    """
    N, K, M = B.shape[0], B.shape[2], rho.shape[0] + 1
    W, T = np.empty((N, 2, K)), np.zeros((M, 12, K))
    information = np.zeros((M, 6, 6))
    g0, g1 = np.empty(6), np.empty(6)
    logarithm = 0.0
    for i in range(N):
        a = np.sqrt(own[i, 0, 0])
        b = own[i, 1, 0] / a
        d = np.sqrt(own[i, 1, 1] - b * b)
        logarithm += 2 * np.log(a * d)
        m = image[i]
        for j in range(6):
            g0[j] = G[i, 0, j] / a
            g1[j] = (G[i, 1, j] - b * g0[j]) / d
        for c in range(K):
            W[i, 0, c] = B[i, 0, c] / a
            W[i, 1, c] = (B[i, 1, c] - b * W[i, 0, c]) / d
        for j in range(6):
            for k in range(6):
                information[m, j, k] += g0[j] * g0[k] + g1[j] * g1[k]
            for c in range(K):
                T[m, j, c] += g0[j] * W[i, 0, c] + g1[j] * W[i, 1, c]
    # Each image's own part first: what is left over of its points then says something of what wanders.
    A, left, before = np.empty((6, 6)), np.empty((6, 6)), np.zeros((6, 6))
    carried = np.zeros((6, K))
    for m in range(M):
        for j in range(6):
            for k in range(6):
                A[j, k] = (1 - share) * information[m, j, k]
                left[j, k] = share * information[m, j, k]
            A[j, j] += 1.0
        logarithm += _factorise(A)
        seen = T[m, :6].copy()
        _forward(A, seen)
        T[m, 6:] = np.sqrt(share) * seen
        T[m, :6] = np.sqrt(1 - share) * seen
        _backward(A, T[m, 6:])
        _forward(A, left)
        _backward(A, left)
        for j in range(6):
            come = 1 / (1 - rho[m - 1, j] ** 2) if m > 0 else 1.0
            go = rho[m, j] ** 2 / (1 - rho[m, j] ** 2) if m < M - 1 else 0.0
            left[j, j] += come + go
            if m > 0:
                q = rho[m - 1, j] / (1 - rho[m - 1, j] ** 2)
                logarithm += np.log(1 - rho[m - 1, j] ** 2)
                for k in range(6):
                    left[j, k] -= q * before[j, k] * rho[m - 1, k] / (1 - rho[m - 1, k] ** 2)
                for c in range(K):
                    T[m, 6 + j, c] += q * carried[j, c]
        logarithm += _factorise(left)
        _forward(left, T[m, 6:])
        carried[:] = T[m, 6:]
        _backward(left, carried)
        before[:] = np.eye(6)
        _forward(left, before)
        _backward(left, before)
    return W, T, logarithm
