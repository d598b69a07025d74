"""A known number of targets as one state: what the measurements of a scan share is known to be shared.

Errors of the camera's pose move all targets of an image alike: these lie to each other far more surely than
on the ground, and one Gaussian over all targets has it so. Every measurement is of a target, and a target has
at most one: what remains to be decided is which way they go together, by a rule of `RULES`.

- ``gnn`` keeps the likeliest way of each scan.
- ``jpda`` merges all ways by their probabilities; targets near each other grow together (coalescence).
- ``jpda-star`` keeps of ways that differ by an exchange alone the likeliest, and merges what is left (Blom
  and Bloem, Probabilistic data association avoiding track coalescence, IEEE Transactions on Automatic
  Control 45, 2000).
- ``mht`` keeps the 30 likeliest histories, and decides at the end (Reid, An algorithm for tracking multiple
  targets, IEEE Transactions on Automatic Control 24, 1979).
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

Index = NDArray[np.int64]


class Rule(NamedTuple):
    """How many histories are kept; whether ways are merged; whether of exchanges one is left."""

    most: int = 1
    merged: bool = False
    pruned: bool = False


RULES = {
    "gnn": Rule(),
    "jpda": Rule(merged=True),
    "jpda-star": Rule(merged=True, pruned=True),
    "mht": Rule(most=30),
}


#: A history whose probability is less than exp(-20) of the likeliest is not kept.
WORTHLESS = 20.0


class JointScans(NamedTuple):
    """D measurements of T targets in K scans, in order of time.

    Attributes
    ----------
    z
        (D, 2) places, m.
    number
        (K,) how many of each scan, from one to T.
    F, Q
        (K, 4, 4) motion of a target to each scan from the one before.
    own, shared
        Standard deviations of each axis, m: of a measurement alone, and of what all of a scan have in common.
    unlike
        (D, T) square of the difference between looks of measurement and target, in units of its spread: zero
        where nobody looks.
    """

    z: Array
    number: Index
    F: Array
    Q: Array
    own: float
    shared: float
    unlike: Array


def assign_jointly(scans: JointScans, x: Array, P: Array, rule: Rule) -> Index:
    """The target of each measurement.

    Parameters
    ----------
    scans
        All scans.
    x, P
        (T, 4) and (4 T, 4 T) before the first of them: north, east and velocities of each target.
    rule
        One of `RULES`.

    Returns
    -------
    (D,)
        Whose each is in the likeliest way of its scan where ways are merged, else in the likeliest history.

    Examples
    --------
    Two that stand five metres from each other, seen with an error of twenty that both share:

    >>> F, Q = np.tile(np.eye(4), (1, 1, 1)), np.zeros((1, 4, 4))
    >>> z, alike = np.array([[25.0, 0.0], [20.0, 0.0]]), np.zeros((2, 2))
    >>> seen = JointScans(z, np.array([2]), F, Q, own=1.0, shared=20.0, unlike=alike)
    >>> x = np.array([[0.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0]])
    >>> assign_jointly(seen, x, 0.01 * np.eye(8), RULES["jpda"]).tolist()
    [1, 0]
    """
    T = len(x)
    ways, sets = _ways(T)
    return _assigned(
        np.asarray(scans.z, float), np.asarray(scans.F, float), np.asarray(scans.Q, float),
        np.asarray(scans.unlike, float), np.asarray(scans.number, np.int64),
        float(scans.own), float(scans.shared), np.asarray(x, float).reshape(-1), np.asarray(P, float),
        ways, sets, *rule,
    )  # fmt: skip


def _ways(T: int) -> tuple[Index, Index]:
    """(T + 1, W, T) targets of 0 to T measurements by every way, and (T + 1, W) which have the same targets.

    -1 is nothing.
    """
    most = len(list(permutations(range(T))))
    ways, sets = np.full((T + 1, most, T), -1), np.full((T + 1, most), -1)
    for n in range(1, T + 1):
        names: dict[frozenset[int], int] = {}
        for k, way in enumerate(permutations(range(T), n)):
            ways[n, k, :n], sets[n, k] = way, names.setdefault(frozenset(way), len(names))
    return ways, sets


@compiled
def _assigned(
    z: Array, F: Array, Q: Array, unlike: Array, count: Index, own: float, shared: float,
    x0: Array, P0: Array, ways: Index, sets: Index, most: int, merged: bool, pruned: bool,
) -> Index:  # fmt: skip
    """As `assign_jointly`."""
    size, T, K = len(x0), len(x0) // 4, len(count)
    kept, number = most, 1
    x, P, score = np.zeros((kept, size)), np.zeros((kept, size, size)), np.zeros(kept)
    x[0], P[0] = x0, P0
    parent, chosen = np.full((K, kept), -1), np.full((K, kept), -1)
    first = 0
    for k in range(K):
        n = count[k]
        W = np.sum(sets[n] >= 0)
        move, noise = np.zeros((size, size)), np.zeros((size, size))
        for t in range(T):
            move[4 * t : 4 * t + 4, 4 * t : 4 * t + 4] = F[k]
            noise[4 * t : 4 * t + 4, 4 * t : 4 * t + 4] = Q[k]
        R = np.zeros((2 * n, 2 * n))
        for i in range(n):
            for j in range(n):
                for axis in range(2):
                    R[2 * i + axis, 2 * j + axis] = shared**2 + (own**2 if i == j else 0.0)
        to_x, to_P = np.zeros((number, W, size)), np.zeros((number, W, size, size))
        worth = np.zeros((number, W))
        for h in range(number):
            ahead, spread = move @ x[h], move @ P[h] @ move.T + noise
            for w in range(W):
                rows = np.zeros(2 * n, np.int64)
                beside = np.zeros((2 * n, size + 1))  # covariances with the state, and the innovation
                worth[h, w] = score[h]
                for i in range(n):
                    to = ways[n, w, i]
                    for axis in range(2):
                        rows[2 * i + axis] = 4 * to + axis
                        beside[2 * i + axis, :size] = spread[4 * to + axis]
                        beside[2 * i + axis, size] = z[first + i, axis] - ahead[4 * to + axis]
                    worth[h, w] -= unlike[first + i, to] / 2
                L = np.linalg.cholesky(beside[:, rows] + R)
                white = np.linalg.solve(L, beside)
                gained, nu = np.ascontiguousarray(white[:, :size].T), np.ascontiguousarray(white[:, size])
                worth[h, w] -= nu @ nu / 2 + np.log(np.diag(L)).sum()
                to_x[h, w] = ahead + gained @ nu
                to_P[h, w] = spread - gained @ gained.T
        best = worth.max()
        if merged:
            p = np.exp(worth[0] - best)
            top = np.argmax(p)
            chosen[k, 0], parent[k, 0] = top, 0
            if pruned:
                for w in range(W):
                    for v in range(W):
                        if sets[n, v] == sets[n, w] and (worth[0, v], -v) > (worth[0, w], -w):
                            p[w] = 0.0
            p /= p.sum()
            x[0], P[0] = 0.0, 0.0
            for w in range(W):
                x[0] += p[w] * to_x[0, w]
            for w in range(W):
                off = to_x[0, w] - x[0]
                P[0] += p[w] * (to_P[0, w] + np.outer(off, off))
        else:
            order = np.argsort(-worth.ravel())[: min(kept, np.sum(worth > best - WORTHLESS))]
            for place, one in enumerate(order):
                parent[k, place], chosen[k, place] = one // W, one % W
                x[place], P[place] = to_x[one // W, one % W], to_P[one // W, one % W]
                score[place] = worth[one // W, one % W] - best
            number = len(order)
        first += n
    whose = np.full(len(z), -1)
    history = 0
    for k in range(K - 1, -1, -1):
        first -= count[k]
        for i in range(count[k]):
            whose[first + i] = ways[count[k], chosen[k, history], i]
        history = parent[k, history]
    return whose
