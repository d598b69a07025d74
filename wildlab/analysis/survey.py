"""Search for animals and keep those that are known: planner, camera and filter closed, F 5.3.

The high-level planner chooses before each leg whether rows are flown on or an animal is gone back to, by F
(5.2)-(5.3). Each animal that was found has a filter for a random walk; an image of it makes its estimate
sharp, and without one it grows old, until it counts as lost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.search import SearchInRows, World, found_in, rows_at
from wildlab.geometry.frames import Array
from wildlab.planning.followers import PatternPlanner
from wildlab.planning.high_level import (
    SEARCH,
    all_positioned,
    best_goal,
    lost_by_covariance,
    lost_by_search,
)
from wildlab.planning.information import SearchSensor, detection_probability
from wildlab.planning.legs import Flying, Leg, Platform


class Rules(NamedTuple):
    """By what the high-level planner goes; F prints none of it.

    Attributes
    ----------
    alpha, c
        Of F (5.2).
    walk
        By how much an animal's variance grows, each way, m^2/s.
    limit
        Of Tr(P), beyond which an animal is lost, m^2.
    doubt
        Probability of having missed an animal where it should be, below which it is lost.
    position_sd
        Of a position that an image gives, each way, m.
    scan
        By how much the camera looks to either side while an animal is looked for, rad.
    """

    alpha: float
    c: float
    walk: float
    limit: float
    doubt: float = 0.05
    position_sd: float = 2.0
    scan: float = np.radians(15.0)


class Surveyed(NamedTuple):
    """A survey that has ended.

    Attributes
    ----------
    positioned
        s, when of every enclosure as many animals had been known at once as live there; infinite where that
        never was.
    p_nc
        (L, 3) where images were taken, m.
    goal
        (D,) of each leg: an animal, or `SEARCH`.
    known
        (D,) animals that are known after each leg, with those of enclosures that are done.
    lost_by_covariance, lost_by_search
        How often an animal was lost by which rule.
    error
        (D,) mean distance of estimates from animals after each leg, m; NaN while none is known.
    """

    positioned: float
    p_nc: Array
    goal: NDArray[np.intp]
    known: NDArray[np.intp]
    lost_by_covariance: int
    lost_by_search: int
    error: Array

    @property
    def revisits(self) -> int:
        """How often the planner turned from one goal to an animal that was known."""
        changed = np.append(True, self.goal[1:] != self.goal[:-1])
        return int((changed & (self.goal != SEARCH)).sum())


class _Filters:
    """One filter for each animal that may live there; P stays a multiple of the unit matrix."""

    def __init__(self, animals: int, rules: Rules) -> None:
        self.rules = rules
        self.x = np.zeros((animals, 2))
        self.p = np.ones(animals)
        self.missed = np.ones(animals)
        self.live = np.zeros(animals, bool)

    @property
    def P(self) -> Array:
        """(A, 2, 2) m^2."""
        return np.asarray(self.p[:, None, None] * np.eye(2))

    def see(self, animals: NDArray[np.intp], positions: Array) -> None:
        """Positions (K, 2) of animals that an image shows."""
        R = self.rules.position_sd**2
        gain = np.where(self.live[animals], self.p[animals] / (self.p[animals] + R), 1.0)
        self.x[animals] += gain[:, None] * (positions - self.x[animals])
        self.p[animals] = gain * R
        self.missed[animals] = 1.0
        self.live[animals] = True


def survey(
    world: World,
    rows: SearchInRows,
    start: Platform,
    sensor: SearchSensor,
    flying: Flying,
    rules: Rules,
    rng: np.random.Generator,
) -> Surveyed:
    """Search rows and go back to animals until each enclosure is done, or the world ends.

    Parameters
    ----------
    world
        What is searched.
    rows
        The search for new animals (F 5.3.3).
    start
        Where the platform begins.
    sensor, flying
        The camera and what the platform can do.
    rules
        Of the high-level planner.
    rng
        For the error of positions.

    Returns
    -------
    Surveyed
    """
    images, animals = world.chance.shape
    filters = _Filters(animals, rules)
    lives = np.bincount(world.area_of, minlength=len(world.areas))
    platform, clock, lost = start, 0.0, np.zeros(2, int)
    p_nc, goals, known, errors = [], list[int](), list[int](), list[float]()
    positioned, done = np.inf, np.zeros(len(world.areas), bool)
    while clock + flying.step <= images * flying.interval:
        count = np.bincount(world.area_of[filters.live], minlength=len(world.areas))
        # An enclosure whose animals were all known at once is scanned, and stays so (F 5.3).
        done |= all_positioned(count, lives)
        if done.all():
            positioned = clock
            break
        wanted = ~done[world.area_of]
        leg, goal = _next(rows, platform, filters, wanted, ~done)
        times = clock + leg.at
        window = rows_at(times, flying.interval)
        if times[-1] > images * flying.interval:
            break
        filters.p += rules.walk * float(leg.at[-1])
        _miss(filters, leg, sensor, world)
        for image, shown in enumerate(found_in(world, leg, window, sensor)):
            seen = np.flatnonzero(shown)
            at = world.animals[window[image], seen, :2]
            filters.see(seen, at + rng.normal(0.0, rules.position_sd, at.shape))
        by_covariance = filters.live & wanted & lost_by_covariance(filters.P, rules.limit)
        by_search = filters.live & wanted & lost_by_search(filters.missed, rules.doubt) & ~by_covariance
        lost += (by_covariance.sum(), by_search.sum())
        filters.live &= ~(by_covariance | by_search)
        filters.missed[~filters.live] = 1.0
        platform, clock = leg.end, float(times[-1])
        off = np.hypot(*(filters.x - world.animals[window[-1], :, :2])[filters.live].T)
        p_nc.append(leg.p_nc)
        goals.append(goal)
        known.append(int(filters.live.sum()))
        errors.append(float(off.mean()) if len(off) else np.nan)
    return Surveyed(
        float(positioned),
        np.concatenate([*p_nc, np.zeros((0, 3))]),
        np.array(goals, np.intp),
        np.array(known, np.intp),
        int(lost[0]),
        int(lost[1]),
        np.array(errors),
    )


def _next(
    rows: SearchInRows, platform: Platform, filters: _Filters, wanted: NDArray[np.bool_],
    open_areas: NDArray[np.bool_],
) -> tuple[Leg, int]:  # fmt: skip
    """The next leg and its goal; ``wanted`` (A,) are animals of areas that are not done."""
    rules = filters.rules
    each = np.flatnonzero(filters.live & wanted)
    way_point = rows.way_point(platform, open_areas)
    chosen = best_goal(
        filters.x[each], filters.P[each], platform.north_east, way_point, alpha=rules.alpha, c=rules.c
    )
    if chosen == SEARCH:
        return rows.next_leg(platform, open_areas)[0], SEARCH
    animal = int(each[chosen])
    sides = (0.0, rules.scan, 0.0, -rules.scan)
    return PatternPlanner(filters.x[animal], rows.terrain, rows.flying, sides).choose(platform), animal


def _miss(filters: _Filters, leg: Leg, sensor: SearchSensor, world: World) -> None:
    """Lower the belief in animals whose estimated position an image shows; what finds one raises it again."""
    up = np.nan_to_num(world.terrain.heights_at(filters.x))
    points = np.column_stack([filters.x, -up])
    for image in range(len(leg.p_nc)):
        if leg.counts[image]:
            R = leg.R_nc[min(image, len(leg.R_nc) - 1)]
            likely = detection_probability(points, leg.p_nc[image], R, sensor)
            filters.missed *= np.where(filters.live, 1 - likely, 1.0)
