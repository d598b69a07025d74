"""Tracks of animals through the images of a way, and what came of them.

Between two images that can tell a track anything there may be hundreds that cannot: they look elsewhere and
detect nothing. These are left out, which changes nothing of the tracks but how finely their walk is cut.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.animals.images import Detector, Images, footprint_circles, sight_from
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.tracking.kalman import update
from wildlab.tracking.motion import Motion
from wildlab.tracking.particles import ImageLook, Rules, mahalanobis_squared, moments, nearest_animal, no_herd
from wildlab.tracking.particles.clouds import Cloud, Inside, move, stay_inside
from wildlab.tracking.particles.steps import step_nearest

#: A walk within a fence is cut into steps no longer than this, s; and tracks are looked at as often.
STATION_S = 20.0
#: How far a walk is taken to lead an animal out of its cloud, in standard deviations.
STRAYS = 4.0


class Known(NamedTuple):
    """What is known of all tracks at a time.

    Attributes
    ----------
    image
        Number of the image.
    identity
        (K,) numbers of the tracks.
    mean, covariance
        (K, 2) m and (K, 2, 2) m^2.
    """

    image: int
    identity: NDArray[np.int64]
    mean: Array
    covariance: Array


class Found(NamedTuple):
    """One detection that was given to a track.

    Attributes
    ----------
    image, animal
        Where, and whose it is; -1 where it is of no animal.
    track
        That it was given to, or that it started.
    started
        Whether it started it.
    before, after
        Trace of that track's covariance before the image and after it, m^2; NaN before its start.
    after_last
        The same after its detection before, m^2.
    own_before
        Trace, before the image, of the track that had this animal's detection before, m^2; NaN for none.
    own
        Number of that track, 0 for none.
    away
        How long the animal had not been detected, s; infinite for the first time, and for none.
    """

    image: int
    animal: int
    track: int
    started: bool
    before: float
    after: float
    after_last: float
    own_before: float
    own: int
    away: float


class FollowedAnimals(NamedTuple):
    """A way with its tracks.

    Attributes
    ----------
    known
        At every station.
    found
        Every detection.
    steps
        How many images were looked at.
    tracks
        How many tracks were started.
    """

    known: list[Known]
    found: list[Found]
    steps: int
    tracks: int


class Follower(Protocol):
    """Tracks that go on image by image."""

    def step(self, look: ImageLook) -> NDArray[np.int64]:
        """One image; (M,) the track that each detection was given."""

    def known(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Numbers (K,), means (K, 2) m and covariances (K, 2, 2) m^2."""

    def reach(self) -> Array:
        """(K,) how far off its mean an animal may be for an image without detections to tell, m."""


