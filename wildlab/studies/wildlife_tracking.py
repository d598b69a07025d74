"""Animals that walk in five enclosures, followed from a gondola and from a multicopter: F 4, 5.3, 7.5, 8.3.

F shows maps of single simulations (figures 5.4, 7.13, 7.14, 7.19) and says in words what came of them. Here
worlds are drawn: land, animals, errors of the pose and of the detections; each is followed by F's particle
filter with and without its negative update, and by a Kalman filter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from time import process_time
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.animal_images import Detector, Images, take_images
from wildlab.analysis.animal_trackers import (
    Aircraft,
    KalmanTracker,
    Known,
    ParticleTracker,
    Patrolled,
    TrackedAnimals,
    Tracker,
    Visits,
    found_on_visits,
    next_lap,
    out_of_sight,
    patrol,
    sight_numbers,
    track_animals,
    turns,
)
from wildlab.analysis.plan_coverage import ExecutionErrors, displaced, drawn_errors
from wildlab.evaluation.intervals import mean_interval, mean_share_interval, share_interval
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain
from wildlab.messages.quantities import percent_between
from wildlab.planning.courses import fly, follow_terrain
from wildlab.planning.coverage import walks
from wildlab.planning.gimbal import GimbalAngles, camera_on_course, swing_roll
from wildlab.planning.patterns import Pattern, check_area, contains, lawn_mowers
from wildlab.reporting.charts.drawing import draw_dots, draw_fences, draw_way, finish, fit_map, spread_points
from wildlab.reporting.figures import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    ellipse,
    map_axes,
    new_figure,
)
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.studies import gondola_coverage as gondola
from wildlab.studies import uav_coverage as uav
from wildlab.studies.page import Shown, interval_words
from wildlab.tracking.motion import Motion
from wildlab.tracking.particles import Inside, walk_of

#: The platforms; and by what animals are followed.
GONDOLA, UAV = "gondola", "uav"
NEGATIVE, POSITIVE, KALMAN = "negative", "without-negative", "kalman"
FILTERS = (NEGATIVE, POSITIVE, KALMAN)
#: The same enclosures with the high-level planner, and rows alone flown by the same means.
REVISITS, ROWS = "uav-revisits", "uav-rows"
#: F 4.2.1, figure 4.1.
PARTICLES = 500
#: F 4.3.1 has a design parameter alpha and prints none.
GATE = 0.99
#: The gondola's gimbal (F 7.5.2: the adaptive roll rotation; the limit is that of F 7.5.1).
STRATEGY = "adaptive-60"
LAPS = 2
#: Images that are looked at, Hz: the camera turns by about an image's width between two.
RATES = {GONDOLA: 2.0, UAV: 1.0}
#: Of F (5.2), not printed: an animal not known to 5 m each way is worth as much as the search, and none that
#: is known better is worth a visit; two swings of the camera are patience enough.
VISITS = Visits(alpha=1.0, c=50.0, worth_m2=50.0, patience=16.0)
ROWS_ALONE = VISITS._replace(worth_m2=float("inf"))


#: Between two images of a flight that its tracks steer, s; and how many of these lie between two at which the
#: tracks are held against the animals. Chosen.
PATROL_S, EVERY = 1.0, 10


class World(NamedTuple):
    """Land, animals and a platform over it.

    Attributes
    ----------
    twin
        Whose platform, camera and enclosures.
    land
        The ground.
    fences
        (E) each (K, 2) m.
    lives
        (E,) animals in each.
    images
        Of `LAPS` laps.
    lap
        How long one takes, s.
    detector, errors
        Of the camera and of its pose.
    motion
        How animals walk, as the filters take it.
    """

    twin: TwinParameters
    land: Terrain
    fences: list[Array]
    lives: NDArray[np.intp]
    images: Images
    lap: float
    detector: Detector
    errors: ExecutionErrors
    motion: Motion


def detector_of(twin: TwinParameters) -> Detector:
    """What becomes of an animal in an image of the twin."""
    a = uav.required(twin.animals, "animals")
    return Detector(a.detected.number, twin.camera.marking_sd.si, a.border.si, a.height.si)


def insides(fences: Iterable[Array]) -> list[Inside]:
    """Each fence as the particle filter takes it."""
    return [partial(contains, check_area(one, "fence")) for one in fences]


def herds(twin: TwinParameters, fences: list[Array], times: Array, seed: int) -> Array:
    """(T, A, 2) m: the animals of all enclosures, one after the other, on their walks (F (4.5))."""
    a = uav.required(twin.animals, "animals")
    each = [
        walks(fence, times, int(one.animals.number), a.speed_sd.si, a.step.si, stream(seed, f"walk {k}"))
        for k, (fence, one) in enumerate(zip(fences, twin.enclosures.values(), strict=True))
    ]
    return np.swapaxes(np.concatenate(each), 0, 1)


class Lap(NamedTuple):
    """One lap: times (T,) s, headings (T,) rad, nominal poses, and how long it takes, s."""

    times: Array
    headings: Array
    poses: CameraPoses
    lap: float


def gondola_way(twin: TwinParameters, land: Terrain, fences: list[Array], seed: int, rate: float) -> Lap:
    """Once round with the adaptive roll rotation (F 7.5.2)."""
    there = gondola.ride(twin, land, rate, 1.0)
    poses = gondola.poses_of(STRATEGY, twin, land, fences, there, seed)
    return Lap(there.times, there.headings, poses, there.duration)


def rolling(twin: TwinParameters) -> Callable[[Array], GimbalAngles]:
    """The multicopter's gimbal: from side to side about roll (F 7.5.1)."""
    g = uav.required(twin.gimbal, "gimbal")
    return lambda times: swing_roll(times, g.limit.si, 4 * g.limit.si / g.period.si)


