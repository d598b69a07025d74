"""The way that is flown through a pattern: legs, turns that can be flown, wind, heights, and when one is
where.

Two kinds of aircraft. One that can stop turns on the spot at each corner, in a stated time. One that cannot
flies the shortest way from the end of a row to the start of the next that is made of arcs of its turn radius
and straight lines (Dubins 1957): such a way leaves the area at its ends.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, wrap
from wildlab.geometry.georeference import Terrain
from wildlab.planning.patterns import Pattern, distances_along

#: Kinds of Dubins' ways: a turn, a straight line or a third turn, a turn. 1 is to the right, -1 to the left.
_KINDS = ((1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (1, -1, 1), (-1, 1, -1))


class Course(NamedTuple):
    """A way with its times, linear between the points.

    Attributes
    ----------
    times
        (M,) s, from 0.
    points
        (M, 2) north and east, metres.
    headings
        (M,) direction of the way over ground, from north to the east, radians, without jumps of a full turn.
    on_row
        (M,) bool: whether the piece that begins at a point lies on a row of the pattern.
    """

    times: Array
    points: Array
    headings: Array
    on_row: Array

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    @property
    def length(self) -> float:
        """Metres over ground."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def distances(self, times: ArrayLike) -> Array:
        """How far one has come by then, (N,) metres.

        Parameters
        ----------
        times
            (N,) s.

        Returns
        -------
        (N,) metres over ground.
        """
        far = distances_along(self.points)
        return np.asarray(np.interp(np.asarray(times, float), self.times, far))

    def at(self, times: ArrayLike) -> tuple[Array, Array]:
        """Where one is, (N, 2) metres, and how one heads, (N,) radians; at the ends before and after.

        Parameters
        ----------
        times
            (N,) s.

        Returns
        -------
        Points and headings.
        """
        t = np.asarray(times, float)
        points = np.stack([np.interp(t, self.times, self.points[:, axis]) for axis in (0, 1)], axis=-1)
        return points, np.asarray(wrap(np.interp(t, self.times, self.headings)))


def fly(
    pattern: Pattern | ArrayLike,
    speed: float,
    *,
    turn_radius: float = 0.0,
    turn_time: float = 0.0,
    wind: ArrayLike = (0.0, 0.0),
    spacing: float = 1.0,
) -> Course:
    """The course through a pattern.

    Parameters
    ----------
    pattern
        From `lawn_mower`, or way points (M, 2), metres.
    speed
        Through the air, m/s.
    turn_radius
        Least radius of a turn in still air, metres; 0 is an aircraft that stops and turns on the spot. A bank
        allows for a radius that grows with the square of the speed over ground, so in wind the radius is that
        at the greatest speed over ground.
    turn_time
        What such a stop takes, seconds; the heading turns evenly meanwhile.
    wind
        (2,) where the air goes to, north and east, m/s.
    spacing
        Of the points on arcs, metres.

    Returns
    -------
    Course

    Examples
    --------
    >>> course = fly([[0.0, 0.0], [100.0, 0.0], [100.0, 20.0]], 10.0, turn_time=3.0)
    >>> print(course.times)
    [ 0. 10. 13. 15.]
    """
    air = np.asarray(wind, float)
    rows, points = _rows_and_points(pattern)
    if turn_radius > 0:
        radius = turn_radius * (1 + float(np.hypot(*air)) / speed) ** 2
        points, on_row = _with_arcs(rows, radius, spacing)
        return _timed(points, on_row, speed, air)
    # Rows are way points too, to the last bit.
    known = {row.tobytes() for row in rows}
    on_row = np.array([np.stack(leg).tobytes() in known for leg in pairwise(points)] + [False])
    return _timed(points, on_row, speed, air, turn_time)


