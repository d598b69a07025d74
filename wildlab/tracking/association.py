"""Which measurement is of which target: validation region and nearest neighbour (H 3.3, 6.2.3, 6.3.2), firm
assignment over a matrix of distances (H 3.3.1), and joint probabilities.

A matrix has a row for each measurement and a column for each track, H (3.10); NaN and infinity stand for
pairs that are out of the question. Probabilities are over all ways to deal measurements out: a way deals each
to at most one target and to each target at most one; its weight is the product of its pairs' weights and of
those of the targets left without. Targets that compete for no measurement are independent: sums are taken
cluster by cluster.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from wildlab.errors import WildlabError
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.tracking.sensors import difference


class Nearest(NamedTuple):
    """The detection with the smallest normalised innovation squared."""

    detection: int
    innovation: Array  # (m,)
    S: Array  # (m, m)
    nis: float


def innovation_squared(innovation: ArrayLike, S: ArrayLike) -> Array:
    """NIS (...), H (3.12), of innovations (..., m) with covariances (..., m, m)."""
    v = np.asarray(innovation, float)
    return np.asarray(
        np.einsum("...i,...i->...", v, np.linalg.solve(np.asarray(S, float), v[..., None])[..., 0])
    )


def nearest_detection(
    z: Array, predicted: Array, spread: Array, R: Array, angles: tuple[bool, ...], row: int
) -> Nearest | None:
    """The nearest of K detections (K, m) by NIS, or None where all are NaN.

    Parameters
    ----------
    predicted, spread
        (m,) and (m, m): the expected measurement and its covariance, without noise.
    R
        (K, m, m).
    row
        For the error: an ``S`` that is not positive definite names it.
    """
    there = np.flatnonzero(np.isfinite(z).all(axis=-1))
    if not len(there):
        return None
    innovations = difference(z[there], predicted, angles)
    S = spread + R[there]
    try:
        np.linalg.cholesky(S)
    except np.linalg.LinAlgError as error:
        raise WildlabError(
            f"the innovation covariance S of row {row} is not positive definite",
            "check the covariances of start, motion and measurements",
            field="S",
        ) from error
    nis = innovation_squared(innovations, S)
    best = int(np.argmin(nis))
    return Nearest(int(there[best]), innovations[best], S[best], float(nis[best]))


Index = NDArray[np.int64]


class Assignment(NamedTuple):
    """Who goes with whom.

    Attributes
    ----------
    track
        (N,) the track of each measurement, -1 where it has none.
    measurement
        (M,) the measurement of each track, -1 where it has none.
    """

    track: Index
    measurement: Index


def global_nearest(distances: ArrayLike, gate: float) -> Assignment:
    """Global nearest neighbour: no measurement goes to two tracks, no track takes two, H 3.3.1.

    The sum of the distances is the least, where each pair that is not made costs as much as the gate. H asks
    for a pair for each row and column that has an entry within the gate, which may not be possible: two
    measurements may lie in the gate of one track alone. Without a gate, as many pairs are made as possible,
    with the least sum among those.

    Parameters
    ----------
    distances
        (N, M), by (3.9), with or without features; they may be negative.
    gate
        The largest distance of a pair; infinite for none.

    Returns
    -------
    Assignment

    Examples
    --------
    The nearest of the first track is nearer still to the second:

    >>> global_nearest([[2.0, 1.0], [5.0, 9.0]], gate=9.21)
    Assignment(track=array([1, 0]), measurement=array([1, 0]))
    """
    d = np.asarray(distances, float)
    possible = np.isfinite(d) & (d <= gate)
    track, measurement = np.full(d.shape[0], -1), np.full(d.shape[1], -1)
    if not possible.any():
        return Assignment(track, measurement)
    # A pair that is out of the question costs what the two cost alone.
    alone = gate
    if not np.isfinite(gate):
        largest, least = d[possible].max(), d[possible].min()
        alone = largest + (largest - least + 1) * min(d.shape)
    rows, columns = linear_sum_assignment(np.where(possible, d, alone))
    made = possible[rows, columns]
    track[rows[made]], measurement[columns[made]] = columns[made], rows[made]
    return Assignment(track, measurement)


#: Clusters with more targets and more measurements than this are summed by belief propagation: the exact sum
#: has two to the power of the smaller number terms.
MOST_EXACT = 12
#: With so few targets or measurements it takes longer to find the clusters than to sum over all at once.
FEW = 5
#: Belief propagation ends where no message changes by more, or after so many rounds.
CLOSE, MOST_ROUNDS = 1e-9, 1000


def association_probabilities(weights: ArrayLike, missed: ArrayLike, most: int = MOST_EXACT) -> Array:
    """How probable each measurement is each target's own, and that a target has none.

    Parameters
    ----------
    weights
        (T, M) of a target with a measurement, not below zero: detection probability times likelihood over the
        density of clutter; zero outside of the gate.
    missed
        (T,) of a target without one, not below zero.
    most
        Clusters in which the smaller of both numbers is larger are approximated, by belief propagation
        (Williams and Lau, Approximate evaluation of marginal association probabilities with belief
        propagation, IEEE Transactions on Aerospace and Electronic Systems 50, 2014); others are exact.

    Returns
    -------
    (T, 1 + M), rows sum to one: the first column is that of no measurement.

    Raises
    ------
    WildlabError
        Where a target has no way at all.

    Examples
    --------
    Two targets that both want the first measurement; one of them has another choice. Of the five ways, whose
    weights are 1, 8, 8, 8 and 64, two give the first measurement to the first target, 72 of 89:

    >>> np.round(association_probabilities([[8.0, 0.0], [8.0, 8.0]], [1.0, 1.0]), 2)
    array([[0.19, 0.81, 0.  ],
           [0.1 , 0.09, 0.81]])
    """
    w, w0 = np.asarray(weights, float), np.asarray(missed, float)
    found = np.zeros((len(w), 1 + w.shape[1]))
    linked = w > 0
    rows, columns = (np.flatnonzero(linked.any(axis=axis)) for axis in (1, 0))
    found[~linked.any(axis=1), 0] = 1.0
    few = min(len(rows), len(columns)) <= min(FEW, most)
    for targets, measurements in [(rows, columns)] if few else _clusters(linked):
        if not len(measurements):
            continue
        # A target's weights may be scaled as one likes; near one, no product leaves what a float holds.
        part, none = w[np.ix_(targets, measurements)], w0[targets]
        scale = np.maximum(part.max(axis=1), none)
        part, none = part / scale[:, None], none / scale
        own = (_exact if min(part.shape) <= most else belief_propagation)(part, none)
        if not np.isfinite(own).all():
            raise WildlabError(
                "targets that cannot be missed share too few measurements",
                "give each a weight of being missed",
            )
        found[targets, 0] = own[:, 0]
        found[np.ix_(targets, 1 + measurements)] = own[:, 1:]
    return found


def _clusters(linked: NDArray[np.bool_]) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Targets and measurements that hang together; each target is in one."""
    n, m = linked.shape
    row, column = np.nonzero(linked)
    graph = coo_matrix((np.ones(len(row)), (row, n + column)), shape=(n + m, n + m))
    _, label = connected_components(graph, directed=False)
    groups = []
    for name in np.unique(label[:n]):
        mine = np.flatnonzero(label == name)
        groups.append((mine[mine < n], mine[mine >= n] - n))
    return groups