def uav_way(twin: TwinParameters, land: Terrain, fences: list[Array], rate: float) -> Lap:
    """Rows over all enclosures, and back, 50 m above the ground (F 7.5.1)."""
    pattern = rows_of(twin, fences)
    s = uav.required(twin.survey, "survey")
    course = fly(pattern, twin.flight.airspeed.si, turn_time=s.turn_time.si)
    times = np.arange(0.0, course.duration, 1 / rate)
    places, headings = course.at(times)
    way = follow_terrain(land, pattern.waypoints, twin.flight.altitude.si, uav.CLIMB)
    p = np.column_stack([places, -way.at(course.distances(times))])
    poses = camera_on_course(uav.camera_of(twin), p, headings, rolling(twin)(times))
    return Lap(times, headings, poses, course.duration)


def rows_of(twin: TwinParameters, fences: list[Array]) -> Pattern:
    """The lawn mower pattern over all enclosures."""
    s, speed = uav.required(twin.survey, "survey"), twin.flight.airspeed.si
    along = [one.course.si for one in twin.enclosures.values()]
    return lawn_mowers(
        fences, s.row_distance.si, directions=along, turn=speed * s.turn_time.si, back=True
    )  # fmt: skip


def draw_world(platform: str, twin_name: str, seed: int) -> World:
    """Land, animals and images of one seed, from `GONDOLA` or `UAV`.

    Parameters
    ----------
    platform
        Which way is flown.
    twin_name
        Of the platform.
    seed
        Of all that is drawn.
    """
    twin, rate = load_twin(twin_name), RATES[platform]
    land = uav.land_of(seed)
    fences = uav.fences_of(twin, len(twin.enclosures))
    if platform == GONDOLA:
        way, errors = gondola_way(twin, land, fences, seed, rate), gondola.errors_of_execution(twin)
    else:
        way, errors = uav_way(twin, land, fences, rate), uav.errors_of_execution(twin)
    rows = np.tile(np.arange(len(way.times)), LAPS)
    times = (way.times + way.lap * np.arange(LAPS)[:, None]).ravel()
    nominal, headings = way.poses.take(rows), way.headings[rows]
    rng = stream(seed, f"execution, {platform}")
    true = displaced(nominal, headings, *drawn_errors(len(headings), errors, 1 / rate, rng))
    detector = detector_of(twin)
    truth = herds(twin, fences, times, seed)
    images = take_images(
        land,
        nominal,
        true,
        headings,
        times,
        truth,
        errors,
        detector,
        stream(seed, f"detections, {platform}"),
    )
    a = uav.required(twin.animals, "animals")
    lives = np.array([int(one.animals.number) for one in twin.enclosures.values()])
    return World(
        twin, land, fences, lives, images, way.lap, detector, errors,
        walk_of(a.speed_sd.si, a.step.si),
    )  # fmt: skip


