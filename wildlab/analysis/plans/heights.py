"""Heights along a way: as few way points as keep a flight near its height above the ground."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain

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
    corner: NDArray[np.intp]
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
        # The greatest of what every other place asks for, less what can be climbed or sunk on the way there.
        before = np.maximum.accumulate(wanted + steepest * along) - steepest * along
        after = np.maximum.accumulate((wanted - steepest * along)[::-1])[::-1] + steepest * along
        wanted = np.maximum(before, after)
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


def _places(way: Array, spacing: float) -> tuple[Array, NDArray[np.intp], Array]:
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


def _thinned(
    along: Array, low: Array, wanted: Array, high: Array, kept: NDArray[np.bool_]
) -> NDArray[np.intp]:
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
