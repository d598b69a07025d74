"""One drawn world, searched by planners that know the same and fly the same: F 5.2, 5.3, appendix A."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.search import (
    Rules,
    SearchByChance,
    SearchByInformation,
    Searched,
    Searcher,
    SearchInRows,
    Surveyed,
    World,
    grid_over,
    search,
    survey,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import Check, columns_of
from wildlab.geometry.frames import Array
from wildlab.planning.areas import rectangle
from wildlab.planning.information import SearchSensor, initial_information
from wildlab.planning.legs import Flying, Platform, look_attitude
from wildlab.planning.planner import Horizon, InformationPlanner, Tour, greedy_tour, shortest_tour
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.target_motion import reflected

#: The planners: by what is to be learnt, the same with its camera fixed straight down, rows with the camera
#: straight down and from side to side, and by chance.
INFORMATION, FIXED, ROWS, SWING, CHANCE = "information", "information-down", "rows", "rows-swing", "chance"
SEARCHERS = (INFORMATION, FIXED, ROWS, SWING, CHANCE)
#: Names of the numbers that are recorded, and their units.
RECORDED = {
    "first_found": "s",
    "half_found": "s",
    "all_found": "s",
    "mean_found": "s",
    "share_found": "1",
    "covered": "1",
    "weighed": "1",
    "positioned": "s",
    "revisits": "1",
    "lost_by_covariance": "1",
    "lost_by_search": "1",
    "tour_time": "s",
    "broken_off": "1",
}
#: The high-level planner's choice (5.3), and the shortest order of the same goals.
GREEDY, AHEAD = "greedy", "look-ahead"
#: Rows with going back to animals that are known (F 5.3.3, 5.3.4).
SURVEY = "search-and-revisit"
#: The same planners where any turn beyond `STOPS_BEYOND` takes the twin's whole time of a turn.
STOPPING = {one: f"{one}-stops" for one in (INFORMATION, ROWS, SWING)}
STOPS_BEYOND = np.radians(30.0)
SUBJECTS = (*SEARCHERS, SURVEY, GREEDY, AHEAD, *STOPPING.values())
#: Its parameters, F (5.2): the exponent, and what the search is worth; an animal that is known to 10 m each
#: way is worth as much. Not printed.
ALPHA, SEARCH_WORTH = 1.0, 200.0
#: Trace of a covariance beyond which an animal is lost, m^2: not known to 10 m each way. Not printed.
LOST_M2 = 200.0
#: For how long animals were not seen at most when the high-level planner is asked, s.
OLDEST_S = 900.0
#: At which shares of the time budget the share found is kept.
STATIONS = 24

#: The camera's reach, the r of F (5.9), m: not printed.
REACH_M = 100.0
#: Grid of the planner, m.
CELL_M = 10.0
#: Between two decisions of a planner, s.
DECISION_S = 3.0
#: How long a search may take, s: what a multicopter's battery allows for.
BUDGET_S = 1200.0


class Tuned(NamedTuple):
    """What was chosen for the planners, on the worlds of seeds 1001 to 1016, which are not judged.

    Of some 50 settings tried without a cost of turns, and some 30 about them with it, that by which all
    animals are found soonest on the mean; for each kind of rows and of planner. Where two were as good as the
    other within that mean's error, the quicker to compute.

    Attributes
    ----------
    sd
        Of the camera's angles as the information planner is told, rad.
    prior
        How far off an animal may be before anything is seen, m.
    looks
        Of the camera, degrees to the side and ahead.
    horizon
        The rest of how steps are chosen.
    down_sd, down_horizon
        The same two where the camera is fixed straight down.
    rows, swing_rows
        Distance between rows, m, with the camera straight down and from side to side.
    swing
        Of the camera in rows, degrees to the side, one image each.
    """

    sd: float = 0.3
    prior: float = 60.0
    looks: tuple[tuple[float, float], ...] = (
        (0.0, 0.0), (25.0, 0.0), (-25.0, 0.0), (45.0, 0.0), (-45.0, 0.0), (0.0, 25.0), (0.0, 45.0),
    )  # fmt: skip
    horizon: Horizon = Horizon(steps=2, fades=0.8)
    down_sd: float = 0.3
    down_horizon: Horizon = Horizon(steps=4, beam=8, fades=0.8)
    rows: float = 32.0
    swing_rows: float = 60.0
    swing: tuple[float, ...] = (15.0, -15.0)


class PlanningScene(NamedTuple):
    """A world and all that every planner is given.

    Attributes
    ----------
    world
        What is searched.
    grid, area_of
        Points (N, 3) m, and of which area each is.
    start
        Where the platform begins.
    sensor, flying
        The camera and what the platform can do.
    walk
        Variance of the animals' walk over a second, each way, m^2.
    first
        Area that the platform begins at.
    """

    world: World
    grid: Array
    area_of: NDArray[np.intp]
    start: Platform
    sensor: SearchSensor
    flying: Flying
    walk: float
    first: int


def draw_scene(seed: int, twin: str) -> PlanningScene:
    """The world of a seed: land, two enclosures, and animals that walk in them.

    Camera, height, speed, sizes of enclosures, how many animals each holds and how they walk are the twin's;
    where the enclosures lie, how they are turned and everything about chance is drawn.
    """
    given = load_twin(twin)
    rng = stream(seed, "world")
    terrain = synthetic_landscape(seed)
    flying = Flying(
        given.flight.airspeed.si,
        given.flight.altitude.si,
        images=int(DECISION_S),
        turn_time=_turn_time(given),
    )
    images = int(BUDGET_S / flying.interval)
    names = rng.choice(sorted(given.enclosures), 2, replace=False)
    areas, animals, of = [], [], []
    for number, (name, side) in enumerate(zip(names, (-1.0, 1.0), strict=True)):
        size = given.enclosures[name]
        length, width = size.length.si, size.width.si
        middle = np.array([rng.uniform(-60.0, 60.0), side * rng.uniform(160.0, 240.0)])
        course = np.pi / 2 + rng.uniform(-0.35, 0.35)
        areas.append(rectangle(float(middle[0]), float(middle[1]), length, width, course))
        count = int(size.animals.number)
        flat = _walks(middle, length, width, course, (images, count), _step_sd(given, flying), rng)
        up = terrain.heights_at(flat.reshape(-1, 2)).reshape(images, count) + given_height(given)
        animals.append(np.concatenate([flat, -up[..., None]], axis=-1))
        of += [number] * count
    world = World(
        terrain, tuple(areas), np.concatenate(animals, axis=1), np.array(of), rng.random((images, len(of)))
    )
    grid, area_of = grid_over(world.areas, terrain, CELL_M)
    first = int(rng.integers(2))
    corner = world.areas[first][int(rng.integers(4))]
    heading = float(np.arctan2(*(world.areas[first].mean(axis=0) - corner)[::-1]))
    start = Platform(corner, heading, look_attitude(heading, 0.0, 0.0))
    half = (given_half(given, "width"), given_half(given, "height"))
    sensor = SearchSensor(*half, sd=Tuned().sd, reach=REACH_M, nearest=CELL_M / 2)
    return PlanningScene(world, grid, area_of, start, sensor, flying, _step_sd(given, flying) ** 2, first)


def given_half(given: TwinParameters, side: str) -> float:
    """Tangent of half an angle of view, F (2.23)."""
    camera = given.camera
    size, focal = (camera.width, camera.fx) if side == "width" else (camera.height, camera.fy)
    return float(size.number / 2 / focal.number)


def given_height(given: TwinParameters) -> float:
    """Of the middle of an animal above the ground, m."""
    return 0.0 if given.animals is None else float(given.animals.height.si)


def _turn_time(given: TwinParameters) -> float:
    """Of the platform, through 180 degrees, s."""
    if given.survey is None:
        raise WildlabError(
            "the twin has no survey", "give one that flies rows, as uav-search", field="survey"
        )
    return float(given.survey.turn_time.si)


def _step_sd(given: TwinParameters, flying: Flying) -> float:
    """Standard deviation of an animal's walk from one image to the next, each way, m."""
    animals = given.animals
    if animals is None:
        return 0.0
    # A new velocity each step of the walk: variances of steps add.
    return float(animals.speed_sd.si * np.sqrt(animals.step.si * flying.interval))


