"""A plan: rows over areas as flights that a battery lasts for, at heights along the way with as few way
points as keep a flight near its height above the ground; how long they take, and what forbids them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wildlab.analysis.plan_request import (
    CLEARANCE,
    FURTHEST,
    GroundView,
    PlanRequest,
    directions,
    look,
    simplified,
    sizes_alone,
)
from wildlab.errors import WildlabError
from wildlab.flight.manifest import TerrainSays
from wildlab.flight.readers.vector import Areas, read_areas
from wildlab.flight.terrain import CutOut, terrain_about
from wildlab.geometry.frames import Array, Indices, Mask, geodetic_to_ned
from wildlab.geometry.georeference import Terrain
from wildlab.planning.courses import Course, fly, no_steeper
from wildlab.planning.patterns import Pattern, contains, distances_along, grid_points, lawn_mowers

#: Metres above or below its height that a way may be between way points.
TOLERANCE = 5.0
#: Metres between places at which the ground below a way is looked at, where the map is no coarser.
SPACING = 5.0
#: Rings, as shares of that distance, and directions in which ground is looked for.
RINGS, DIRECTIONS = (0.25, 0.5, 0.75, 0.97), 16
#: Places along a way at most; a longer one is looked at more coarsely.
MOST_PLACES = 100_000


class HeightProfile(NamedTuple):
    """A way in three dimensions.

    Attributes
    ----------
    points
        (N, 2) north and east of the way points, metres.
    ground
        (N,) height of the ground below each, above the plane down = 0 of n, metres.
    height
        (N,) of the way points, above the same plane.
    corner
        (N,) which point of the given way each is; -1 for those put between them.
    least, most
        Heights above the ground anywhere on the way, metres.
    highest
        (2,) where it is that high above the ground, metres.
    unknown
        Metres of the way below which the ground is not known; there it is taken to be as at the nearest place
        of the way where it is.
    """

    points: Array
    ground: Array
    height: Array
    corner: Indices
    least: float
    most: float
    highest: Array
    unknown: float


def clear_of(above: float, trees: float = 0.0) -> float:
    """How far a way keeps from ground and treetops on all sides, metres.

    Parameters
    ----------
    above
        Height above the ground, metres.
    trees
        That stand on it, metres.

    Returns
    -------
    float
        `CLEARANCE`; of low ways half the height above the treetops, or every slope would be a wall.

    Examples
    --------
    >>> clear_of(60.0), clear_of(12.0)
    (10.0, 6.0)
    """
    return min(CLEARANCE, (above - trees) / 2)


def follow(
    way: Array,
    terrain: Terrain | None,
    above: float,
    most_above: float = math.inf,
    steepest: float = math.inf,
    trees: float = 0.0,
) -> HeightProfile:
    """Way points that follow the ground.

    Parameters
    ----------
    way
        (M, 2) north and east, metres: corners of the way, all of which are kept.
    terrain
        In the same n; None is flat ground at zero.
    above
        Height above the ground, metres.
    most_above
        What may not be passed, by the rules; between way points, too.
    steepest
        Metres up or down for each metre of way, where an aircraft cannot slow down: it begins to climb before
        a hill, and is then higher above the ground than was asked for.
    trees
        That stand on the ground, metres.

    Returns
    -------
    Followed
        Between way points the height runs straight and, at every place that was looked at, stays within
        `TOLERANCE` of what was asked for and below ``most_above``, but where ``steepest`` asks for more, or
        ground beside or before it would be nearer than `clear_of`.
    """
    if terrain is None:
        zero, high = np.zeros(len(way)), np.full(len(way), above)
        return HeightProfile(way, zero, high, np.arange(len(way)), above, above, way[0], 0.0)
    places, corner, along = _places(way, max(SPACING, terrain.step / 2))
    ground = terrain.heights_at(places)
    known = np.isfinite(ground)
    if not known.any():
        ground, unknown = np.zeros(len(places)), float(along[-1])
    else:
        steps = np.diff(along)
        unknown = float(steps[~(known[1:] & known[:-1])].sum())
        nearest = (
            np.abs(np.subtract.outer(along[~known], along[known])).argmin(axis=1) if not known.all() else []
        )
        ground = ground.copy()
        ground[~known] = ground[known][nearest]
    clear = _clear(places, terrain, clear_of(above, trees)) + trees
    wanted = np.fmax(ground + above, clear)
    if math.isfinite(steepest):
        wanted = no_steeper(wanted, along, steepest)
    up = min(TOLERANCE, max(most_above - above, 0.0))
    kept = _thinned(
        along, np.fmin(np.fmax(wanted - TOLERANCE, clear), wanted), wanted, wanted + up, corner >= 0
    )
    flown = np.interp(along, along[kept], wanted[kept])
    over = flown - ground
    least, most, highest = float(over.min()), float(over.max()), places[int(over.argmax())]
    return HeightProfile(
        places[kept], ground[kept], wanted[kept], corner[kept], least, most, highest, unknown
    )


def _clear(places: Array, terrain: Terrain, distance: float) -> Array:
    """The least height at each place that is so far from all ground about it; NaN where none is known."""
    bearings = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    found = np.full(len(places), np.nan)
    for share in RINGS:
        rise = distance * math.sqrt(1 - share**2)
        for north, east in zip(np.cos(bearings), np.sin(bearings), strict=True):
            beside = terrain.heights_at(places + share * distance * np.array([north, east]))
            found = np.fmax(found, beside + rise)
    return found


def _places(way: Array, spacing: float) -> tuple[Array, Indices, Array]:
    """Places along a way, which corner of it each is, and how far along it."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    spacing = max(spacing, float(steps.sum()) / MOST_PLACES)
    points, corner = [way[:1]], [0]
    for k, length in enumerate(steps):
        count = max(int(np.ceil(length / spacing)), 1)
        share = (np.arange(count) + 1)[:, None] / count
        points.append(way[k] + share * (way[k + 1] - way[k]))
        corner += [-1] * (count - 1) + [k + 1]
    places = np.concatenate(points)
    along = distances_along(places)
    return places, np.array(corner), along


