"""In which order to visit areas that can each be entered in several ways: the shortest way through all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.planning.areas import way_inside

#: Up to how many areas every order is looked at.
EXACT = 9
#: Ways between areas, times corners of the fence, up to which ways that stay inside are measured; of more,
#: which would take minutes, the order is by straight ways.
MOST_WAYS = 20_000


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
    order: Sequence[int] | None = None,
    fence: Array | None = None,
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
        Whether one returns to where one began.
    order
        A given order: then only the ways are chosen.
    fence
        (K, 2) metres: the ways between the areas stay inside.

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
    >>> from wildlab.planning.visits import AreaWay, visit_order
    >>> there = [[AreaWay(np.zeros((0, 2, 2)), np.array([[x, 0.0], [x, 1.0]]))] for x in (5.0, 1.0, 3.0)]
    >>> visit_order(there, start=[0.0, 0.0])
    [(1, 0), (2, 0), (0, 0)]
    """
    if any(not len(one) for one in ways):
        raise WildlabError("an area has no way over it", "give one at least for each", field="ways")
    costs = _Costs(ways, start, back, fence)
    if order is not None:
        return costs.best_ways(list(order))[1]
    if len(ways) <= EXACT:
        return costs.exact()
    return costs.improved()


class _Costs:
    """Lengths between all ways, and orders by them."""

    def __init__(
        self, ways: Sequence[Sequence[AreaWay]], start: ArrayLike | None, back: bool, fence: Array | None
    ) -> None:
        flat = [(k, w) for k, each in enumerate(ways) for w in range(len(each))]
        self.flat = flat
        self.of = [[i for i, (k, _) in enumerate(flat) if k == one] for one in range(len(ways))]
        entrance = np.array([ways[k][w].points[0] for k, w in flat])
        leave = np.array([ways[k][w].points[-1] for k, w in flat])
        apart = np.linalg.norm(leave[:, None] - entrance[None], axis=-1)
        if fence is not None and len(flat) ** 2 * len(fence) <= MOST_WAYS:
            for i, j in np.ndindex(*apart.shape):
                if flat[i][0] != flat[j][0]:
                    path = way_inside(fence, leave[i], entrance[j])
                    apart[i, j] = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        # What lies within a way counts as well: ways round corners differ.
        self.inner = np.array(
            [np.linalg.norm(np.diff(ways[k][w].points, axis=0), axis=1).sum() for k, w in flat]
        )
        self.apart = apart
        at = None if start is None else np.asarray(start, float)
        self.first = np.zeros(len(flat)) if at is None else np.linalg.norm(entrance - at, axis=-1)
        self.back, self.start = back, at
        self.home = np.zeros(len(flat)) if at is None or not back else np.linalg.norm(leave - at, axis=-1)

    def best_ways(self, order: list[int]) -> tuple[float, list[tuple[int, int]]]:
        """The best ways in a given order, and their length."""
        # Without a start, a way back ends where it began: every beginning is tried.
        loops = self.back and self.start is None
        best: tuple[float, list[int]] = (np.inf, [])
        for begin in ([one] for one in self.of[order[0]]) if loops else [self.of[order[0]]]:
            length = self.first[begin] + self.inner[begin]
            paths = [[one] for one in begin]
            for k in order[1:]:
                options = self.of[k]
                total = length[:, None] + self.apart[np.ix_([p[-1] for p in paths], options)]
                pick = total.argmin(axis=0)
                length = total[pick, np.arange(len(options))] + self.inner[options]
                paths = [[*paths[pick[i]], one] for i, one in enumerate(options)]
            last = [p[-1] for p in paths]
            length = length + (self.apart[last, begin[0]] if loops else self.home[last])
            k = int(length.argmin())
            if length[k] < best[0]:
                best = (float(length[k]), paths[k])
        return best[0], [self.flat[one] for one in best[1]]

    def exact(self) -> list[tuple[int, int]]:
        """Held and Karp's dynamic programme over sets of areas; ways with the areas."""
        count, size = len(self.of), len(self.flat)
        owner = np.array([k for k, _ in self.flat])
        loops = self.back and self.start is None
        best: tuple[float, list[int]] = (np.inf, [])
        for begin in self.of[0] if loops else [None]:
            length = np.full((1 << count, size), np.inf)
            before = np.full((1 << count, size), -1, int)
            for one in range(size) if begin is None else [begin]:
                length[1 << owner[one], one] = self.first[one] + self.inner[one]
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
            full = (1 << count) - 1
            total_way = length[full] + (self.home if begin is None else self.apart[:, begin])
            last = int(total_way.argmin())
            if total_way[last] < best[0]:
                path, mask = [last], full
                while before[mask, path[-1]] >= 0:
                    mask, step = mask ^ (1 << owner[path[-1]]), before[mask, path[-1]]
                    path.append(int(step))
                best = (float(total_way[last]), path[::-1])
        return [self.flat[one] for one in best[1]]

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
