"""A search for animals, closed: a planner says where to fly, a camera looks, and what it finds is told.

A planner knows the ground, the fences and how many animals each holds (F 5.1); where they are it learns when
an image shows one. An animal in an image is found with the probability of F (5.8)-(5.9), and where the ground
hides it, not at all. An enclosure whose animals are all found is done (F 5.3), whoever plans. Turns take
their time, whoever turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import in_field_of_view, lines_clear
from wildlab.planning.legs import Flying, Leg, PatternPlanner, Platform, RandomWalk, SearchSensor
from wildlab.planning.patterns import contains, grid_points, lawn_mower
from wildlab.planning.planner import (
    SEARCH,
    InformationPlanner,
    best_goal,
    detection_probability,
)


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
    goal
        (D,) of each leg: an animal, or `SEARCH`.
    lost_by_covariance, lost_by_search
        How often an animal was lost by which rule.
    """

    positioned: float
    goal: Indices
    lost_by_covariance: int
    lost_by_search: int


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
        return self.p[:, None, None] * np.eye(2)

    def see(self, animals: Indices, positions: Array) -> None:
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
    goals, positioned, done = list[int](), np.inf, np.zeros(len(world.areas), bool)
    while clock + flying.step <= images * flying.interval:
        count = np.bincount(world.area_of[filters.live], minlength=len(world.areas))
        # An enclosure whose animals were all known at once is scanned, and stays so (F 5.3).
        done |= count >= lives
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
        # Too little is known of them, or they were not where they should be (F 5.3, 5.3.4).
        by_covariance = filters.live & wanted & (2 * filters.p > rules.limit)
        by_search = filters.live & wanted & (filters.missed < rules.doubt) & ~by_covariance
        lost += (by_covariance.sum(), by_search.sum())
        filters.live &= ~(by_covariance | by_search)
        filters.missed[~filters.live] = 1.0
        platform, clock = leg.end, float(times[-1])
        goals.append(goal)
    return Surveyed(float(positioned), np.array(goals, np.intp), *lost.tolist())


def _next(
    rows: SearchInRows, platform: Platform, filters: _Filters, wanted: Mask,
    open_areas: Mask,
) -> tuple[Leg, int]:  # fmt: skip
    """The next leg and its goal; ``wanted`` (A,) are animals of areas that are not done."""
    rules = filters.rules
    each = np.flatnonzero(filters.live & wanted)
    way_point = rows.way_point(platform, open_areas)
    chosen = best_goal(
        filters.x[each], filters.P[each], platform.north_east, way_point, alpha=rules.alpha, c=rules.c
    )
    if chosen == SEARCH:
        return rows.next_leg(platform, open_areas), SEARCH
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


class World(NamedTuple):
    """What is searched.

    Attributes
    ----------
    terrain
        The ground.
    areas
        Fences, (K, 2) north and east each, m.
    animals
        (T, A, 3) the middle of each animal's body in n after each interval between images, m.
    area_of
        (A,) in which area each lives.
    chance
        (T, A) from 0 to 1: an animal is found in an image where its probability is above this. At one time
        the same for all planners, so that luck does not tell them apart.
    """

    terrain: Terrain
    areas: tuple[Array, ...]
    animals: Array
    area_of: Indices
    chance: Array


class Searched(NamedTuple):
    """A search that has ended: all were found, or the time was up.

    Attributes
    ----------
    found
        (A,) s, when each animal was first found; infinite where it was not.
    p_nc
        (L, 3) where images were taken, m.
    at
        (L,) s, when.
    counts
        (L,) images for which the camera was at rest.
    """

    found: Array
    p_nc: Array
    at: Array
    counts: Mask


class Searcher(Protocol):
    """A planner, as the loop asks it."""

    def next_leg(self, platform: Platform, open_areas: Mask) -> Leg:
        """The next leg.

        Parameters
        ----------
        platform
            Where it is.
        open_areas
            (A,) whether an area still has animals that were not found.
        """
        ...


def search(
    world: World, searcher: Searcher, start: Platform, sensor: SearchSensor, flying: Flying
) -> Searched:
    """Let a planner search until all are found or the world ends.

    Parameters
    ----------
    world
        What is searched, for as long as it has rows.
    searcher
        The planner.
    start
        Where the platform begins.
    sensor
        The camera; it decides what is found.
    flying
        What the platform can do.

    Returns
    -------
    Searched
    """
    images, animals = world.chance.shape
    found = np.full(animals, np.inf)
    platform, clock = start, 0.0
    p_nc, at, counts = [], [], []
    while np.isinf(found).any():
        still = np.isinf(found)
        open_areas = np.array([still[world.area_of == k].any() for k in range(len(world.areas))])
        leg = searcher.next_leg(platform, open_areas)
        times = clock + leg.at
        rows = rows_at(times, flying.interval)
        if rows[-1] >= images or times[-1] > images * flying.interval:
            break
        shown = found_in(world, leg, rows, sensor) & still
        for image in range(flying.images):
            found[shown[image] & np.isinf(found)] = times[image]
        platform, clock = leg.end, float(times[-1])
        p_nc.append(leg.p_nc)
        at.append(times)
        counts.append(leg.counts)
    return Searched(found, np.concatenate(p_nc), np.concatenate(at), np.concatenate(counts))


def rows_at(times: Array, interval: float) -> Indices:
    """(L,) rows of a world that hold at times (L,) s: the last begun; turns put images between rows."""
    return np.floor(np.asarray(times) / interval + 1e-9).astype(np.intp) - 1


