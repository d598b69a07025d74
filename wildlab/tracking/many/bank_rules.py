"""By what a bank gives detections to tracks: places, and what both look like. H 3.3.1, 6.4.4."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

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

    Weights are of `FEATURES` alone. By the other rules, and where a track is found again, the distance has to
    be chi-square: all features count alike whose weight is not zero.
    """

    features: Array
    sd: Array
    weights: Array

    @property
    def used(self) -> Array:
        """(f,) one for each feature that counts, and zero for the others."""
        return (self.weights > 0).astype(float)


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
        return Limits(float(_with_more(gate, np.array([appearance.used.sum()]))[0]))
    if rule == VETO and appearance is not None:
        return Limits(gate, alike_limit(veto_probability, appearance))
    return Limits(gate)


def alike_limit(probability: float, appearance: Appearance) -> float:
    """The largest distance of looks that lets in so many of a target's own; none where no feature counts."""
    count = int(appearance.used.sum())
    return gate_threshold(probability, count) if count else np.inf


def _with_more(gate: float, count: Array) -> Array:
    """A gate on places, as of so many elements more: as many of a target's own are beyond it."""
    # By what is outside: what is inside rounds to one.
    return np.asarray(chdtri(2 + count, np.exp(-gate / 2)), float)


def compare_looks(rows: Array, alive: Alive, appearance: Appearance, rule: str, gate: float) -> Array:
    """(N, M) how far detections with features (N, f) are from what the tracks look like.

    By `STATE` features that are not known of both take the gate on places, ``gate``, as far: of any pair it
    lets in as many as of one whose features are all known.
    """
    if rule == STATE:
        used = appearance.used
        known = (np.isfinite(rows) * used) @ (alive.known > 0).T
        wider = _with_more(gate, np.array([used.sum()])) - _with_more(gate, known)
        return wider + estimated_distances(rows, alive.total, alive.known, appearance.sd, used)
    # What is stored is the mean of two, and as uncertain as half of a detection.
    weights = appearance.weights if rule == FEATURES else appearance.used
    return feature_distances(rows, alive.stored, np.sqrt(1.5) * appearance.sd, weights)


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
