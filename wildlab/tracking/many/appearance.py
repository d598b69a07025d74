"""What targets look like as a help in association: H 3.3.1 and 6.4.4.

A track keeps what its target looked like when it was started. H names size, intensity and the first of Hu's
invariants, and prints neither weights nor spreads: both are the caller's to choose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array
from wildlab.tracking.association import Assignment, global_nearest


def image_features(area: ArrayLike, intensity: ArrayLike, hu: ArrayLike, metres_per_px: ArrayLike) -> Array:
    """Size, intensity and first Hu moment of detections, on scales whose spread hardly depends on the value.

    Size is taken on the ground, so that it stays the same while the distance changes.

    Parameters
    ----------
    area
        (N,) px^2.
    intensity
        (N,) mean of each region less the background's, in any unit.
    hu
        (N, 7) or (N,), of which the first invariant counts.
    metres_per_px
        (N,) or one: how long a pixel is at the target, m.

    Returns
    -------
    (N, 3)
        Natural logarithm of the size in m^2, intensity, natural logarithm of the Hu moment; NaN where a size
        or a moment is not positive.

    Examples
    --------
    >>> image_features([100.0], [12.0], [0.2], 0.5).round(2).tolist()
    [[3.22, 12.0, -1.61]]
    """
    first = np.asarray(hu, float)
    first = first[:, 0] if first.ndim == 2 else first
    size = np.asarray(area, float) * np.asarray(metres_per_px, float) ** 2
    columns = (_logarithm(size), np.asarray(intensity, float), _logarithm(first))
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def feature_distances(measured: ArrayLike, stored: ArrayLike, sd: ArrayLike, weights: ArrayLike) -> Array:
    """Weighted sum of squared differences of features, each in units of its spread.

    With all weights 1 and features that are normal and independent it is chi-square, as (3.9) is, so that the
    two may be added.

    Parameters
    ----------
    measured
        (N, f) of measurements.
    stored
        (M, f) of tracks.
    sd
        (f,) standard deviation of the difference between a measurement of a target and what its track keeps,
        or (M, f) where tracks know it differently well.
    weights
        (f,), not negative; zero leaves a feature out.

    Returns
    -------
    (N, M)
        A feature that is not known, NaN, on either side adds nothing.

    Raises
    ------
    WildlabError
        If the shapes do not fit each other, a spread is not positive or a weight is negative.

    Examples
    --------
    >>> feature_distances([[3.0, 1.0]], [[1.0, 1.0], [3.0, 4.0]], sd=[1.0, 3.0], weights=[1.0, 0.5]).tolist()
    [[4.0, 0.5]]
    """
    new, kept, spread, w = (np.asarray(one, float) for one in (measured, stored, sd, weights))
    f = spread.shape[-1] if spread.shape in (spread.shape[-1:], kept.shape) else -1
    if new.ndim != 2 or kept.ndim != 2 or (new.shape[1], kept.shape[1], w.shape) != (f, f, (f,)):
        raise WildlabError(
            f"features of shapes {new.shape} and {kept.shape} do not go with spreads of shape {spread.shape} "
            f"and weights of shape {w.shape}",
            "give (N, f), (M, f), (f,) or (M, f), and (f,)",
        )
    if not (np.isfinite(spread) & (spread > 0)).all():
        raise WildlabError(f"a spread of {spread.tolist()}", "give positive ones", field="sd")
    if not (np.isfinite(w) & (w >= 0)).all():
        raise WildlabError(
            f"weights of {w.tolist()}", "give none below zero; zero leaves a feature out", field="weights"
        )
    apart = (new[:, None] - kept) / spread
    return np.asarray(np.where(np.isnan(apart), 0.0, w * apart**2).sum(axis=-1))


def estimated_distances(
    measured: ArrayLike, total: ArrayLike, known: ArrayLike, sd: ArrayLike, used: ArrayLike
) -> Array:
    """Normalised innovations squared of features that are part of a track's state, H 6.4.4's future work.

    A feature of a target is the same at all times, and every measurement of it has the same noise: the Kalman
    filter's estimate is the mean of what was measured, its variance that of the noise over their number.
    Noise of features and of places have nothing to do with each other, and so the two parts of the state
    neither: the innovation squared of the whole state is the sum of both.

    Parameters
    ----------
    measured
        (N, f) of measurements.
    total, known
        (M, f) sums of all that went to each track, and of how many.
    sd
        (f,) standard deviation of one measurement.
    used
        (f,) which features count.

    Returns
    -------
    (N, M)
        Chi-square of as many degrees of freedom as features are known. One that is not adds nothing.

    Examples
    --------
    >>> estimated_distances([[3.0]], [[2.0], [4.0]], [[2.0], [2.0]], [1.0], [True]).round(3).tolist()
    [[2.667, 0.667]]
    """
    count = np.asarray(known, float)
    mean = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
    spread = np.asarray(sd, float) * np.sqrt(1 + 1 / np.maximum(count, 1))
    return feature_distances(measured, mean, spread, np.asarray(used, float))


def with_features(distances: ArrayLike, features: ArrayLike, gate: float) -> Array:
    """Physical and feature distance together, H 6.4.4: the gate is one of the physical distance alone.

    Parameters
    ----------
    distances
        (N, M), by (3.9).
    features
        (N, M), from `feature_distances`.
    gate
        The largest physical distance of a pair.

    Returns
    -------
    (N, M)
        Their sum; infinite outside the gate. To be assigned without a gate.

    Examples
    --------
    >>> with_features([[1.0, 20.0]], [[3.0, 0.0]], gate=9.21).tolist()
    [[4.0, inf]]
    """
    d = np.asarray(distances, float)
    return np.asarray(np.where(d <= gate, d + np.asarray(features, float), np.inf))


def veto(assignment: Assignment, features: ArrayLike, limit: float) -> Assignment:
    """Undo the pairs that do not look alike: features as a veto after an association by distance.

    Parameters
    ----------
    assignment
        By distance.
    features
        (N, M), from `feature_distances`.
    limit
        The largest feature distance of a pair.

    Returns
    -------
    Assignment
        Its pairs within the limit; measurements and tracks of the others have none.

    Raises
    ------
    WildlabError
        If the features are not as many as the assignment has measurements and tracks.
    """
    f = np.asarray(features, float)
    track, measurement = (one.copy() for one in assignment)
    if f.shape != (len(track), len(measurement)):
        raise WildlabError(
            f"features of shape {f.shape} do not go with {len(track)} measurements and {len(measurement)} "
            "tracks",
            "give (N, M)",
            field="features",
        )
    rows = np.flatnonzero(track >= 0)
    undone = rows[~(f[rows, track[rows]] <= limit)]
    measurement[track[undone]] = -1
    track[undone] = -1
    return Assignment(track, measurement)


def _logarithm(values: Array) -> Array:
    return np.log(np.where(values > 0, values, np.nan))


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
        return Limits(float(gate_with_more(gate, np.array([appearance.used.sum()]))[0]))
    if rule == VETO and appearance is not None:
        return Limits(gate, alike_limit(veto_probability, appearance))
    return Limits(gate)


def alike_limit(probability: float, appearance: Appearance) -> float:
    """The largest distance of looks that lets in so many of a target's own; none where no feature counts."""
    count = int(appearance.used.sum())
    return gate_threshold(probability, count) if count else np.inf


def gate_with_more(gate: float, count: Array) -> Array:
    """A gate on places, as of so many elements more: as many of a target's own are beyond it."""
    # By what is outside: what is inside rounds to one.
    return np.asarray(chdtri(2 + count, np.exp(-gate / 2)), float)


def associate(distances: Array, features: Array | None, rule: str, limits: Limits) -> Assignment:
    """One image's association by a rule.

    Parameters
    ----------
    distances, features
        (N, M), by (3.9) and of features; by `STATE` the first is the sum of both.
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
