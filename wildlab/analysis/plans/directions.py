"""Directions of rows: of an aircraft that cannot stop, the quickest with its turns and the wind."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wildlab.analysis.plans.wanted import Wanted
from wildlab.geometry.frames import Array
from wildlab.planning.areas import edge_directions
from wildlab.planning.courses import fly
from wildlab.planning.patterns import lawn_mower

#: Directions that are flown through for each area, at most.
MOST_TRIED = 12


def directions(outlines: Sequence[Array], distance: float, wanted: Wanted) -> list[float] | None:
    """Of the rows over each area.

    Parameters
    ----------
    outlines
        (K, 2) each, metres.
    distance
        Between rows, metres.
    wanted
        A direction, or the aircraft and the wind.

    Returns
    -------
    list of float or None
        Radians from north to the east, as stated or the quickest of those along the edges of each outline,
        without the ways there and back. None where the shortest rows are the quickest: a multicopter stops
        to turn, and its autopilot holds its speed over the ground.
    """
    if wanted.direction_deg is not None:
        return [math.radians(wanted.direction_deg)] * len(outlines)
    if wanted.vehicle == "multicopter":
        return None
    turn = math.pi * wanted.turn_radius_m

    def seconds(outline: Array, angle: float) -> float:
        rows = lawn_mower(outline, distance, direction=angle, turn=turn)
        course = fly(
            rows,
            wanted.speed_m_s,
            turn_radius=wanted.turn_radius_m,
            wind=wanted.drift,
            spacing=wanted.turn_radius_m / 10,
        )
        return course.duration

    def quickest(outline: Array) -> float:
        tried = [float(one) for one in edge_directions(outline, MOST_TRIED)]
        return min(tried, key=lambda angle: seconds(outline, angle))

    return [quickest(outline) for outline in outlines]