def dubins(
    start: ArrayLike, heading: float, end: ArrayLike, end_heading: float, radius: float, spacing: float = 1.0
) -> Array:
    """The shortest way between two points with given headings for what turns no tighter than a radius.

    Parameters
    ----------
    start, end
        (2,) north and east, metres.
    heading, end_heading
        There, from north to the east, radians.
    radius
        Metres, above zero.
    spacing
        Of points on arcs at most, metres.

    Returns
    -------
    (M, 2) metres, from start to end.

    Examples
    --------
    Round to the parallel row 20 m to the right, with 10 m to turn in: half a circle.

    >>> way = dubins([0.0, 0.0], 0.0, [0.0, 20.0], np.pi, 10.0, spacing=0.01)
    >>> round(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()), 2)
    31.42
    """
    a, b = np.asarray(start, float), np.asarray(end, float)
    # Two turns to the same side and a line always make a way: there is one at least.
    ways = [(kind, _parts(kind, (b - a) / radius, heading, end_heading)) for kind in _KINDS]
    kind, parts = min(((k, p) for k, p in ways if p is not None), key=lambda way: round(sum(way[1]), 12))
    way = [a[None]]
    here, angle = a, heading
    for sense, part in zip(kind, parts, strict=True):
        count = max(int(np.ceil(part * radius / spacing)), 1) if sense else 1
        along = part * (np.arange(count) + 1) / count
        if sense:
            centre = here + radius * sense * np.array([-np.sin(angle), np.cos(angle)])
            turned = angle + sense * along
            way.append(centre - radius * sense * np.stack([-np.sin(turned), np.cos(turned)], axis=-1))
            angle = float(turned[-1])
        else:
            way.append(here + radius * along[:, None] * np.array([np.cos(angle), np.sin(angle)]))
        here = way[-1][-1]
    points = np.concatenate(way)
    points[-1] = b
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9
    return np.asarray(points[np.concatenate([[True], apart])])


def _parts(
    kind: tuple[int, int, int], to: Array, heading: float, end_heading: float
) -> tuple[float, float, float] | None:
    """Lengths of the three parts in radii, or None where this kind does not lead there."""
    first, middle, last = kind
    centre = first * np.array([-np.sin(heading), np.cos(heading)])
    centre_end = to + last * np.array([-np.sin(end_heading), np.cos(end_heading)])
    between = centre_end - centre
    apart, bearing = float(np.hypot(*between)), float(np.arctan2(between[1], between[0]))
    full = 2 * np.pi

    def turned(angle: float) -> float:
        # Rounding makes nothing of a turn into a whole one.
        left = float(np.mod(angle, full))
        return 0.0 if full - left < 1e-9 else left

    if middle == 0:
        if first == last:
            course, straight = bearing, apart
        else:
            if apart < 2:
                return None
            course, straight = bearing + first * float(np.arcsin(2 / apart)), float(np.sqrt(apart**2 - 4))
        return turned(first * (course - heading)), straight, turned(last * (end_heading - course))
    if apart > 4:
        return None
    # Three arcs: the middle circle touches both others, on either side of the line between them.
    found = []
    for side in (1, -1):
        lean = side * float(np.arccos(apart / 4))
        towards = np.array([np.cos(bearing + lean), np.sin(bearing + lean)])
        onwards = centre_end - (centre + 2 * towards)
        leave = bearing + lean + first * np.pi / 2
        enter = float(np.arctan2(onwards[1], onwards[0])) - first * np.pi / 2
        arcs = first * (leave - heading), middle * (enter - leave), last * (end_heading - enter)
        found.append((turned(arcs[0]), turned(arcs[1]), turned(arcs[2])))
    return min(found, key=sum)


def _rows_and_points(pattern: Pattern | ArrayLike) -> tuple[Array, Array]:
    if isinstance(pattern, Pattern):
        return pattern.rows, pattern.waypoints
    points = np.asarray(pattern, float)
    return np.stack([points[:-1], points[1:]], axis=1), points


def _with_arcs(rows: Array, radius: float, spacing: float) -> tuple[Array, Array]:
    """Rows and the ways between them, (M, 2), and whether the piece after each point is on a row."""
    points, on_row = [rows[0]], [[True]]
    headings = np.arctan2(*(rows[:, 1] - rows[:, 0]).T[::-1])
    for k in range(1, len(rows)):
        apart = float(np.linalg.norm(rows[k, 0] - rows[k - 1, 1]))
        if apart > 1e-9 or abs(wrap(headings[k] - headings[k - 1])) > 1e-9:
            way = dubins(rows[k - 1, 1], headings[k - 1], rows[k, 0], headings[k], radius, spacing)
            points.append(way[1:])
            on_row.append([False] * (len(way) - 1))
        points.append(rows[k, 1:])
        on_row.append([True])
    on_row.append([False])
    return np.concatenate(points), np.concatenate(on_row).astype(bool)


