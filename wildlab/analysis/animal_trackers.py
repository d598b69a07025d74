"""Tracks of animals through the images of a way, the loop closed where tracks say where to fly, and what came
of it.

Between two images that can tell a track anything there may be hundreds that cannot: they look elsewhere and
detect nothing. These are left out, which changes nothing of the tracks but how finely their walk is cut.

F 5.3: rows are flown to find new animals, and broken off where one that is known is worth a visit by (5.2)
and (5.3); it is then found again, or lost by the images that should have shown it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.animal_images import (
    Detector,
    Images,
    Sight,
    footprint_circles,
    sight_from,
    take_images,
)
from wildlab.analysis.plan_coverage import ExecutionErrors, displaced, drawn_errors
from wildlab.geometry.camera import Camera
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.georeference import Terrain
from wildlab.planning.gimbal import GimbalAngles, camera_on_course
from wildlab.planning.planner import SEARCH, best_goal
from wildlab.tracking.association import global_nearest
from wildlab.tracking.kalman import update
from wildlab.tracking.motion import Motion
from wildlab.tracking.particles import (
    Cloud,
    Inside,
    effective_size,
    log_likelihood,
    mahalanobis_squared,
    moments,
    move,
    nearest_animal,
    resample,
    start_gaussian,
    stay_inside,
    weigh,
    weigh_unseen,
)

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
    before: float
    after: float
    after_last: float
    own_before: float
    own: int
    away: float


class TrackedAnimals(NamedTuple):
    """A way with its tracks.

    Attributes
    ----------
    known
        At every station.
    found
        Every detection.
    steps
        How many images were looked at.
    """

    known: list[Known]
    found: list[Found]
    steps: int


class ImageScan(NamedTuple):
    """One image.

    Attributes
    ----------
    time
        s.
    z, R
        (M, 2) detections on the ground, north and east, m, NaN where a ray met none; and (M, 2, 2) m^2.
    sight
        Footprint, line of sight and detector.
    """

    time: float
    z: Array
    R: Array
    sight: Sight

    @property
    def usable(self) -> Mask:
        """(M,) detections that have a place."""
        return np.asarray(np.isfinite(self.z).all(axis=1) & np.isfinite(self.R).all(axis=(1, 2)))


class Tracker(Protocol):
    """Tracks that go on image by image."""

    def step(self, scan: ImageScan) -> NDArray[np.int64]:
        """One image, no earlier than the last; (M,) the track of each detection, 0 where that is NaN."""

    def known(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Numbers (K,), means (K, 2) m and covariances (K, 2, 2) m^2."""

    def reach(self) -> Array:
        """(K,) how far from its mean an animal may be for an image without detections to tell, m."""


#: A detection that leaves a cloud with fewer particles' worth of weight than this says more than they can.
LEAST_EFFECTIVE = 10.0