def _thinned(along: Array, low: Array, wanted: Array, high: Array, kept: Mask) -> Indices:
    """Places between which a straight line stays between low and high, each at the height wanted there.

    From a place kept, the slopes that clear all places so far make a wedge; the last place that a line
    within the wedge reaches is kept next.
    """
    chosen = [0]
    begin, steepest, flattest, reached = 0, math.inf, -math.inf, 0
    k = 1
    while k < len(along):
        far = along[k] - along[begin]
        if far > 0:
            slope = (wanted[k] - wanted[begin]) / far
            fits = flattest - 1e-12 <= slope <= steepest + 1e-12
        else:
            fits = True
        if fits:
            reached = k
        ends = kept[k] or k == len(along) - 1
        # The next place may fit again although this one does not: the wedge alone decides when to stop.
        if far > 0:
            steepest = min(steepest, (high[k] - wanted[begin]) / far)
            flattest = max(flattest, (low[k] - wanted[begin]) / far)
        if flattest > steepest or (ends and not fits):
            begin = reached if reached > begin else begin + 1
            chosen.append(begin)
            steepest, flattest, reached, k = math.inf, -math.inf, begin, begin + 1
            continue
        if ends:
            chosen.append(k)
            begin, steepest, flattest, reached = k, math.inf, -math.inf, k
        k += 1
    return np.unique(chosen)


#: Corners of a turn that are left out of the way points, as a share of its radius.
BULGE = 0.08
#: Nearer than this a point is the take-off point, metres.
SAME = 0.5


class Sortie(NamedTuple):
    """A flight.

    Attributes
    ----------
    name
        "sortie 1".
    rows
        (K,) which rows of the pattern it flies, in order.
    course
        The way over the ground with its times, as if it were level.
    row_of
        (M,) which row of the pattern the piece of the course after each point lies on; -1 for none.
    way
        Way points with heights.
    duration
        Seconds, with climbing, sinking and landing.
    steepest
        Greatest speed of climbing or sinking that the way would need at this speed, m/s.
    """

    name: str
    rows: Indices
    course: Course
    row_of: Indices
    way: HeightProfile
    duration: float
    steepest: float


