"""What forbids a plan once its heights are known: take-off on unknown ground, rules, and ground too near."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.analysis.plans.heights import HeightProfile, clear_of
from wildlab.analysis.plans.sorties import Sortie
from wildlab.analysis.plans.wanted import Wanted
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain

#: Metres above what the rules allow that are rounding.
ROUNDING = 0.05
#: Places along a way from which the nearest ground is looked for: so far apart, metres, and so many at most.
APART, MOST_PLACES = 2.0, 20_000
#: Directions in which ground is looked for, how rings grow, and how many places are looked at closely.
DIRECTIONS, GROWING, CLOSELY = 24, 1.15, 20


def refuse_take_off(home: Array, terrain: Terrain | None, wanted: Wanted) -> None:
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
    place = (
        "another take-off point with --home" if wanted.home is not None else "a take-off point with --home"
    )
    raise WildlabError(
        "the take-off point lies outside the map of heights, or where it has a hole, and all heights of the "
        "plan would be above it",
        f"give a map that knows it, {place}, or --above ground for an autopilot with a map of its own",
        field="--home",
    )


def refuse_heights(sorties: Sequence[Sortie], home: Array, wanted: Wanted, above: float) -> None:
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
    helps = [f"plan {lower:.0f} m above the ground or lower (--height)"] if lower >= wanted.least_m else []
    if wanted.vehicle == "fixed-wing":
        helps.append("fly slower (--speed)")
        why = (
            f": it climbs and sinks at {wanted.climb_m_s:g} m/s at most, and begins to before the ground does"
        )
    else:
        why = ": it keeps its distance from ground that is as steep as a wall"
    helps += ["lay the rows along the slopes (--direction)", "state with --max-height what you may fly"]
    raise WildlabError(
        f"{worst.name} is {most:.0f} m above the ground {_side(north, 'north', 'south')} and "
        f"{_side(east, 'east', 'west')} of the take-off point, {most - allowed:.0f} m more than the rules "
        f"allow{why}",
        f"{', '.join(helps[:-1])}, or {helps[-1]}",
        field="--max-height",
    )


def _side(metres: float, ahead: str, behind: str) -> str:
    return f"{abs(metres):.0f} m {ahead if metres >= 0 else behind}"


def refuse_near(sorties: Sequence[Sortie], terrain: Terrain | None, wanted: Wanted, above: float) -> float:
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
            f"the way comes within {nearest:.1f} m of ground that is as steep as a wall, and "
            f"{least:.1f} m are the least",
            "lay the rows along it (--direction), or plan what lies above and below it by itself",
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
    bearings = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    around = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    radius = 1.0
    while radius < near.min() and np.isfinite(near.min()):
        near = np.minimum(near, _distance(places, radius * around, terrain))
        radius *= GROWING
    best = float(near.min())
    # Rings have gaps: about the nearest places, the ground is looked at closely.
    if np.isfinite(best) and best > 0:
        worst = places[np.argsort(near)[:CLOSELY]]
        side = np.linspace(-best, best, 61)
        grid = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        best = min(best, float(_distance(worst, grid, terrain).min()))
    return best


def _distance(places: Array, offsets: Array, terrain: Terrain) -> Array:
    """From each place (N, 3) to the nearest column of ground at the offsets (K, 2), metres."""
    found = np.full(len(places), np.inf)
    for north, east in offsets:
        below = places[:, 2] - terrain.heights_at(places[:, :2] + [north, east])
        # Ground that stands higher than the place is as far away as it is level.
        found = np.fmin(found, np.sqrt(north**2 + east**2 + np.maximum(below, 0.0) ** 2))
    return found
