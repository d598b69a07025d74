"""Attitudes between two that are known, along the shortest turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.compilation import announced, compiled
from wildlab.geometry.frames import Array

Rows = NDArray[np.intp]


def between_attitudes(q_nb: ArrayLike, before: Rows, after: Rows, share: ArrayLike) -> Array:
    """Rotations on the way from some attitudes to others, turning at an even rate the shorter way (slerp).

    Parameters
    ----------
    q_nb
        (M, 4) quaternions w, x, y, z, of any length but zero.
    before, after
        (N,) their rows to start from and to end at.
    share
        (N,) how far on the way, 0 at the start and 1 at the end.

    Returns
    -------
    (N, 3, 3), takes a vector from b to n; NaN where the share or one of both quaternions is NaN or zero.

    Examples
    --------
    Half-way from north to east is north-east:

    >>> q = np.array([[1.0, 0.0, 0.0, 0.0], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    >>> R = between_attitudes(q, np.array([0]), np.array([1]), np.array([0.5]))
    >>> print(np.round(R[0] @ [1.0, 0.0, 0.0], 3))
    [0.707 0.707 0.   ]
    """
    q, s = np.ascontiguousarray(q_nb, float), np.ascontiguousarray(share, float)
    R = np.empty((len(s), 3, 3))
    with announced("attitudes between two others"):
        _fill(q, np.ascontiguousarray(before), np.ascontiguousarray(after), s, R)
    return R


@compiled
def _fill(q: Array, before: Rows, after: Rows, share: Array, R: Array) -> None:
    for k in range(len(share)):
        i, j, s = before[k], after[k], share[k]
        a, b, c, d = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        e, f, g, h = q[j, 0], q[j, 1], q[j, 2], q[j, 3]
        size, other = np.sqrt(a * a + b * b + c * c + d * d), np.sqrt(e * e + f * f + g * g + h * h)
        if not (np.isfinite(s) and np.isfinite(size) and np.isfinite(other) and size > 0 and other > 0):
            R[k] = np.nan
            continue
        a, b, c, d = a / size, b / size, c / size, d / size
        e, f, g, h = e / other, f / other, g / other, h / other
        # The turn from one to the other: the first backwards, then the second.
        w = a * e + b * f + c * g + d * h
        x = a * f - b * e - c * h + d * g
        y = a * g + b * h - c * e - d * f
        z = a * h - b * g + c * f - d * e
        if w < 0:  # the same turn the shorter way
            w, x, y, z = -w, -x, -y, -z
        length = np.sqrt(x * x + y * y + z * z)
        half = np.arctan2(length, w)
        # sin(s half) / sin(half), which is s where both vanish.
        scale = np.sin(s * half) / length if length > 1e-12 else s
        w, x, y, z = np.cos(s * half), scale * x, scale * y, scale * z
        a, b, c, d = (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        )
        size = a * a + b * b + c * c + d * d
        R[k, 0, 0], R[k, 0, 1], R[k, 0, 2] = (
            1 - 2 * (c * c + d * d) / size,
            2 * (b * c - a * d) / size,
            2 * (b * d + a * c) / size,
        )
        R[k, 1, 0], R[k, 1, 1], R[k, 1, 2] = (
            2 * (b * c + a * d) / size,
            1 - 2 * (b * b + d * d) / size,
            2 * (c * d - a * b) / size,
        )
        R[k, 2, 0], R[k, 2, 1], R[k, 2, 2] = (
            2 * (b * d - a * c) / size,
            2 * (c * d + a * b) / size,
            1 - 2 * (b * b + c * c) / size,
        )
