"""The hot loop of the Monte Carlo of H 6.4.3, compiled: run after run, image by image, two detections each.

What it computes is what `wildlab.tracking.association.innovation_squared` and
`wildlab.tracking.kalman.correct` compute; tests hold it against filters written out for single runs. A target
in or behind the plane of the lens has no expected measurement, and neither has an azimuth on the axis: NaN,
and nothing is associated by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

#: What a distance is computed from, as the numbers that the loop knows.
POSITION, PIXELS, ANGLES, BOTH = 0, 1, 2, 3


@compiled
def expected(
    form: int, n: float, e: float, p: Array, R: Array, A: Array
) -> tuple[float, float, float, float, float, float]:
    """Measurement of a target at (n, e, 0) and its derivatives by n and e, row by row.

    H (6.3), (6.4), (6.7), (6.9). ``p`` (3,) and ``R`` (3, 3) are the camera's pose, ``A`` (5,) fx, fy, cx, cy
    and skew.
    """
    if form == POSITION:
        return n, e, 1.0, 0.0, 0.0, 1.0
    a, b, c = n - p[0], e - p[1], -p[2]
    X = R[0, 0] * a + R[1, 0] * b + R[2, 0] * c
    Y = R[0, 1] * a + R[1, 1] * b + R[2, 1] * c
    Z = R[0, 2] * a + R[1, 2] * b + R[2, 2] * c
    if not Z > 0:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    if form == PIXELS:
        x, y = X / Z, Y / Z
        xn, xe = (R[0, 0] - x * R[0, 2]) / Z, (R[1, 0] - x * R[1, 2]) / Z
        yn, ye = (R[0, 1] - y * R[0, 2]) / Z, (R[1, 1] - y * R[1, 2]) / Z
        u, v = A[0] * x + A[4] * y + A[2], A[1] * y + A[3]
        return u, v, A[0] * xn + A[4] * yn, A[0] * xe + A[4] * ye, A[1] * yn, A[1] * ye
    level2 = X * X + Y * Y
    if not level2 > 0:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    level, range2 = np.sqrt(level2), level2 + Z * Z
    ax, ay = -Y / level2, X / level2
    ex, ey, ez = -Z * X / (level * range2), -Z * Y / (level * range2), level / range2
    return (
        np.arctan2(Y, X), np.arctan2(Z, level), ax * R[0, 0] + ay * R[0, 1], ax * R[1, 0] + ay * R[1, 1],
        ex * R[0, 0] + ey * R[0, 1] + ez * R[0, 2], ex * R[1, 0] + ey * R[1, 1] + ez * R[1, 2],
    )  # fmt: skip


@compiled
def gap_of(measured: float, predicted: float, wrapped: bool) -> float:
    """Measurement minus prediction, from -pi on and below pi where it is ``wrapped``."""
    gap = measured - predicted
    return gap - 2 * np.pi * np.floor((gap + np.pi) / (2 * np.pi)) if wrapped else gap


@compiled
def add_distances(
    form: int, x: Array, P: Array, p: Array, R: Array, A: Array, noise: Array,
    measured: Array, nis: Array,
) -> None:  # fmt: skip
    """Adds the normalised innovation squared of both detections (2, 2) to ``nis`` (2,), H (3.12)."""
    z0, z1, h00, h01, h10, h11 = expected(form, x[0], x[1], p, R, A)
    a0, a1 = P[0, 0] * h00 + P[0, 1] * h01, P[1, 0] * h00 + P[1, 1] * h01
    b0, b1 = P[0, 0] * h10 + P[0, 1] * h11, P[1, 0] * h10 + P[1, 1] * h11
    s00, s11 = h00 * a0 + h01 * a1 + noise[0, 0], h10 * b0 + h11 * b1 + noise[1, 1]
    s01 = h10 * a0 + h11 * a1 + noise[0, 1]
    for k in range(2):
        v0, v1 = gap_of(measured[k, 0], z0, form == ANGLES), measured[k, 1] - z1
        nis[k] += (s11 * v0 * v0 - 2 * s01 * v0 * v1 + s00 * v1 * v1) / (s00 * s11 - s01 * s01)


@compiled
def nearest(nis: Array) -> int:
    """0 or 1, whichever is smaller; -1 where neither is known."""
    first = nis[0] if np.isfinite(nis[0]) else np.inf
    second = nis[1] if np.isfinite(nis[1]) else np.inf
    if first == np.inf and second == np.inf:
        return -1
    return 0 if first <= second else 1


@compiled
def move(x: Array, P: Array, F: Array, Q: Array, y: Array, M: Array) -> None:
    """H (3.5a)-(3.5b) in place; ``y`` (4,) and ``M`` (4, 4) are scratch."""
    for i in range(4):
        y[i] = F[i, 0] * x[0] + F[i, 1] * x[1] + F[i, 2] * x[2] + F[i, 3] * x[3]
        for j in range(4):
            M[i, j] = F[i, 0] * P[0, j] + F[i, 1] * P[1, j] + F[i, 2] * P[2, j] + F[i, 3] * P[3, j]
    for i in range(4):
        x[i] = y[i]
        for j in range(i + 1):
            P[i, j] = P[j, i] = Q[i, j] + (
                M[i, 0] * F[j, 0] + M[i, 1] * F[j, 1] + M[i, 2] * F[j, 2] + M[i, 3] * F[j, 3]
            )


@compiled
def update_with(
    form: int, x: Array, P: Array, p: Array, R: Array, A: Array, noise: Array,
    measured: Array, U: Array, K: Array,
) -> None:  # fmt: skip
    """H (3.7d)-(3.7h) in place with ``measured`` (2,); nothing happens where it cannot be predicted.

    ``U`` and ``K`` (4, 2) are scratch.
    """
    z0, z1, h00, h01, h10, h11 = expected(form, x[0], x[1], p, R, A)
    v0, v1 = gap_of(measured[0], z0, form == ANGLES), measured[1] - z1
    if not np.isfinite(v0 + v1):
        return
    for i in range(4):
        U[i, 0], U[i, 1] = P[i, 0] * h00 + P[i, 1] * h01, P[i, 0] * h10 + P[i, 1] * h11
    s00, s11 = h00 * U[0, 0] + h01 * U[1, 0] + noise[0, 0], h10 * U[0, 1] + h11 * U[1, 1] + noise[1, 1]
    s01 = h10 * U[0, 0] + h11 * U[1, 0] + noise[0, 1]
    determinant = s00 * s11 - s01 * s01
    for i in range(4):
        K[i, 0] = (U[i, 0] * s11 - U[i, 1] * s01) / determinant
        K[i, 1] = (U[i, 1] * s00 - U[i, 0] * s01) / determinant
    for i in range(4):
        x[i] += K[i, 0] * v0 + K[i, 1] * v1
        # With the optimal gain, Joseph's form is P less K S K', and U is K S: symmetric, as both are filled.
        for j in range(i + 1):
            P[i, j] = P[j, i] = P[i, j] - K[i, 0] * U[j, 0] - K[i, 1] * U[j, 1]


@compiled
def associate_runs(
    gate: int, update: int, assigned: bool, A: Array, p_nc: Array, R_nc: Array, measured: Array, F: Array,
    Q: Array, noise: Array, x0: Array, P0: Array, taken: NDArray[np.int64], nis: Array, estimate: Array,
) -> None:  # fmt: skip
    """All N runs through their T images.

    Parameters
    ----------
    gate, update
        By what detections are associated (`BOTH`: the sum of the distances by pixels and by angles), and
        by what the track is updated.
    assigned
        Whether with the detection that was associated, else with the main object's.
    A, p_nc, R_nc
        (5,) of the camera; (N, T, 3) and (N, T, 3, 3) the poses as they are known.
    measured
        (3, N, T, 2, 2): by form the two detections, the main object's first.
    F, Q, noise, x0, P0
        (4, 4), (4, 4), (3, 2, 2) by form, (N, 4), (4, 4).
    taken, nis, estimate
        Output, (N, T), (N, T, 2) and (N, T, 2): which detection (-1: neither), both distances, and north and
        east after the update.
    """
    x, P, y, M = np.empty(4), np.empty((4, 4)), np.empty(4), np.empty((4, 4))
    U, K, d = np.empty((4, 2)), np.empty((4, 2)), np.empty(2)
    for r in range(taken.shape[0]):
        x[:], P[:] = x0[r], P0
        for t in range(taken.shape[1]):
            move(x, P, F, Q, y, M)
            p, R = p_nc[r, t], R_nc[r, t]
            d[:] = 0.0
            for form in range(3):
                if form == gate or (gate == BOTH and form != POSITION):
                    add_distances(form, x, P, p, R, A, noise[form], measured[form, r, t], d)
            best = nearest(d)
            taken[r, t], nis[r, t, 0], nis[r, t, 1] = best, d[0], d[1]
            used = best if assigned else 0
            if used >= 0:
                z = measured[update, r, t, used]
                update_with(update, x, P, p, R, A, noise[update], z, U, K)
            estimate[r, t, 0], estimate[r, t, 1] = x[0], x[1]
