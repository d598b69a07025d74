"""Rows over five enclosures at two heights, the camera straight down or turning about yaw: what is covered.

F 7.5.1 shows four maps (figure 7.12) and prints no number of them. Here each is flown over land that is drawn
for each seed, since F's map is not public.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from wildlab.analysis.plan_coverage import ExecutionErrors, Looks, as_planned
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import mean_share_interval
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain
from wildlab.messages.quantities import percent_between
from wildlab.planning.courses import Course, fly, follow_terrain
from wildlab.planning.coverage import Coverage, first_seen, nodes_in, see, walks
from wildlab.planning.gimbal import camera_on_course, look_down, swing_yaw
from wildlab.planning.patterns import lawn_mowers
from wildlab.reporting.charts.drawing import Values, draw_fences, draw_way, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import EAST_M, NORTH_M, synthetic_landscape
from wildlab.simulation.manifest import twin_manifest
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.target_motion import enclosure_corners

Part = TypeVar("Part")


class Case(NamedTuple):
    """Height above ground and row distance, metres; if and how much faster the camera swings."""

    height: float
    rows: float
    yaw: bool
    faster: float = 1.0


#: F figure 7.12 (a) to (d).
DOWN, YAW, LOW, LOW_CLOSE = "down-60m-25m", "yaw-60m-25m", "yaw-30m-25m", "yaw-30m-10m"
CASES = {
    DOWN: Case(60.0, 25.0, False),
    YAW: Case(60.0, 25.0, True),
    LOW: Case(30.0, 25.0, True),
    LOW_CLOSE: Case(30.0, 10.0, True),
}
#: A swing that keeps pace: from half the height a swing sees half as much of the way.
LOW_FASTER = "yaw-30m-25m-faster"
MORE = {LOW_FASTER: Case(30.0, 25.0, True, faster=2.0)}
#: Row distances at which animals that move are looked for, the camera down from 60 m.
SPACINGS = (25.0, 40.0, 60.0)
#: Chosen: an animal of 1.5 m; 10 ms is a usual time constant of a microbolometer; a quarter of an animal's
#: length; animals down to a dozen pixels; r of (5.9) where these are few.
LOOKS = Looks(size=1.5, exposure=0.01, blur_share=0.25, furthest=150.0, range_scale=150.0)
#: Metres up or down for each metre of way: what a multicopter climbs and sinks at this speed. Chosen.
CLIMB = 0.4
#: Animals that walk in each enclosure, for the share that is missed.
WALKERS = 60


class Flown(NamedTuple):
    """A course over terrain, with the camera's poses at evenly spaced times."""

    course: Course
    times: Array
    poses: CameraPoses


def land_of(seed: int) -> Terrain:
    """Land of the size of F's map and 50 m more on each side, for the ways and views that leave it."""
    return synthetic_landscape(seed, north=NORTH_M + 100, east=EAST_M + 100)


def camera_of(twin: TwinParameters) -> Camera:
    """The twin's camera as its sheet states it."""
    return twin_manifest(twin, 0).geometry_camera()


def required(part: Part | None, name: str) -> Part:
    """A part of a twin without which there is nothing to compute.

    Raises
    ------
    WildlabError
        Where the twin has none.
    """
    if part is None:
        raise WildlabError("the twin has none", "name a twin that searches enclosures", field=name)
    return part


def fences_of(twin: TwinParameters, fields: int) -> list[Array]:
    """The first so many of the twin's enclosures."""
    return [enclosure_corners(one) for one in twin.enclosures.values()][:fields]


def errors_of_execution(twin: TwinParameters) -> ExecutionErrors:
    """How far off its plan a flight is: the autopilot's pose, and how well it keeps to its course."""
    a, f = twin.autopilot, twin.flight
    return ExecutionErrors(
        float(np.hypot(a.horizontal_sd.si, f.track_sd.si)),
        float(np.hypot(a.vertical_sd.si, f.altitude_sd.si)),
        a.position_correlation_time.si,
        a.roll_sd.si,
        a.pitch_sd.si,
        a.yaw_sd.si,
        a.attitude_correlation_time.si,
    )