def particles_of(world: World, seed: int, negative: bool) -> ParticleTracker:
    """F's particle filter, which knows how animals walk, their fences, and what the camera shows."""
    return ParticleTracker(
        world.motion, insides(world.fences), stream(seed, "particles"), particles=PARTICLES,
        gate_probability=GATE, negative=negative,
    )  # fmt: skip


def tracker_of(name: str, world: World, seed: int) -> Tracker:
    """One of `FILTERS`."""
    if name == KALMAN:
        return KalmanTracker(world.motion, GATE)
    return particles_of(world, seed, name == NEGATIVE)


def run_filter(name: str, world: World, seed: int) -> TrackedAnimals:
    """A world followed by one of `FILTERS`."""
    return track_animals(
        world.images, world.land, world.detector, tracker_of(name, world, seed), world.motion
    )


def patrol_times(world: World) -> Array:
    """When the images of a search are taken, (T,) s."""
    return np.arange(0.0, LAPS * world.lap, PATROL_S)


def run_patrol(world: World, herd: Array, seed: int, visits: Visits) -> Patrolled:
    """One search of all enclosures in rows, with visits to animals that are known (F 5.3).

    ``herd`` (T, A, 2): where they are at `patrol_times`, m.
    """
    twin = world.twin
    pattern = rows_of(twin, world.fences)
    aircraft = Aircraft(
        uav.camera_of(twin), rolling(twin), twin.flight.altitude.si, twin.flight.airspeed.si, world.errors,
        world.detector,
    )  # fmt: skip
    return patrol(
        world.land, aircraft, pattern.rows.reshape(-1, 2), np.repeat(pattern.area, 2), world.lives,
        patrol_times(world), herd, particles_of(world, seed, True), visits, stream(seed, "patrol"),
    )  # fmt: skip


def filter_numbers(world: World, followed: TrackedAnimals) -> dict[str, float]:
    """What is compared of a filter, by name."""
    images = world.images
    later = next_lap(followed.found, images.times, world.lap)
    own = [np.sqrt(one.own_before / 2) for one in later if np.isfinite(one.own_before)]
    right = sum(one.track == one.own for one in later)
    away = out_of_sight(followed.known, followed.found, images.times, images.truth)
    return {
        **sight_numbers(away),
        "later": len(later),
        "right": right,
        "right_share": right / len(later) if later else np.nan,
        "sd_later": np.median(own) if own else np.nan,
    }


def platform_numbers(world: World) -> dict[str, float]:
    """What the images of a platform's first lap show of the animals."""
    images = world.images
    first = images.in_view[images.times < world.lap]
    seconds = first.sum(axis=0) * float(np.median(np.diff(images.times)))
    seen = seconds > 0
    return {
        "at_once": first.mean(),
        "in_view": np.median(seconds[seen]) if seen.any() else np.nan,
        "by_fence_alone": np.sqrt(np.mean([_uniform_trace(one) / 2 for one in world.fences])),
    }


def _uniform_trace(fence: Array) -> float:
    """Trace of the covariance of a place anywhere in a rectangle, m^2."""
    sides = np.linalg.norm(np.diff(fence[:3], axis=0), axis=1)
    return float((sides**2).sum() / 12)


