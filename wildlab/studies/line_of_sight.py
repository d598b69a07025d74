"""What the thermal camera of F sees of land that was drawn: exactly, and by the two ways of F 2.5.2.

For each seed land is drawn, and the camera set above it at several heights and tilts, at places and with
headings that are drawn, too. Nothing flies. All three ways are asked of the same grid points: those in the
field of view of F (2.23). Times are no part of this: they are not the same twice.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.intervals import mean_interval, mean_share_interval
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, camera_rotation
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import (
    Looked,
    cast_rays,
    compare_angles,
    field_of_view,
    footprint,
    in_field_of_view,
    lines_clear,
)
from wildlab.messages.quantities import percent, percent_between
from wildlab.reporting.charts.drawing import Values, draw_heights, finish, fit_map, lines_chart
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.published import bounds_of
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import grow_trees, synthetic_landscape
from wildlab.simulation.parameters import load_twin

#: Ways to tell whether a point is seen, and what else there are numbers of.
RAYS, ANGLES, EXACT = "ray-casting", "bresenham", "exact"
#: Rays that begin at the camera and not at the highest ground in view.
WHOLE_RAYS = "whole-rays"
LETTER, VIEW, TREES = "by-the-letter", "field-of-view", "trees"
#: Heights above the ground below the camera, metres: F's gondola is at 3 to 20 m (8.2), its multicopter at
#: 25 to 60 m (7.5.1); twice and four times that beside them.
HEIGHTS = (10, 20, 40, 60, 120, 240)
#: Angles between the lens and straight down, degrees. F prints 60 as the limit of the multicopter (7.5.1).
TILTS = (0, 30, 60, 75)
#: At which of them heights are compared and times taken, and at which height tilts are.
TILT, HEIGHT = 60, 60
#: Of algorithm 1, metres: half a cell, and a cell. F prints neither.
STEP, TOLERANCE = 1.0, 2.0
#: Between the line of sight and straight down, degrees, where trees are looked at; and at how many points.
INCIDENCES = (0, 15, 30, 45, 60, 75)
POINTS = 1000
#: Fewer grid points than this in view tell nothing of a share.
FEWEST = 30
#: How far places stay from the border of the map, metres.
MARGIN = 50.0


class TerrainView(NamedTuple):
    """The camera above land, and the grid points in its field of view.

    Attributes
    ----------
    p_nc, R_nc
        (3,) metres and (3, 3).
    nodes
        (N, 2) rows and columns.
    points
        (N, 3) metres in n.
    """

    p_nc: Array
    R_nc: Array
    nodes: NDArray[np.int64]
    points: Array


def camera_of(twin: str) -> Camera:
    """The camera of a twin as F 2.5.1 has it: centred, without distortion."""
    found = load_twin(twin).camera
    width, height = int(found.width.value), int(found.height.value)
    return Camera(width, height, found.fx.si, found.fy.si, width / 2, height / 2)


def look(land: Terrain, camera: Camera, rng: np.random.Generator, height: float, tilt: float) -> TerrainView:
    """The camera at a place and with a heading that are drawn: over the map, and looking at it.

    Parameters
    ----------
    land
        The ground.
    camera
        Centred, without distortion.
    rng
        For place and heading.
    height
        Above the ground below the camera, metres.
    tilt
        Of the lens from straight down, degrees.
    """
    south, north, west, east = land.extent
    ahead = height * np.tan(np.radians(tilt))
    place, aim, heading = np.zeros(2), np.full(2, np.nan), 0.0
    while np.isnan(land.heights_at(aim[None])[0]):
        place = rng.uniform([south + MARGIN, west + MARGIN], [north - MARGIN, east - MARGIN])
        heading = rng.uniform(-np.pi, np.pi)
        aim = place + ahead * np.array([np.cos(heading), np.sin(heading)])
    p_nc = np.array([*place, -(float(land.heights_at(place[None])[0]) + height)])
    R_nc = camera_rotation(0.0, np.radians(tilt - 90.0), heading)
    nodes, points = nodes_of(land)
    inside = in_field_of_view(field_of_view(camera), points, p_nc, R_nc)
    return TerrainView(p_nc, R_nc, nodes[inside], points[inside])


def nodes_of(land: Terrain) -> tuple[NDArray[np.int64], Array]:
    """(N, 2) rows and columns of all grid points, and (N, 3) metres in n."""
    nodes = np.argwhere(np.isfinite(land.height))
    north_east = np.array([land.north, land.east]) + land.step * nodes
    return nodes, np.column_stack([north_east, -land.height[tuple(nodes.T)].astype(float)])


def width_on_ground(land: Terrain, camera: Camera, view: TerrainView) -> float:
    """How far the middles of the left and the right side of the image are apart on the ground, metres."""
    pose = CameraPoses.at_lens(camera, view.p_nc, view.R_nc, np.eye(3))
    outline = footprint(land, pose, per_side=2).points
    return float(np.linalg.norm(outline[3] - outline[7]))


def trial(seed: int, *, twin: str, views: int) -> dict[tuple[str, str], float]:
    """What the ways say of land that is drawn for this seed.

    Parameters
    ----------
    seed
        Of the land, its trees, places and headings.
    twin
        Whose camera it is.
    views
        How many places, for each height and tilt.

    Returns
    -------
    dict of float
        By (subject, name). Of each of `settings`, over the grid points of all its views: the share that is
        ``seen``; of both ways of F their ``agreement`` with the exact one, the shares that only they see
        (``too_many``) and only the exact one (``too_few``), and their ``steps`` a grid point, those of rays
        that begin at the camera, too; of (2.24) by the letter the share that is
        ``seen``. Of trees the share of the grid points on which they are ``planted``, and at each of
        `INCIDENCES` the share that they hide of what is seen without them (``hidden``).
        Of the field of view, straight down, the ``exponent`` with which its width grows with the height.
    """
    land, camera, rng = synthetic_landscape(seed), camera_of(twin), stream(seed, "line of sight")
    numbers: dict[tuple[str, str], float] = {}
    for name, height, tilt in settings():
        drawn = [look(land, camera, rng, height, tilt) for _ in range(views)]
        for (subject, what), value in compare(land, drawn).items():
            numbers[subject, f"{what}_{name}"] = value
    grown = grow_trees(land, seed)
    numbers[TREES, "planted"] = (grown.height > land.height).mean()
    trees = hidden_by_trees(land, grown, stream(seed, "trees"))
    numbers |= {(TREES, f"hidden_{degrees}deg"): share for degrees, share in trees.items()}
    widths = []
    for height in HEIGHTS:
        below = [look(land, camera, rng, height, 0.0) for _ in range(views)]
        widths.append(float(np.nanmean([width_on_ground(land, camera, one) for one in below])))
    numbers[VIEW, "exponent"] = np.polyfit(np.log(HEIGHTS), np.log(widths), 1)[0]
    return numbers


def settings() -> list[tuple[str, float, float]]:
    """Name, height (m) and tilt (deg) of all that is compared, each once."""
    heights = [(f"{height}m", float(height), float(TILT)) for height in HEIGHTS]
    return heights + [(f"{tilt}deg", float(HEIGHT), float(tilt)) for tilt in TILTS if tilt != TILT]


def compare(land: Terrain, views: list[TerrainView]) -> dict[tuple[str, str], float]:
    """What the ways say of the grid points of all views together, by (subject, name); see `trial`.

    NaN where fewer than `FEWEST` points are in view.
    """
    exact = np.concatenate([lines_clear(land, one.points, one.p_nc) for one in views])
    if len(exact) < FEWEST:
        exact = np.full(len(exact), np.nan)
    ways = {
        RAYS: [cast_rays(land, one.nodes, one.p_nc, STEP, TOLERANCE) for one in views],
        ANGLES: [compare_angles(land, one.nodes, one.p_nc) for one in views],
    }
    numbers = {(EXACT, "seen"): _share(exact)}
    for subject, found in ways.items():
        clear = np.concatenate([one.clear for one in found]).astype(float)
        numbers[subject, "agreement"] = _share(1 - np.abs(clear - exact))
        numbers[subject, "too_many"] = _share(clear * (1 - exact))
        numbers[subject, "too_few"] = _share((1 - clear) * exact)
        numbers[subject, "steps"] = _share(_steps(found) + 0 * exact)
    whole = [cast_rays(land, one.nodes, one.p_nc, STEP, TOLERANCE, shorten=False) for one in views]
    numbers[WHOLE_RAYS, "steps"] = _share(_steps(whole) + 0 * exact)
    letter = [compare_angles(land, one.nodes, one.p_nc, itself=True, signed=True) for one in views]
    numbers[LETTER, "seen"] = _share(np.concatenate([one.clear for one in letter]) + 0 * exact)
    return numbers


def hidden_by_trees(land: Terrain, grown: Terrain, rng: np.random.Generator) -> dict[int, float]:
    """Of the ground that is seen of land without trees, the share that trees hide, by incidence (deg).

    Points are drawn all over the land, each with a bearing; along that the camera stands as far off as the
    incidence asks for, `HEIGHT` above the point. Points and bearings are the same for all incidences.
    """
    south, north, west, east = land.extent
    where = rng.uniform([south, west], [north, east], (POINTS, 2))
    points = np.column_stack([where, -land.heights_at(where)])
    bearing = rng.uniform(-np.pi, np.pi, POINTS)
    off = np.column_stack([np.cos(bearing), np.sin(bearing)])
    found = {}
    for degrees in INCIDENCES:
        away = HEIGHT * np.tan(np.radians(degrees)) * off
        lenses = np.column_stack([where + away, points[:, 2] - HEIGHT])
        on_map = ~np.isnan(land.heights_at(lenses[:, :2]))
        # The other way round where the map ends; what stands beyond its end is not known.
        lenses[~on_map, :2] -= 2 * away[~on_map]
        on_map = ~np.isnan(land.heights_at(lenses[:, :2]))
        seen = on_map & lines_clear(land, points, lenses)
        found[degrees] = 1 - lines_clear(grown, points[seen], lenses[seen]).mean()
    return found


def _share(values: Array) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _steps(found: list[Looked]) -> Array:
    return np.concatenate([one.steps for one in found]).astype(float)


#: How often each call is timed; the quickest counts.
REPEATS = 5
#: What is timed.
WAYS = (RAYS, WHOLE_RAYS, ANGLES, EXACT)
#: Over how many lands at most: more would tell no more of a ratio than this.
MOST = 20
#: Grid points in view that are timed, at most; and of the whole map one in so many.
MOST_POINTS, PART = 2000, 10


def best_times(calls: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """Fewest seconds of the processor for each call, all in turn: what else a machine does only adds."""
    for call in calls.values():
        call()  # the first one compiles, and fills the caches
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(REPEATS):
        for name, call in calls.items():
            begun = time.process_time()
            call()
            times[name].append(time.process_time() - begun)
    return {name: min(each) for name, each in times.items()}


def timed(seeds: Iterable[int], twin: str) -> pd.DataFrame:
    """Times of the three ways over views like those of the trials.

    Parameters
    ----------
    seeds
        Of the lands; the first `MOST` are taken.
    twin
        Whose camera it is.

    Returns
    -------
    DataFrame
        A row for each seed; columns (way, height): seconds a grid point in view; `VIEW`: seconds for each
        grid point of the map to tell whether it is in view.
    """
    camera, rows, lands = camera_of(twin), {}, list(seeds)[:MOST]
    halves = field_of_view(camera)
    for seed in lands:
        land, rng = synthetic_landscape(seed), stream(seed, "times")
        row: dict[tuple[str, int], float] = {}
        _, points = nodes_of(land)
        for height in HEIGHTS:
            view = look(land, camera, rng, height, TILT)
            # In the order of the map: to fetch heights from all over it would be what takes the time.
            some = np.sort(rng.permutation(len(view.nodes))[:MOST_POINTS])
            nodes, ends, lens = view.nodes[some], view.points[some], view.p_nc
            found = best_times(
                {
                    RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE),
                    WHOLE_RAYS: partial(cast_rays, land, nodes, lens, STEP, TOLERANCE, shorten=False),
                    ANGLES: partial(compare_angles, land, nodes, lens),
                    EXACT: partial(lines_clear, land, ends, lens),
                    VIEW: partial(in_field_of_view, halves, points[::PART], lens, view.R_nc),
                }
            )
            for way, seconds in found.items():
                count = len(points[::PART]) if way == VIEW else len(some)
                row[way, height] = seconds / count if count >= FEWEST else np.nan
        rows[seed] = row
    names = [(way, height) for height in HEIGHTS for way in (*WAYS, VIEW)]
    values = np.array([[row[name] for name in names] for row in rows.values()])
    return pd.DataFrame(values, pd.Index(rows, name="seed"), pd.MultiIndex.from_tuples(names))


def seconds(times: pd.DataFrame, way: str) -> Array:
    """(lands, heights) of one way, s a grid point."""
    return np.column_stack([times[way, height].to_numpy(float) for height in HEIGHTS])


def furthest_ratio(times: pd.DataFrame, way: str, beside: str) -> Array:
    """(lands,) where both differ most, how many times the quicker's time the slower one takes."""
    apart = np.abs(np.log(seconds(times, way) / seconds(times, beside)))
    return np.asarray(np.exp(np.nanmax(apart, axis=1)))