class ParticleTracker:
    """Tracks by F's particle filter (F 4.3, 5.3), each kept inside the fence that it began in.

    Each detection takes its closest track, whose particles it weighs by (4.11), and what lies in no gate
    starts a track, one for each: F does not say whether the second detection of a group takes the track that
    the first has just started. A lost track is kept, moves on, and may be re-identified.

    Parameters
    ----------
    motion
        How animals walk.
    fences
        Of the enclosures.
    rng
        Random numbers.
    particles
        Of each animal.
    gate_probability
        That an animal's own detection is let in.
    negative
        Whether images without a detection count, F 4.2.2.
    """

    def __init__(
        self, motion: Motion, fences: Sequence[Inside], rng: np.random.Generator, *, particles: int = 500,
        gate_probability: float = 0.99, negative: bool = True,
    ) -> None:  # fmt: skip
        self._motion, self._fences, self._rng = motion, fences, rng
        self._particles, self._gate, self._negative = particles, gate_probability, negative
        self._time = np.nan
        self.cloud = Cloud(np.zeros((0, particles, 2)), np.zeros((0, particles)))
        #: By track: which fence it began in, -1 for none; when it was last detected, s; whether it is lost.
        self.home, self.seen_at, self.lost = np.zeros(0, np.intp), np.zeros(0), np.zeros(0, bool)
        self._moments = moments(self.cloud)

    def step(self, scan: ImageScan) -> NDArray[np.int64]:
        """As `Tracker` has it: nearest neighbour, (4.11), and the negative update."""
        usable = scan.usable
        z, R = scan.z[usable], scan.R[usable]
        if scan.time > self._time:
            self._move(scan.time - self._time)
        self._time = scan.time
        taken, found = self._associated(z, R)
        seen = np.isin(np.arange(len(self.lost)), taken)
        if self._negative:
            unseen = weigh_unseen(self.cloud, scan.sight(self.cloud.x)).cloud
            found = Cloud(found.x, np.where(seen[:, None], found.w, unseen.w))
        self.cloud, self.lost = found, self.lost & ~seen
        self.seen_at = np.where(seen, scan.time, self.seen_at)
        new = np.flatnonzero(taken < 0)
        taken[new] = len(self.lost) + np.arange(len(new))
        if len(new):
            self._start(start_gaussian(z[new], R[new], self._particles, self._rng))
        if len(self.lost):
            self.cloud, _ = resample(self.cloud, self._rng)
        self._moments = moments(self.cloud)
        names = np.zeros(len(usable), np.int64)
        names[usable] = taken + 1
        return names

    def _move(self, dt: float) -> None:
        steps = max(int(np.ceil(dt / STATION_S - 1e-9)), 1)
        for _ in range(steps if len(self.lost) else 0):
            moved = move(self.cloud, self._motion, dt / steps, self._rng)
            self.cloud = stay_inside(self.cloud, moved, self._inside)

    def _inside(self, places: Array) -> Mask:
        """(K, N) whether places (K, N, 2) are inside the fence that each track began in."""
        inside = np.ones(places.shape[:-1], bool)
        for number, fence in enumerate(self._fences):
            mine = self.home == number
            if mine.any():
                inside[mine] = fence(places[mine])
        return inside

    def _associated(self, z: Array, R: Array) -> tuple[NDArray[np.int64], Cloud]:
        """The track (M,) of each detection, -1 for none; the clouds after them."""
        given = np.zeros(self.cloud.w.shape)
        if not len(z):
            return np.zeros(0, np.int64), weigh(self.cloud, given).cloud
        mean, covariance = moments(self.cloud)
        squared = mahalanobis_squared(mean, covariance, z, R)
        taken = nearest_animal(np.where(self.lost[:, None], np.inf, squared), self._gate)
        # Then those that were lost, one detection each: a lap later no two are likely to be one animal's.
        limit = min(gate_threshold(self._gate, 2), 1e6)
        free = taken < 0
        again = global_nearest(np.where(self.lost[:, None] & free, squared, np.inf).T, limit)
        taken = np.where(free, again.track, taken)
        for j in np.flatnonzero(taken >= 0):
            given[taken[j]] += log_likelihood(self.cloud.x[taken[j]], z[j], R[j])
        found = weigh(self.cloud, given).cloud
        return taken, self._revived(found, taken, mean, covariance, z, R)

    def _revived(
        self, cloud: Cloud, taken: NDArray[np.int64], mean: Array, covariance: Array, z: Array, R: Array
    ) -> Cloud:
        """Clouds of which a detection leaves hardly a particle, drawn anew about it.

        A sharp detection at the edge of a wide cloud gives one particle all the weight, and what resampling
        makes of that is a point that knows nothing of its error. Such a cloud is drawn from the normal
        distribution that a Kalman filter would have come to from the cloud's own mean (K, 2) and covariance.
        """
        thin = effective_size(cloud.w) < LEAST_EFFECTIVE
        x, w = cloud.x.copy(), cloud.w.copy()
        for a in np.flatnonzero(thin & np.isin(np.arange(len(thin)), taken)):
            at, P = mean[a], covariance[a]
            for j in np.flatnonzero(taken == a):
                after = update(at, P, z[j], np.eye(2), R[j])
                at, P = after.x, after.P
            fresh = start_gaussian(at[None], ((P + P.T) / 2)[None], x.shape[1], self._rng)
            x[a], w[a] = fresh.x[0], fresh.w[0]
        return Cloud(x, w)

    def _start(self, cloud: Cloud) -> None:
        """Add tracks at the time of the image; their home is the fence that holds most of their cloud."""
        home, most = np.full(len(cloud.w), -1, np.intp), np.zeros(len(cloud.w))
        for number, fence in enumerate(self._fences):
            share = fence(cloud.x).mean(axis=1)
            home[share > most] = number
            most = np.maximum(share, most)
        self.cloud = Cloud._make(map(np.concatenate, zip(self.cloud, cloud, strict=True)))
        self.home = np.append(self.home, home)
        self.seen_at = np.append(self.seen_at, np.full(len(home), self._time))
        self.lost = np.append(self.lost, np.zeros(len(home), bool))

    def seen_now(self, track: int) -> bool:
        """Whether the latest image had a detection of a track, by its number."""
        return bool(track > 0 and self.seen_at[track - 1] == self._time)

    def give_up(self, track: int) -> None:
        """Take a track, by its number, for lost: it was looked for and not found (F 5.3.4)."""
        self.lost[track - 1] = True

    def known(self) -> tuple[NDArray[np.int64], Array, Array]:
        """As `Tracker` has it."""
        return np.arange(len(self.lost)) + 1, *self._moments

    def reach(self) -> Array:
        """As `Tracker` has it."""
        if not self._negative or not len(self.lost):
            return np.full(len(self.lost), -np.inf)
        away = self.cloud.x - self._moments[0][:, None]
        return np.hypot(away[..., 0], away[..., 1]).max(axis=1)


