"""Particle filters: many animals at once, seen and not seen, and kept in by a fence (F 4.2, 4.3).

Animals are the first axis, particles the second: states (A, N, n), weights (A, N). A step of the filter is
`move` and `stay_inside`; then `weigh` with a `log_likelihood`, or `weigh_unseen` where an image looked and
found nothing; then `moments`, and `resample`. Always resampling is SIR, by the effective size alone SIS.
`nearest_animal` is F's rule of association.

>>> rng = np.random.default_rng(1)
>>> cloud = start_gaussian([[0.0, 0.0]], 400 * np.eye(2), 2000, rng)
>>> cloud = move(cloud, walk_of(0.5, 1.0), 10.0, rng)
>>> cloud, log_evidence = weigh(cloud, log_likelihood(cloud.x, [[12.0, 3.0]], 4 * np.eye(2)))
>>> cloud, resampled = resample(cloud, rng)
>>> mean, covariance = moments(cloud)
>>> bool(np.hypot(*(mean[0] - [12.0, 3.0])) < 1.0), resampled
(True, array([ True]))

Particles move by the motion model itself (prior sampling, F (4.15)). F's random walk (4.5) draws a velocity
for each step and holds it over that step, and F does not say how long a step is. The spread after a time
depends on it: n steps of length T add n (sd T)^2, so ten times as many steps in the same time spread the
cloud a tenth as far in variance. `walk_of` turns a standard deviation of velocities *and* the step they last
into a walk that gives the same spread however often it is predicted.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import check_covariance, gate_threshold
from wildlab.geometry.frames import Array
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.motion import Motion, random_walk

__all__ = [
    "Cloud",
    "Weighed",
    "draw",
    "effective_size",
    "log_likelihood",
    "mahalanobis_squared",
    "moments",
    "move",
    "nearest_animal",
    "resample",
    "start_gaussian",
    "stay_inside",
    "walk_of",
    "weigh",
    "weigh_unseen",
]


#: Places (..., 2) m -> whether each lies in an enclosure.
Inside = Callable[[Array], NDArray[np.bool_]]


class Cloud(NamedTuple):
    """Particles of A animals at once.

    Attributes
    ----------
    x
        (A, N, n) states; north and east, m, are the first two.
    w
        (A, N) weights, none below zero; each animal's sum to one.
    """

    x: Array
    w: Array


class Weighed(NamedTuple):
    """A cloud after a measurement.

    Attributes
    ----------
    cloud
        With the new weights; states as they were.
    log_evidence
        (A,) logarithm of c_k, F (4.10): how probable the measurement was before it was made. Minus infinity
        where no particle can have made it; the weights are then as they were.
    """

    cloud: Cloud
    log_evidence: Array


def weigh(cloud: Cloud, log_likelihood: ArrayLike) -> Weighed:
    """Measurement update, F (4.9)-(4.10).

    Parameters
    ----------
    cloud
        As it was expected.
    log_likelihood
        (A, N), or what fits it: of the measurement given each particle; minus infinity where it is
        impossible.

    Returns
    -------
    Weighed

    Examples
    --------
    >>> cloud = Cloud(np.array([[[0.0, 0.0], [9.0, 0.0]]]), np.array([[0.5, 0.5]]))
    >>> after, log_evidence = weigh(cloud, np.log([[0.9, 0.3]]))
    >>> print(after.w, np.round(np.exp(log_evidence), 3))
    [[0.75 0.25]] [0.6]
    """
    given = np.where(cloud.w > 0, log_likelihood, -np.inf)
    top = given.max(axis=1, initial=-np.inf)
    possible = top > -np.inf
    # The largest one is taken out, so that the sum is not zero.
    w = cloud.w * np.exp(given - np.where(possible, top, 0.0)[:, None])
    total = np.where(possible, w.sum(axis=1), 1.0)
    after = np.where(possible[:, None], w / total[:, None], cloud.w)
    return Weighed(Cloud(cloud.x, after), np.where(possible, np.log(total) + top, -np.inf))


def weigh_unseen(cloud: Cloud, detection: ArrayLike) -> Weighed:
    """Negative measurement update, F 4.2.2: an image had no detection of the animal.

    Parameters
    ----------
    cloud
        As it was expected.
    detection
        (A, N), or what fits it: probability with which the image would have had a detection of an animal that
        is where the particle is; 0 outside the footprint and where something hides it.

    Returns
    -------
    Weighed
        Its evidence is the probability of seeing nothing of the animal. F lowers the weights without saying
        by how much; what Bayes' rule asks for is the factor one minus the probability of detection.
    """
    with np.errstate(divide="ignore"):
        return weigh(cloud, np.log1p(-np.asarray(detection, float)))


def moments(cloud: Cloud) -> tuple[Array, Array]:
    """Mean and covariance of clouds, F (4.12)-(4.13).

    Parameters
    ----------
    cloud
        Of A animals.

    Returns
    -------
    mean, covariance
        (A, n) and (A, n, n), in the units of the state.

    Examples
    --------
    >>> mean, covariance = moments(Cloud(np.array([[[0.0, 0.0], [4.0, 0.0]]]), np.array([[0.75, 0.25]])))
    >>> print(mean, covariance[0, 0, 0])
    [[1. 0.]] 3.0
    """
    mean = np.einsum("an,anc->ac", cloud.w, cloud.x)
    off = cloud.x - mean[:, None]
    return mean, np.swapaxes(off * cloud.w[..., None], 1, 2) @ off


def effective_size(w: ArrayLike) -> Array:
    """How many particles of equal weight would be worth as much, F (4.14).

    Parameters
    ----------
    w
        (..., N) weights that sum to one.

    Returns
    -------
    (...) from 1 to N.

    Examples
    --------
    >>> print(effective_size([[0.25, 0.25, 0.25, 0.25], [0.5, 0.5, 0.0, 0.0]]))
    [4. 2.]
    """
    weights = np.asarray(w, float)
    return np.asarray(1 / np.einsum("...n,...n->...", weights, weights))


def start_gaussian(mean: ArrayLike, covariance: ArrayLike, particles: int, rng: np.random.Generator) -> Cloud:
    """Clouds about first estimates.

    Parameters
    ----------
    mean
        (A, n).
    covariance
        (A, n, n), or (n, n) for all.
    particles
        Of each animal, at least one.
    rng
        Random numbers.

    Returns
    -------
    Cloud

    Raises
    ------
    WildlabError
        Where a covariance is none.
    """
    middle = np.atleast_2d(np.asarray(mean, float))
    A, n = middle.shape
    P = np.broadcast_to(np.asarray(covariance, float), (A, n, n))
    check_covariance(P, "covariance")
    noise = rng.standard_normal((A, particles, n)) @ np.swapaxes(root_of(P), -1, -2)
    return Cloud(middle[:, None] + noise, np.full((A, particles), 1.0 / particles))


def root_of(P: Array) -> Array:
    """A matrix (..., n, n) whose product with its transpose is ``P``; also where ``P`` has no full rank."""
    values, vectors = np.linalg.eigh(P)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


#: F's share of the particles at which SIS resamples, beside (4.14).
FLODELL_THRESHOLD = 2 / 3


def resample(
    cloud: Cloud,
    rng: np.random.Generator,
    threshold: float = FLODELL_THRESHOLD,
) -> tuple[Cloud, NDArray[np.bool_]]:
    """Draw the particles anew of those animals whose effective size has fallen to the threshold.

    Parameters
    ----------
    cloud
        Of A animals.
    rng
        Random numbers.
    threshold
        Share of the number of particles. 1 resamples always, which is SIR; less is SIS, with F's 2/3.

    Returns
    -------
    cloud, resampled
        Where it was resampled, (A,) bool, weights are equal.
    """
    N = cloud.w.shape[1]
    due = effective_size(cloud.w) <= threshold * N * (1 + 1e-9)  # sums are rounded
    if not due.any():
        return cloud, due
    chosen = draw(cloud.w[due], rng)
    x, w = cloud.x.copy(), cloud.w.copy()
    x[due] = np.take_along_axis(cloud.x[due], chosen[..., None], axis=1)
    w[due] = 1 / N
    return Cloud(x, w), due


def draw(w: ArrayLike, rng: np.random.Generator) -> NDArray[np.int64]:
    """Which particles to take, as many as there were: at points at equal distances (systematic resampling).

    Of a particle these are N times its weight in the mean, and never off that by a whole copy. F draws with
    replacement, which leaves more to chance.

    Parameters
    ----------
    w
        (A, N) weights that sum to one.
    rng
        Random numbers.

    Returns
    -------
    (A, N) indices along the last axis, ascending; never one of a particle without weight.

    Examples
    --------
    >>> print(draw([[0.0, 0.5, 0.0, 0.5]], np.random.default_rng(1)))
    [[1 1 3 3]]
    """
    weights = np.atleast_2d(np.asarray(w, float))
    A, N = weights.shape
    points = (np.arange(N) + rng.random((A, 1))) / N
    cumulative = np.cumsum(weights, axis=1)
    cumulative /= cumulative[:, -1:]
    points = np.minimum(points, np.nextafter(1.0, 0.0))
    return np.stack([np.searchsorted(*one, "right") for one in zip(cumulative, points, strict=True)])


#: Places (..., 2) m -> probability that an image has a detection of an animal that is there.
Sight = Callable[[Array], Array]


def log_likelihood(positions: ArrayLike, z: ArrayLike, R: ArrayLike) -> Array:
    """Of all measurements that a track was given, F (4.11): each one's, multiplied.

    Several measurements of one animal in one image count as independent looks at it. Where they are pieces of
    one outline, or of animals side by side, the estimate is surer of itself than it should be.

    Parameters
    ----------
    positions
        (..., 2) m of the particles.
    z
        (M, m), or (m,) for one: on the ground, m.
    R
        Their covariances, (M, m, m) or (m, m) for all.

    Returns
    -------
    (...) with the constant of the normal distribution; 0 for no measurement.

    Raises
    ------
    WildlabError
        Where an ``R`` is no covariance or has no inverse.

    Examples
    --------
    >>> print(np.round(log_likelihood([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0]], np.eye(2)), 3))
    [-1.838 -3.838]
    """
    x, found = np.asarray(positions, float), np.atleast_2d(np.asarray(z, float))
    total = np.zeros(x.shape[:-1])
    if not found.size:
        return total
    m = found.shape[-1]
    covariances = np.broadcast_to(np.asarray(R, float), (len(found), m, m))
    check_covariance(covariances, "R")
    try:
        roots = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError as error:
        raise WildlabError(
            "the covariance of a measurement has no inverse", "give noise in every direction", field="R"
        ) from error
    for one, root in zip(found, roots, strict=True):
        white = (one - x) @ np.linalg.inv(root).T
        constant = m / 2 * np.log(2 * np.pi) + np.log(np.diagonal(root)).sum()
        total -= 0.5 * np.einsum("...i,...i->...", white, white) + constant
    return total


def walk_of(sd_velocity: float, step: float) -> Motion:
    """F (4.5) with the step that its noise depends on: as spread out after any number of steps.

    Parameters
    ----------
    sd_velocity
        Of the velocity drawn for each step, m/s, the same north and east.
    step
        How long an animal keeps to it, s; not the time between two images.

    Returns
    -------
    Motion
        `wildlab.tracking.motion.random_walk` with the density sd sqrt(step).

    Examples
    --------
    >>> F, Q = walk_of(0.5, 1.0)(1800.0)  # half an hour at half a metre a second
    >>> print(round(float(np.sqrt(Q[0, 0])), 1))
    21.2
    """
    return partial(random_walk, density=sd_velocity * float(np.sqrt(step)))


def move(cloud: Cloud, motion: Motion, dt: float, rng: np.random.Generator) -> Cloud:
    """Time update by a motion model, F (4.16); weights stay as they are, F (4.18).

    Parameters
    ----------
    cloud
        With the states of the model.
    motion
        As the other filters take it: a step in seconds -> F, Q.
    dt
        s.
    rng
        Random numbers.

    Returns
    -------
    Cloud
    """
    F, Q = motion(dt)
    noise = rng.standard_normal(cloud.x.shape) @ root_of(Q).T
    return Cloud(cloud.x @ F.T + noise, cloud.w)


def stay_inside(before: Cloud, after: Cloud, inside: Inside) -> Cloud:
    """The enclosure as prior while animals move: a particle whose step leads out stays where it was.

    In the long run a walk is then anywhere in the enclosure with equal chance. A velocity that led out is
    given up as well.

    Parameters
    ----------
    before, after
        Clouds at two times, the same particles.
    inside
        The enclosure: (..., 2) m -> (...) bool.

    Returns
    -------
    Cloud
        With the weights of ``after``.
    """
    kept = np.asarray(inside(after.x[..., :2]), bool)
    stayed = before.x.copy()
    stayed[..., 2:] = 0.0
    return Cloud(np.where(kept[..., None], after.x, stayed), after.w)


def mahalanobis_squared(mean: ArrayLike, covariance: ArrayLike, z: ArrayLike, R: ArrayLike) -> Array:
    """Squares of D_M, F (4.19), between A animals and M detections.

    D_M is a root, and F (4.20) compares it with a quantile of the chi-square distribution, which is that of
    its square. It is the square that is compared here. By the letter of (4.20) a gate of 99 % is one of 9.21
    standard deviations, which shuts out next to nothing.

    Parameters
    ----------
    mean, covariance
        (A, n) and (A, n, n); north and east, m, are the first two.
    z
        (M, 2) m.
    R
        (M, 2, 2), or (2, 2) for all, m^2.

    Returns
    -------
    (A, M)
    """
    x, P = np.asarray(mean, float)[:, None, :2], np.asarray(covariance, float)[:, None, :2, :2]
    found = np.asarray(z, float).reshape(-1, 2)
    S = P + np.broadcast_to(np.asarray(R, float), (len(found), 2, 2))
    return innovation_squared(found - x, S)


def nearest_animal(squared: ArrayLike, gate_probability: float) -> NDArray[np.int64]:
    """F's modified nearest neighbour, F 4.3.1: each *detection* takes its closest track within the gate.

    A track may be taken by several detections, whose likelihoods (4.11) multiplies, and a group of animals
    gets fewer tracks than it has animals: how many tracks there are is no count of animals.

    Parameters
    ----------
    squared
        (A, M) as `mahalanobis_squared` has it.
    gate_probability
        Probability that an animal's own detection is let in, in (0, 1]; 1 is no gate.

    Returns
    -------
    (M,) index of the track, -1 where none lies within the gate.

    Raises
    ------
    WildlabError
        For a probability outside (0, 1].

    Examples
    --------
    >>> print(nearest_animal([[1.0, 4.0, 30.0], [2.0, 90.0, 20.0]], 0.99))
    [ 0  0 -1]
    """
    d = np.asarray(squared, float)
    if not len(d):
        return np.full(d.shape[1], -1)
    d = np.where(np.isnan(d), np.inf, d)
    limit = min(gate_threshold(gate_probability, 2), float(np.finfo(float).max))
    return np.asarray(np.where(d.min(axis=0) <= limit, d.argmin(axis=0), -1))
