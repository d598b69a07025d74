"""Whether lines over bilinear patches are clear, compiled: that there is no crossing, and not where it is.

A line is followed from its lower end, for that is where ground hides it; above the highest node nothing does.
What hid the line before is tried first: neighbours are hidden by the same ridge. Coordinates and blocks are
those of `wildlab.geometry.terrain_kernels`, whose functions are not called here, for the compiler's cache
looks at one file only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any

#: Cells along each side of the smallest block, as a power of two: as in `terrain_kernels`.
FIRST = 2
#: Of a direction, what is as good as nothing.
TINY = 1e-150


@compiled
def touches(height: Array, i: int, j: int, u: float, v: float, z: float, ray: Array, end: float) -> bool:
    """Whether a line that enters patch (i, j) at (u, v, z) comes down to it within ``end`` of its parameter.

    True too where the patch lacks a node: NaN compares as not above.
    """
    a = np.float64(height[i, j])
    b, c = height[i, j + 1] - a, height[i + 1, j] - a
    d = height[i + 1, j + 1] - a - b - c
    above = z - (a + b * u + c * v + d * u * v)
    if not above > 0:
        return True
    slope = ray[2] - (b * ray[0] + c * ray[1] + d * (u * ray[1] + v * ray[0]))
    bend = -d * ray[0] * ray[1]
    if not above + end * (slope + end * bend) > 0:
        return True
    # Between both ends it dips where the height above the ground is bent upwards and falls at first.
    dips: bool = bend > 0 and slope < 0 and -slope < 2 * bend * end and slope * slope >= 4 * bend * above
    return dips


@compiled
def inside(position: float, along: float, before: int, first: int, last: int) -> int:
    """Cell of a position within first to last, never behind the one before: rounding makes circles."""
    now = min(max(int(position), first), last)
    return max(now, before) if along > 0 else min(now, before)


@compiled
def hidden_at(
    height: Array,
    blocks: Array,
    shapes: Array,
    start: Array,
    ray: Array,
    begin: float,
    end: float,
    top: float,
) -> float:
    """Parameter near which a line is hidden, followed from ``begin`` to ``end``; NaN where it is clear.

    ``ray[2]`` is not below zero: the line rises.
    """
    rows, columns = height.shape
    x, y, z = start[0], start[1], start[2]
    dx = 0.0 if abs(ray[0]) < TINY else ray[0]
    dy = 0.0 if abs(ray[1]) < TINY else ray[1]
    dz = ray[2]
    t = begin
    for position, along, last in ((x, dx, columns - 1.0), (y, dy, rows - 1.0)):
        if along == 0:
            if position < 0 or position > last:
                return np.nan
            continue
        near, far = -position / along, (last - position) / along
        t, end = max(t, min(near, far)), min(end, max(near, far))
    if dz > 0:
        end = min(end, (top - z) / dz)
    elif z > top:
        return np.nan
    if not t <= end:
        return np.nan
    per_x, per_y = 1 / dx if dx else np.inf, 1 / dy if dy else np.inf
    levels = shapes.shape[0]
    level = 0
    j = min(max(int(x + t * dx), 0), columns - 2)
    i = min(max(int(y + t * dy), 0), rows - 2)
    # Every step crosses a border or goes down a level, and every border takes it up by one level at most.
    for _ in range(4 * (rows + columns) + 100):
        size = 0 if level == 0 else FIRST + level - 1
        bi, bj = i >> size, j >> size
        if level > 0 and z + t * dz <= blocks[shapes[level - 1, 2] + bi * shapes[level - 1, 1] + bj]:
            level -= 1
            continue
        left, low = bj << size, bi << size
        right, high = min(left + (1 << size), columns - 1), min(low + (1 << size), rows - 1)
        tx = np.inf if dx == 0 else ((right if dx > 0 else left) - x) * per_x
        ty = np.inf if dy == 0 else ((high if dy > 0 else low) - y) * per_y
        out = max(min(tx, ty, end), t)
        if level == 0 and touches(height, i, j, x + t * dx - j, y + t * dy - i, z + t * dz, ray, out - t):
            return t
        if out >= end:
            return np.nan
        t = out
        was_i, was_j = i, j
        # The border that was crossed says in which cell the walk goes on; rounding has no say in it.
        if tx <= ty:
            j = right if dx > 0 else left - 1
            if tx < ty:
                i = inside(y + t * dy, dy, i, low, high - 1)
        if ty <= tx:
            i = high if dy > 0 else low - 1
            if ty < tx:
                j = inside(x + t * dx, dx, j, left, right - 1)
        if not (0 <= i < rows - 1 and 0 <= j < columns - 1):
            return np.nan
        # The block about this one was looked at and is too high; the next one may not be.
        wider = FIRST + level
        if level < levels and (was_i >> wider != i >> wider or was_j >> wider != j >> wider):
            level += 1
    return t


@compiled
def clear_all(
    height: Array, blocks: Array, shapes: Array, lenses: Array, points: Array, short: float, top: float
) -> Array:
    """Whether the line from a lens to each point is clear, but for ``short`` of its length before the point.

    One lens may stand for all.
    """
    rows, columns = height.shape
    clear = np.zeros(points.shape[0], np.bool_)
    start, ray = np.empty(3), np.empty(3)
    hint_x, hint_y = np.nan, np.nan
    for n in range(points.shape[0]):
        lens, point = lenses[0 if lenses.shape[0] == 1 else n], points[n]
        rises = lens[2] >= point[2]
        known = True
        for k in range(3):
            start[k] = point[k] if rises else lens[k]
            ray[k] = lens[k] - point[k] if rises else point[k] - lens[k]
            known = known and np.isfinite(start[k] + ray[k])
        if not known:
            continue
        begin, end = (short, 1.0) if rises else (0.0, 1.0 - short)
        # What hid the line before may hide this one: at the place on it that is nearest to that.
        flat = ray[0] * ray[0] + ray[1] * ray[1]
        s = ((hint_x - start[0]) * ray[0] + (hint_y - start[1]) * ray[1]) / flat
        if begin <= s <= end:
            x, y = start[0] + s * ray[0], start[1] + s * ray[1]
            if 0 <= x <= columns - 1 and 0 <= y <= rows - 1:
                j, i = min(int(x), columns - 2), min(int(y), rows - 2)
                u, v = x - j, y - i
                low = (1 - u) * height[i, j] + u * height[i, j + 1]
                high = (1 - u) * height[i + 1, j] + u * height[i + 1, j + 1]
                if start[2] + s * ray[2] < (1 - v) * low + v * high:
                    continue
        t = hidden_at(height, blocks, shapes, start, ray, begin, end, top)
        if t == t:
            hint_x, hint_y = start[0] + t * ray[0], start[1] + t * ray[1]
        else:
            clear[n] = True
    return clear
