"""Many animals, image after image: tracks that start, are lost and are found again, F 4.3 and 5.3.

Two rules, kept apart. `step_nearest` is F's: each detection takes its closest track, whose particles it
weighs by (4.11); what lies in no gate starts a track. `step_counting` gives a track one detection at most
and keeps the probability that each track is an animal, and how many were never seen: it counts. Both step
once for an image, so that whoever plans the flight can look at the tracks in between.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.frames import Array
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.kalman import update
from wildlab.tracking.particles.association import mahalanobis_squared, nearest_animal, one_to_one
from wildlab.tracking.particles.clouds import (
    Cloud,
    effective_size,
    moments,
    start_gaussian,
    weigh,
    weigh_unseen,
)
from wildlab.tracking.particles.counting import existence_after
from wildlab.tracking.particles.likelihoods import log_likelihood
from wildlab.tracking.particles.particle_sets import (
    Herd,
    ImageLook,
    Rules,
    kept,
    moved,
    start_tracks,
    with_new,
)
from wildlab.tracking.particles.resampling import resample

Integers = NDArray[np.int64]

#: A track that is less probable than this is given up where animals are counted.
LEAST_EXISTENCE = 1e-3
#: A detection that leaves a cloud with fewer particles' worth of weight than this says more than they can.
LEAST_EFFECTIVE = 10.0
#: What stands for a density of zero, 1/m^2, so that ratios stay finite.
LEAST_DENSITY = 1e-100


def step_nearest(
    herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator
) -> tuple[Herd, Integers]:
    """F's tracking, one image on: modified nearest neighbour, (4.11), negative update, both lost rules.

    Detections that no track takes start one each: F does not say whether the second one of a group takes the
    track that the first one has just started.

    Parameters
    ----------
    herd
        What was known.
    look
        The image, no earlier than the one before.
    rules
        Of the flight.
    rng
        Random numbers.

    Returns
    -------
    herd, taken
        What is known now; (M,) the identity that each detection was given, 0 where it is NaN.

    Raises
    ------
    WildlabError
        For an image that is earlier than the one before.
    """
    return _of_usable(_nearest, herd, look, rules, rng)


def _nearest(herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator) -> tuple[Herd, Integers]:
    herd = moved(herd, look, rules, rng)
    mean, covariance = moments(herd.cloud)
    squared = mahalanobis_squared(mean, covariance, look.z, look.R)
    taken = nearest_animal(np.where(herd.lost[:, None], np.inf, squared), rules.gate_probability)
    # Then those that were lost, one detection each: a lap later no two are likely to be one animal's.
    limit = min(gate_threshold(rules.gate_probability, 2), 1e6)
    free = taken < 0
    again = one_to_one(np.where(herd.lost[:, None] & free, limit - squared, -np.inf))
    taken = np.where(free, again, taken)
    given = np.zeros(herd.cloud.w.shape)
    seen = np.zeros(len(herd.identity), bool)
    for j in np.flatnonzero(taken >= 0):
        a = taken[j]
        given[a] += log_likelihood(herd.cloud.x[a, :, :2], look.z[j], look.R[j])
        seen[a] = True
    found, _ = weigh(herd.cloud, given)
    found = _revived(found, seen, mean, covariance, taken, look, rng)
    unseen, log_nothing = weigh_unseen(herd.cloud, look.sight(herd.cloud.x[..., :2]))
    missed = np.where(seen, 1.0, herd.missed * np.exp(log_nothing))
    w = np.where(seen[:, None], found.w, unseen.w) if rules.negative else found.w
    cloud = Cloud(found.x, w)
    herd = herd._replace(
        cloud=cloud, missed=missed, lost=herd.lost & ~seen, seen_at=np.where(seen, look.time, herd.seen_at)
    )
    new = np.flatnonzero(taken < 0)
    names = np.where(taken >= 0, np.append(herd.identity, 0)[taken], 0)
    names[new] = herd.born + 1 + np.arange(len(new))
    herd = with_new(herd, start_tracks(look.z[new], look.R[new], rules, rng), np.ones(len(new)), look.time)
    return _resampled(_lost(herd, rules), rules, rng), names


def _revived(
    cloud: Cloud, seen: NDArray[np.bool_], mean: Array, covariance: Array, taken: Integers, look: ImageLook,
    rng: np.random.Generator,
) -> Cloud:  # fmt: skip
    """Clouds of which a detection leaves hardly a particle, drawn anew about it.

    A sharp detection at the edge of a wide cloud gives one particle all the weight, and what resampling makes
    of that is a point that knows nothing of its error. Such a cloud is drawn from the normal distribution
    that a Kalman filter would have come to from the cloud's own mean (A, n) and covariance (A, n, n).
    """
    thin = np.flatnonzero(seen & (effective_size(cloud.w) < LEAST_EFFECTIVE))
    if not len(thin):
        return cloud
    x, w = cloud.x.copy(), cloud.w.copy()
    H = np.eye(2, x.shape[2])
    for a in thin:
        at, P = mean[a], covariance[a]
        for j in np.flatnonzero(taken == a):
            after = update(at, P, look.z[j], H, look.R[j])
            at, P = after.x, after.P
        fresh = start_gaussian(at[None], ((P + P.T) / 2)[None], x.shape[1], rng)
        x[a], w[a] = fresh.x[0], fresh.w[0]
    return Cloud(x, w)


def step_counting(
    herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator
) -> tuple[Herd, Integers]:
    """Tracking that counts, one image on: one detection at most for a track, and each with its probability.

    A detection is of a track, of an animal that was never seen, or false: each pair gains the logarithm of
    how much more likely the first is than the others, and the pairs that gain most together are taken. Then
    each track is updated as if that pairing were sure (integrated probabilistic data association with one
    candidate), and a detection without a track starts one that is an animal with the probability that it is
    of one never seen. Images without a detection count always: existence means nothing without them.

    Parameters
    ----------
    herd
        What was known; begin with `expect`.
    look
        The image, with the density of false detections.
    rules
        Of the flight. Nothing is lost: what is less probable than `LEAST_EXISTENCE` ends.
    rng
        Random numbers.

    Returns
    -------
    herd, taken
        What is known now; (M,) the identity that each detection was given, 0 where it was not used: NaN, or
        no track's and false without much doubt.

    Raises
    ------
    WildlabError
        For an image that is earlier than the one before.
    """
    return _of_usable(_counting, herd, look, rules, rng)


def _counting(herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator) -> tuple[Herd, Integers]:
    herd = moved(herd, look, rules, rng)
    A, M = len(herd.identity), len(look.z)
    sight, of_unseen = look.sight(herd.cloud.x[..., :2]), look.sight(herd.unseen.x[0, :, :2])
    # Density of detections of animals never seen, at each detection; and of all that is no track's.
    unseen_each = np.array([
        of_unseen * np.exp(log_likelihood(herd.unseen.x[0, :, :2], z, R))
        for z, R in zip(look.z, look.R, strict=True)
    ]).reshape(M, herd.unseen.x.shape[1])  # fmt: skip
    new_density = herd.expected_unseen * (unseen_each @ herd.unseen.w[0])
    other = np.maximum(new_density + look.clutter, LEAST_DENSITY)
    gate = gate_threshold(rules.gate_probability, 2)
    near = mahalanobis_squared(*moments(herd.cloud), look.z, look.R) <= gate
    # Of the pairs within the gate alone: a frame full of glitter has more pairs than fit into memory.
    seen_each, density = dict[tuple[int, int], Array](), np.zeros((A, M))
    for a, j in np.argwhere(near).tolist():
        each = sight[a] * np.exp(log_likelihood(herd.cloud.x[a, :, :2], look.z[j], look.R[j]))
        seen_each[a, j], density[a, j] = each, herd.existence[a] * float(each @ herd.cloud.w[a])
    nothing = 1 - herd.existence * np.einsum("an,an->a", sight, herd.cloud.w)
    with np.errstate(divide="ignore"):
        gain = np.log(density) - np.log(other) - np.log(np.maximum(nothing, LEAST_DENSITY))[:, None]
    taken = one_to_one(np.where(density > 0, gain, -np.inf))
    likely = 1 - sight
    for j in np.flatnonzero(taken >= 0).tolist():
        likely[taken[j]] += seen_each[int(taken[j]), j] / other[j]
    with np.errstate(divide="ignore"):
        cloud, log_evidence = weigh(herd.cloud, np.log(likely))
    seen = np.isin(np.arange(A), taken)
    existence = np.where(
        log_evidence > 700, 1.0, existence_after(herd.existence, np.exp(np.minimum(log_evidence, 700)))
    )
    missed = np.where(seen, 1.0, herd.missed * np.exp(np.where(seen, 0.0, log_evidence)))
    unseen, expected = _unseen_after(herd, of_unseen, unseen_each, _doubt(gain, taken, new_density / other))
    new = np.flatnonzero((taken < 0) & (new_density > LEAST_EXISTENCE * other))
    names = np.where(taken >= 0, np.append(herd.identity, 0)[taken], 0)
    names[new] = herd.born + 1 + np.arange(len(new))
    herd = herd._replace(
        cloud=cloud, existence=existence, missed=missed, unseen=unseen,
        seen_at=np.where(seen, look.time, herd.seen_at),
        expected_unseen=expected,
    )  # fmt: skip
    fresh = start_tracks(look.z[new], look.R[new], rules, rng)
    herd = with_new(herd, fresh, new_density[new] / other[new], look.time)
    herd = kept(herd, herd.existence >= LEAST_EXISTENCE)
    if herd.unseen.x.size:
        herd = herd._replace(unseen=resample(herd.unseen, rng, "systematic")[0])
    return _resampled(herd, rules, rng), names


def _of_usable(
    step: Callable[[Herd, ImageLook, Rules, np.random.Generator], tuple[Herd, Integers]],
    herd: Herd,
    look: ImageLook,
    rules: Rules,
    rng: np.random.Generator,
) -> tuple[Herd, Integers]:
    """One of the steps with the detections that met the ground; the others keep their place, with 0."""
    z, R = np.asarray(look.z, float).reshape(-1, 2), np.asarray(look.R, float).reshape(-1, 2, 2)
    usable = np.isfinite(z).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    herd, names = step(herd, look._replace(z=z[usable], R=R[usable]), rules, rng)
    aligned = np.zeros(len(z), np.int64)
    aligned[usable] = names
    return herd, aligned


def _doubt(gain: Array, taken: Integers, new: Array) -> Array:
    """(M,) how probable it is that a detection that a track took is of an animal never seen."""
    mine = np.where(taken >= 0, gain[taken, np.arange(len(taken))] if len(gain) else 0.0, np.inf)
    return np.where(taken >= 0, new / (1 + np.exp(np.minimum(mine, 700))), 0.0)


def _unseen_after(herd: Herd, sight: Array, seen_each: Array, doubt: Array) -> tuple[Cloud, float]:
    """Where animals never seen may be, and how many: those the image did not show, and those it may have."""
    w, total = herd.unseen.w[0], herd.expected_unseen
    if not len(w):
        return herd.unseen, total
    left = total * w * (1 - sight)
    for one, share in zip(seen_each, doubt, strict=True):
        if share > 0:
            left = left + share * (one * w) / (one @ w)
    if not left.sum() > 0:
        return herd.unseen, 0.0
    return Cloud(herd.unseen.x, (left / left.sum())[None]), float(left.sum())


def _lost(herd: Herd, rules: Rules) -> Herd:
    """Both rules by which an animal that was known is lost, F 5.3 and 5.3.4."""
    _, covariance = moments(herd.cloud)
    trace = np.trace(covariance[:, :2, :2], axis1=1, axis2=2)
    return herd._replace(lost=herd.lost | (trace > rules.lost_trace) | (herd.missed < rules.lost_doubt))


def _resampled(herd: Herd, rules: Rules, rng: np.random.Generator) -> Herd:
    if not len(herd.identity):
        return herd
    return herd._replace(cloud=resample(herd.cloud, rng, rules.scheme, rules.threshold)[0])