def patrol_numbers(world: World, herd: Array, flown: Patrolled, until: float) -> dict[str, float]:
    """What is compared of a search with visits and of one without, by name.

    Animals out of sight count while their enclosure is searched, which is when they may be visited, and up to
    ``until``, s: when the shorter of the two searches ended.
    """
    done = np.minimum(np.repeat(flown.done, world.lives), until)
    away = out_of_sight(flown.known[::EVERY], flown.found, flown.times, herd, done)
    back = found_on_visits(flown)
    return {
        **sight_numbers(away),
        "fall": np.median([one.after / one.before for one in back]) if back else np.nan,
        "grew": np.mean([one.before > one.after_last for one in back]) if back else np.nan,
        "minutes": float(flown.times[-1]) / 60,
        "turns": turns(flown),
        "visits": len(back),
        "given_up": len(flown.given_up),
        "done": np.isfinite(flown.done).mean(),
        "animals_share": len({one.animal for one in flown.found}) / herd.shape[1],
    }


class Runs(NamedTuple):
    """All that is computed of one seed.

    Attributes
    ----------
    worlds
        By platform.
    followed
        By platform and filter.
    patrolled
        By `REVISITS` and `ROWS`.
    """

    worlds: dict[str, World]
    followed: dict[tuple[str, str], TrackedAnimals]
    patrolled: dict[str, Patrolled]


def all_runs(seed: int, twin: str, second: str) -> tuple[Runs, dict[tuple[str, str], float]]:
    """Everything of one seed, and the numbers of `trial`."""
    worlds = {name: draw_world(name, source, seed) for name, source in ((GONDOLA, twin), (UAV, second))}
    followed = {
        (name, one): run_filter(one, world, seed) for name, world in worlds.items() for one in FILTERS
    }
    uav_world = worlds[UAV]
    herd = herds(uav_world.twin, uav_world.fences, patrol_times(uav_world), seed)
    patrolled = {
        name: run_patrol(uav_world, herd, seed, visits)
        for name, visits in ((REVISITS, VISITS), (ROWS, ROWS_ALONE))
    }
    numbers: dict[tuple[str, str], float] = {}
    for name, world in worlds.items():
        numbers |= {(name, key): value for key, value in platform_numbers(world).items()}
    for (name, one), run in followed.items():
        found = filter_numbers(worlds[name], run)
        numbers |= {(f"{name}-{one}", key): value for key, value in found.items()}
    both = min(float(flown.times[-1]) for flown in patrolled.values())
    for name, flown in patrolled.items():
        found = patrol_numbers(uav_world, herd, flown, both)
        numbers |= {(name, key): value for key, value in found.items()}
    return Runs(worlds, followed, patrolled), numbers


def trial(seed: int, *, twin: str, second: str) -> dict[tuple[str, str], float]:
    """All platforms and filters over the world of one seed.

    Parameters
    ----------
    seed
        Of land, animals, errors and detections.
    twin, second
        Of the gondola and of the multicopter.
    """
    return all_runs(seed, twin, second)[1]


#: Numbers of `searches_table` and their units; those without one are shares.
_OF_SEARCH = {"minutes": "min", "turns": "", "visits": "", "given_up": "", "rmse": "m", "sd": "m"}
_SHARES = ("done", "animals_share")


def mean_cell(values: pd.Series, unit: str = "") -> str:
    """Mean over worlds of what cannot be negative, with its 95 % interval."""
    return interval_words(mean_interval(values), 1, unit, least=0.0)


def count_cell(count: int, of: int) -> str:
    """A count, with the interval of its share.

    Examples
    --------
    >>> count_cell(8, 10), count_cell(0, 0)
    ('8 of 10 (49 to 94 %)', 'none of 0')
    """
    if not of:
        return "none of 0"
    found = share_interval(count, of)
    return f"{count} of {of} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def tracks_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of animals out of sight, a row for each platform and filter."""
    rows = []
    for one in (f"{platform}-{each}" for platform in (GONDOLA, UAV) for each in FILTERS):
        cells = {name: mean_cell(runs[one, name]) for name in ("rmse", "sd", "anees")}
        right = count_cell(int(runs[one, "right"].sum()), int(runs[one, "later"].sum()))
        rows.append({"filter": names[one], **cells, "right": right})
    return pd.DataFrame(rows)