def time_numbers(times: pd.DataFrame) -> dict[str, Array]:
    """What the rules of claims ask of times, (lands,) each: where both of F's ways differ most, how many
    times the quicker's the slower one takes; and the dearest view and the cheapest of these ways, s."""
    found = {f"times/{way}": furthest_ratio(times, way, ANGLES) for way in (RAYS, WHOLE_RAYS)}
    ways = np.hstack([seconds(times, way) for way in (RAYS, ANGLES)])
    return found | {
        "times/cheap": np.nanmax(seconds(times, VIEW), axis=1),
        "times/dear": np.nanmin(ways, axis=1),
    }


def at_heights(runs: pd.DataFrame, subject: str, name: str) -> Array:
    """(lands, heights) of one number."""
    return np.column_stack([runs[subject, f"{name}_{height}m"] for height in HEIGHTS])


def hidden(runs: pd.DataFrame) -> Array:
    """(lands, incidences) share of what is seen without trees that trees hide."""
    return np.column_stack([runs[TREES, f"hidden_{degrees}deg"] for degrees in INCIDENCES])


_COLOURS = {RAYS: BLUE, WHOLE_RAYS: GREEN, ANGLES: VERMILLION, EXACT: INK}
#: What all charts over the height of the camera have.
_HEIGHT = "height above the ground (m)"


