"""How far a set of estimates is from the set of true targets, when their number may be wrong too."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from wildlab.errors import WildlabError

Array = NDArray[np.float64]


class Ospa(NamedTuple):
    """``distance ** p == localisation ** p + cardinality ** p``, all in the unit of the points."""

    distance: float
    localisation: float
    cardinality: float


class Gospa(NamedTuple):
    """``distance ** p == localisation ** p + missed ** p + false ** p``, all in the unit of the points.

    ``n_missed`` true targets have no estimate nearer than the cut-off, ``n_false`` estimates no target.
    """

    distance: float
    localisation: float
    missed: float
    false: float
    n_missed: int
    n_false: int


def ospa(truth: ArrayLike, estimates: ArrayLike, cutoff: float, order: float = 2.0) -> Ospa:
    """Optimal subpattern assignment distance (Schuhmacher, Vo and Vo 2008) between two sets of points.

    An error per target: normalised by the larger of the two numbers, and never above ``cutoff``.

    Parameters
    ----------
    truth, estimates
        (M, k) and (N, k), in one unit; either may be empty.
    cutoff
        Distance from which a target counts as missed, in that unit; what each surplus point costs.
    order
        p of the metric, at least 1: the higher, the more an outlier costs.

    Returns
    -------
    Ospa
        All zero where both sets are empty.

    Raises
    ------
    WildlabError
        If the points do not fit each other or are not finite, the cut-off is not positive or the order below
        1.
    """
    cost, few, many = _costs(truth, estimates, cutoff, order)
    if many == 0:
        return Ospa(0.0, 0.0, 0.0)
    rows, columns = linear_sum_assignment(cost)
    near = float(cost[rows, columns].sum()) / many
    surplus = cutoff**order * (many - few) / many
    return Ospa(*((part ** (1 / order)) for part in (near + surplus, near, surplus)))


def gospa(truth: ArrayLike, estimates: ArrayLike, cutoff: float, order: float = 2.0) -> Gospa:
    """Generalised OSPA (Rahmathullah, Garcia-Fernandez and Svensson 2017) with alpha = 2.

    A sum over the targets, not a mean; with alpha = 2 it falls into localisation, missed and false targets. A
    pair as far apart as ``cutoff``, or further, is not a pair: it is a missed target and a false one.

    Parameters
    ----------
    truth, estimates
        (M, k) and (N, k), in one unit; either may be empty.
    cutoff
        Distance from which a target counts as missed and an estimate as false, in that unit; to the power of
        ``order``, each costs half of it.
    order
        p of the metric, at least 1: the higher, the more an outlier costs.

    Returns
    -------
    Gospa
        All zero where both sets are empty.

    Raises
    ------
    WildlabError
        As `ospa`.
    """
    cost, _, _ = _costs(truth, estimates, cutoff, order)
    rows, columns = linear_sum_assignment(cost)
    # A pair at the cut-off costs as much as the two left alone: it counts as left alone.
    paired = cost[rows, columns] < cutoff**order
    near = float(cost[rows, columns][paired].sum())
    n_missed, n_false = (size - int(paired.sum()) for size in cost.shape)
    missed, false = (n * cutoff**order / 2 for n in (n_missed, n_false))
    whole, *parts = (part ** (1 / order) for part in (near + missed + false, near, missed, false))
    return Gospa(whole, parts[0], parts[1], parts[2], n_missed, n_false)


def _costs(truth: ArrayLike, estimates: ArrayLike, cutoff: float, order: float) -> tuple[Array, int, int]:
    """``min(distance, cutoff) ** order`` (M, N), and the smaller and the larger number of points."""
    if not (0 < cutoff < np.inf and 1 <= order < np.inf):
        raise WildlabError(
            f"a cut-off of {cutoff:g} and order {order:g} make no metric",
            "give a positive cut-off, and an order of at least 1",
        )
    x, y = (np.asarray(points, float) for points in (truth, estimates))
    size = max(x.shape[1] if x.ndim == 2 else 0, y.shape[1] if y.ndim == 2 else 0)
    x, y = (points.reshape(0, size) if points.size == 0 else points for points in (x, y))
    if x.ndim != 2 or y.ndim != 2 or x.shape[1] != y.shape[1]:
        raise WildlabError(
            f"points of shape {x.shape} do not go with points of shape {y.shape}",
            "give (M, k) and (N, k), one row per point",
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise WildlabError("a point is not finite", "leave out rows without a position")
    few, many = sorted((len(x), len(y)))
    if few == 0:
        return np.empty((len(x), len(y))), few, many
    return np.minimum(cdist(x, y), cutoff) ** order, few, many