class Particles:
    """Tracks by F's particle filter, each kept inside the fence that it began in."""

    def __init__(
        self, motion: Motion, fences: list[Inside], rng: np.random.Generator, rules: Callable[..., Rules]
    ) -> None:
        self._motion, self._fences, self._rng = motion, fences, rng
        self._home = np.zeros(0, np.intp)
        self.rules = rules(self._moves)
        self.herd = no_herd(self.rules)
        self._moments = moments(self.herd.cloud)

    def _moves(self, cloud: Cloud, seen: NDArray[np.bool_], dt: float, rng: np.random.Generator) -> Cloud:
        steps = max(int(np.ceil(dt / STATION_S - 1e-9)), 1)
        for _ in range(steps):
            cloud = stay_inside(cloud, move(cloud, self._motion, dt / steps, rng), self._inside)
        return cloud

    def _inside(self, places: Array) -> NDArray[np.bool_]:
        """(K, N) whether places (K, N, 2) are inside the fence that each track began in."""
        inside = np.ones(places.shape[:-1], bool)
        for number, fence in enumerate(self._fences):
            mine = self._home == number
            if mine.any():
                inside[mine] = fence(places[mine])
        return inside

    def step(self, look: ImageLook) -> NDArray[np.int64]:
        """As `Follower` has it."""
        self.herd, names = step_nearest(self.herd, look, self.rules, self._rng)
        self._moments = moments(self.herd.cloud)
        new = self.herd.cloud.x[len(self._home) :, :, :2]
        # Where most of a new cloud lies; outside all fences none keeps it.
        shares = np.array([fence(new).mean(axis=1) for fence in self._fences]).reshape(len(self._fences), -1)
        if len(new):
            home = np.where(shares.max(axis=0) > 0, shares.argmax(axis=0), -1)
            self._home = np.append(self._home, home.astype(np.intp))
        return names

    @property
    def home(self) -> NDArray[np.intp]:
        """(K,) which fence each track began in, -1 for none."""
        return self._home

    def seen_now(self, track: int) -> bool:
        """Whether the latest image had a detection of a track, by its number."""
        mine = self.herd.identity == track
        return bool((self.herd.seen_at[mine] == self.herd.time).any())

    def give_up(self, track: int) -> None:
        """Take a track, by its number, for lost: it was looked for and not found (F 5.3.4)."""
        lost = self.herd.lost | (self.herd.identity == track)
        self.herd = self.herd._replace(lost=lost)

    def known(self) -> tuple[NDArray[np.int64], Array, Array]:
        """As `Follower` has it."""
        mean, covariance = self._moments
        return self.herd.identity, mean[:, :2], covariance[:, :2, :2]

    def reach(self) -> Array:
        """As `Follower` has it."""
        if not self.rules.negative or not len(self.herd.identity):
            return np.full(len(self.herd.identity), -np.inf)
        off = self.herd.cloud.x[..., :2] - self._moments[0][:, None, :2]
        return np.asarray(np.sqrt((off**2).sum(axis=-1).max(axis=1)))


class Kalman:
    """The same rule of association with a Kalman filter for each track, which no image without detections and
    no fence can tell anything: the ellipse that F 8.3 holds the particle filter against."""

    def __init__(self, motion: Motion, gate_probability: float) -> None:
        self._motion, self._gate = motion, gate_probability
        self._time = np.nan
        self._mean, self._P = np.zeros((0, 2)), np.zeros((0, 2, 2))

    def step(self, look: ImageLook) -> NDArray[np.int64]:
        """As `Follower` has it."""
        if len(self._mean):
            F, Q = self._motion(look.time - self._time)
            self._mean, self._P = self._mean @ F.T, F @ self._P @ F.T + Q
        self._time = look.time
        usable = np.isfinite(look.z).all(axis=1) & np.isfinite(look.R).all(axis=(1, 2))
        z, R = look.z[usable], look.R[usable]
        names = np.zeros(len(look.z), np.int64)
        if not len(z):
            return names
        taken = nearest_animal(mahalanobis_squared(self._mean, self._P, z, R), self._gate)
        for j in np.flatnonzero(taken >= 0):
            a = taken[j]
            after = update(self._mean[a], self._P[a], z[j], np.eye(2), R[j])
            self._mean[a], self._P[a] = after.x, after.P
        new = np.flatnonzero(taken < 0)
        taken[new] = len(self._mean) + np.arange(len(new))
        self._mean, self._P = np.concatenate([self._mean, z[new]]), np.concatenate([self._P, R[new]])
        names[usable] = taken + 1
        return names

    def known(self) -> tuple[NDArray[np.int64], Array, Array]:
        """As `Follower` has it."""
        return np.arange(len(self._mean)) + 1, self._mean.copy(), self._P.copy()

    def reach(self) -> Array:
        """As `Follower` has it."""
        return np.full(len(self._mean), -np.inf)


class Ledger:
    """Which detections went where: what `FollowedAnimals` is made of, kept while the tracks go on."""

    def __init__(self, animals: int) -> None:
        self.found: list[Found] = []
        self._seen_at = np.full(animals, -np.inf)
        self._own = np.zeros(animals, np.int64)
        self._after_last: dict[int, float] = {}

    def enter(
        self,
        image: int,
        time: float,
        animals: NDArray[np.intp],
        names: NDArray[np.int64],
        before: dict[int, float],
        after: dict[int, float],
    ) -> None:
        """The detections of one image; traces of all tracks before and after it, by their number."""
        own = np.append(self._own, 0)  # the last row is that of no animal
        for animal, name in zip(animals.tolist(), names.tolist(), strict=True):
            if not name:
                continue
            away = time - float(self._seen_at[animal]) if animal >= 0 else np.inf
            self.found.append(
                Found(
                    image, animal, name, name not in before, before.get(name, np.nan), after[name],
                    self._after_last.get(name, np.nan), before.get(int(own[animal]), np.nan),
                    int(own[animal]), away,
                )
            )  # fmt: skip
            if animal >= 0:
                self._own[animal], self._seen_at[animal] = name, time
        for name in set(names.tolist()) - {0}:
            self._after_last[name] = after[name]


