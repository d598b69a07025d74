"""Rows as flights that a battery lasts for, from the take-off point and back, at heights along the way with
as few way points as keep a flight near its height above the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wildlab.analysis.plans.request import PlanRequest
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.terrain import Terrain
from wildlab.planning.courses import Course, fly, no_steeper
from wildlab.planning.patterns import Pattern

#: Metres above or below its height that a way may be between way points.
TOLERANCE = 5.0
#: Metres between places at which the ground below a way is looked at, where the map is no coarser.
SPACING = 5.0
#: Metres that a way keeps from ground and treetops on all sides, where it is high enough for that.
CLEARANCE = 10.0
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
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
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
