"""Quiet images of a bank of filters, in which every detection goes to a track of its own, compiled.

What it computes is what `wildlab.tracking.many.bank.run_bank` computes image by image. Where a detection is
free, two want the same track, or a track ends, it stops before that image and leaves it to the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

Index = NDArray[np.int64]
#: Rules of `wildlab.tracking.association` as the loop knows them.
DISTANCE, FEATURES, VETO, STATE = 0, 1, 2, 3
#: So near to its limit a deviation is left to be decided by the eigenvalues.
NEARLY = 1 + 1e-9


@compiled
def look_distance(
    row: Array, stored: Array, total: Array, known: Array, sd: Array, weights: Array, wider: Array, rule: int
) -> float:
    """Of one detection's features (f,) from those of one track, as `compare_looks` has it."""
    distance, both = 0.0, 0
    for i in range(len(row)):
        if rule == STATE:
            kept = total[i] / known[i] if known[i] > 0 else np.nan
            spread = sd[i] * np.sqrt(1 + 1 / max(known[i], 1.0))
        else:
            kept, spread = stored[i], np.sqrt(1.5) * sd[i]
        apart = (row[i] - kept) / spread
        if not np.isnan(apart):
            distance += weights[i] * apart**2
        if weights[i] > 0 and np.isfinite(row[i]) and known[i] > 0:
            both += 1
    return distance + wider[both] if rule == STATE else distance


@compiled
def correct_place(x: Array, P: Array, z: Array, R: Array) -> None:
    """`wildlab.tracking.kalman.update` of a state (4,), (4, 4) with a position (2,), in place."""
    s00, s01, s11 = P[0, 0] + R[0, 0], P[0, 1] + R[0, 1], P[1, 1] + R[1, 1]
    determinant = s00 * s11 - s01 * s01
    K, kept = np.empty((4, 2)), np.eye(4)
    for i in range(4):
        K[i, 0] = (s11 * P[i, 0] - s01 * P[i, 1]) / determinant
        K[i, 1] = (s00 * P[i, 1] - s01 * P[i, 0]) / determinant
        kept[i, 0] -= K[i, 0]
        kept[i, 1] -= K[i, 1]
    v0, v1 = z[0] - x[0], z[1] - x[1]
    for i in range(4):
        x[i] += K[i, 0] * v0 + K[i, 1] * v1
    posterior = kept @ P @ kept.T + K @ R @ K.T
    P[:] = (posterior + posterior.T) / 2


@compiled
def follow_quietly(
    start: int, before: int, images: Index, ends: Index, z: Array, features: Array, steps: Index, F: Array,
    Q: Array, R: Array, rule: int, gate: float, alike: float, sd: Array, weights: Array, wider: Array,
    interval: float, longest: Array, x: Array, P: Array, x_then: Array, P_then: Array, stored: Array,
    total: Array, known: Array, last: Index, absent: Index, taken: Index, xs: Array, Ps: Array,
) -> int:  # fmt: skip
    """Images from ``start`` on, up to the first that is not quiet, whose place is returned.

    Parameters
    ----------
    before
        Number of the image that the tracks stand at.
    images, ends
        (K,) numbers of all images, and where the detections of each end.
    z, features
        (D, 2) and (D, f).
    steps, F, Q
        (K,) which transition leads to each image from the one before, and (S, 4, 4) these; the first image's
        is of no use.
    R, rule, gate, alike, sd, weights, wider
        Noise; the rule, its gates on distances and (of a veto) looks; spreads and weights of features; and by
        how much the gate on places is larger the more features are known, (f + 1,).
    interval, longest
        s between two images; (3,) s without a detection in view, and of any kind, and m of the largest
        deviation of a place, that no track outlives.
    x, P, x_then, P_then, stored, total, known, last, absent
        Of the A tracks, as `Alive` has them; changed in place.
    taken, xs, Ps
        Output, (D,) the row of the track of each detection, and (K, A, ...) the states after each image.
    """
    A = len(x)
    best, y, M = np.empty(len(z), np.int64), x.copy(), P.copy()
    for k in range(start, len(images)):
        missed, first = images[k] - before - 1, ends[k - 1] if k else 0
        for a in range(A):
            unseen, age = (absent[a] + missed) * interval, (images[k] - last[a]) * interval
            if not (unseen <= longest[0] and age <= longest[1]):
                return k
        step = F[steps[k]]
        for a in range(A):
            y[a] = step @ x[a]
            prior = step @ P[a] @ step.T + Q[steps[k]]
            M[a] = (prior + prior.T) / 2
            half = np.hypot((M[a, 0, 0] - M[a, 1, 1]) / 2, M[a, 0, 1])
            largest = np.sqrt((M[a, 0, 0] + M[a, 1, 1]) / 2 + half)
            if not largest * NEARLY <= longest[2]:
                return k
        for d in range(first, ends[k]):
            best[d], least, vetoed = -1, np.inf, False
            for a in range(A):
                v0, v1 = z[d, 0] - y[a, 0], z[d, 1] - y[a, 1]
                s00, s01, s11 = M[a, 0, 0] + R[0, 0], M[a, 0, 1] + R[0, 1], M[a, 1, 1] + R[1, 1]
                distance = (s11 * v0 * v0 - 2 * s01 * v0 * v1 + s00 * v1 * v1) / (s00 * s11 - s01 * s01)
                looks = 0.0
                if rule != DISTANCE:
                    looks = look_distance(
                        features[d], stored[a], total[a], known[a], sd, weights, wider, rule
                    )
                cost = distance + looks if rule in (FEATURES, STATE) else distance
                within = cost if rule == STATE else distance
                if within <= gate and cost < least:
                    best[d], least = a, cost
                    vetoed = rule == VETO and not looks <= alike
            if best[d] < 0 or vetoed:
                return k
            for other in range(first, d):
                if best[other] == best[d]:
                    return k
        x[:], P[:] = y, M
        for a in range(A):
            absent[a] += missed + 1
        for d in range(first, ends[k]):
            a = best[d]
            correct_place(x[a], P[a], z[d], R)
            taken[d], last[a], absent[a] = a, images[k], 0
            x_then[a], P_then[a] = x[a], P[a]
            for i in range(features.shape[1]):
                if np.isfinite(features[d, i]):
                    total[a, i] += features[d, i]
                    known[a, i] += 1
        xs[k], Ps[k], before = x, P, images[k]
    return len(images)
