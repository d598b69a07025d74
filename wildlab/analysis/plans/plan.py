"""A plan: rows over areas as flights, how long they take, what they cost, and what forbids them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from wildlab.analysis.plans.request import (
    CLEARANCE,
    FURTHEST,
    GroundView,
    PlanRequest,
    directions,
    look,
    simplified,
    sizes_alone,
)
from wildlab.analysis.plans.sorties import HeightProfile, Sortie, clear_of, split_rows
from wildlab.errors import WildlabError
from wildlab.flight.manifest import TerrainSays
from wildlab.flight.readers.vector import Area, Areas, read_areas
from wildlab.flight.terrain import CutOut, terrain_about
from wildlab.geometry.frames import Array, geodetic_to_ned, ned_to_geodetic
from wildlab.geometry.terrain import Terrain
from wildlab.planning.patterns import Pattern, contains, lawn_mowers

#: Metres above what the rules allow that are rounding.
ROUNDING = 0.05
#: Places along a way from which the nearest ground is looked for: so far apart, metres, and so many at most.
APART, MOST_PLACES = 2.0, 20_000
#: How many places are looked at closely.
CLOSELY = 20


def refuse_take_off(home: Array, terrain: Terrain | None, wanted: PlanRequest) -> None:
    """Refuse heights above a take-off point of which the map does not know the height.

    Parameters
    ----------
    home
        (2,) the take-off point in n, metres.
    terrain
        In the same n; None is flat ground.
    wanted
        Above what heights are kept.

    Raises
    ------
    WildlabError
        Where all heights would be above a height that nobody knows.
    """
    if terrain is None or wanted.heights != "take-off" or np.isfinite(terrain.heights_at(home[None])).all():
        return
    raise WildlabError(
        "the map of heights does not know the take-off point, and all heights would be above it",
        "give another map or --home, or --above ground for an autopilot with its own map",
        field="--home",
    )


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
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = int(min(max(along[-1] / APART, 2), MOST_PLACES)) + 1
    at = np.unique(np.concatenate([np.linspace(0, along[-1], count), along]))
    places = np.stack([np.interp(at, along, points[:, axis]) for axis in range(3)], axis=1)
    near = np.nan_to_num(places[:, 2] - terrain.heights_at(places[:, :2]), nan=np.inf)
    # First all places, by a coarse grid; then those nearest to ground, by a fine one.
    for most, across in ((len(near), 21), (CLOSELY, 61)):
        rows = np.argsort(near)[:most]
        best = max(float(near.min()), 0.0)
        if np.isfinite(best):
            side = np.linspace(-best, best, across)
            grid = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
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
        turn=_turn_length(wanted),
        start=home,
        back=home is not None,
    )
    # What a tilted camera sees lies ahead: rows begin, and end, as much before the ground that is theirs.
    along = np.stack([np.cos(pattern.directions), np.sin(pattern.directions)], axis=-1)
    pattern = pattern._replace(rows=pattern.rows - view.middle * height * along[:, None])
    if home is None:
        home = pattern.rows[0, 0]
    refuse_take_off(home, terrain, wanted)
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
        points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
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
        order = ": latitude and longitude are swapped" if np.hypot(*swapped) <= FURTHEST_HOME else ""
        raise WildlabError(
            f"the take-off point lies {far / 1000:,.0f} km from the areas{order}",
            "give latitude, then longitude, in degrees",
            field="--home",
        )
    return here


def _turn_length(wanted: PlanRequest) -> float:
    """What a turn costs, as metres of way: half a circle, or the time that one stands."""
    return math.pi * wanted.turn_radius_m if wanted.turn_radius_m > 0 else wanted.speed_m_s * wanted.turn_s


def on_earth(points: Array, height: Array, areas: Areas) -> tuple[Array, Array, Array]:
    """Places of n as latitude and longitude in degrees, and heights above the ellipsoid.

    Parameters
    ----------
    points
        (N, 2) north and east, metres.
    height
        (N,) above the plane down = 0 of n, metres.
    areas
        With the origin.

    Returns
    -------
    Latitude, longitude (degrees), height (metres): (N,) each.
    """
    p = np.column_stack([points, -np.asarray(height)])
    lat, lon, h = np.moveaxis(ned_to_geodetic(p, areas.origin), -1, 0)
    return np.degrees(lat), np.degrees(lon), h


def rings_on_earth(area: Area, areas: Areas) -> list[Array]:
    """Outline and holes of an area, (K, 2) latitude and longitude in degrees each."""
    return [
        np.stack(on_earth(ring, np.zeros(len(ring)), areas)[:2], axis=1)
        for ring in (area.outline, *area.holes)
    ]