def _walks(
    middle: Array, length: float, width: float, course: float, shape: tuple[int, int], sd: float,
    rng: np.random.Generator,
) -> Array:  # fmt: skip
    """(T, A, 2) random walks that fences reflect, from anywhere in the enclosure (F 7.5.1)."""
    half = np.array([length, width]) / 2
    walk = rng.uniform(-half, half, (shape[1], 2)) + np.cumsum(sd * rng.standard_normal((*shape, 2)), axis=0)
    x, y = (reflected(walk[..., axis], half[axis]) for axis in (0, 1))
    along = np.array([np.cos(course), np.sin(course)])
    return np.asarray(middle + x[..., None] * along + y[..., None] * np.array([-along[1], along[0]]))


def searchers(
    scene: PlanningScene, seed: int, tuned: Tuned | None = None
) -> dict[str, Callable[[], Searcher]]:
    """Each planner by its name, made anew when called."""
    t = tuned or Tuned()
    looks = tuple((float(np.radians(side)), float(np.radians(ahead))) for side, ahead in t.looks)
    order = (scene.first, 1 - scene.first)
    world, flying = scene.world, scene.flying

    def informed(horizon: Horizon, sd: float) -> Searcher:
        sensor = replace(scene.sensor, sd=sd)
        Y = initial_information(len(scene.grid), [t.prior, t.prior, 1.0])
        planner = InformationPlanner(scene.grid, Y, world.terrain, sensor, flying, horizon)
        return SearchByInformation(planner, scene.area_of, scene.walk / flying.interval)

    free = replace(t.horizon, looks=looks)
    down = replace(t.down_horizon, looks=((0.0, 0.0),))
    swing = tuple(np.radians(t.swing))
    return {
        INFORMATION: lambda: informed(free, t.sd),
        FIXED: lambda: informed(down, t.down_sd),
        ROWS: lambda: SearchInRows(world, flying, t.rows, order),
        SWING: lambda: SearchInRows(world, flying, t.swing_rows, order, swing),
        CHANCE: lambda: SearchByChance(world, flying, stream(seed, "random walk")),
    }


