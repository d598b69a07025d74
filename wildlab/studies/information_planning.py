"""One drawn world, searched by planners that know the same and fly the same: F 5.2, 5.3, appendix A."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import permutations
from time import process_time
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

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
    rows_at,
    search,
    survey,
)
from wildlab.evaluation.intervals import mean_share_interval, share_interval
from wildlab.geometry.frames import Array
from wildlab.messages.quantities import percent_between
from wildlab.planning.legs import Flying, Leg, Platform, SearchSensor, look_attitude
from wildlab.planning.patterns import rectangle
from wildlab.planning.planner import SEARCH, Horizon, InformationPlanner, best_goal, initial_information
from wildlab.reporting.charts.drawing import (
    Values,
    draw_fences,
    draw_heights,
    draw_way,
    finish,
    fit_map,
    lines_chart,
)
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    VERMILLION,
    map_axes,
    new_figure,
)
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import reflected
from wildlab.studies.uav_coverage import required


class Tour(NamedTuple):
    """A way to a number of goals.

    Attributes
    ----------
    path
        (T, 2) m.
    time
        s until the last goal was reached.
    order
        Goals in the order in which they were reached, `SEARCH` for the way point.
    broken_off
        How often it turned to another goal before the one it was flying to was reached: the zigzag of F
        figure 5.4.
    """

    path: Array
    time: float
    order: tuple[int, ...]
    broken_off: int


#: A tour by choices each second is given up after this, s.
LONGEST_S = 3600.0


def greedy_tour(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike,
    *,
    alpha: float,
    c: float,
    speed: float,
    walk: float,
) -> Tour:
    """What comes of choosing anew by F (5.3) all the time, until each animal and the way point were visited.

    A goal that was reached is taken out: by the letter of (5.2) it would be worth more than all others for as
    long as the platform is there, and it would stay for good.

    Parameters
    ----------
    positions, covariances, platform, way_point, alpha, c
        As `wildlab.planning.planner.utilities` has them. An animal that is reached counts as found where
        it was expected.
    speed
        Of the platform, m/s.
    walk
        By how much variances grow, each way, m^2/s.

    Returns
    -------
    Tour
        Its time is infinite where it was given up.
    """
    at = np.asarray(positions, float).reshape(-1, 2)
    P = np.array(covariances, float).reshape(-1, 2, 2)
    here, end = np.asarray(platform, float).copy(), np.asarray(way_point, float)
    path, order = [here.copy()], list[int]()
    time, broken_off, last = 0.0, 0, None
    while len(order) < len(at) + 1 and time < LONGEST_S:
        there = np.array([one for one in range(len(at)) if one not in order], int)
        goal = best_goal(at[there], P[there], here, None if SEARCH in order else end, alpha=alpha, c=c)
        goal = SEARCH if goal == SEARCH else int(there[goal])
        broken_off += last is not None and goal != last
        aim = end if goal == SEARCH else at[goal]
        away = float(np.hypot(*(aim - here)))
        P += walk * np.eye(2)
        if away <= speed:
            here, last = aim.copy(), None
            time += away / speed
            order.append(goal)
        else:
            here += (aim - here) * (speed / away)
            last, time = goal, time + 1.0
        path.append(here.copy())
    whole = len(order) == len(at) + 1
    return Tour(np.array(path), time if whole else np.inf, tuple(order), broken_off)


def shortest_tour(positions: ArrayLike, platform: ArrayLike, way_point: ArrayLike, speed: float) -> Tour:
    """The quickest way to the same goals, by trying all orders: what a look ahead would have done.

    Parameters
    ----------
    positions
        (m, 2) m.
    platform, way_point
        (2,) m.
    speed
        m/s.

    Returns
    -------
    Tour
    """
    at = np.asarray(positions, float).reshape(-1, 2)
    goals = np.concatenate([at, np.asarray(way_point, float)[None]])
    orders = np.array(list(permutations(range(len(goals)))))
    ways = np.concatenate(
        [np.broadcast_to(np.asarray(platform, float), (len(orders), 1, 2)), goals[orders]], axis=1
    )
    lengths = np.linalg.norm(np.diff(ways, axis=1), axis=-1).sum(axis=1)
    best = int(np.argmin(lengths))
    order = tuple(SEARCH if one == len(at) else int(one) for one in orders[best])
    return Tour(ways[best], float(lengths[best]) / speed, order, 0)


#: The planners: by what is to be learnt, the same with its camera fixed straight down, rows with the camera
#: straight down and from side to side, and by chance.
INFORMATION, FIXED, ROWS, SWING, CHANCE = "information", "information-down", "rows", "rows-swing", "chance"
SEARCHERS = (INFORMATION, FIXED, ROWS, SWING, CHANCE)
#: The high-level planner's choice (5.3), and the shortest order of the same goals.
GREEDY, AHEAD = "greedy", "look-ahead"
#: Rows with going back to animals that are known (F 5.3.3, 5.3.4).
SURVEY = "search-and-revisit"
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


#: What was chosen for the planners, on the worlds of seeds 1001 to 1016, which are not judged. Of some 50
#: settings tried without a cost of turns, and some 30 about them with it, that by which all animals are found
#: soonest on the mean; for each kind of rows and of planner. Where two were as good as the other within that
#: mean's error, the quicker to compute. The first: what the planner by information is told of the camera's
#: angles, rad, and how far off an animal may be before anything is seen, m (standard deviations).
ANGLE_SD, PRIOR_M = 0.3, 60.0
#: Of the free camera, degrees to the side and ahead.
LOOKS_DEG = ((0, 0), (25, 0), (-25, 0), (45, 0), (-45, 0), (0, 25), (0, 45))
#: The rest of how steps are chosen, with the free camera and with one that is fixed straight down.
FREE = Horizon(steps=2, fades=0.8, looks=tuple(tuple(np.radians(one).tolist()) for one in LOOKS_DEG))
DOWN = Horizon(steps=4, beam=8, fades=0.8, looks=((0.0, 0.0),))
#: Distance between rows, m, with the camera straight down and from side to side; and these sides, rad.
ROWS_M, SWING_ROWS_M, SWING_RAD = 32.0, 60.0, (float(np.radians(15.0)), float(np.radians(-15.0)))


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
    walking, turn_time = required(given.animals, "animals"), required(given.survey, "survey").turn_time.si
    flying = Flying(
        given.flight.airspeed.si, given.flight.altitude.si, images=int(DECISION_S), turn_time=turn_time
    )
    # A new velocity each step of the walk: variances of steps add.
    step_sd = float(walking.speed_sd.si * np.sqrt(walking.step.si * flying.interval))
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
        flat = _walks(middle, length, width, course, (images, count), step_sd, rng)
        up = terrain.heights_at(flat.reshape(-1, 2)).reshape(images, count) + walking.height.si
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
    camera = given.camera
    # Tangents of half the angles of view, F (2.23).
    halves = (
        float(camera.width.number / 2 / camera.fx.number),
        float(camera.height.number / 2 / camera.fy.number),
    )
    sensor = SearchSensor(halves, ANGLE_SD, REACH_M, CELL_M / 2)
    return PlanningScene(world, grid, area_of, start, sensor, flying, step_sd**2, first)


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


def searchers(scene: PlanningScene, seed: int) -> dict[str, Callable[[], Searcher]]:
    """Each planner by its name, made anew when called."""
    order = (scene.first, 1 - scene.first)
    world, flying = scene.world, scene.flying

    def informed(horizon: Horizon) -> Searcher:
        Y = initial_information(len(scene.grid), [PRIOR_M, PRIOR_M, 1.0])
        planner = InformationPlanner(scene.grid, Y, world.terrain, scene.sensor, flying, horizon)
        return SearchByInformation(planner, scene.area_of, scene.walk / flying.interval)

    return {
        INFORMATION: lambda: informed(FREE),
        FIXED: lambda: informed(DOWN),
        ROWS: lambda: SearchInRows(world, flying, ROWS_M, order),
        SWING: lambda: SearchInRows(world, flying, SWING_ROWS_M, order, SWING_RAD),
        CHANCE: lambda: SearchByChance(world, flying, stream(seed, "random walk")),
    }


def search_all(
    seed: int, twin: str, only: tuple[str, ...] = SEARCHERS
) -> tuple[PlanningScene, dict[str, Searched]]:
    """The world of a seed and what each planner made of it."""
    scene = draw_scene(seed, twin)
    each = searchers(scene, seed)
    return scene, {
        name: search(scene.world, each[name](), scene.start, scene.sensor, scene.flying) for name in only
    }


def numbers_of(found: Searched) -> dict[str, float]:
    """What is kept of a search; a time of what was not found is the whole budget."""
    times = np.sort(np.minimum(found.found, BUDGET_S))
    last = np.arange(1, STATIONS + 1) * BUDGET_S / STATIONS
    return {
        "half_found": times[(len(times) + 1) // 2 - 1],
        "all_found": times[-1],
        "share_found": np.isfinite(found.found).mean(),
        **{f"share_{n + 1}": (found.found <= at).mean() for n, at in enumerate(last)},
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
    rows = SearchInRows(scene.world, scene.flying, ROWS_M, order)
    rules = Rules(ALPHA, SEARCH_WORTH, scene.walk / scene.flying.interval, LOST_M2)
    rng = stream(seed, "errors of positions")
    return survey(scene.world, rows, scene.start, scene.sensor, scene.flying, rules, rng)


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One drawn world, searched by every planner, and one choice of the high-level planner in it."""
    scene, found = search_all(seed, twin)
    numbers = {(who, name): value for who, one in found.items() for name, value in numbers_of(one).items()}
    numbers[SURVEY, "lost_by_covariance"] = survey_rows(seed, scene).lost_by_covariance
    situation = draw_situation(seed, scene)
    for who, tour in ((GREEDY, situation.greedy), (AHEAD, situation.ahead)):
        numbers[who, "tour_time"] = tour.time
        numbers[who, "broken_off"] = tour.broken_off
    return numbers


