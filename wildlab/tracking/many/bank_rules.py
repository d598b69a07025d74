"""By what a bank gives detections to tracks: places, and what both look like. H 3.3.1, 6.4.4."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.many.assignment import Assignment, global_nearest
from wildlab.tracking.many.bank_life import Alive
from wildlab.tracking.many.features import (
    estimated_distances,
    feature_distances,
    veto,
    with_features,
)

Array = NDArray[np.float64]

#: What association goes by: distance alone; with features weighed in; with features as a veto on what was
#: associated by distance; with features that are part of the state, and so of the validation region.
DISTANCE, FEATURES, VETO, STATE = "distance", "features", "veto", "state"
RULES = (DISTANCE, FEATURES, VETO, STATE)


class Appearance(NamedTuple):
    """What detections look like, (D, f), and what is told of it: spreads and weights, (f,).

    Features of the state have no weights: all count whose weight is not zero.
    """

    features: Array
    sd: Array
    weights: Array


class Limits(NamedTuple):
    """The largest distance in the validation region, and of features that a veto lets through."""

    gate: float
    alike: float = np.inf


def limits_of(rule: str, gate: float, veto_probability: float, appearance: Appearance | None) -> Limits:
    """What a rule makes of a gate on places, and of the share of a target's own looks that a veto lets in.

    Where features are part of the state, the gate lets in as many of a target's own detections as that on
    places alone.

    Examples
    --------
    >>> looks = Appearance(np.zeros((1, 3)), np.ones(3), np.ones(3))
    >>> found = limits_of(STATE, gate_threshold(0.99, 2), 0.999, looks)
    >>> bool(np.isclose(found.gate, gate_threshold(0.99, 5)))
    True
    """
    if rule == STATE and appearance is not None:
        inside = float(-np.expm1(-gate / 2))
        return Limits(gate_threshold(inside, 2 + int((appearance.weights > 0).sum())))
    if rule == VETO and appearance is not None:
        return Limits(gate, gate_threshold(veto_probability, len(appearance.sd)))
    return Limits(gate)


def compare_looks(rows: Array, alive: Alive, appearance: Appearance, rule: str) -> Array:
    """(N, M) how far detections with features (N, f) are from what the tracks look like."""
    if rule == STATE:
        used = appearance.weights > 0
        return estimated_distances(rows, alive.total, alive.known, appearance.sd, used)
    # What is stored is the mean of two, and as uncertain as half of a detection.
    return feature_distances(rows, alive.stored, np.sqrt(1.5) * appearance.sd, appearance.weights)


def associate(distances: Array, features: Array | None, rule: str, limits: Limits) -> Assignment:
    """One image's association by a rule.

    Parameters
    ----------
    distances, features
        (N, M), by (3.9) and from `compare_looks`; by `STATE` the first is the sum of both.
    rule
        One of `RULES`.
    limits
        From `limits_of`.

    Returns
    -------
    Assignment
    """
    if rule == FEATURES and features is not None:
        return global_nearest(with_features(distances, features, limits.gate), np.inf)
    chosen = global_nearest(distances, limits.gate)
    if rule == VETO and features is not None:
        return veto(chosen, features, limits.alike)
    return chosen


def has_room(distances: Array, chosen: Assignment, gate: float) -> NDArray[np.bool_]:
    """Which rows lie in the gate of a track that took nothing."""
    return np.asarray(((distances <= gate) & (chosen.measurement < 0)).any(axis=1))
