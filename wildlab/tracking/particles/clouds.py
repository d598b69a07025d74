"""Clouds of particles: what they say together, and how a measurement weighs them; F 4.2.2-4.2.4."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.validation import check_covariance
from wildlab.tracking.particles.kernels import weighted_moments

#: Places (..., 2) m -> whether each lies in an enclosure.
Inside = Callable[[Array], NDArray[np.bool_]]
#: Rounds of drawing places before an area counts as one that has no room.
ROUNDS = 1000


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

    Raises
    ------
    WildlabError
        Where a likelihood is NaN or infinite.

    Examples
    --------
    >>> cloud = Cloud(np.array([[[0.0, 0.0], [9.0, 0.0]]]), np.array([[0.5, 0.5]]))
    >>> after, log_evidence = weigh(cloud, np.log([[0.9, 0.3]]))
    >>> print(after.w, np.round(np.exp(log_evidence), 3))
    [[0.75 0.25]] [0.6]
    """
    given = np.broadcast_to(np.asarray(log_likelihood, float), cloud.w.shape)
    if np.isnan(given).any() or (given == np.inf).any():
        raise WildlabError(
            "a likelihood is not a number",
            "give minus infinity where a particle cannot have made the measurement",
            field="log_likelihood",
        )
    # The largest one of those that have any weight is taken out, so that no sum comes out as zero.
    top = np.where(cloud.w > 0, given, -np.inf).max(axis=1, keepdims=True)
    possible = np.isfinite(top[:, 0])
    top = np.where(possible[:, None], top, 0.0)
    raw = np.where(cloud.w > 0, cloud.w * np.exp(np.minimum(given - top, 0.0)), 0.0)
    total = raw.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.where(possible[:, None], raw / total[:, None], cloud.w)
        log_evidence = np.where(possible, np.log(total) + top[:, 0], -np.inf)
    return Weighed(Cloud(cloud.x, w), log_evidence)


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

    Raises
    ------
    WildlabError
        Where a probability is not from 0 to 1.
    """
    p = np.asarray(detection, float)
    if not ((p >= 0) & (p <= 1)).all():
        raise WildlabError(
            "a probability of detection is not from 0 to 1",
            "give 0 where the camera does not look or cannot see, and no NaN",
            field="detection",
        )
    with np.errstate(divide="ignore"):
        return weigh(cloud, np.log1p(-p))


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
    x, w = (np.ascontiguousarray(one, float) for one in cloud)
    return weighted_moments(x, w)


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
        Where there is no particle, or a covariance is none.
    """
    middle = np.atleast_2d(np.asarray(mean, float))
    A, n = middle.shape
    P = np.broadcast_to(np.asarray(covariance, float), (A, n, n))
    check_covariance(P, "covariance")
    noise = rng.standard_normal((A, _some(particles), n)) @ np.swapaxes(root_of(P), -1, -2)
    return Cloud(middle[:, None] + noise, even(A, particles))


def start_inside(
    inside: Inside, low: ArrayLike, high: ArrayLike, animals: int, particles: int, rng: np.random.Generator
) -> Cloud:
    """Clouds that know nothing but the enclosure: anywhere in it with equal chance.

    Parameters
    ----------
    inside
        The enclosure: (..., 2) m -> (...) bool.
    low, high
        (2,) m: a rectangle that holds it.
    animals, particles
        How many, and of how many particles each.
    rng
        Random numbers.

    Returns
    -------
    Cloud
        With states (A, N, 2).

    Raises
    ------
    WildlabError
        Where there is no particle, or no place in the enclosure was found.
    """
    wanted = animals * _some(particles)
    corner, far = np.asarray(low, float), np.asarray(high, float)
    found, have = list[Array](), 0
    for _ in range(ROUNDS):
        tried = rng.uniform(corner, far, (max(wanted, 64), 2))
        found.append(tried[np.asarray(inside(tried), bool)])
        have += len(found[-1])
        if have >= wanted:
            break
    else:
        raise WildlabError(
            f"of {ROUNDS * max(wanted, 64)} places in the rectangle {have} lie in the enclosure",
            "give the enclosure and the rectangle about it in the same metres north and east",
            field="inside",
        )
    return Cloud(np.concatenate(found)[:wanted].reshape(animals, particles, 2), even(animals, particles))


def even(animals: int, particles: int) -> Array:
    """Equal weights (A, N)."""
    return np.full((animals, particles), 1.0 / particles)


def root_of(P: Array) -> Array:
    """A matrix (..., n, n) whose product with its transpose is ``P``; also where ``P`` has no full rank."""
    values, vectors = np.linalg.eigh(P)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def _some(particles: int) -> int:
    if particles < 1:
        raise WildlabError(f"{particles} particles", "give at least one for each animal", field="particles")
    return particles