def split_rows(
    pattern: Pattern, home: Array, wanted: PlanRequest, terrain: Terrain | None, above: float
) -> tuple[Sortie, ...]:
    """Rows in their order, as few flights as the battery allows.

    Parameters
    ----------
    pattern
        The rows.
    home
        (2,) the take-off point, metres.
    wanted
        Speed, turns, wind, battery.
    terrain
        In the same n.
    above
        Height above the ground, metres.

    Returns
    -------
    tuple of Sortie

    Raises
    ------
    WildlabError
        Where a battery does not last for one row.
    """
    sorties: list[Sortie] = []
    first, total = 0, len(pattern.rows)
    while first < total:
        name = f"sortie {len(sorties) + 1}"

        def to(end: int, begin: int = first, name: str = name) -> Sortie:
            return fly_rows(name, range(begin, end), pattern, home, wanted, terrain, above)

        best = to(total)
        if best.duration > wanted.usable_s:
            best = to(first + 1)
            if best.duration > wanted.usable_s:
                raise WildlabError(
                    f"one row with the way there and back takes {best.duration / 60:.1f} minutes, and of a "
                    f"battery of {wanted.battery_min:g} minutes {wanted.usable_s / 60:.1f} may be used",
                    "take off nearer to it (--home), fly faster, turn the rows (--direction), or split the "
                    "area into smaller ones",
                    field="--battery",
                )
            # Longer flights take longer: the last row that a battery lasts for is found by halving.
            low, high = first + 1, total
            while high - low > 1:
                middle = (low + high) // 2
                one = to(middle)
                if one.duration <= wanted.usable_s:
                    best, low = one, middle
                else:
                    high = middle
        sorties.append(best)
        first += len(best.rows)
    return tuple(sorties)


def fly_rows(
    name: str,
    rows: Sequence[int],
    pattern: Pattern,
    home: Array,
    wanted: PlanRequest,
    terrain: Terrain | None,
    above: float,
) -> Sortie:
    """One flight over given rows, however long it takes.

    Parameters
    ----------
    name
        Of the flight.
    rows
        Of the pattern, in the order in which they are flown.
    pattern, home, wanted, terrain, above
        As for `split_rows`.

    Returns
    -------
    Sortie
    """
    chosen = np.array(rows, np.intp)
    legs, of = list(pattern.rows[chosen]), [int(one) for one in chosen]
    # The way there and back are legs like rows, so that turns into them are flown and counted, too.
    if np.linalg.norm(legs[0][0] - home) > SAME:
        legs, of = [np.stack([home, legs[0][0]]), *legs], [-1, *of]
    if np.linalg.norm(legs[-1][1] - home) > SAME:
        legs, of = [*legs, np.stack([legs[-1][1], home])], [*of, -1]
    flown = np.stack(legs)
    whole = Pattern(
        flown, np.array(of, np.intp), flown.reshape(-1, 2), np.zeros(len(flown)), pattern.distance
    )
    course = fly(
        whole,
        wanted.speed_m_s,
        turn_radius=wanted.turn_radius_m,
        turn_time=wanted.turn_s if wanted.turn_radius_m == 0 else 0.0,
        wind=wanted.drift,
        spacing=max(wanted.turn_radius_m / 20, 1.0),
    )
    corners = _corners(course, wanted.turn_radius_m)
    # What can stop slows down where the ground is steep; what cannot has to begin to climb before.
    slope = wanted.climb_m_s / wanted.fastest_m_s
    steepest = slope if wanted.vehicle == "fixed-wing" else math.inf
    way = follow(course.points[corners], terrain, above, wanted.max_height_m, steepest, wanted.trees_m)
    duration, steepest = _times(course, corners, way, wanted)
    return Sortie(name, chosen, course, _row_of(course, flown, of), way, duration, steepest)