def plan(twin: TwinParameters, land: Terrain, case: Case, fields: int, rate: float) -> Flown:
    """The course of a case, its heights above ground kept, and where the camera looks at ``rate`` (Hz)."""
    speed, stop = twin.flight.airspeed.si, required(twin.survey, "survey").turn_time.si
    along = [one.course.si for one in twin.enclosures.values()][:fields]
    pattern = lawn_mowers(fences_of(twin, fields), case.rows, directions=along, turn=speed * stop, back=True)
    course = fly(pattern, speed, turn_time=stop)
    times = np.arange(0.0, course.duration, 1 / rate)
    places, headings = course.at(times)
    way = follow_terrain(land, pattern.waypoints, case.height, CLIMB)
    p = np.column_stack([places, -way.at(course.distances(times))])
    angles = look_down(times)
    if case.yaw:
        g = required(twin.gimbal, "gimbal")
        angles = swing_yaw(times, g.limit.si, case.faster * 4 * g.limit.si / g.period.si, g.tilt.si)
    return Flown(course, times, camera_on_course(camera_of(twin), p, headings, angles))


def trial(seed: int, *, twin: str, fields: int, rate: float) -> dict[tuple[str, str], float]:
    """All cases over the land of one seed.

    Parameters
    ----------
    seed
        Of land and animals.
    twin
        Whose enclosures, camera, gimbal and speed it is.
    fields
        How many of its enclosures.
    rate
        Images that are looked at for each second.
    """
    return all_runs(seed, twin, fields, rate)[1]


def all_runs(
    seed: int, twin: str, fields: int, rate: float
) -> tuple[dict[str, tuple[Flown, Coverage]], dict[tuple[str, str], float]]:
    """Every one of `CASES` and `MORE` and what it covers, by name, and the numbers of `trial`."""
    parameters = load_twin(twin)
    land = land_of(seed)
    inside = nodes_in(land, fences_of(parameters, fields)) >= 0
    runs = {}
    for name, case in (CASES | MORE).items():
        flown = plan(parameters, land, case, fields, rate)
        runs[name] = flown, as_planned(land, flown.poses, flown.times, LOOKS)
    numbers = {
        (name, key): value
        for name, (flown, covered) in runs.items()
        for key, value in numbers_of(flown, covered, inside).items()
    }
    open_view = see(land, runs[DOWN][0].poses, LOOKS.furthest, hidden=False)
    shown = np.bincount(open_view.node, minlength=land.height.size).reshape(inside.shape) > 0
    numbers[DOWN, "in_view"] = shown[inside].mean()
    return runs, numbers | _moving(parameters, land, seed, fields, rate)


def numbers_of(flown: Flown, covered: Coverage, inside: NDArray[np.bool_]) -> dict[str, float]:
    """What is compared of a case, by name."""
    step = float(np.median(np.diff(flown.times)))
    return seen_numbers(covered, inside, step) | {"time": flown.course.duration}


def seen_numbers(covered: Coverage, inside: NDArray[np.bool_], step: float) -> dict[str, float]:
    """Share of the enclosures' nodes that is seen, ground that is, and how long; ``step`` is the time between
    two images, s."""
    seen, cell = covered.seen, covered.step**2
    return {
        "seen": seen[inside].mean(),
        "in_sight": covered.looks[seen].mean() * step if seen.any() else np.nan,
        "ground": seen.sum() * cell,
        "outside": (seen & ~inside).sum() * cell,
    }


def _moving(
    twin: TwinParameters, land: Terrain, seed: int, fields: int, rate: float
) -> dict[tuple[str, str], float]:
    """Time, ground in no image, and animals that are never seen, with rows near and far apart.

    The same animals once walk and once stand where they begin: what is missed of those that stand is ground
    that no image shows, and the rest is by their moving.
    """
    flights = [plan(twin, land, Case(60.0, spacing, False), fields, rate) for spacing in SPACINGS]
    longest = max((one.times for one in flights), key=len)
    animals = required(twin.animals, "animals")
    herds = [
        walks(fence, longest, WALKERS, animals.speed_sd.si, animals.step.si, stream(seed, f"herd {k}"))
        for k, fence in enumerate(fences_of(twin, fields))
    ]
    inside = nodes_in(land, fences_of(twin, fields)) >= 0
    numbers = {}
    for spacing, flown in zip(SPACINGS, flights, strict=True):
        found = see(land, flown.poses, LOOKS.furthest)
        count = len(flown.times)
        sharp = np.ones(count, bool)
        shown = np.bincount(found.node, minlength=land.height.size).reshape(inside.shape) > 0
        rows = f"rows-{spacing:.0f}m"
        numbers[rows, "time"] = flown.course.duration
        numbers[rows, "unseen"] = 1 - shown[inside].mean()
        for name, kept in (("missed", slice(count)), ("missed_still", np.zeros(count, np.intp))):
            seen = [np.isfinite(first_seen(found, land, flown.times, sharp, one[:, kept])) for one in herds]
            numbers[rows, name] = float(1 - np.mean(seen))
    return numbers


