"""Lawn-mower patterns: parallel rows over one area or several, in the order of the shortest way (F 5.2).

F flies rows over one enclosure after the other and leaves the order of the enclosures and the direction of
the rows to the user; here both may be chosen, or follow from the length of the way. F's sentence that such
rows cover any convex area takes no heed of how rows end: a row that ends at the fence leaves the tips of a
slanted fence unseen, so rows here reach as far as the area does anywhere within half a row distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError, above_zero, share_below_one
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array, Indices
from wildlab.planning.areas import check_area, edge_directions

#: More rows than this over one area are a slip of a unit.
MOST_ROWS = 5000


class Footprint(NamedTuple):
    """The largest upright rectangle within what a level camera sees that looks straight down, metres.

    Attributes
    ----------
    width, length
        Along the rows and along the columns of the image.
    """

    width: float
    length: float


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


def footprint(camera: Camera, height: float) -> Footprint:
    """What a camera that looks straight down surely sees of flat ground.

    Parameters
    ----------
    camera
        The intrinsic parameters; distortion is taken off, so the edges of the footprint are curved, and the
        rectangle lies within them.
    height
        Of the lens above the ground, metres.

    Returns
    -------
    Footprint

    Raises
    ------
    WildlabError
        Where the height is not above zero.

    Examples
    --------
    >>> footprint(Camera(100, 50, fx=99.0, fy=49.0, cx=49.5, cy=24.5), 10.0)
    Footprint(width=10.0, length=10.0)
    """
    above_zero(height=height)
    right, low = camera.width - 1.0, camera.height - 1.0
    u, v = np.linspace(0, right, 65), np.linspace(0, low, 65)
    xy = [
        normalise(camera, np.stack(np.broadcast_arrays(*edge), axis=-1))
        for edge in ((0.0, v), (right, v), (u, 0.0), (u, low))
    ]
    width = float(xy[1][:, 0].min() - xy[0][:, 0].max())
    length = float(xy[3][:, 1].min() - xy[2][:, 1].max())
    return Footprint(round(width * height, 9), round(length * height, 9))


def row_distance(width: float, overlap: float = 0.0) -> float:
    """Distance between rows for which neighbouring strips share a part of their width.

    Parameters
    ----------
    width
        Of the strip that one row sees, metres.
    overlap
        Share of it that the next row sees again, from 0 to below 1.

    Returns
    -------
    float, metres.

    Raises
    ------
    WildlabError
        Where the width is not above zero, or the overlap is not from 0 to below 1.

    Examples
    --------
    >>> row_distance(30.0, 0.2)
    24.0
    """
    above_zero(width=width)
    share_below_one(overlap=overlap)
    return width * (1 - overlap)


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
        Between rows at most, metres; see `row_distance`.
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
    distance: float | Sequence[float],
    *,
    directions: Sequence[float | None] | None = None,
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
        Between rows, for all or for each, metres.
    directions
        Of the rows of each area, radians, None where it is to be chosen as in `lawn_mower`.
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
        As `lawn_mower`; where there is no area, or not one distance, direction or place for each.

    Examples
    --------
    >>> from wildlab.planning.areas import rectangle
    >>> fields = [rectangle(0.0, east, 100.0, 40.0, 0.0) for east in (0.0, 200.0, 100.0)]
    >>> print(lawn_mowers(fields, 20.0, start=[-100.0, 0.0]).area)
    [0 0 2 2 1 1]
    """
    if not len(areas):
        raise WildlabError("there is no area", "give one at least", field="areas")
    apart = np.atleast_1d(np.asarray(distance, float))
    apart = np.repeat(apart, len(areas)) if np.ndim(distance) == 0 else apart
    wanted: list[float | None] = [None] * len(areas) if directions is None else list(directions)
    for given, what in ((len(apart), "distance"), (len(wanted), "directions")):
        if given != len(areas):
            raise WildlabError(f"{given} values for {len(areas)} areas", "give one for each", field=what)
    fences = [check_area(one, f"area {k + 1}") for k, one in enumerate(areas)]
    inner = [
        _block_ways(fence, float(d), angle, turn)
        for fence, d, angle in zip(fences, apart, wanted, strict=True)
    ]
    chosen = visit_order([ways for ways, _ in inner], start=start, back=back)
    rows, area, way = [], [], []
    for k, which in chosen:
        one = inner[k][0][which]
        rows.append(one.rows)
        area.append(np.full(len(one.rows), k))
        way.append(one.points)
    flown = np.concatenate(rows)
    along = flown[:, 1] - flown[:, 0]
    return Pattern(
        flown,
        np.concatenate(area).astype(np.intp),
        np.concatenate(way),
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
) -> tuple[list[AreaWay], float]:
    """Ways over one area, each with its own entrance and exit, and the distance between its rows."""
    angle = _best_direction(fence, distance, turn) if direction is None else float(direction)
    rows, step = rows_over(fence, distance, angle)
    each = [[_way(way) for way in _four_ways(block)] for block in _blocks(rows, angle)]
    if len(each) == 1:
        return each[0], step
    # Blocks within a concave area, in the shortest order; the whole may be flown either way round.
    flown = np.concatenate([each[k][which].rows for k, which in visit_order(each)])
    return [_way(flown), _way(flown[::-1, ::-1])], step


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