def _exact(w: Array, w0: Array) -> Array:
    """(T, 1 + M) of a cluster. The sets are of whatever there is less of, targets or measurements."""
    free = np.ones(w.shape[1])
    pairs = _pairs(w, w0, free) if w.shape[1] <= w.shape[0] else _pairs(w.T.copy(), free, w0).T
    return np.concatenate([np.maximum(1 - pairs.sum(axis=1, keepdims=True), 0.0), pairs], axis=1)


@compiled
def _pairs(w: Array, item_none: Array, slot_none: Array) -> Array:
    """(I, S) probabilities of pairs over all ways: item after item, over the sets of slots that are taken."""
    n, m = w.shape
    size = 1 << m
    ahead = np.zeros((n + 1, size))
    ahead[0, 0] = 1.0
    for i in range(n):
        for taken in range(size):
            value = ahead[i, taken]
            if value == 0.0:
                continue
            ahead[i + 1, taken] += value * item_none[i]
            for j in range(m):
                if w[i, j] > 0.0 and not taken >> j & 1:
                    ahead[i + 1, taken | 1 << j] += value * w[i, j]
        ahead[i + 1] /= max(ahead[i + 1].max(), 1e-300)
    behind = np.ones(size)
    for taken in range(size):
        for j in range(m):
            if not taken >> j & 1:
                behind[taken] *= slot_none[j]
    found = np.zeros((n, m))
    for i in range(n - 1, -1, -1):
        before = np.zeros(size)
        total = 0.0
        for taken in range(size):
            value = ahead[i, taken]
            before[taken] = item_none[i] * behind[taken]
            for j in range(m):
                if w[i, j] > 0.0 and not taken >> j & 1:
                    one = w[i, j] * behind[taken | 1 << j]
                    found[i, j] += value * one
                    before[taken] += one
            total += value * before[taken]
        found[i] /= total
        behind = before / max(before.max(), 1e-300)
    return found


def belief_propagation(weights: ArrayLike, missed: ArrayLike) -> Array:
    """The same as `association_probabilities` for clusters of any size, near enough and not exact.

    Messages run between targets and measurements until they settle. Exact where no loop of targets and
    measurements competes.

    Parameters
    ----------
    weights
        (T, M) as there.
    missed
        (T,) as there, above zero.

    Returns
    -------
    (T, 1 + M), rows sum to one.
    """
    w, w0 = np.asarray(weights, float), np.asarray(missed, float)
    odds = w / w0[:, None]
    free = np.ones_like(odds)  # from each measurement to each target: how free it is
    for _ in range(MOST_ROUNDS):
        wanted = odds * free
        asks = odds / (1 + wanted.sum(axis=1, keepdims=True) - wanted)
        new = 1 / (1 + asks.sum(axis=0) - asks)
        moved = np.abs(new - free).max(initial=0.0)
        free = new
        if moved < CLOSE:
            break
    all_of = np.concatenate([np.ones((len(w), 1)), odds * free], axis=1)
    return np.asarray(all_of / all_of.sum(axis=1, keepdims=True))