def _corners(course: Course, radius: float) -> Indices:
    """Points of a course that a way needs: without stops on the spot, and arcs as some of their points."""
    points = course.points
    moved = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9])
    kept = np.flatnonzero(moved)
    if radius == 0:
        return kept
    on_row = course.on_row[kept]
    fixed = on_row | np.concatenate([[True], on_row[:-1]])
    fixed[-1] = True
    chosen = [0]
    for k in range(1, len(kept)):
        if not fixed[k]:
            # The furthest next point for which the arc stays near its chord.
            a, b = points[kept[chosen[-1]]], points[kept[k + 1]]
            between = points[kept[chosen[-1] + 1 : k + 1]]
            chord = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
            off = np.abs((between - a) @ np.array([-chord[1], chord[0]]))
            if off.max() <= BULGE * radius:
                continue
        chosen.append(k)
    return kept[np.array(chosen)]


def _times(course: Course, corners: Indices, way: HeightProfile, wanted: PlanRequest) -> tuple[float, float]:
    """Seconds with climbing, and the greatest vertical speed that the way would need."""
    at = np.flatnonzero(way.corner >= 0)
    arrival = course.times[corners[way.corner[at]]]
    # Where it stops to turn, a point stands twice in the course: it leaves at the later time.
    stops = np.append(np.all(course.points[1:] == course.points[:-1], axis=1), False)
    where = corners[way.corner[at]]
    leave = course.times[np.where(stops[where], where + 1, where)]
    total, steepest = float((leave - arrival).sum()), 0.0
    for a, b, begin, end in zip(at[:-1], at[1:], leave[:-1], arrival[1:], strict=True):
        lengths = np.linalg.norm(np.diff(way.points[a : b + 1], axis=0), axis=1)
        level = (end - begin) * lengths / max(float(lengths.sum()), 1e-9)
        rise = np.abs(np.diff(way.height[a : b + 1]))
        with np.errstate(divide="ignore", invalid="ignore"):
            steepest = max(steepest, float(np.nan_to_num(rise / level, posinf=0.0).max(initial=0.0)))
        total += float(np.maximum(level, rise / wanted.climb_m_s).sum())
    up, down = way.height[0] - way.ground[0], way.height[-1] - way.ground[-1]
    return total + float(up + down) / wanted.climb_m_s, steepest


def _row_of(course: Course, flown: Array, of: list[int]) -> Indices:
    """Which row each piece of a course is: rows come whole, and in their order."""
    found = np.full(len(course.points), -1, np.intp)
    begin = 0
    for leg, row in zip(flown, of, strict=True):
        for k in range(begin, len(course.points) - 1):
            if np.allclose(course.points[k : k + 2], leg, atol=1e-6, rtol=0):
                found[k], begin = row, k + 1
                break
    return found


#: Metres above what the rules allow that are rounding.
ROUNDING = 0.05
#: Places along a way from which the nearest ground is looked for: so far apart, metres, and so many at most.
APART, MOST_NEAR = 2.0, 20_000
#: How many places are looked at closely.
CLOSELY = 20


def refuse_heights(sorties: Sequence[Sortie], home: Array, wanted: PlanRequest, above: float) -> None:
    """Refuse ways above what the rules allow.

    Parameters
    ----------
    sorties
        The flights.
    home
        (2,) the take-off point in n, metres.
    wanted
        The rules, and what the aircraft can do.
    above
        Height above the ground that was planned, metres.

    Raises
    ------
    WildlabError
        Where a way is higher somewhere; it says where, by how much, and what to do.
    """
    worst = max(sorties, key=lambda one: one.way.most)
    most, allowed = worst.way.most, wanted.max_height_m
    if most <= allowed + ROUNDING:
        return
    north, east = worst.way.highest - home
    lower = above - (most - allowed)
    helps = [f"plan {lower:.0f} m or lower (--height)"] if lower >= wanted.least_m else []
    if wanted.vehicle == "fixed-wing":
        helps.append("fly slower (--speed)")
        why = f"climbs at {wanted.climb_m_s:g} m/s at most"
    else:
        why = "keeps away from ground as steep as a wall"
    helps += ["lay rows along the slopes (--direction)", "state --max-height"]
    raise WildlabError(
        f"{worst.name} is {most:.0f} m above the ground {_side(north, 'north', 'south')} and "
        f"{_side(east, 'east', 'west')} of the take-off point, {most - allowed:.0f} m too high: it {why}",
        f"{', '.join(helps[:-1])}, or {helps[-1]}",
        field="--max-height",
    )