def traces_of(follower: Follower) -> dict[int, float]:
    """Trace of each track's covariance, m^2, by its number."""
    identity, _, covariance = follower.known()
    return dict(zip(identity.tolist(), np.trace(covariance, axis1=1, axis2=2).tolist(), strict=True))


def follow(
    images: Images, terrain: Terrain, detector: Detector, follower: Follower, motion: Motion
) -> FollowedAnimals:
    """Take a follower through all images that can tell its tracks anything.

    Parameters
    ----------
    images
        Of one way.
    terrain
        The ground.
    detector
        What the tracks take the camera for.
    follower
        With its tracks; they are carried on.
    motion
        How fast an animal can leave its cloud.

    Returns
    -------
    Followed
    """
    times = images.times
    T = len(times)
    middle, radius = footprint_circles(terrain, images.poses)
    station = np.unique(np.searchsorted(times, np.arange(times[0], times[-1] + STATION_S, STATION_S)))
    stations = np.zeros(T, bool)
    stations[np.minimum(station, T - 1)] = True
    stations[-1] = True
    detected = np.zeros(T, bool)
    detected[images.image] = True
    ledger, known = Ledger(images.truth.shape[1]), list[Known]()
    steps, k, tells = 0, 0, True

    def look(k: int) -> ImageLook:
        z, R, _ = images.taken(k)
        p, circle = images.poses, (middle[k], float(radius[k]))
        sight = sight_from(terrain, p.camera, p.p_nc[k], p.R_nc[k], circle, detector)
        return ImageLook(float(times[k]), z, R, sight)

    while k < T:
        steps += 1
        time = float(times[k])
        if detected[k]:
            # First on to the image alone: a trace before it is one at its time.
            follower.step(blind(time))
            before = traces_of(follower)
            names = follower.step(look(k))
            ledger.enter(k, time, images.taken(k)[2], names, before, traces_of(follower))
        else:
            follower.step(look(k) if tells else blind(time))
        if stations[k]:
            known.append(Known(k, *follower.known()))
        k, tells = next_look(follower, k, times, middle, radius, detected | stations, motion)
    tracks = max((one.track for one in ledger.found), default=0)
    return FollowedAnimals(known, ledger.found, steps, tracks)


def blind(time: float) -> ImageLook:
    """An image that shows nothing of the ground."""
    return ImageLook(time, np.zeros((0, 2)), np.zeros((0, 2, 2)), lambda places: np.zeros(places.shape[:-1]))


def next_look(
    follower: Follower, k: int, times: Array, middle: Array, radius: Array, wanted: NDArray[np.bool_],
    motion: Motion,
) -> tuple[int, bool]:  # fmt: skip
    """The next image to be looked at, and whether what it does not show can tell a track anything."""
    ahead = np.flatnonzero(wanted[k + 1 :])
    last = k + 1 + int(ahead[0]) if len(ahead) else len(times)
    rows = np.arange(k + 1, min(last + 1, len(times)))
    _, mean, _ = follower.known()
    reach = follower.reach()
    able = np.isfinite(reach)
    if len(rows) and able.any():
        spread = float(np.sqrt(motion(float(times[rows[-1]] - times[k]))[1][0, 0]))
        away = np.linalg.norm(middle[rows, None] - mean[None, able], axis=-1)
        near = (away < radius[rows, None] + reach[able] + STRAYS * spread).any(axis=1)
        if near.any():
            return int(rows[near.argmax()]), True
    return last, False