def _timed(points: Array, on_row: Array, speed: float, wind: Array, turn_time: float = 0.0) -> Course:
    step = np.diff(points, axis=0)
    far = np.linalg.norm(step, axis=1)
    kept = far > 1e-12
    points, on_row = points[np.concatenate([[True], kept])], np.concatenate([on_row[:-1][kept], [False]])
    step, far = step[kept], far[kept]
    along = step / far[:, None]
    # The wind triangle: what blows across the way is met by heading into it.
    across = along[:, 0] * wind[1] - along[:, 1] * wind[0]
    ground = along @ wind + np.sqrt(speed**2 - across**2)
    headings = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    times, where, heading, row = [0.0], [points[0]], [headings[0]], [bool(on_row[0])]
    for k in range(len(step)):
        if k and turn_time > 0 and abs(headings[k] - headings[k - 1]) > 1e-3:
            # At the end of a leg still as on it; then the turn on the spot.
            times.append(times[-1] + turn_time)
            where.append(points[k])
            heading.append(headings[k])
            row[-1] = False
            row.append(bool(on_row[k]))
        times.append(times[-1] + far[k] / ground[k])
        where.append(points[k + 1])
        heading.append(headings[k])
        row.append(bool(on_row[k + 1]))
    if turn_time == 0:
        # Without stops a heading belongs to the piece that begins there.
        heading = [*headings, headings[-1]]
    return Course(np.array(times), np.array(where), np.array(heading), np.array(row))


class Profile(NamedTuple):
    """Heights along a way.

    Attributes
    ----------
    points
        (M, 3) in n, metres.
    above
        (M,) height above ground, metres: never less than was asked for.
    """

    points: Array
    above: Array

    def at(self, distances: ArrayLike) -> Array:
        """Heights after so many metres of way over ground.

        Parameters
        ----------
        distances
            (N,) metres.

        Returns
        -------
        (N,) metres upwards in n.
        """
        far = distances_along(self.points[:, :2])
        return np.asarray(np.interp(np.asarray(distances, float), far, -self.points[:, 2]))


#: Metres between places at which the ground below a way is looked at.
SPACING = 5.0


def follow_terrain(terrain: Terrain, points: ArrayLike, above: float, slope: float) -> Profile:
    """The lowest way that keeps a height above ground and neither climbs nor sinks too steeply.

    So the platform climbs before a hill, and is nowhere lower than asked.

    Parameters
    ----------
    terrain
        In the same n.
    points
        (K, 2) way points, north and east, metres; they are all kept.
    above
        Height above ground, metres.
    slope
        Metres up or down for each metre of way.

    Returns
    -------
    Profile

    Raises
    ------
    WildlabError
        Where the way leads off the map or over what it does not know.

    Examples
    --------
    >>> ground = np.array([[0, 0], [0, 0], [20, 20], [0, 0]], np.float32)
    >>> hill = Terrain(ground, north=0.0, east=0.0, step=100.0)
    >>> way = follow_terrain(hill, [[0.0, 50.0], [300.0, 50.0]], 30.0, slope=0.1)
    >>> print(-way.points[::20, 2])
    [30. 40. 50. 40.]
    """
    way = np.asarray(points, float)
    parts = [way[:1]]
    for a, b in pairwise(way):
        count = max(int(np.ceil(np.linalg.norm(b - a) / SPACING)), 1)
        parts.append(a + (np.arange(count) + 1)[:, None] / count * (b - a))
    dense = np.concatenate(parts)
    ground = terrain.heights_at(dense)
    lost = int((~np.isfinite(ground)).sum())
    if lost:
        raise WildlabError(
            f"{lost} of {len(dense)} places on the way lie off the map or where it has no height",
            "give terrain that holds the whole way, turns too",
            field="terrain",
        )
    along = distances_along(dense)
    height = no_steeper(ground + above, along, slope)
    return Profile(np.column_stack([dense, -height]), height - ground)


def no_steeper(heights: Array, along: Array, slope: float) -> Array:
    """The lowest heights (N,) that are nowhere below these and neither climb nor sink more steeply.

    Each is the greatest of what every other place asks for, less what can be climbed or sunk on the way
    there; ``along`` (N,) is how far along the way, metres, ``slope`` metres up or down for each metre of it.
    """
    before = np.maximum.accumulate(heights + slope * along) - slope * along
    after = np.maximum.accumulate((heights - slope * along)[::-1])[::-1] + slope * along
    return np.asarray(np.maximum(before, after))