def _side(metres: float, ahead: str, behind: str) -> str:
    return f"{abs(metres):.0f} m {ahead if metres >= 0 else behind}"


def refuse_near(
    sorties: Sequence[Sortie], terrain: Terrain | None, wanted: PlanRequest, above: float
) -> float:
    """Refuse ways that come too near to the ground on any side, and say how near they come.

    Parameters
    ----------
    sorties
        The flights.
    terrain
        In n; None is flat ground.
    wanted
        Height of the trees.
    above
        Height above the ground that was planned, metres.

    Returns
    -------
    float
        Least distance in space between the ways and the treetops, metres.

    Raises
    ------
    WildlabError
        Where that is less than half of what ways are planned to keep.
    """
    if terrain is None:
        return above - wanted.trees_m
    nearest = min(nearest_ground(one.way, terrain, wanted.trees_m) for one in sorties)
    least = clear_of(above, wanted.trees_m) / 2
    if nearest < least:
        raise WildlabError(
            f"the way comes within {nearest:.1f} m of steep ground, and {least:.1f} m are the least",
            "lay rows along it (--direction), or plan above and below by themselves",
            field="--terrain",
        )
    return nearest


def nearest_ground(way: HeightProfile, terrain: Terrain, trees: float = 0.0) -> float:
    """Least distance in space between a way and the ground, not only straight down.

    Parameters
    ----------
    way
        With heights.
    terrain
        In the same n.
    trees
        That stand on it everywhere, metres.

    Returns
    -------
    float, metres. Ground that is not known is no ground.
    """
    points = np.column_stack([way.points, way.height - trees])
    along = distances_along(points)
    count = int(min(max(along[-1] / APART, 2), MOST_NEAR)) + 1
    at = np.unique(np.concatenate([np.linspace(0, along[-1], count), along]))
    places = np.stack([np.interp(at, along, points[:, axis]) for axis in range(3)], axis=1)
    near = np.nan_to_num(places[:, 2] - terrain.heights_at(places[:, :2]), nan=np.inf)
    # First all places, by a coarse grid; then those nearest to ground, by a fine one.
    for most, across in ((len(near), 21), (CLOSELY, 61)):
        rows = np.argsort(near)[:most]
        best = max(float(near.min()), 0.0)
        if np.isfinite(best):
            side = np.linspace(-best, best, across)
            grid = grid_points(side, side)
            near[rows] = np.minimum(near[rows], _distance(places[rows], grid, terrain))
    return float(near.min())


def _distance(places: Array, offsets: Array, terrain: Terrain) -> Array:
    """From each place (N, 3) to the nearest column of ground at the offsets (K, 2), metres."""
    found = np.full(len(places), np.inf)
    for north, east in offsets:
        below = places[:, 2] - terrain.heights_at(places[:, :2] + [north, east])
        # Ground that stands higher than the place is as far away as it is level.
        found = np.fmin(found, np.sqrt(north**2 + east**2 + np.maximum(below, 0.0) ** 2))
    return found


#: A height that is not stated stays this far below the greatest one allowed, metres: way points between
#: which the ground falls away are higher above it.
BELOW_RULE = 5.0
#: Turns of a fence smaller than this share of a strip are left to the overlap.
FOLLOWED = 0.02
#: A map reaches at least so far beyond the areas, metres.
LEAST_MARGIN = 200.0
#: Share of an area of which the map may know nothing.
MOST_UNKNOWN = 0.05
#: Metres from the take-off point to the areas' middle beyond which it is a slip of a key.
FURTHEST_HOME = 50_000.0