def searches_table(runs: pd.DataFrame, quantities: Mapping[str, str]) -> pd.DataFrame:
    """Means over worlds of searches with and without visits to known animals, a row for each number."""
    cells = {name: {one: mean_cell(runs[one, name], unit) for one in (REVISITS, ROWS)}
             for name, unit in _OF_SEARCH.items()}  # fmt: skip
    cells |= {
        name: {one: percent_between(mean_share_interval(runs[one, name]), 0) for one in (REVISITS, ROWS)}
        for name in _SHARES
    }
    return pd.DataFrame([{"what": quantities[name]} | row for name, row in cells.items()])


#: Images of each world that are timed, and worlds at most: so many that a claim can hold.
IMAGES, TIMED = 600, 40


def processor_ratio(seeds: Iterable[int], second: str) -> Array:
    """How many times the Kalman filter's processor time the particle filter takes, on the same images.

    Parameters
    ----------
    seeds
        Of the worlds; the first `TIMED` are taken.
    second
        The twin of the multicopter.

    Returns
    -------
    ndarray
        (N,), one of each world; without the negative update, so that both look at the same images.
    """
    ratios = []
    for seed in list(seeds)[:TIMED]:
        world = draw_world(UAV, second, seed)
        images, spent = world.images.first(IMAGES), []
        for name in (POSITIVE, KALMAN):
            tracker = tracker_of(name, world, seed)
            began = process_time()
            track_animals(images, world.land, world.detector, tracker, world.motion)
            spent.append(process_time() - began)
        ratios.append(spent[0] / spent[1])
    return np.array(ratios)


#: Probability that the drawn ellipses hold, as in F figure 4.1.
HELD = 0.95
#: So many images after a visit has found its animal is the last of the maps of it.
AFTER = 60


def figures(runs: Runs, table: pd.DataFrame, names: Mapping[str, str]) -> list[Shown]:
    """All figures of the page; that of a visit only where the world has one.

    Parameters
    ----------
    runs
        Of the world shown.
    table
        Of all worlds.
    names
        Words for platforms.
    """
    gondola = runs.worlds[GONDOLA], runs.followed[GONDOLA, NEGATIVE]
    multicopter = runs.worlds[UAV], runs.followed[UAV, NEGATIVE]
    found = {
        "fig-7-19b": tracks_map(*gondola, 1.0),
        "fig-7-19a": tracks_map(*gondola, 0.5),
        "fig-7-13": tracks_map(*multicopter, 1.0),
        "negative": negative_differences(table, names),
        "fig-7-14": visit_maps(runs.worlds[UAV], runs.patrolled[REVISITS]),
    }
    return [Shown(fig, name) for name, fig in found.items() if fig is not None]


def tracks_map(world: World, followed: TrackedAnimals, share: float) -> Figure:
    """Animals, tracks and the path up to a share of the first lap."""
    fig, ax = new_figure(5.9, 5.2)
    times = world.images.times
    known = _at(followed.known, times, share * world.lap)
    places = world.images.truth[known.image]
    seen = np.isin(np.arange(len(places)), [one.animal for one in followed.found if one.image <= known.image])
    way = world.images.poses.p_nc[: known.image + 1, :2]
    _ground(ax, world, way)
    _tracks(ax, known, np.ones(len(known.mean), bool), BLUE, "track of an animal")
    for name, which, fill in (
        ("animal, detected", seen, VERMILLION), ("animal, not detected yet", ~seen, "none")
    ):  # fmt: skip
        ax.plot(*places[which, ::-1].T, "o", ms=4.5, mec=INK, mew=0.9, mfc=fill, label=name)
    # Whatever an ellipse reaches to.
    fit_map(ax, np.concatenate([*world.fences, way]), 25.0)
    map_axes(ax)
    return finish(fig)


def _at(known: list[Known], times: Array, time: float) -> Known:
    return known[int(np.argmin([abs(times[one.image] - time) for one in known]))]


