"""Outlines as rows are laid over them: without the small turns of a fence that no row can follow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.area import Area, crossing, ring_area
from wildlab.geometry.frames import Array
from wildlab.planning.areas import contains

#: Points to a side on which overlapping areas are counted.
ACROSS = 200


def simplified(ring: Array, tolerance: float) -> Array:
    """A ring with fewer corners, none of which lies further from it than a tolerance (Douglas and Peucker).

    Parameters
    ----------
    ring
        (K, 2) metres, not closed, that does not cross itself.
    tolerance
        Metres; corners that lie nearer to the simpler ring are left out.

    Returns
    -------
    (L, 2) metres, some of the corners in their order. The ring itself where the simpler one would cross
    itself or bound next to nothing.

    Examples
    --------
    >>> ring = np.array([[0.0, 0.0], [0.0, 50.0], [0.2, 100.0], [100.0, 100.0], [100.0, 0.0]])
    >>> print(len(simplified(ring, 1.0)))
    4
    """
    if len(ring) <= 4:
        return ring
    # Two corners far apart are kept for certain; each half between them is thinned by itself.
    first = int(np.argmax(((ring - ring.mean(axis=0)) ** 2).sum(axis=1)))
    turned = np.roll(ring, -first, axis=0)
    far = int(np.argmax(((turned - turned[0]) ** 2).sum(axis=1)))
    closed = np.concatenate([turned, turned[:1]])
    kept = {0, far}
    todo = [(0, far), (far, len(closed) - 1)]
    while todo:
        begin, end = todo.pop()
        if end - begin < 2:
            continue
        off = _distances(closed[begin + 1 : end], closed[begin], closed[end])
        worst = int(np.argmax(off))
        if off[worst] > tolerance:
            middle = begin + 1 + worst
            kept.add(middle)
            todo += [(begin, middle), (middle, end)]
    simpler = turned[sorted(kept)]
    if len(simpler) < 3 or ring_area(simpler) < ring_area(ring) / 2 or crossing(simpler) is not None:
        return ring
    return simpler


def sizes_alone(areas: Sequence[Area]) -> dict[str, float]:
    """How much of each area lies in no area before it: together, what all of them cover.

    Parameters
    ----------
    areas
        Outlines and holes in n.

    Returns
    -------
    dict
        Square metres, by name. Where areas overlap, counted on `ACROSS` points to a side.
    """
    found = {}
    for k, area in enumerate(areas):
        low, high = area.outline.min(axis=0), area.outline.max(axis=0)
        near = [
            one
            for one in areas[:k]
            if (one.outline.min(axis=0) < high).all() and (one.outline.max(axis=0) > low).all()
        ]
        share = 0.0
        if near:
            side = [low[axis] + (high - low)[axis] * (np.arange(ACROSS) + 0.5) / ACROSS for axis in (0, 1)]
            points = np.stack(np.meshgrid(*side, indexing="ij"), axis=-1).reshape(-1, 2)
            points = points[_within(area, points)]
            before = np.zeros(len(points), bool)
            for one in near:
                before |= _within(one, points)
            share = float(before.mean()) if len(points) else 0.0
        found[area.name] = area.size * (1 - share)
    return found


def _within(area: Area, points: Array) -> NDArray[np.bool_]:
    """Which points (N, 2) lie in an area, and not in its holes."""
    inside = np.asarray(contains(area.outline, points))
    for hole in area.holes:
        inside &= ~contains(hole, points)
    return inside


def _distances(points: Array, a: Array, b: Array) -> Array:
    """How far points (N, 2) are from the segment a-b, metres."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(points - a - share[:, None] * along, axis=1))