@dataclass(frozen=True, eq=False)
class Plan:
    """What came out.

    Attributes
    ----------
    wanted
        What was asked for.
    areas
        With the origin of n.
    terrain
        Under them; None is flat ground.
    view
        What the camera sees of flat ground.
    height
        Of the lens above the ground, metres.
    strip
        How wide a row's strip is, metres.
    pattern
        All rows.
    home
        (2,) the take-off point in n, metres.
    sorties
        The flights.
    nearest
        Least distance in space between the ways and the ground, or the treetops on it, metres.
    cut
        Where the terrain comes from; None where it was given, or there is none.
    """

    wanted: PlanRequest
    areas: Areas
    terrain: Terrain | None
    view: GroundView
    height: float
    strip: float
    pattern: Pattern
    home: Array
    sorties: tuple[Sortie, ...]
    nearest: float
    cut: CutOut | None = None

    @cached_property
    def alone(self) -> dict[str, float]:
        """Square metres of each area that lie in none before it, by name."""
        return sizes_alone(self.areas.areas)

    @property
    def names(self) -> list[str]:
        """Of the areas, as what may be passed on calls them: by number, unless their names may be told."""
        return [
            area.name if self.wanted.names else f"area {k + 1}" for k, area in enumerate(self.areas.areas)
        ]

    @property
    def duration(self) -> float:
        """Of all flights, seconds, without changes of batteries."""
        return sum(one.duration for one in self.sorties)

    def area_seconds(self) -> Array:
        """Seconds on the rows of each area and in the turns between them, (A,)."""
        seconds = np.zeros(len(self.areas.areas))
        for one in self.sorties:
            steps = np.diff(one.course.times)
            on = np.flatnonzero(one.row_of[:-1] >= 0)
            if not len(on):
                continue
            # Between its first and its last piece on rows of an area, a flight is there for that area.
            of = self.pattern.area[one.row_of[on]]
            for area in np.unique(of):
                mine = on[of == area]
                seconds[area] += steps[mine[0] : mine[-1] + 1].sum()
        return seconds


def make_plan(wanted: PlanRequest, terrain: Terrain | None = None) -> Plan:
    """Plan a flight.

    Parameters
    ----------
    wanted
        What is asked for.
    terrain
        Under the areas, in n about their middle, in place of the map that ``wanted`` names.

    Returns
    -------
    Plan

    Raises
    ------
    WildlabError
        Where nothing can be flown as it is wanted; the message says what and why.
    """
    areas = read_areas(wanted.area)
    view = look(wanted.camera, wanted.tilt_deg, wanted.gimbal, wanted.swing_deg)
    height = _height(wanted, view)
    strip = view.width * height
    distance = strip * (1 - wanted.overlap)
    home = None if wanted.home is None else _home(wanted.home, areas)
    cut = None
    if terrain is None and wanted.terrain is not None:
        cut = _cut_out(wanted.terrain, wanted, areas, home, view.middle * height + FURTHEST * height)
        terrain = cut.terrain
    if terrain is not None:
        _check_under(areas, terrain, strip)
    outlines = [simplified(area.outline, FOLLOWED * strip) for area in areas.areas]
    pattern = lawn_mowers(
        outlines,
        distance,
        directions=directions(outlines, distance, wanted),
        # What a turn costs, as metres of way: half a circle, or the time that one stands.
        turn=math.pi * wanted.turn_radius_m if wanted.turn_radius_m > 0 else wanted.speed_m_s * wanted.turn_s,
        start=home,
        back=home is not None,
    )
    # What a tilted camera sees lies ahead: rows begin, and end, as much before the ground that is theirs.
    along = np.stack([np.cos(pattern.directions), np.sin(pattern.directions)], axis=-1)
    pattern = pattern._replace(rows=pattern.rows - view.middle * height * along[:, None])
    if home is None:
        home = pattern.rows[0, 0]
    there = terrain is None or np.isfinite(terrain.heights_at(home[None])).all()
    if wanted.heights == "take-off" and not there:
        raise WildlabError(
            "the map of heights does not know the take-off point, and all heights would be above it",
            "give another map or --home, or --above ground for an autopilot with its own map",
            field="--home",
        )
    sorties = split_rows(pattern, home, wanted, terrain, height)
    refuse_heights(sorties, home, wanted, height)
    nearest = refuse_near(sorties, terrain, wanted, height)
    return Plan(wanted, areas, terrain, view, height, strip, pattern, home, sorties, nearest, cut)


