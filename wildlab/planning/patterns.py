"""Lawn-mower patterns: parallel rows over one area or several, in the order of the shortest way (F 5.2).

F flies rows over one enclosure after the other and leaves the order of the enclosures and the direction of
the rows to the user; here both may be chosen, or follow from the length of the way. F's sentence that such
rows cover any convex area takes no heed of how rows end: a row that ends at the fence leaves the tips of a
slanted fence unseen, so rows here reach as far as the area does anywhere within half a row distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError, above_zero
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array, Indices, Mask

#: Corners nearer to one another than this are one corner, metres; and what counts as on a border.
SAME = 1e-6
#: Areas below this cannot be searched, square metres.
LEAST = 1e-3
#: Directions of rows that are tried at most.
MOST_DIRECTIONS = 60


def check_area(corners: ArrayLike, name: str = "area") -> Array:
    """A polygon that can be searched: clockwise as seen from above, not closed, no corner twice.

    Parameters
    ----------
    corners
        (K, 2) north and east, metres, in either sense; the first may stand at the end once more.
    name
        Of the area, for messages.

    Returns
    -------
    (K', 2) metres.

    Raises
    ------
    WildlabError
        Where it has fewer than three corners, corners that are not numbers, or no extent.

    Examples
    --------
    >>> print(check_area([[0, 0], [0, 10], [20, 10], [20, 0], [0, 0]]))
    [[20.  0.]
     [20. 10.]
     [ 0. 10.]
     [ 0.  0.]]
    """
    points = np.asarray(corners, float)
    if points.ndim != 2 or points.shape[-1] != 2:
        raise WildlabError(f"corners of the shape {points.shape}", "give rows of north and east", field=name)
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise WildlabError(
            f"corner {row + 1} is not a number", "give north and east of every corner in metres", field=name
        )
    points = points[np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1) > SAME]
    if len(points) < 3:
        raise WildlabError(
            f"the polygon has {len(points)} different corner{'s' * (len(points) != 1)}",
            "give three at least",
            field=name,
        )
    signed = _signed_area(points)
    if abs(signed) < LEAST:
        raise WildlabError(
            f"the polygon has an area of {abs(signed):.2g} m2",
            "its corners lie on one line: move one",
            field=name,
        )
    # North to the first axis, east to the second: positive is clockwise from above.
    return points if signed > 0 else np.ascontiguousarray(points[::-1])


def contains(corners: ArrayLike, points: ArrayLike) -> Mask:
    """Which points lie in a polygon, by counting the edges that a line to the north crosses.

    Parameters
    ----------
    corners
        (K, 2) metres.
    points
        (..., 2) metres, north and east. On the border either answer may come out.

    Returns
    -------
    (...) bool; False of NaN.

    Examples
    --------
    >>> contains([[0, 0], [0, 10], [20, 10], [20, 0]], [[5, 5], [25, 5]])
    array([ True, False])
    """
    asked = np.asarray(points, float)
    fence = np.ascontiguousarray(corners, float)
    return _contains(fence, np.ascontiguousarray(asked.reshape(-1, 2))).reshape(asked.shape[:-1])


@compiled
def _contains(fence: Array, points: Array) -> Mask:
    north, east = fence.T
    inside = np.zeros(len(points), np.bool_)
    for k in range(len(fence)):
        if east[k - 1] == east[k]:
            continue
        slope = (north[k] - north[k - 1]) / (east[k] - east[k - 1])
        for i in range(len(points)):
            if (east[k - 1] > points[i, 1]) != (east[k] > points[i, 1]):
                inside[i] ^= points[i, 0] < north[k - 1] + (points[i, 1] - east[k - 1]) * slope
    return inside


def distances_along(points: Array) -> Array:
    """How far along a way (N, d) each of its points is, (N,): zero at the first."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def grid_points(*axes: ArrayLike) -> Array:
    """All points (N, 2) of a grid with these norths and easts, along east first."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def rectangle(north: float, east: float, length: float, width: float, course: float) -> Array:
    """Corners of a rectangle about its middle, (4, 2) metres, clockwise.

    Parameters
    ----------
    north, east
        Of its middle, metres.
    length, width
        Along the course and across it, metres.
    course
        From north to the east, radians.

    Returns
    -------
    (4, 2) metres.

    Examples
    --------
    >>> print(rectangle(0.0, 0.0, 4.0, 2.0, 0.0))
    [[ 2.  1.]
     [-2.  1.]
     [-2. -1.]
     [ 2. -1.]]
    """
    along = np.array([np.cos(course), np.sin(course)])
    across = np.array([-along[1], along[0]])
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    corners = np.array([north, east]) + length * signs[:, :1] * along + width * signs[:, 1:] * across
    return check_area(corners, "rectangle")


def _signed_area(points: Array) -> float:
    # About the first corner: far from the origin a cross product loses digits.
    p = points - points[0]
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def edge_directions(corners: ArrayLike, most: int = MOST_DIRECTIONS) -> Array:
    """Directions of the edges of a fence, of those that differ the ones of the longest edges.

    Parameters
    ----------
    corners
        (K, 2) north and east, metres.
    most
        How many at most.

    Returns
    -------
    (D,) radians from 0 to below pi: a direction and its reverse are the same rows; the longest edge's first.

    Examples
    --------
    >>> print(edge_directions([[0, 0], [0, 40], [100, 40], [100, 0]]))
    [0.         1.57079633]
    """
    fence = np.asarray(corners, float)
    edges = np.roll(fence, -1, axis=0) - fence
    edges = edges[np.argsort(-np.linalg.norm(edges, axis=1), kind="stable")]
    angles = np.mod(np.arctan2(edges[:, 1], edges[:, 0]), np.pi)
    angles = np.where(np.pi - angles < 1e-9, 0.0, angles)
    # Of a fence with very many corners the edges that differ, and of these the longest.
    coarse = (
        np.round(angles, 2) if len(edges) <= MOST_DIRECTIONS else np.round(MOST_DIRECTIONS * angles / np.pi)
    )
    _, first = np.unique(coarse, return_index=True)
    return angles[np.sort(first)][:most]


#: More rows than this over one area are a slip of a unit.
MOST_ROWS = 5000


class Pattern(NamedTuple):
    """Rows in the order in which they are flown.

    Attributes
    ----------
    rows
        (R, 2, 2): start and end of each row, north and east, metres.
    area
        (R,) of which area each row is, counted as given.
    waypoints
        (M, 2) metres: starts and ends of rows, and corners of the fence where the way between two rows has to
        go round one.
    directions
        (R,) of the rows as flown, from north to the east, radians.
    distance
        Between neighbouring rows, metres, of each area: no more than was asked for. (A,)
    """

    rows: Array
    area: Indices
    waypoints: Array
    directions: Array
    distance: Array

    @property
    def length(self) -> float:
        """Of the straight way through all way points, metres."""
        return float(np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1).sum())


def lawn_mower(
    corners: ArrayLike,
    distance: float,
    *,
    direction: float | None = None,
    turn: float = 0.0,
    start: ArrayLike | None = None,
) -> Pattern:
    """Rows back and forth over one area, convex or not (F 5.2, figure 5.1).

    As many evenly spaced rows as are needed for no point of the area to be further than half the distance
    from one. Where the area is concave a row may fall into pieces; pieces that follow one another from row to
    row make a block that is flown back and forth, and the blocks are visited in the shortest order.

    Parameters
    ----------
    corners
        (K, 2) north and east, metres.
    distance
        Between rows at most, metres.
    direction
        Of the rows, from north to the east, radians; None takes the one, of those along the fence's edges,
        that needs the shortest rows, counting ``turn`` for each.
    turn
        What a turn costs, as metres of way: speed times the time of a turn.
    start
        (2,) where the way begins, metres: the pattern is entered at the corner that makes the way shortest.

    Returns
    -------
    Pattern

    Raises
    ------
    WildlabError
        As `check_area`; where the distance is not above zero, or so small that thousands of rows follow.

    Examples
    --------
    >>> pattern = lawn_mower([[0, 0], [0, 40], [100, 40], [100, 0]], 20.0)
    >>> print(pattern.waypoints)
    [[  0.  10.]
     [100.  10.]
     [100.  30.]
     [  0.  30.]]
    """
    return lawn_mowers(
        [corners], distance, directions=None if direction is None else [direction],
        turn=turn, start=start,
    )  # fmt: skip


def lawn_mowers(
    areas: Sequence[ArrayLike],
    distance: float,
    *,
    directions: Sequence[float] | None = None,
    turn: float = 0.0,
    start: ArrayLike | None = None,
    back: bool = False,
) -> Pattern:
    """Rows over several areas, one after the other, in the order of the shortest way (F 5.2, figure 5.2).

    Parameters
    ----------
    areas
        Each (K, 2) north and east, metres.
    distance
        Between rows at most, metres.
    directions
        Of the rows of each area, radians; None chooses them as in `lawn_mower`.
    turn
        As for `lawn_mower`.
    start
        (2,) where the way begins; None leaves that open.
    back
        Whether the way leads back to where it began, which then counts for the order.

    Returns
    -------
    Pattern

    Raises
    ------
    WildlabError
        As `lawn_mower`.

    Examples
    --------
    >>> fields = [rectangle(0.0, east, 100.0, 40.0, 0.0) for east in (0.0, 200.0, 100.0)]
    >>> print(lawn_mowers(fields, 20.0, start=[-100.0, 0.0]).area)
    [0 0 2 2 1 1]
    """
    wanted: Sequence[float | None] = [None] * len(areas) if directions is None else directions
    fences = [check_area(one, f"area {k + 1}") for k, one in enumerate(areas)]
    inner = [_block_ways(fence, distance, angle, turn) for fence, angle in zip(fences, wanted, strict=True)]
    chosen = visit_order([ways for ways, _ in inner], start=start, back=back)
    rows = [inner[k][0][which] for k, which in chosen]
    flown = np.concatenate(rows)
    along = flown[:, 1] - flown[:, 0]
    return Pattern(
        flown,
        np.repeat([k for k, _ in chosen], [len(one) for one in rows]).astype(np.intp),
        flown.reshape(-1, 2),
        np.arctan2(along[:, 1], along[:, 0]),
        np.array([apart for _, apart in inner]),
    )


def rows_over(corners: ArrayLike, distance: float, direction: float) -> tuple[list[list[Array]], float]:
    """Pieces of rows over an area, row by row from left to right of their direction.

    Parameters
    ----------
    corners
        (K, 2) metres, from `check_area`.
    distance
        Between rows at most, metres.
    direction
        Of the rows, from north to the east, radians.

    Returns
    -------
    For each row a list of its pieces, (2, 2) metres each, along the direction; and the distance between rows.

    Raises
    ------
    WildlabError
        Where the distance is not above zero, or too small.
    """
    above_zero(distance=distance)
    fence = np.asarray(corners, float)
    along = np.array([np.cos(direction), np.sin(direction)])
    across = np.array([-along[1], along[0]])
    turned = np.stack([fence @ along, fence @ across], axis=-1)
    low, high = float(turned[:, 1].min()), float(turned[:, 1].max())
    if (high - low) / distance > MOST_ROWS:
        raise WildlabError(
            f"rows {distance:g} m apart over {high - low:.0f} m would be more than {MOST_ROWS}",
            "give a larger distance between rows",
            field="distance",
        )
    count = max(int(np.ceil((high - low) / distance - 1e-9)), 1)
    step = (high - low) / count
    rows = []
    for k in range(count):
        bottom, middle, top = (low + (k + part) * step for part in (0.0, 0.5, 1.0))
        rows.append([np.outer(span, along) + middle * across for span in _spans(turned, bottom, top)])
    return rows, step


def _block_ways(
    fence: Array, distance: float, direction: float | None, turn: float
) -> tuple[list[Array], float]:
    """Ways over one area, each with its own entrance and exit, and the distance between its rows."""
    angle = _best_direction(fence, distance, turn) if direction is None else float(direction)
    rows, step = rows_over(fence, distance, angle)
    each = [_four_ways(block) for block in _blocks(rows, angle)]
    if len(each) == 1:
        return each[0], step
    # Blocks within a concave area, in the shortest order; the whole may be flown either way round.
    flown = np.concatenate([each[k][which] for k, which in visit_order(each)])
    return [flown, flown[::-1, ::-1]], step


def _best_direction(fence: Array, distance: float, turn: float) -> float:
    def cost(angle: float) -> float:
        pieces = [piece for row in rows_over(fence, distance, angle)[0] for piece in row]
        lengths = sum(float(np.linalg.norm(piece[1] - piece[0])) for piece in pieces)
        return lengths + len(pieces) * (turn + distance)

    # Of equals the longest edge's.
    return min((float(one) for one in edge_directions(fence)), key=lambda angle: round(cost(angle), 6))


def _blocks(rows: list[list[Array]], direction: float) -> list[Array]:
    """Pieces that follow one another from row to row, each block (R, 2, 2) along the direction."""
    along = np.array([np.cos(direction), np.sin(direction)])
    open_blocks: list[list[Array]] = []
    done: list[list[Array]] = []
    for row in rows:
        spans = [piece @ along for piece in row]
        before = [block[-1] @ along for block in open_blocks]
        meets = np.array([[a[0] < b[1] and b[0] < a[1] for b in spans] for a in before], bool)
        meets = meets.reshape(len(before), len(spans))
        following: list[list[Array]] = []
        for j, piece in enumerate(row):
            above = np.flatnonzero(meets[:, j])
            if len(above) == 1 and meets[above[0]].sum() == 1:
                open_blocks[above[0]].append(piece)
                following.append(open_blocks[above[0]])
            else:
                following.append([piece])
        done += [block for block in open_blocks if not any(block is kept for kept in following)]
        open_blocks = following
    return [np.stack(block) for block in done + open_blocks]


def _four_ways(block: Array) -> list[Array]:
    """A block from either side, each from either end, flown back and forth. (R, 2, 2) each."""
    odd = np.arange(len(block)) % 2 == 1
    ways = []
    for rows in (block, block[::-1]):
        for turned in (odd, ~odd):
            ways.append(np.where(turned[:, None, None], rows[:, ::-1], rows))
    return ways


def _spans(turned: Array, bottom: float, top: float) -> list[Array]:
    """How far along a polygon reaches anywhere between two lines across: united, (2,) each.

    Between neighbouring corners, as counted across, a polygon is made of trapezia.
    """
    levels = turned[:, 1]
    levels = np.unique(np.concatenate([[bottom, top], levels[(levels > bottom) & (levels < top)]]))
    following = np.roll(turned, -1, axis=0)
    found = []
    for low, high in pairwise(levels):
        if high - low <= 1e-9 * (top - bottom):
            continue  # rounding alone
        middle = (low + high) / 2
        spans = (turned[:, 1] > middle) != (following[:, 1] > middle)
        a, b = turned[spans], following[spans]
        slope = (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
        x = a[:, 0] + (np.array([[low], [middle], [high]]) - a[:, 1]) * slope
        ranked = x[:, np.argsort(x[1])]
        lefts, rights = ranked[:, ::2].min(axis=0), ranked[:, 1::2].max(axis=0)
        found += [(float(a), float(b)) for a, b in zip(lefts, rights, strict=True)]
    united: list[list[float]] = []
    for left, right in sorted(found):
        if united and left <= united[-1][1]:
            united[-1][1] = max(united[-1][1], right)
        else:
            united.append([left, right])
    return [np.array(one) for one in united]


#: Up to how many areas every order is looked at.
EXACT = 6


def visit_order(
    ways: Sequence[Sequence[Array]],
    *,
    start: ArrayLike | None = None,
    back: bool = False,
) -> list[tuple[int, int]]:
    """The order of areas, and how each is entered, that makes the whole way shortest.

    Every order is looked at for up to `EXACT` areas. Of more, a way that goes to the nearest next is improved
    by turning parts of it round and by moving areas to other places (2-opt, or-opt) until none of that helps:
    such a way is short, not surely the shortest.

    Parameters
    ----------
    ways
        Of each area the ways over it: rows (R, 2, 2) in metres, in the order flown.
    start
        (2,) where one begins, metres; None begins at any entrance.
    back
        Whether one returns to the start.

    Returns
    -------
    Of each visit the number of the area and of its way.

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.planning.patterns import visit_order
    >>> there = [[np.array([[[x, 0.0], [x, 1.0]]])] for x in (5.0, 1.0, 3.0)]
    >>> visit_order(there, start=[0.0, 0.0])
    [(1, 0), (2, 0), (0, 0)]
    """
    costs = _Costs(ways, start, back)
    if len(ways) <= EXACT:
        each = map(costs.best_ways, permutations(range(len(ways))))
        return min(each, key=lambda one: (one[0], one[1][::-1]))[1]
    order = costs.nearest_next()
    length, chosen = costs.best_ways(order)
    again = True
    while again:
        again = False
        for changed in _changed(order):
            shorter, ways_there = costs.best_ways(changed)
            if shorter < length - 1e-9:
                order, length, chosen, again = changed, shorter, ways_there, True
                break
    return chosen


class _Costs:
    """Lengths between all ways, and orders by them."""

    def __init__(self, ways: Sequence[Sequence[Array]], start: ArrayLike | None, back: bool) -> None:
        flat = [(k, w) for k, each in enumerate(ways) for w in range(len(each))]
        self.flat = flat
        self.of = [[i for i, (k, _) in enumerate(flat) if k == one] for one in range(len(ways))]
        entrance = np.array([ways[k][w][0, 0] for k, w in flat])
        leave = np.array([ways[k][w][-1, 1] for k, w in flat])
        apart = np.linalg.norm(leave[:, None] - entrance[None], axis=-1)
        # What lies within a way counts as well: ways round corners differ.
        self.inner = np.array(
            [np.linalg.norm(np.diff(ways[k][w].reshape(-1, 2), axis=0), axis=1).sum() for k, w in flat]
        )
        self.apart = apart
        at = None if start is None else np.asarray(start, float)
        self.first = np.zeros(len(flat)) if at is None else np.linalg.norm(entrance - at, axis=-1)
        self.home = np.zeros(len(flat)) if at is None or not back else np.linalg.norm(leave - at, axis=-1)

    def best_ways(self, order: Sequence[int]) -> tuple[float, list[tuple[int, int]]]:
        """The best ways in a given order, and their length."""
        begin = self.of[order[0]]
        length = self.first[begin] + self.inner[begin]
        paths = [[one] for one in begin]
        for k in order[1:]:
            options = self.of[k]
            total = length[:, None] + self.apart[np.ix_([p[-1] for p in paths], options)]
            pick = total.argmin(axis=0)
            length = total[pick, np.arange(len(options))] + self.inner[options]
            paths = [[*paths[pick[i]], one] for i, one in enumerate(options)]
        length = length + self.home[[p[-1] for p in paths]]
        best = int(length.argmin())
        return float(length[best]), [self.flat[one] for one in paths[best]]

    def nearest_next(self) -> list[int]:
        """From one area to that which begins nearest."""
        here = int(self.first.argmin())
        order = [self.flat[here][0]]
        while len(order) < len(self.of):
            left = [one for k, options in enumerate(self.of) if k not in order for one in options]
            here = left[int(self.apart[here, left].argmin())]
            order.append(self.flat[here][0])
        return order


def _changed(order: list[int]) -> list[list[int]]:
    """Orders that differ by one part turned round or by one area moved."""
    count = len(order)
    turned = [
        order[:i] + order[i:j][::-1] + order[j:] for i in range(count - 1) for j in range(i + 2, count + 1)
    ]
    moved = []
    for i in range(count):
        rest = order[:i] + order[i + 1 :]
        moved += [[*rest[:j], order[i], *rest[j:]] for j in range(count) if j != i]
    return turned + moved
