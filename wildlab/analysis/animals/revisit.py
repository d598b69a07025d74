"""The loop closed: tracks by the particle filter say where to fly, and what is seen there goes to the tracks.

F 5.3: rows are flown to find new animals, and broken off where one that is known is worth a visit by (5.2)
and (5.3); it is then found again, or lost by the images that should have shown it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.animals.follow import Found, Known, Ledger, Particles, blind, traces_of
from wildlab.analysis.animals.images import Detector, footprint_circles, put_on_ground, shown, sight_from
from wildlab.analysis.plans.flown import ExecutionErrors, displaced, drawn_errors
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.gimbal import GimbalAngles, camera_on_course
from wildlab.planning.high_level import SEARCH, all_positioned, best_goal
from wildlab.tracking.particles import ImageLook


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
    area_of: NDArray[np.intp],
    lives: NDArray[np.intp],
    times: Array,
    truth: Array,
    follower: Particles,
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
    follower
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
        identity, mean, P = follower.known()
        here_live, home = ~follower.herd.lost, follower.home
        counts = np.bincount(home[here_live & (home >= 0)], minlength=len(lives))[: len(lives)]
        done[np.isinf(done) & all_positioned(counts, lives)] = time
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
        told = _pose(terrain, aircraft, here, heading, times[k : k + 1])
        true = displaced(told, [heading], off[k : k + 1], turn[k : k + 1])
        _see(terrain, aircraft, told, true, heading, truth[k], time, follower, ledger, k, rng)
        if scanned > visits.patience and not follower.seen_now(goal):
            follower.give_up(goal)
            given_up.append(goal)
        known.append(Known(k, *follower.known()))
        goals.append(goal)
        path.append(told.p_nc[0])
    flown = len(goals)
    return Patrolled(
        times[:flown], np.array(path).reshape(-1, 3), np.array(goals, np.int64), known, ledger.found,
        given_up, done,
    )  # fmt: skip


def _pose(terrain: Terrain, aircraft: Aircraft, here: Array, heading: float, time: Array) -> CameraPoses:
    up = float(np.nan_to_num(terrain.heights_at(here[None]))[0]) + aircraft.height
    p = np.array([[here[0], here[1], -up]])
    return camera_on_course(aircraft.camera, p, [heading], aircraft.gimbal(time))


def _see(
    terrain: Terrain, aircraft: Aircraft, told: CameraPoses, true: CameraPoses, heading: float,
    truth: Array, time: float, follower: Particles, ledger: Ledger, k: int, rng: np.random.Generator,
) -> None:  # fmt: skip
    """One image for the tracks."""
    detector = aircraft.detector
    in_view = shown(terrain, true.camera, true.p_nc[0], true.R_nc[0], truth, detector)
    seen = np.flatnonzero(in_view & (rng.random(len(truth)) < detector.detected))
    z, R = np.zeros((0, 2)), np.zeros((0, 2, 2))
    if len(seen):
        rows = np.zeros(len(seen), np.intp)
        z, R = put_on_ground(
            terrain,
            told.take(rows),
            true.take(rows),
            np.full(len(seen), heading),
            truth[seen],
            aircraft.errors,
            detector,
            rng,
        )
    follower.step(blind(time))
    before = traces_of(follower)
    middle, radius = footprint_circles(terrain, told)
    sight = sight_from(
        terrain, told.camera, told.p_nc[0], told.R_nc[0], (middle[0], float(radius[0])), detector
    )
    names = follower.step(ImageLook(time, z, R, sight))
    ledger.enter(k, time, seen, names, before, traces_of(follower))


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
    own: NDArray[np.bool_]

    @property
    def nees(self) -> Array:
        """(N,) squared distances in units of the covariance; 2 on average where it is right."""
        solved = np.linalg.solve(self.covariance, self.off[..., None])[..., 0]
        return np.asarray(np.einsum("ni,ni->n", self.off, solved))


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

    ``rmse`` and ``sd`` in m (`sd` for one axis), ``anees``, ``beyond``: the share outside the ellipse that
    should hold 95 %; the same of tracks of one animal alone, ``own``, and the share of these.
    """
    names = ("rmse", "sd", "anees", "beyond", "rmse_own", "anees_own", "own_share")
    if not len(away.off):
        return dict.fromkeys(names, np.nan)
    squares, mine, nees = (away.off**2).sum(axis=1), away.own, away.nees
    trace = np.trace(away.covariance, axis1=1, axis2=2)
    return {
        "rmse": float(np.sqrt(squares.mean())),
        "sd": float(np.sqrt(trace.mean() / 2)),
        "anees": float(nees.mean()),
        "beyond": float((nees > chi2_quantile(0.95, 2)).mean()),
        "rmse_own": float(np.sqrt(squares[mine].mean())) if mine.any() else np.nan,
        "anees_own": float(nees[mine].mean()) if mine.any() else np.nan,
        "own_share": float(mine.mean()),
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