#: Over how many worlds at most planning is timed.
TIMED = 10


class _Timed:
    """A planner, and how much of the processor's time it takes to choose and to add what was seen."""

    def __init__(self, searcher: Searcher) -> None:
        self.searcher = searcher
        self.seconds: list[float] = []

    def next_leg(self, platform: Platform, open_areas: NDArray[np.bool_]) -> Leg:
        """As `Searcher` has it."""
        began = process_time()
        chosen = self.searcher.next_leg(platform, open_areas)
        self.seconds.append(process_time() - began)
        return chosen


def planning_cost(seeds: Iterable[int], twin: str) -> pd.DataFrame:
    """What planning by information takes of the processor, without the world and the camera about it.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    twin
        As for `trial`.

    Returns
    -------
    DataFrame
        A row for each seed: ``decision``, s for each decision on the mean, and ``load``, share of one core
        over the search. The first decision is left out: it loads what is compiled.
    """
    rows = {}
    for seed in list(seeds)[:TIMED]:
        scene = draw_scene(seed, twin)
        timed = _Timed(searchers(scene, seed)[INFORMATION]())
        found = search(scene.world, timed, scene.start, scene.sensor, scene.flying)
        spent = timed.seconds[1:]
        flown = found.at[-1] - found.at[scene.flying.images - 1]
        rows[seed] = {"decision": float(np.mean(spent)), "load": float(np.sum(spent) / flown)}
    return pd.DataFrame.from_dict(rows, orient="index")