class KalmanTracker:
    """The same rule of association with a Kalman filter for each track, which no image without detections and
    no fence can tell anything: the ellipse that F 8.3 holds the particle filter against."""

    def __init__(self, motion: Motion, gate_probability: float) -> None:
        self._motion, self._gate = motion, gate_probability
        self._time = np.nan
        self._mean, self._P = np.zeros((0, 2)), np.zeros((0, 2, 2))

    def step(self, scan: ImageScan) -> NDArray[np.int64]:
        """As `Tracker` has it."""
        if len(self._mean):
            F, Q = self._motion(scan.time - self._time)
            self._mean, self._P = self._mean @ F.T, F @ self._P @ F.T + Q
        self._time = scan.time
        usable = scan.usable
        z, R = scan.z[usable], scan.R[usable]
        names = np.zeros(len(usable), np.int64)
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
        """As `Tracker` has it."""
        return np.arange(len(self._mean)) + 1, self._mean.copy(), self._P.copy()

    def reach(self) -> Array:
        """As `Tracker` has it."""
        return np.full(len(self._mean), -np.inf)


class Ledger:
    """Which detections went where: what `TrackedAnimals` is made of, kept while the tracks go on."""

    def __init__(self, animals: int) -> None:
        self.found: list[Found] = []
        self._seen_at = np.full(animals, -np.inf)
        self._own = np.zeros(animals, np.int64)
        self._after_last: dict[int, float] = {}

    def take(self, image: int, tracker: Tracker, scan: ImageScan, animals: Indices) -> None:
        """Let the tracks have an image, and enter its detections; ``animals`` (M,) whose these are."""
        # First on to the image alone: a trace before it is one at its time.
        tracker.step(blind(scan.time))
        before = traces_of(tracker)
        names, time = tracker.step(scan), scan.time
        after = traces_of(tracker)
        own = np.append(self._own, 0)  # the last row is that of no animal
        for animal, name in zip(animals.tolist(), names.tolist(), strict=True):
            if not name:
                continue
            away = time - float(self._seen_at[animal]) if animal >= 0 else np.inf
            self.found.append(
                Found(
                    image, animal, name, before.get(name, np.nan), after[name],
                    self._after_last.get(name, np.nan), before.get(int(own[animal]), np.nan),
                    int(own[animal]), away,
                )
            )  # fmt: skip
            if animal >= 0:
                self._own[animal], self._seen_at[animal] = name, time
        for name in set(names.tolist()) - {0}:
            self._after_last[name] = after[name]


