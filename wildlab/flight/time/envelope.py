"""The line under stamps that can only be late: what is left of delays when the least of them count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Stamps under the line are early, and outliers, where it rises by so many of its own standard deviations
#: without them; so often is it tried what the next two that it rests on hide.
EARLY, PEELS = 10.0, 10
#: Fewer stamps are all believed: among them the least delays are too far apart to tell.
FEW = 60
#: What can lie on the hull, or come to: so many of the lowest in each of so many stretches.
STRETCHES, LOWEST = 200, 12


class Envelope(NamedTuple):
    """``y = at_0 + slope x`` under all used; standard deviations at the mean of ``x``, of the slope."""

    at_0: float
    slope: float
    used: NDArray[np.bool_]
    middle_sd: float
    slope_sd: float


def lower_line(x: Array, y: Array) -> Envelope:
    """The line under all points that has the least sum of distances above it.

    It is the edge of the lower convex hull under the mean of ``x``. A few points far under all others are
    left out. How well the line is known follows from how close together the lowest distances lie: where
    the density of delays at no delay is f, the least of N is off by 1 / (N f).

    Parameters
    ----------
    x, y
        (N,) each, finite; ``y`` about zero.

    Returns
    -------
    Envelope
        Standard deviations are infinite where there are fewer than four points.
    """
    x_0 = float(x.mean())
    near = _lowest(x, y)
    kept = near
    at_0, slope, support = _edge(x[kept], y[kept], x_0)
    best, start = (at_0, slope, kept), at_0 + slope * x_0
    for peel in range(1, 1 + min(PEELS, len(x) // FEW)):
        kept = np.delete(kept, support)
        at_0, slope, support = _edge(x[kept], y[kept], x_0)
        sd, _ = _spreads(x, y - at_0 - slope * x)
        # Without outliers each round lifts the line by about the distance between neighbours.
        if at_0 + slope * x_0 - start > (EARLY + 2 * peel) * max(sd, 1e-7):
            best = (at_0, slope, kept)
    at_0, slope, kept = best
    above = y - at_0 - slope * x
    middle_sd, slope_sd = _spreads(x, above)
    if len(kept) < len(near):
        # What went with the outliers and is none comes back.
        good = near[above[near] >= -3 * middle_sd]
        at_0, slope, _ = _edge(x[good], y[good], x_0)
        above = y - at_0 - slope * x
        # Where some are early, others may be, by less than it takes to be seen.
        middle_sd, slope_sd = (3 * sd for sd in _spreads(x, above))
    return Envelope(at_0, slope, above >= -1e-6, middle_sd, slope_sd)


def _lowest(x: Array, y: Array) -> NDArray[np.intp]:
    """Rows of the lowest points in each stretch of x."""
    if len(x) <= STRETCHES * LOWEST:
        return np.arange(len(x))
    stretch = np.minimum(((x - x.min()) / np.ptp(x) * STRETCHES).astype(int), STRETCHES - 1)
    order = np.lexsort((y, stretch))
    first = np.searchsorted(stretch[order], stretch[order])
    return np.sort(order[np.arange(len(x)) - first < LOWEST])


def _edge(x: Array, y: Array, mean: float) -> tuple[float, float, list[int]]:
    """Height at zero and slope of the hull's edge under a mean of x, and the rows that it rests on."""
    order = np.lexsort((y, x))
    # Of equal x only the lowest can be on the hull.
    order = order[np.concatenate([[True], np.diff(x[order]) > 0])]
    px, py = x[order].tolist(), y[order].tolist()
    hull: list[int] = []
    for i in range(len(px)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (px[b] - px[a]) * (py[i] - py[a]) > (py[b] - py[a]) * (px[i] - px[a]):
                break
            hull.pop()
        hull.append(i)
    if len(hull) == 1:
        return py[hull[0]], 0.0, [int(order[hull[0]])]
    at = int(np.clip(np.searchsorted([px[i] for i in hull], mean), 1, len(hull) - 1))
    a, b = hull[at - 1], hull[at]
    slope = (py[b] - py[a]) / (px[b] - px[a])
    return py[a] - slope * px[a], slope, [int(order[a]), int(order[b])]


def _spreads(x: Array, above: Array) -> tuple[float, float]:
    """Standard deviations of the line at the middle and of its slope, from distances above it (N,)."""
    if len(x) < 4 or np.ptp(x) == 0:
        return np.inf, np.inf
    # The two that the line rests on say nothing; a handful above them tells how dense delays are there.
    lowest = np.sort(above[above >= 0])[2:]
    if len(lowest) < 2:
        return np.inf, np.inf
    many = int(np.clip(round(np.sqrt(len(lowest))), 2, 30))
    many = min(many, len(lowest))
    spacing = float(lowest[many - 1]) / many
    # The same from the fifth alone, which is more where small delays are rare.
    spacing = max(spacing, 0.25 * float(lowest[min(4, len(lowest) - 1)]))
    # A least value is as far off, in the mean, as it spreads; a line has two ends to find, and half of the
    # points for each.
    return 2.0 * spacing, 2.3 * spacing / float(np.std(x))
