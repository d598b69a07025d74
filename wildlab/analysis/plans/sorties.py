"""Rows as flights that a battery lasts for: each from the take-off point over some rows and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.plans.heights import HeightProfile, follow
from wildlab.analysis.plans.wanted import Wanted
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.courses import Course, fly
from wildlab.planning.patterns import Pattern

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
    rows: NDArray[np.intp]
    course: Course
    row_of: NDArray[np.intp]
    way: HeightProfile
    duration: float
    steepest: float


def split_rows(
    pattern: Pattern, home: Array, wanted: Wanted, terrain: Terrain | None, above: float
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
    wanted: Wanted,
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


def _corners(course: Course, radius: float) -> NDArray[np.intp]:
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
    return np.asarray(kept[np.array(chosen)])


def _times(
    course: Course, corners: NDArray[np.intp], way: HeightProfile, wanted: Wanted
) -> tuple[float, float]:
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


def _row_of(course: Course, flown: Array, of: list[int]) -> NDArray[np.intp]:
    """Which row each piece of a course is: rows come whole, and in their order."""
    found = np.full(len(course.points), -1, np.intp)
    begin = 0
    for leg, row in zip(flown, of, strict=True):
        for k in range(begin, len(course.points) - 1):
            if np.allclose(course.points[k : k + 2], leg, atol=1e-6, rtol=0):
                found[k], begin = row, k + 1
                break
    return found