def agreement_over_height(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Agreement of both algorithms with the exact line of sight."""
    lines = {
        names[way]: _mean(100 * at_heights(runs, way, "agreement"), _COLOURS[way], 100.0)
        for way in (RAYS, ANGLES)
    }
    return lines_chart(HEIGHTS, lines, _HEIGHT, "correct points (%)", xscale="log")


def times_over_height(times: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Time per grid point: the counterpart of F figure 7.1."""
    lines = {}
    for way in WAYS:
        values = 1e6 * seconds(times, way)
        ends = np.transpose([bounds_of(pd.Series(column)) for column in values.T])
        lines[names[way]] = Values(np.nanmedian(values, axis=0), ends, _COLOURS[way])
    return lines_chart(HEIGHTS, lines, _HEIGHT, "time per grid point (µs)", xscale="log", yscale="log")


def hidden_over_incidence(runs: pd.DataFrame) -> Figure:
    """Share of the ground that trees hide."""
    lines = {"": _mean(100 * hidden(runs), GREEN)}
    label, ground = "incidence, from straight down (°)", "ground hidden by trees (%)"
    return lines_chart(INCIDENCES, lines, label, ground, size=(5.6, 3.2), ylim=(0, None))


def view_map(land: Terrain, view: TerrainView, names: Mapping[str, str]) -> Figure:
    """One view on the map: what is seen, and where each algorithm says something else."""
    exact = lines_clear(land, view.points, view.p_nc)
    ways = {
        RAYS: cast_rays(land, view.nodes, view.p_nc, STEP, TOLERANCE).clear,
        ANGLES: compare_angles(land, view.nodes, view.p_nc).clear,
    }
    fig, axes = new_figure(5.8, 3.9, columns=2, sharey=True)
    for ax, (way, clear) in zip(axes, ways.items(), strict=True):
        draw_heights(ax, land)
        for name, which, colour in (
            ("hidden", ~exact & ~clear, INK), ("wrongly visible", clear & ~exact, ORANGE),
            ("wrongly hidden", exact & ~clear, VERMILLION),
        ):  # fmt: skip
            ax.plot(*view.points[which, 1::-1].T, ".", ms=2.2, color=colour)
            ax.plot([], [], "o", color=colour, label=name)
        ax.plot(*view.p_nc[1::-1], "^", color=BLUE, ms=7, label="camera")
        ax.set_title(f"{names[way]}: {percent(float((clear != exact).mean()))} wrong", fontsize=10)
        fit_map(ax, np.vstack([view.points, view.p_nc]), 10.0)
    map_axes(axes[0])
    map_axes(axes[1], north="")
    return finish(fig)


def agreement_table(runs: pd.DataFrame) -> pd.DataFrame:
    """Shares of grid points by height and tilt, with the 95 % interval of their mean over terrains."""
    shares = []
    for name, height, tilt in settings():
        row = {"where": f"{height:.0f} m, {tilt:.0f}°", "seen": _share_words(runs[EXACT, f"seen_{name}"])}
        for way in (RAYS, ANGLES):
            row[way] = _share_words(runs[way, f"agreement_{name}"])
            wrong = [percent(float(runs[way, f"{what}_{name}"].mean())) for what in ("too_many", "too_few")]
            row[f"{way}-wrong"] = " / ".join(wrong)
        shares.append(row)
    return pd.DataFrame(shares)


def _share_words(values: ArrayLike) -> str:
    return percent_between(mean_share_interval(values))


def _mean(values: Array, colour: str, most: float = np.inf) -> Values:
    """Mean over terrains and its 95 % interval."""
    mean = np.nanmean(values, axis=0)
    if len(values) < 2:
        return Values(mean, color=colour)
    ends = np.clip([mean_interval(column)[1:] for column in values.T], 0.0, most).T
    return Values(mean, ends, colour)