COLOURS = {INFORMATION: BLUE, FIXED: PURPLE, ROWS: ORANGE, SWING: GREEN, CHANCE: GREY}
_STYLES = {INFORMATION: "-", FIXED: "--", ROWS: "-", SWING: "-", CHANCE: ":"}


def search_map(scene: PlanningScene, found: Searched, who: str) -> Figure:
    """The path of one planner over one world, until all were found or the time was up."""
    fig, ax = new_figure(5.6, 3.9)
    draw_heights(ax, scene.world.terrain, 10.0, every=4)
    draw_fences(ax, scene.world.areas)
    path = np.concatenate([scene.start.north_east[None], found.p_nc[:, :2]])
    draw_way(ax, path, COLOURS[who], width=1.3)
    ax.plot(*path[0, ::-1], "s", color=INK, ms=6, label="start")
    late = np.isinf(found.found)
    rows = rows_at(np.where(late, found.at[-1], found.found), scene.flying.interval).astype(int)
    places = scene.world.animals[rows, np.arange(len(rows))]
    for name, which, fill in (
        ("animal, where it was found", ~late, VERMILLION), ("not found, last position", late, "none")
    ):  # fmt: skip
        if which.any():
            ax.plot(*places[which, 1::-1].T, "o", ms=6, mec=INK, mew=1.0, mfc=fill, label=name)
    fit_map(ax, np.concatenate(scene.world.areas), 45.0)
    map_axes(ax)
    return finish(fig)


def share_over_time(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Share of the animals found over time, mean over worlds, with its 95 % interval."""
    at, lines = np.arange(STATIONS + 1) * BUDGET_S / STATIONS / 60, {}
    for who in SEARCHERS:
        shares = np.column_stack(
            [0 * runs[who, "share_1"], *(runs[who, f"share_{n + 1}"] for n in range(STATIONS))]
        )
        ends = (
            np.transpose([mean_share_interval(column)[1:] for column in shares.T])
            if len(shares) > 1
            else None
        )
        lines[names[who]] = Values(shares.mean(axis=0), ends, COLOURS[who], _STYLES[who])
    fig = lines_chart(at, lines, "time (min)", "share of animals found", size=(5.6, 4.6), ticks=False)
    fig.axes[0].set(xlim=(0, at[-1]), ylim=(0, 1.02))
    return fig


def planners_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Medians over worlds of times (min), and in how many worlds the planner by information is sooner."""
    own = runs[INFORMATION, "all_found"].to_numpy(float)
    rows = []
    for who in SEARCHERS:
        times = runs[who, "all_found"].to_numpy(float)
        sooner = share_interval(int((own < times).sum()), int((~np.isnan(own + times)).sum()))
        missed = int((runs[who, "share_found"] < 1).sum())
        rows.append(
            {
                "planner": names[who],
                "half": _median_minutes(runs[who, "half_found"]),
                "all": _median_minutes(runs[who, "all_found"]),
                "missed": f"{missed} of {len(runs)}",
                "sooner": "" if who == INFORMATION else percent_between(sooner, 0),
            }
        )
    return pd.DataFrame(rows)


def _median_minutes(seconds: pd.Series) -> str:
    """A median in minutes; of searches that ended before it, that they did."""
    middle = float(seconds.median())
    return f"over {BUDGET_S / 60:.0f}" if middle >= BUDGET_S - 1e-6 else f"{middle / 60:.1f}"