def found_in(world: World, leg: Leg, rows: Indices, sensor: SearchSensor) -> Mask:
    """(L, A) which animals the images of a leg find; ``rows`` (L,) are its images in the world's count."""
    hit = np.zeros((len(rows), world.chance.shape[1]), bool)
    for image, row in enumerate(rows):
        if not leg.counts[image]:
            continue
        at, p = world.animals[row], leg.p_nc[image]
        away = ((at - p) ** 2).sum(axis=1)
        likely = world.chance[row] < np.exp(-away / sensor.reach**2)
        if likely.any():
            inside = np.flatnonzero(likely)
            R_nc = leg.R_nc[min(image, len(leg.R_nc) - 1)]
            inside = inside[in_field_of_view(sensor.halves, at[inside], p, R_nc)]
            hit[image, inside] = lines_clear(world.terrain, at[inside], p) if len(inside) else True
    return hit


class SearchByInformation:
    """The planner of F 5.3.2 over the grids of all areas that are not done.

    Parameters
    ----------
    planner
        With the grid of all areas.
    area_of
        (N,) of which area each point of its grid is.
    walk
        By how much the variance of where an animal is grows, each way, m^2/s, by which what is known wears
        off.
    """

    def __init__(self, planner: InformationPlanner, area_of: Indices, walk: float) -> None:
        self.planner, self.area_of, self.walk = planner, area_of, walk

    def next_leg(self, platform: Platform, open_areas: Mask) -> Leg:
        """As `Searcher` has it."""
        self.planner.weights[:] = open_areas[self.area_of]
        leg = self.planner.choose(platform).leg
        self.planner.add(leg)
        self.planner.wait(self.walk * float(leg.at[-1]))
        return leg


class SearchInRows:
    """Rows over one area after the other, again over those where animals are left, F 5.2 with F 5.3's rule.

    Parameters
    ----------
    world
        Its fences and its ground are used, no more.
    flying
        What the platform can do.
    distance
        Between rows, m.
    order
        In which the areas are searched.
    sides
        Of the camera, as `PatternPlanner` has them.
    """

    def __init__(
        self,
        world: World,
        flying: Flying,
        distance: float,
        order: Sequence[int],
        sides: Sequence[float] = (0.0,),
    ) -> None:
        self.areas, self.terrain, self.flying = world.areas, world.terrain, flying
        self.distance, self.order, self.sides = distance, tuple(order), tuple(sides)
        self._queue: list[int] = []
        self._now: PatternPlanner | None = None
        self._area = -1

    def next_leg(self, platform: Platform, open_areas: Mask) -> Leg:
        """As `Searcher` has it."""
        return self._rows(platform, open_areas).choose(platform)

    def way_point(self, platform: Platform, open_areas: Mask) -> Array:
        """(2,) m, the first that was not visited: where the search would go on."""
        rows = self._rows(platform, open_areas)
        return rows.way_points[rows.visited]

    def _rows(self, platform: Platform, open_areas: Mask) -> PatternPlanner:
        """What is left of the rows that are being flown, or the rows over the next area."""
        if self._now is None or self._now.done or not open_areas[self._area]:
            self._queue = [one for one in self._queue if open_areas[one]]
            if not self._queue:
                self._queue = [one for one in self.order if open_areas[one]]
            self._area = self._queue.pop(0)
            rows = lawn_mower(self.areas[self._area], self.distance, start=platform.north_east)
            self._now = PatternPlanner(rows.waypoints, self.terrain, self.flying, self.sides)
        return self._now


class SearchByChance:
    """A random walk over the areas that are not done.

    Parameters
    ----------
    world
        Its fences and its ground are used, no more.
    flying
        What the platform can do.
    rng
        What chance there is.
    """

    def __init__(self, world: World, flying: Flying, rng: np.random.Generator) -> None:
        self.areas = world.areas
        self._walk = RandomWalk(list(world.areas), world.terrain, flying, rng)

    def next_leg(self, platform: Platform, open_areas: Mask) -> Leg:
        """As `Searcher` has it."""
        self._walk.areas = [area for area, still in zip(self.areas, open_areas, strict=True) if still]
        return self._walk.choose(platform)


def grid_over(areas: Sequence[Array], terrain: Terrain, step: float) -> tuple[Array, Indices]:
    """Points inside areas, one for each cell of a grid.

    Parameters
    ----------
    areas
        Fences, (K, 2) each, m.
    terrain
        On which the points lie.
    step
        Between points, m.

    Returns
    -------
    points, area_of
        (N, 3) in n, m, and (N,) in which area each lies.

    Raises
    ------
    WildlabError
        Where an area lies beyond the map, or is too small for a point.
    """
    points, of = [], []
    for number, area in enumerate(areas):
        low, high = area.min(axis=0), area.max(axis=0)
        axes = [np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True)]
        flat = grid_points(*axes)
        flat = flat[contains(area, flat)] if len(flat) else flat
        up = terrain.heights_at(flat)
        if not len(flat) or not np.isfinite(up).all():
            raise WildlabError(
                f"area {number + 1} has {len(flat)} points of the grid, {np.isnan(up).sum()} off the map",
                "give an area on the map, and a grid finer than the area",
                field="areas",
            )
        points.append(np.column_stack([flat, -up]))
        of.append(np.full(len(flat), number))
    return np.concatenate(points), np.concatenate(of)
