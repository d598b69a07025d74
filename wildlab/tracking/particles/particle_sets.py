"""Many animals, image after image: what is kept of them, and what is the same for all images."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.particles.clouds import Cloud, Inside, even, start_gaussian, start_inside
from wildlab.tracking.particles.likelihoods import Sight
from wildlab.tracking.particles.resampling import FLODELL_THRESHOLD

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
    clutter
        Expected false detections, 1/m^2; for counting alone.
    """

    time: float
    z: Array
    R: Array
    sight: Sight
    clutter: float = 0.0


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
    scheme, threshold
        As `resample` takes them.
    """

    moves: Moves
    particles: int = 500
    gate_probability: float = 0.99
    negative: bool = True
    start_sd: tuple[float, ...] = ()
    lost_trace: float = np.inf
    lost_doubt: float = 0.0
    scheme: str = "multinomial"
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
    existence
        (A,) probability that it is an animal; 1 by F's rule, which does not ask.
    unseen
        Where animals may be that were never detected, (1, U, n); none by F's rule.
    expected_unseen
        How many of those.
    born
        How many identities were given.
    """

    time: float
    cloud: Cloud
    identity: NDArray[np.int64]
    seen_at: Array
    missed: Array
    lost: NDArray[np.bool_]
    existence: Array
    unseen: Cloud
    expected_unseen: float
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
        np.zeros(0, np.int64), nothing, nothing, np.zeros(0, bool), nothing,
        Cloud(np.zeros((1, 0, n)), np.zeros((1, 0))), 0.0, 0,
    )  # fmt: skip


def expect(
    rules: Rules,
    animals: float,
    inside: Inside,
    low: Array,
    high: Array,
    rng: np.random.Generator,
    particles: int = 4000,
) -> Herd:
    """Before the first image, where about so many animals are expected in an enclosure.

    Parameters
    ----------
    rules
        Of the flight.
    animals
        Expected number; how many there are is taken as Poisson about it.
    inside, low, high
        The enclosure, and a rectangle that holds it, as `start_inside` takes them.
    rng
        Random numbers.
    particles
        For where animals may be that were not seen yet.

    Returns
    -------
    Herd
        Without a track, with animals to be found.

    Raises
    ------
    WildlabError
        As `start_inside`, or where the number is below zero.
    """
    if not 0 <= animals < np.inf:
        raise WildlabError(f"{animals} animals expected", "give zero or more", field="animals")
    x = start_inside(inside, low, high, 1, particles, rng).x
    rest = rng.standard_normal((1, particles, len(rules.start_sd))) * np.asarray(rules.start_sd)
    cloud = Cloud(np.concatenate([x, rest], axis=-1), even(1, particles))
    return no_herd(rules)._replace(unseen=cloud, expected_unseen=float(animals))


def moved(herd: Herd, look: ImageLook, rules: Rules, rng: np.random.Generator) -> Herd:
    """All tracks, and those never seen, at the time of an image."""
    dt = 0.0 if np.isnan(herd.time) else look.time - herd.time
    if not dt >= 0:
        raise WildlabError(
            f"an image at {look.time} s after one at {herd.time} s", "sort the images by time", field="time"
        )
    if dt == 0:
        return herd._replace(time=look.time)
    cloud, unseen = herd.cloud, herd.unseen
    if len(herd.identity):
        cloud = rules.moves(cloud, herd.seen_at == herd.time, dt, rng)
    if unseen.x.size:
        unseen = rules.moves(unseen, np.zeros(1, bool), dt, rng)
    return herd._replace(time=look.time, cloud=cloud, unseen=unseen)


def start_tracks(z: Array, R: Array, rules: Rules, rng: np.random.Generator) -> Cloud:
    """Clouds (M, N, n) about detections (M, 2) with covariances (M, 2, 2)."""
    n, M = 2 + len(rules.start_sd), len(z)
    mean, covariance = np.zeros((M, n)), np.zeros((M, n, n))
    mean[:, :2], covariance[:, :2, :2] = z, R
    covariance[:, range(2, n), range(2, n)] = np.square(rules.start_sd)
    return start_gaussian(mean, covariance, rules.particles, rng)


def with_new(herd: Herd, cloud: Cloud, existence: Array, time: float) -> Herd:
    """The same with new tracks behind, their probabilities (M,) and the time of the image."""
    count = len(existence)
    if not count:
        return herd
    return herd._replace(
        cloud=Cloud(np.concatenate([herd.cloud.x, cloud.x]), np.concatenate([herd.cloud.w, cloud.w])),
        identity=np.append(herd.identity, herd.born + 1 + np.arange(count)),
        seen_at=np.append(herd.seen_at, np.full(count, time)),
        missed=np.append(herd.missed, np.ones(count)),
        lost=np.append(herd.lost, np.zeros(count, bool)),
        existence=np.append(herd.existence, existence),
        born=herd.born + count,
    )


def kept(herd: Herd, which: NDArray[np.bool_]) -> Herd:
    """Those tracks alone, (A,) bool."""
    return herd._replace(
        cloud=Cloud(herd.cloud.x[which], herd.cloud.w[which]), identity=herd.identity[which],
        seen_at=herd.seen_at[which], missed=herd.missed[which], lost=herd.lost[which],
        existence=herd.existence[which],
    )  # fmt: skip