def _height(wanted: PlanRequest, view: GroundView) -> float:
    """The height that was asked for, or the one from which the animal has the pixels it shall have."""
    most, least = wanted.max_height_m, wanted.trees_m + CLEARANCE if wanted.trees_m > 0 else 0.0
    if wanted.height_m is not None:
        if wanted.height_m > most:
            raise WildlabError(
                f"a height of {wanted.height_m:g} m, and the rules allow {most:g} m",
                "fly lower, or state --max-height",
                field="--height",
            )
        if wanted.height_m < least:
            raise WildlabError(
                f"a height of {wanted.height_m:g} m, and trees of {wanted.trees_m:g} m",
                f"fly at {least:g} m or higher",
                field="--height",
            )
        return wanted.height_m
    sharp = wanted.animal_m / wanted.pixels * math.sqrt(wanted.camera.fx * wanted.camera.fy) / view.slant
    least = wanted.least_m
    if sharp < least:
        over = f"trees of {wanted.trees_m:g} m" if wanted.trees_m > 0 else "the ground"
        raise WildlabError(
            f"{wanted.animal_m:g} m are {wanted.pixels:g} pixels from {sharp:.1f} m only: over {over}, "
            f"{least:g} m are the least unasked",
            "ask for fewer --pixels, or state --height",
            field="--pixels",
        )
    return float(math.floor(min(sharp, max(most - BELOW_RULE, min(most, least)))))


def _cut_out(
    says: TerrainSays, wanted: PlanRequest, areas: Areas, home: Array | None, beyond: float
) -> CutOut:
    """The map under the areas and as far about them as a flight comes or looks."""
    points = np.concatenate([area.outline for area in areas.areas])
    if home is not None:
        points = np.concatenate([points, home[None]])
    margin = max(LEAST_MARGIN, beyond + 6 * wanted.turn_radius_m)
    return terrain_about(Path(says.file), says, areas.origin, points, margin)


def _check_under(areas: Areas, terrain: Terrain, strip: float) -> None:
    """Refuse areas below which the map knows too little."""
    for area in areas.areas:
        low, high = area.outline.min(axis=0), area.outline.max(axis=0)
        sides = [
            np.linspace(low[k], high[k], max(20, min(200, int((high - low)[k] / strip * 8)))) for k in (0, 1)
        ]
        points = grid_points(*sides)
        points = np.concatenate([points[contains(area.outline, points)], area.outline])
        unknown = float((~np.isfinite(terrain.heights_at(points))).mean())
        if unknown > MOST_UNKNOWN:
            raise WildlabError(
                f"the map of heights lacks {100 * unknown:.0f} % of {area.name}",
                "give a map of the whole area, or plan what it holds",
                field="--terrain",
            )


def _home(home: tuple[float, float], areas: Areas) -> Array:
    lat, lon = np.radians(home)
    here = geodetic_to_ned(lat, lon, 0.0, areas.origin)[:2]
    far = float(np.hypot(*here))
    if not far <= FURTHEST_HOME:
        swapped = geodetic_to_ned(lon, lat, 0.0, areas.origin)[:2] if abs(home[1]) <= 90 else here
        order = ", but with latitude and longitude exchanged" if np.hypot(*swapped) <= FURTHEST_HOME else ""
        raise WildlabError(
            f"the take-off point lies {far / 1000:,.0f} km from the areas{order}",
            "give it as latitude, then longitude; the file of the areas has longitude first",
            field="--home",
        )
    return here