def traces_of(tracker: Tracker) -> dict[int, float]:
    """Trace of each track's covariance, m^2, by its number."""
    identity, _, covariance = tracker.known()
    return dict(zip(identity.tolist(), np.trace(covariance, axis1=1, axis2=2).tolist(), strict=True))


def track_animals(
    images: Images, terrain: Terrain, detector: Detector, tracker: Tracker, motion: Motion
) -> TrackedAnimals:
    """Take a tracker through all images that can tell its tracks anything.

    Parameters
    ----------
    images
        Of one way.
    terrain
        The ground.
    detector
        What the tracks take the camera for.
    tracker
        With its tracks; they are carried on.
    motion
        How fast an animal can leave its cloud.

    Returns
    -------
    TrackedAnimals
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
    while k < T:
        steps += 1
        scan = scan_at(terrain, images, k, detector)
        if detected[k]:
            ledger.take(k, tracker, scan, images.taken(k)[2])
        else:
            tracker.step(scan if tells else blind(scan.time))
        if stations[k]:
            known.append(Known(k, *tracker.known()))
        k, tells = next_scan(tracker, k, times, middle, radius, detected | stations, motion)
    return TrackedAnimals(known, ledger.found, steps)


def scan_at(terrain: Terrain, images: Images, row: int, detector: Detector) -> ImageScan:
    """What one of the images tells tracks."""
    z, R, _ = images.taken(row)
    p = images.poses
    sight = sight_from(terrain, p.camera, p.p_nc[row], p.R_nc[row], detector)
    return ImageScan(float(images.times[row]), z, R, sight)


def blind(time: float) -> ImageScan:
    """An image that shows nothing of the ground."""
    return ImageScan(time, np.zeros((0, 2)), np.zeros((0, 2, 2)), lambda places: np.zeros(places.shape[:-1]))


def next_scan(
    tracker: Tracker, k: int, times: Array, middle: Array, radius: Array, wanted: Mask,
    motion: Motion,
) -> tuple[int, bool]:  # fmt: skip
    """The next image to be looked at, and whether what it does not show can tell a track anything."""
    ahead = np.flatnonzero(wanted[k + 1 :])
    last = k + 1 + int(ahead[0]) if len(ahead) else len(times)
    rows = np.arange(k + 1, min(last + 1, len(times)))
    _, mean, _ = tracker.known()
    reach = tracker.reach()
    able = np.isfinite(reach)
    if len(rows) and able.any():
        spread = float(np.sqrt(motion(float(times[rows[-1]] - times[k]))[1][0, 0]))
        away = np.linalg.norm(middle[rows, None] - mean[None, able], axis=-1)
        near = (away < radius[rows, None] + reach[able] + STRAYS * spread).any(axis=1)
        if near.any():
            return int(rows[near.argmax()]), True
    return last, False


class Aircraft(NamedTuple):
    """What flies, and what it carries.

    Attributes
    ----------
    camera
        Intrinsic parameters.
    gimbal
        Where the camera looks at times, s: the same along rows and on a visit.
    height, speed
        Above the ground, m, and m/s.
    errors
        How far off its pose it is.
    detector
        What becomes of an animal in an image.
    """

    camera: Camera
    gimbal: Callable[[Array], GimbalAngles]
    height: float
    speed: float
    errors: ExecutionErrors
    detector: Detector


class Visits(NamedTuple):
    """By what the high-level planner goes; F prints none of it.

    Attributes
    ----------
    alpha, c
        Of F (5.2).
    worth_m2
        Trace of a covariance from which on an animal is worth a visit, m^2; infinite for rows alone.
    patience
        How long the camera scans about a place before the animal is given up, s.
    """

    alpha: float
    c: float
    worth_m2: float
    patience: float


class Patrolled(NamedTuple):
    """A flight that was steered by its tracks.

    Attributes
    ----------
    times
        (T,) s of its images.
    p_nc
        (T, 3) m.
    goal
        (T,) number of the track flown to, or `SEARCH`.
    known
        After every image.
    found
        Every detection.
    given_up
        Numbers of the tracks that were looked for and not found, one for each time.
    done
        (E,) s when each enclosure had as many tracks at once as animals live there; infinite for never.
    """

    times: Array
    p_nc: Array
    goal: NDArray[np.int64]
    known: list[Known]
    found: list[Found]
    given_up: list[int]
    done: Array


def patrol(
    terrain: Terrain,
    aircraft: Aircraft,
    way_points: Array,
    area_of: Indices,
    lives: Indices,
    times: Array,
    truth: Array,
    tracker: ParticleTracker,
    visits: Visits,
    rng: np.random.Generator,
) -> Patrolled:
    """Fly rows and visits until the rows are flown or the time is up.

    Parameters
    ----------
    terrain
        The ground.
    aircraft
        What flies.
    way_points, area_of
        (M, 2) m of the search, and (M,) in which enclosure each is. Those of an enclosure that is done are
        left out (F 5.3).
    lives
        (E,) animals that live in each enclosure, which F takes as known.
    times
        (T,) s, evenly spaced, of all images that there is time for.
    truth
        (T, A, 2) m.
    tracker
        Tracks; they are carried on, and know the same enclosures by the same numbers.
    visits
        Of the high-level planner.
    rng
        Random numbers of the errors and of the images.

    Returns
    -------
    Patrolled
    """
    step = float(times[1] - times[0])
    off, turn = drawn_errors(len(times), aircraft.errors, step, rng)
    here, heading, reached = way_points[0].astype(float), 0.0, 0
    ledger, known, goals, path = Ledger(truth.shape[1]), list[Known](), list[int](), list[Array]()
    given_up, done = list[int](), np.full(len(lives), np.inf)
    sought, arrived, scanned = SEARCH, False, 0.0
    for k, time in enumerate(times.tolist()):
        identity, mean, P = tracker.known()
        here_live, home = ~tracker.lost, tracker.home
        counts = np.bincount(home[here_live & (home >= 0)], minlength=len(lives))[: len(lives)]
        done[np.isinf(done) & (counts >= lives)] = time
        while reached < len(way_points) and np.isfinite(done[area_of[reached]]):
            reached += 1
        if reached == len(way_points):
            break
        wanted = here_live & (np.trace(P, axis1=1, axis2=2) >= visits.worth_m2) & (home >= 0)
        wanted &= np.isinf(done)[home]
        rows = np.flatnonzero(wanted)
        chosen = best_goal(
            mean[rows], P[rows], here, way_points[reached], alpha=visits.alpha, c=visits.c
        )  # fmt: skip
        goal = SEARCH if chosen == SEARCH else int(identity[rows[chosen]])
        aim = way_points[reached] if goal == SEARCH else mean[rows[chosen]]
        away, reach = float(np.hypot(*(aim - here))), aircraft.speed * step
        heading = float(np.arctan2(*(aim - here)[::-1])) if away > 0 else heading
        here = aim.astype(float) if away <= reach else here + (aim - here) * (reach / away)
        if goal == SEARCH:
            reached += away <= reach
        # From where the animal should be the camera scans; one that this does not find is given up.
        if goal != sought:
            sought, arrived, scanned = goal, False, 0.0
        arrived |= goal != SEARCH and away <= reach
        scanned += step if arrived else 0.0
        row = slice(k, k + 1)
        up = float(np.nan_to_num(terrain.heights_at(here[None]))[0]) + aircraft.height
        nominal = camera_on_course(
            aircraft.camera, np.array([[*here, -up]]), [heading], aircraft.gimbal(times[row])
        )
        true = displaced(nominal, [heading], off[row], turn[row])
        images = take_images(
            terrain, nominal, true, np.array([heading]), times[row], truth[row], aircraft.errors,
            aircraft.detector, rng,
        )  # fmt: skip
        scan = scan_at(terrain, images, 0, aircraft.detector)
        ledger.take(k, tracker, scan, images.taken(0)[2])
        if scanned > visits.patience and not tracker.seen_now(goal):
            tracker.give_up(goal)
            given_up.append(goal)
        known.append(Known(k, *tracker.known()))
        goals.append(goal)
        path.append(nominal.p_nc[0])
    flown = len(goals)
    return Patrolled(
        times[:flown], np.array(path).reshape(-1, 3), np.array(goals, np.int64), known, ledger.found,
        given_up, done,
    )  # fmt: skip


#: An animal is out of sight once it has not been detected for so long, s. Chosen.
OUT_OF_SIGHT = 30.0


class OutOfSight(NamedTuple):
    """Animals with a track at a time when they were not detected for a while; N of them, at all stations.

    Attributes
    ----------
    off
        (N, 2) m, the track's mean from the animal.
    covariance
        (N, 2, 2) m^2, the track's.
    own
        (N,) bool: whether the track had not been given another animal's detection by then.
    """

    off: Array
    covariance: Array
    own: Mask

    @property
    def nees(self) -> Array:
        """(N,) squared distances in units of the covariance; 2 on average where it is right."""
        solved = np.linalg.solve(self.covariance, self.off[..., None])[..., 0]
        return np.einsum("ni,ni->n", self.off, solved)


def out_of_sight(
    known: list[Known], found: list[Found], times: Array, truth: Array, until: ArrayLike = np.inf
) -> OutOfSight:
    """Where tracks are and animals are, once these were not detected for `OUT_OF_SIGHT`.

    An animal's track is the one that its latest detection was given to.

    Parameters
    ----------
    known, found
        Of the tracks.
    times, truth
        (T,) s and (T, A, 2) m.
    until
        (A,) s up to when an animal counts, or one time for all.

    Returns
    -------
    OutOfSight
    """
    animals = truth.shape[1]
    counts = np.broadcast_to(np.asarray(until, float), animals)
    own, seen_at = np.zeros(animals, np.int64), np.full(animals, np.inf)
    off, covariance, pure, row = list[Array](), list[Array](), list[bool](), 0
    first, mixed = dict[int, int](), set[int]()
    for one in known:
        while row < len(found) and found[row].image <= one.image:
            if first.setdefault(found[row].track, found[row].animal) != found[row].animal:
                mixed.add(found[row].track)
            if found[row].animal >= 0:
                own[found[row].animal], seen_at[found[row].animal] = found[row].track, times[found[row].image]
            row += 1
        at = {int(name): k for k, name in enumerate(one.identity)}
        time = times[one.image]
        for animal in np.flatnonzero((time - seen_at > OUT_OF_SIGHT) & (time <= counts)):
            k = at.get(int(own[animal]))
            if k is not None:
                off.append(one.mean[k] - truth[one.image, animal])
                covariance.append(one.covariance[k])
                pure.append(int(own[animal]) not in mixed)
    return OutOfSight(
        np.array(off).reshape(-1, 2), np.array(covariance).reshape(-1, 2, 2), np.array(pure, bool)
    )  # fmt: skip


def sight_numbers(away: OutOfSight) -> dict[str, float]:
    """How well animals out of sight are known, by name; NaN where there was none.

    ``rmse`` and ``sd`` in m (`sd` for one axis), and ``anees``.
    """
    if not len(away.off):
        return dict.fromkeys(("rmse", "sd", "anees"), np.nan)
    return {
        "rmse": float(np.sqrt((away.off**2).sum(axis=1).mean())),
        "sd": float(np.sqrt(np.trace(away.covariance, axis1=1, axis2=2).mean() / 2)),
        "anees": float(away.nees.mean()),
    }


def next_lap(found: list[Found], times: Array, lap: float) -> list[Found]:
    """Of each animal that was detected in the first lap, its first detection in the second."""
    seen: set[int] = set()
    back: dict[int, Found] = {}
    for one in found:
        if times[one.image] < lap:
            seen.add(one.animal)
        elif one.animal in seen:
            back.setdefault(one.animal, one)
    return [one for animal, one in sorted(back.items()) if animal >= 0]


def found_on_visits(flown: Patrolled) -> list[Found]:
    """Detections that gave an animal's track back to it while that track was flown to."""
    return [
        one for one in flown.found
        if flown.goal[one.image] == one.track == one.own and OUT_OF_SIGHT < one.away < np.inf
    ]  # fmt: skip


def turns(flown: Patrolled) -> int:
    """How often a search turned to a track, from its rows or from another track."""
    goal = np.append(SEARCH, flown.goal)
    return int(((goal[1:] != goal[:-1]) & (goal[1:] != SEARCH)).sum())