def search_all(
    seed: int, twin: str, only: tuple[str, ...] = SEARCHERS
) -> tuple[PlanningScene, dict[str, Searched]]:
    """The world of a seed and what each planner made of it."""
    scene = draw_scene(seed, twin)
    each = searchers(scene, seed)
    return scene, {
        name: search(scene.world, each[name](), scene.start, scene.sensor, scene.flying, scene.grid)
        for name in only
    }


def numbers_of(found: Searched) -> dict[str, float]:
    """What is kept of a search; a time of what was not found is the whole budget."""
    times = np.sort(np.minimum(found.found, BUDGET_S))
    last = np.arange(1, STATIONS + 1) * BUDGET_S / STATIONS
    shares = {f"share_{n + 1}": float((found.found <= at).mean()) for n, at in enumerate(last)}
    return {
        "first_found": float(times[0]),
        "half_found": float(times[(len(times) + 1) // 2 - 1]),
        "all_found": float(times[-1]),
        "mean_found": float(times.mean()),
        "share_found": float(np.isfinite(found.found).mean()),
        "covered": float(found.covered[-1]),
        "weighed": found.asked / found.decisions,
        "decisions": float(found.decisions),
        **shares,
    }


class Situation(NamedTuple):
    """What the high-level planner is asked: animals that are known, and where the search goes on.

    Attributes
    ----------
    positions, covariances
        (m, 2) m and (m, 2, 2) m^2.
    platform, way_point
        (2,) m.
    greedy, ahead
        What comes of choosing by F (5.3) all the time, and the shortest order.
    """

    positions: Array
    covariances: Array
    platform: Array
    way_point: Array
    greedy: Tour
    ahead: Tour


def draw_situation(seed: int, scene: PlanningScene) -> Situation:
    """The animals of the first enclosure, last seen at random times; platform and way point anywhere."""
    rng = stream(seed, "situation")
    of = scene.world.area_of == scene.first
    positions = scene.world.animals[0, of, :2]
    ages = rng.uniform(0.0, OLDEST_S, len(positions))
    covariances = (1.0 + scene.walk * ages)[:, None, None] * np.eye(2)
    spots = scene.grid[scene.area_of == scene.first, :2]
    platform, way_point = spots[rng.choice(len(spots), 2, replace=False)]
    speed = scene.flying.speed
    greedy = greedy_tour(
        positions, covariances, platform, way_point, alpha=ALPHA, c=SEARCH_WORTH, speed=speed, walk=scene.walk
    )
    ahead = shortest_tour(positions, platform, way_point, speed)
    return Situation(positions, covariances, platform, way_point, greedy, ahead)


def survey_rows(seed: int, scene: PlanningScene) -> Surveyed:
    """Rows over the world of a seed, and going back to animals by F (5.2)-(5.3), until all are positioned."""
    order = (scene.first, 1 - scene.first)
    rows = SearchInRows(scene.world, scene.flying, Tuned().rows, order)
    rules = Rules(ALPHA, SEARCH_WORTH, scene.walk / scene.flying.interval, LOST_M2)
    rng = stream(seed, "errors of positions")
    return survey(scene.world, rows, scene.start, scene.sensor, scene.flying, rules, rng)


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One drawn world, searched by every planner, and one choice of the high-level planner in it."""
    scene, found = search_all(seed, twin)
    numbers = {(who, name): value for who, one in found.items() for name, value in numbers_of(one).items()}
    stops = scene._replace(flying=replace(scene.flying, stops_beyond=STOPS_BEYOND))
    each = searchers(stops, seed)
    for who, name in STOPPING.items():
        one = search(stops.world, each[who](), stops.start, stops.sensor, stops.flying, stops.grid[:1])
        numbers[name, "all_found"] = numbers_of(one)["all_found"]
        numbers[name, "share_found"] = numbers_of(one)["share_found"]
    surveyed = survey_rows(seed, scene)
    numbers[SURVEY, "positioned"] = min(surveyed.positioned, BUDGET_S)
    numbers[SURVEY, "all_positioned"] = float(np.isfinite(surveyed.positioned))
    numbers[SURVEY, "most_known"] = float(surveyed.known.max() / scene.world.chance.shape[1])
    numbers[SURVEY, "revisits"] = float(surveyed.revisits)
    numbers[SURVEY, "lost_by_covariance"] = float(surveyed.lost_by_covariance)
    numbers[SURVEY, "lost_by_search"] = float(surveyed.lost_by_search)
    situation = draw_situation(seed, scene)
    for who, tour in ((GREEDY, situation.greedy), (AHEAD, situation.ahead)):
        numbers[who, "tour_time"] = tour.time
        numbers[who, "broken_off"] = float(tour.broken_off)
    return numbers


def check_claims(runs: pd.DataFrame, *, loads: Array) -> dict[str, Check]:
    """What the worlds give for each claim of F, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each world.
    loads
        (N,) share of one core, as the notebook has measured it on some worlds (`timing.planning_cost`).
    """

    of = columns_of(runs)

    def sooner(name: str, other: str, one: str = INFORMATION) -> Check:
        first, second = of(one, name), of(other, name)
        return Check.smaller(first, second, "s")

    greedy, ahead = of(GREEDY, "tour_time"), of(AHEAD, "tour_time")
    return {
        "lower-search-time": sooner("all_found", ROWS),
        "lower-search-time-swing": sooner("all_found", SWING),
        "lower-search-time-fixed": sooner("all_found", ROWS, FIXED),
        "sooner-half": sooner("half_found", ROWS),
        "sooner-than-chance": sooner("all_found", CHANCE),
        "computationally-expensive": Check(measured=np.asarray(loads, float), above=True, unit="of one core"),
        "greedy": Check(measured=greedy / ahead - 1, above=True, first=greedy, second=ahead, unit="s"),
        "lost-in-large-area": Check(true=of(SURVEY, "lost_by_covariance") > 0),
        "zigzag": Check(true=of(GREEDY, "broken_off") > 0),
    }