def _ground(ax: Axes, world: World, way: Array) -> None:
    draw_fences(ax, world.fences)
    ax.plot([], [], color=INK, label="fence of an enclosure")
    draw_way(ax, way, GREY, "path so far", width=1.0)
    ax.plot(*way[-1, 1::-1], "^", color=INK, ms=7, label="the camera now")


def _tracks(
    ax: Axes, known: Known, which: NDArray[np.bool_], color: str, name: str, width: float = 1.3
) -> None:
    for mean, covariance in zip(known.mean[which], known.covariance[which], strict=True):
        ellipse(ax, mean[::-1], covariance[::-1, ::-1], HELD, color=color, lw=width)
    ax.plot([], [], color=color, lw=width, label=name)


def visit_rows(flown: Patrolled) -> tuple[int, int] | None:
    """Of the visit after which the covariance fell furthest: its first image, and that which found it.

    None where no visit found its animal.
    """
    best: tuple[float, int, int] | None = None
    for one in flown.found:
        if flown.goal[one.image] != one.track or not np.isfinite(one.before):
            continue
        first = one.image
        while first > 0 and flown.goal[first - 1] == one.track:
            first -= 1
        if best is None or one.before - one.after > best[0]:
            best = (one.before - one.after, first, one.image)
    return None if best is None else best[1:]


def visit_maps(world: World, flown: Patrolled) -> Figure | None:
    """Before a visit, as it finds its animal, and when the search goes on (F figures 5.4 and 7.14)."""
    rows = visit_rows(flown)
    if rows is None:
        return None
    first, found = rows
    track = int(flown.goal[found])
    later = min(found + AFTER, len(flown.times) - 1)
    waited = f"{flown.times[later] - flown.times[found]:.0f} s later"
    fig, axes = new_figure(5.9, 9.0, rows=3)
    middle = flown.known[found].mean[flown.known[found].identity == track][0]
    for ax, row, what in zip(
        axes, (max(first - 1, 0), found, later), ("Before the visit", "Seen again", waited), strict=True
    ):
        known = flown.known[row]
        mine = known.identity == track
        _ground(ax, world, flown.p_nc[: row + 1, :2])
        _tracks(ax, known, mine, VERMILLION, "track of the animal visited", 2.0)
        _tracks(ax, known, ~mine, BLUE, "other tracks")
        own = known.covariance[mine]
        sd = float(np.sqrt(np.trace(own[-1]) / 2)) if len(own) else np.nan
        ax.set(xlim=(middle[1] - 160, middle[1] + 160), ylim=(middle[0] - 95, middle[0] + 95))
        map_axes(ax, scale_bar=ax is axes[-1], east="east (m)" if ax is axes[-1] else "")
        ax.set_title(f"{what}: SD {sd:.1f} m")
    return finish(fig)


def negative_differences(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """What the negative update changes, world by world."""
    fig, axes = new_figure(5.9, 3.8, columns=2, sharey=True)
    platforms = {GONDOLA: BLUE, UAV: ORANGE}
    for ax, name, label in zip(axes, ("sd", "rmse"), ("Predicted SD", "RMS error"), strict=True):
        for place, (platform, color) in enumerate(platforms.items()):
            one, other = f"{platform}-{NEGATIVE}", f"{platform}-{POSITIVE}"
            values = (runs[one, name] - runs[other, name]).dropna().to_numpy(float)
            draw_dots(ax, place + spread_points(len(values), 0.16), values, color, size=8)
            if len(values) > 1:
                found = mean_interval(values)
                bar = [[found.estimate - found.low], [found.high - found.estimate]]
                ax.errorbar(place + 0.3, found.estimate, bar, fmt="D", color=INK, ms=5, capsize=4)
        ax.axhline(0, color=GREY, lw=1.0)
        ax.set(title=label, xlim=(-0.5, 1.6), xticks=[0, 1], xticklabels=[names[one] for one in platforms])
    return finish(fig, ylabel="with less without (m)")