#: Quantities of the page's tables, by its key.
TABLES = {
    "plans": ("seen", "ground", "outside", "in_sight", "time"),
    "rows": ("time", "unseen", "missed_still", "missed"),
}

#: Quantities of `means_table` that are no shares: hectares, minutes and seconds in their units.
_SCALES = {"ground": 1e-4, "outside": 1e-4, "time": 1 / 60, "in_sight": 1.0}
_COLOURS = (BLUE, ORANGE)


def extent(land: Terrain) -> tuple[float, float, float, float]:
    """West, east, south and north edges of the nodes' cells, metres, as `imshow` wants them."""
    south, north, west, east = land.extent
    half = land.step / 2
    return west - half, east + half, south - half, north + half


def coverage_map(shown: Coverage, land: Terrain, fences: Sequence[Array], track: Array) -> Figure:
    """Where a plan sees the ground sharply (green), and where only blurred (orange); fences and path."""
    state = np.where(shown.seen, 1.0, np.where(shown.blurred > 0, 0.0, np.nan))
    fig, ax, _ = _nodes_map(
        state, land, fences, cmap=ListedColormap([ORANGE, GREEN]), vmin=0, vmax=1, alpha=0.55
    )
    draw_way(ax, track, VERMILLION, width=0.7)
    map_axes(ax)
    return fig


def age_map(
    values: Array, inside: NDArray[np.bool_], land: Terrain, fences: Sequence[Array], label: str
) -> Figure:
    """A number for each node of the enclosures, north up."""
    fig, ax, image = _nodes_map(np.where(inside, values, np.nan), land, fences, cmap="viridis")
    fig.colorbar(image, ax=ax, location="bottom", label=label, shrink=0.6, aspect=30)
    map_axes(ax)
    return fig


def _nodes_map(
    values: Array, land: Terrain, fences: Sequence[Array], **look: Any
) -> tuple[Figure, Axes, AxesImage]:
    """A value for each node (R, C) of a terrain in colour, with fences."""
    fig, ax = new_figure(5.8, 4.2)
    image = ax.imshow(values, origin="lower", extent=extent(land), interpolation="nearest", **look)
    draw_fences(ax, fences)
    return fig, ax, image


def shares_chart(runs: pd.DataFrame, names: Mapping[str, str], quantities: Mapping[str, str]) -> Figure:
    """Mean shares with their 95 % interval, a row for each subject and a colour for each quantity.

    Parameters
    ----------
    runs
        Columns (subject, name), a row for each flight.
    names, quantities
        Words for subjects and for at most two quantities, by name.
    """
    series = {}
    for (name, words), color in zip(quantities.items(), _COLOURS, strict=False):
        middle, *ends = 100 * np.array([mean_share_interval(runs[who, name]) for who in names]).T
        series[words] = Values(middle, ends, color)
    return rows_chart(
        list(names.values()), series, "share (%)", size=(5.8, 1.1 + 0.3 * len(names)), xlim=(-2, 102)
    )


def means_table(runs: pd.DataFrame, names: Mapping[str, str], quantities: Sequence[str]) -> pd.DataFrame:
    """Means over flights, a row for each subject: shares with their 95 % interval, areas in hectares, times
    in minutes, times in sight in seconds."""
    rows = []
    for who, words in names.items():
        row: dict[str, object] = {"plan": words}
        for name in quantities:
            if name in _SCALES:
                row[name] = _SCALES[name] * float(runs[who, name].mean())
            else:
                row[name] = percent_between(mean_share_interval(runs[who, name]))
        rows.append(row)
    return pd.DataFrame(rows)
