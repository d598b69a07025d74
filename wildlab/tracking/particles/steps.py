"""Many animals, image after image: tracks that start, are lost and are found again, F 4.3 and 5.3.

Each detection takes its closest track, whose particles it weighs by (4.11); what lies in no gate starts a
track. A step is one image, so that whoever plans the flight can look at the tracks in between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array
from wildlab.tracking.association import global_nearest, innovation_squared
from wildlab.tracking.kalman import update
from wildlab.tracking.particles.clouds import (
    FLODELL_THRESHOLD,
    Cloud,
    Sight,
    effective_size,
    log_likelihood,
    moments,
    resample,
    start_gaussian,
    weigh,
    weigh_unseen,
)


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


#: Clouds, which animals the last image showed (A,), seconds, random numbers -> clouds.
Moves = Callable[[Cloud, NDArray[np.bool_], float, np.random.Generator], Cloud]


class ImageLook(NamedTuple):
    """One image.

    Attributes
    ----------
    time
        s.
    z
        (M, 2) detections on the ground, north and east, m; NaN where a ray met none.
    R
        (M, 2, 2) their covariances, m^2.
    sight
        Probability of a detection of an animal at a place: footprint, line of sight and detector.
    """

    time: float
    z: Array
    R: Array
    sight: Sight


class Rules(NamedTuple):
    """What is the same for all images.

    Attributes
    ----------
    moves
        How animals move.
    particles
        Of each animal; F has 500.
    gate_probability
        That an animal's own detection is let in.
    negative
        Whether images without a detection count, F 4.2.2.
    start_sd
        Standard deviations of what a detection does not tell, such as (0.5, 0.5) m/s for two velocities.
    lost_trace
        A track whose covariance has a greater trace is lost, F 5.3, m^2.
    lost_doubt
        A track is lost once images that had to show it would all have missed it with less than this
        probability, F 5.3.4.
    threshold
        As `resample` takes it.
    """

    moves: Moves
    particles: int = 500
    gate_probability: float = 0.99
    negative: bool = True
    start_sd: tuple[float, ...] = ()
    lost_trace: float = np.inf
    lost_doubt: float = 0.0
    threshold: float = FLODELL_THRESHOLD


class Herd(NamedTuple):
    """What is known after an image; A tracks.

    Attributes
    ----------
    time
        s; NaN before the first image.
    cloud
        States (A, N, n), weights (A, N).
    identity
        (A,) numbers from 1, never given twice.
    seen_at
        (A,) s, when each was last detected.
    missed
        (A,) probability that all images since then would have missed it.
    lost
        (A,) bool. A lost one is kept, moves on, and may be found again.
    born
        How many identities were given.
    """

    time: float
    cloud: Cloud
    identity: NDArray[np.int64]
    seen_at: Array
    missed: Array
    lost: NDArray[np.bool_]
    born: int


def no_herd(rules: Rules) -> Herd:
    """Before the first image, where nothing is known.

    Parameters
    ----------
    rules
        Of the flight.

    Returns
    -------
    Herd
        Without a track.
    """
    n = 2 + len(rules.start_sd)
    nothing = np.zeros(0)
    return Herd(
        np.nan, Cloud(np.zeros((0, rules.particles, n)), np.zeros((0, rules.particles))),
        np.zeros(0, np.int64), nothing, nothing, np.zeros(0, bool), 0,
    )  # fmt: skip


def moved(herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator) -> Herd:
    """All tracks at the time of an image."""
    dt = 0.0 if np.isnan(herd.time) else look.time - herd.time
    if not dt >= 0:
        raise WildlabError(
            f"an image at {look.time} s after one at {herd.time} s", "sort the images by time", field="time"
        )
    if dt == 0:
        return herd._replace(time=look.time)
    cloud = herd.cloud
    if len(herd.identity):
        cloud = rules.moves(cloud, herd.seen_at == herd.time, dt, rng)
    return herd._replace(time=look.time, cloud=cloud)


def start_tracks(z: Array, R: Array, rules: Rules, rng: np.random.Generator) -> Cloud:
    """Clouds (M, N, n) about detections (M, 2) with covariances (M, 2, 2)."""
    n, M = 2 + len(rules.start_sd), len(z)
    mean, covariance = np.zeros((M, n)), np.zeros((M, n, n))
    mean[:, :2], covariance[:, :2, :2] = z, R
    covariance[:, range(2, n), range(2, n)] = np.square(rules.start_sd)
    return start_gaussian(mean, covariance, rules.particles, rng)


def with_new(herd: Herd, cloud: Cloud, time: float) -> Herd:
    """The same with new tracks (M, N, n) behind, at the time of the image."""
    count = len(cloud.w)
    if not count:
        return herd
    return herd._replace(
        cloud=Cloud(np.concatenate([herd.cloud.x, cloud.x]), np.concatenate([herd.cloud.w, cloud.w])),
        identity=np.append(herd.identity, herd.born + 1 + np.arange(count)),
        seen_at=np.append(herd.seen_at, np.full(count, time)),
        missed=np.append(herd.missed, np.ones(count)),
        lost=np.append(herd.lost, np.zeros(count, bool)),
        born=herd.born + count,
    )


Integers = NDArray[np.int64]

#: A detection that leaves a cloud with fewer particles' worth of weight than this says more than they can.
LEAST_EFFECTIVE = 10.0


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
    z, R = np.asarray(look.z, float).reshape(-1, 2), np.asarray(look.R, float).reshape(-1, 2, 2)
    usable = np.isfinite(z).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    look = look._replace(z=z[usable], R=R[usable])
    herd = moved(herd, look, rules, rng)
    taken, seen, found = _associated(herd, look, rules, rng)
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
    if len(new):
        herd = with_new(herd, start_tracks(look.z[new], look.R[new], rules, rng), look.time)
    herd = _lost(herd, rules)
    if len(herd.identity):
        herd = herd._replace(cloud=resample(herd.cloud, rng, rules.threshold)[0])
    aligned = np.zeros(len(z), np.int64)
    aligned[usable] = names
    return herd, aligned


def _associated(
    herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator
) -> tuple[Integers, NDArray[np.bool_], Cloud]:
    """The track (M,) of each detection, -1 for none; which tracks (A,) took any; their clouds after it."""
    taken, seen = np.zeros(0, np.int64), np.zeros(len(herd.identity), bool)
    if not len(look.z):
        # Of no use where clouds without a detection are weighed by that.
        return taken, seen, herd.cloud if rules.negative else weigh(herd.cloud, 0.0).cloud
    mean, covariance = moments(herd.cloud)
    squared = mahalanobis_squared(mean, covariance, look.z, look.R)
    taken = nearest_animal(np.where(herd.lost[:, None], np.inf, squared), rules.gate_probability)
    # Then those that were lost, one detection each: a lap later no two are likely to be one animal's.
    limit = min(gate_threshold(rules.gate_probability, 2), 1e6)
    free = taken < 0
    again = global_nearest(np.where(herd.lost[:, None] & free, squared, np.inf).T, limit)
    taken = np.where(free, again.track, taken)
    given = np.zeros(herd.cloud.w.shape)
    for j in np.flatnonzero(taken >= 0):
        a = taken[j]
        given[a] += log_likelihood(herd.cloud.x[a, :, :2], look.z[j], look.R[j])
        seen[a] = True
    found = weigh(herd.cloud, given).cloud
    return taken, seen, _revived(found, seen, mean, covariance, taken, look, rng)


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


def _lost(herd: Herd, rules: Rules) -> Herd:
    """Both rules by which an animal that was known is lost, F 5.3 and 5.3.4."""
    _, covariance = moments(herd.cloud)
    trace = np.trace(covariance[:, :2, :2], axis1=1, axis2=2)
    return herd._replace(lost=herd.lost | (trace > rules.lost_trace) | (herd.missed < rules.lost_doubt))