def _way(rows: Array) -> AreaWay:
    return AreaWay(rows, rows.reshape(-1, 2))


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
EXACT = 9


class AreaWay(NamedTuple):
    """One way over an area.

    Attributes
    ----------
    rows
        (R, 2, 2) metres, in the order flown.
    points
        (M, 2) metres, all way points; the first is its entrance, the last its exit.
    """

    rows: Array
    points: Array


def visit_order(
    ways: Sequence[Sequence[AreaWay]],
    *,
    start: ArrayLike | None = None,
    back: bool = False,
) -> list[tuple[int, int]]:
    """The order of areas, and how each is entered, that makes the whole way shortest.

    Every order is looked at for up to `EXACT` areas (dynamic programming over the set of those visited). Of
    more, a way that goes to the nearest next is improved by turning parts of it round and by moving areas to
    other places (2-opt, or-opt) until none of that helps: such a way is short, not surely the shortest.

    Parameters
    ----------
    ways
        Of each area the ways over it.
    start
        (2,) where one begins, metres; None begins at any entrance.
    back
        Whether one returns to the start.

    Returns
    -------
    Of each visit the number of the area and of its way.

    Raises
    ------
    WildlabError
        Where an area has no way.

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.planning.patterns import AreaWay, visit_order
    >>> there = [[AreaWay(np.zeros((0, 2, 2)), np.array([[x, 0.0], [x, 1.0]]))] for x in (5.0, 1.0, 3.0)]
    >>> visit_order(there, start=[0.0, 0.0])
    [(1, 0), (2, 0), (0, 0)]
    """
    if any(not len(one) for one in ways):
        raise WildlabError("an area has no way over it", "give one at least for each", field="ways")
    costs = _Costs(ways, start, back)
    if len(ways) <= EXACT:
        return costs.exact()
    return costs.improved()


class _Costs:
    """Lengths between all ways, and orders by them."""

    def __init__(self, ways: Sequence[Sequence[AreaWay]], start: ArrayLike | None, back: bool) -> None:
        flat = [(k, w) for k, each in enumerate(ways) for w in range(len(each))]
        self.flat = flat
        self.of = [[i for i, (k, _) in enumerate(flat) if k == one] for one in range(len(ways))]
        entrance = np.array([ways[k][w].points[0] for k, w in flat])
        leave = np.array([ways[k][w].points[-1] for k, w in flat])
        apart = np.linalg.norm(leave[:, None] - entrance[None], axis=-1)
        # What lies within a way counts as well: ways round corners differ.
        self.inner = np.array(
            [np.linalg.norm(np.diff(ways[k][w].points, axis=0), axis=1).sum() for k, w in flat]
        )
        self.apart = apart
        at = None if start is None else np.asarray(start, float)
        self.first = np.zeros(len(flat)) if at is None else np.linalg.norm(entrance - at, axis=-1)
        self.home = np.zeros(len(flat)) if at is None or not back else np.linalg.norm(leave - at, axis=-1)

    def best_ways(self, order: list[int]) -> tuple[float, list[tuple[int, int]]]:
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

    def exact(self) -> list[tuple[int, int]]:
        """Held and Karp's dynamic programme over sets of areas; ways with the areas."""
        count, size = len(self.of), len(self.flat)
        owner = np.array([k for k, _ in self.flat])
        length = np.full((1 << count, size), np.inf)
        before = np.full((1 << count, size), -1, int)
        length[1 << owner, np.arange(size)] = self.first + self.inner
        for mask in range(1, 1 << count):
            here = np.flatnonzero(np.isfinite(length[mask]))
            there = np.flatnonzero((mask >> owner) & 1 == 0)
            if not len(here) or not len(there):
                continue
            total = length[mask, here][:, None] + self.apart[np.ix_(here, there)] + self.inner[there]
            pick = total.argmin(axis=0)
            value = total[pick, np.arange(len(there))]
            masks = mask | (1 << owner[there])
            better = value < length[masks, there]
            length[masks[better], there[better]] = value[better]
            before[masks[better], there[better]] = here[pick[better]]
        mask = (1 << count) - 1
        path = [int((length[mask] + self.home).argmin())]
        while before[mask, path[-1]] >= 0:
            mask, step = mask ^ (1 << owner[path[-1]]), before[mask, path[-1]]
            path.append(int(step))
        return [self.flat[one] for one in path[::-1]]

    def improved(self) -> list[tuple[int, int]]:
        """Nearest next, then parts turned round or moved until nothing helps."""
        order = self._nearest_next()
        length, chosen = self.best_ways(order)
        again = True
        while again:
            again = False
            for changed in _changed(order):
                shorter, ways = self.best_ways(changed)
                if shorter < length - 1e-9:
                    order, length, chosen, again = changed, shorter, ways, True
                    break
        return chosen

    def _nearest_next(self) -> list[int]:
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
