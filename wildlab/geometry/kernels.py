"""Compiled: rays over terrain.

Over bilinear patches it is one walk from cell to cell that steps over whole blocks.

A patch is the bilinear surface over four neighbouring nodes. Along a ray its height is a quadratic in the
ray's parameter, so where the ray meets it is known exactly; nothing is marched. A ray that stays above the
highest node of a block passes the whole block in one step.

Coordinates are those of the grid: ``x`` in columns (east), ``y`` in rows (north), ``z`` metres upwards.
`wildlab.geometry.georeference` gives them their place in n.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled
from wildlab.geometry.rays import BELOW, HIT, MISSED, NO_DATA, NOT_KNOWN

Array = Any


#: Any array: the types are the compiler's business.

#: Cells along each side of the smallest block that is stepped over, as a power of two.
FIRST = 2
#: Of a direction, what is as good as nothing.
TINY = 1e-150


def highest_of_blocks(height: Array, side: int, lone: float) -> Array:
    """Highest node of each block of ``side`` cells, both edges included; missing nodes count as ``lone``."""
    nodes = np.where(np.isnan(height), np.float32(lone), height)
    cells = np.maximum(nodes[:-1], nodes[1:])
    return highest(np.maximum(cells[:, :-1], cells[:, 1:]), side)


def highest(below: Array, side: int = 2) -> Array:
    """Highest of each block of ``side`` by ``side``; the last ones may be smaller."""
    rows, columns = (np.arange(0, count, side) for count in below.shape)
    return np.maximum.reduceat(np.maximum.reduceat(below, rows, axis=0), columns, axis=1)


@compiled
def patch_height(height: Array, x: float, y: float) -> float:
    """Height of the surface; NaN off the grid and over a patch that lacks a node."""
    rows, columns = height.shape
    if not (0 <= x <= columns - 1 and 0 <= y <= rows - 1):
        return np.nan
    j, i = min(int(x), columns - 2), min(int(y), rows - 2)
    u, v = x - j, y - i
    a, c = np.float64(height[i, j]), np.float64(height[i + 1, j])
    low, high = a + u * (height[i, j + 1] - a), c + u * (height[i + 1, j + 1] - c)
    return float(low + v * (high - low))


@compiled
def first_crossing(height: Array, i: int, j: int, start: Array, ray: Array, t0: float, t1: float) -> float:
    """Smallest parameter in [t0, t1] at which a ray above patch (i, j) reaches it; NaN for none."""
    a = np.float64(height[i, j])
    b, c = height[i, j + 1] - a, height[i + 1, j] - a
    d = height[i + 1, j + 1] - a - b - c
    # From t0 on, so that the numbers stay small: over a long way a square of t loses what z has.
    u, v = start[0] + t0 * ray[0] - j, start[1] + t0 * ray[1] - i
    above = (start[2] + t0 * ray[2]) - (a + b * u + c * v + d * u * v)
    if above <= 0:
        return t0
    slope = ray[2] - (b * ray[0] + c * ray[1] + d * (u * ray[1] + v * ray[0]))
    bend = -d * ray[0] * ray[1]
    end = t1 - t0
    if above + end * (slope + end * bend) > 0 and (bend <= 0 or slope >= 0):
        return np.nan  # still above at the end, and no dip between
    inside = slope * slope - 4 * bend * above
    if inside < 0:
        return np.nan
    # The root that does not subtract equal numbers.
    half = -0.5 * (slope - np.sqrt(inside)) if slope < 0 else -0.5 * (slope + np.sqrt(inside))
    first = np.inf
    if half != 0:
        s = above / half
        if s >= 0:
            first = s
    if bend != 0:
        s = half / bend
        if 0 <= s < first:
            first = s
    if first <= end:
        return t0 + first
    # Rounding may put a crossing at the patch's edge just behind it.
    return t1 if above + end * (slope + end * bend) <= 0 else np.nan


@compiled
def onward(position: float, along: float, before: int, first: int, last: int) -> int:
    """Cell of a position within first to last, never behind the one before: rounding makes circles."""
    now = min(max(int(position), first), last)
    return max(now, before) if along > 0 else min(now, before)


@compiled
def walk(
    height: Array, blocks: Array, shapes: Array, start: Array, ray: Array, furthest: float, top: float
) -> tuple[float, int]:
    """Parameter at which a ray first meets the surface, and what became of it.

    ``blocks`` holds the highest nodes of all levels one after the other, ``shapes`` (levels, 3) rows, columns
    and where each begins. Over a patch that lacks a node the surface is taken to lie nowhere above ``top``: a
    ray that comes lower there is of no use.
    """
    rows, columns = height.shape
    x, y, z = start[0], start[1], start[2]
    dx, dy, dz = ray[0], ray[1], ray[2]
    if not (np.isfinite(x + y + z + dx + dy + dz)):
        return np.nan, NOT_KNOWN
    # So near to straight down that the reciprocal has no number: straight down.
    dx, dy = 0.0 if abs(dx) < TINY else dx, 0.0 if abs(dy) < TINY else dy
    t, end = 0.0, furthest
    for position, along, last in ((x, dx, columns - 1.0), (y, dy, rows - 1.0)):
        if along == 0:
            if position < 0 or position > last:
                return np.nan, MISSED
            continue
        near, far = -position / along, (last - position) / along
        t, end = max(t, min(near, far)), min(end, max(near, far))
    if dz < 0:
        t = max(t, (top - z) / dz)  # nothing is above the highest node
    elif z > top:
        return np.nan, MISSED
    if not t <= end:
        return np.nan, MISSED
    begun = t == 0.0
    per_x, per_y, per_z = 1 / dx if dx else np.inf, 1 / dy if dy else np.inf, 1 / dz if dz else np.inf
    levels = shapes.shape[0]
    level = min(levels, 2)
    j = min(max(int(x + t * dx), 0), columns - 2)
    i = min(max(int(y + t * dy), 0), rows - 2)
    # From a border towards less it goes into the cell before, and has nothing to do with this one.
    if dx < 0 and 0 < j == x + t * dx:
        j -= 1
    if dy < 0 and 0 < i == y + t * dy:
        i -= 1
    # Every step crosses a border or goes down a level, and every border takes it up by one level at most.
    for _ in range(4 * (rows + columns) + 100):
        size = 0 if level == 0 else FIRST + level - 1
        bi, bj = i >> size, j >> size
        left, low = bj << size, bi << size
        right, high = min(left + (1 << size), columns - 1), min(low + (1 << size), rows - 1)
        tx = np.inf if dx == 0 else ((right if dx > 0 else left) - x) * per_x
        ty = np.inf if dy == 0 else ((high if dy > 0 else low) - y) * per_y
        out = max(min(tx, ty, end), t)
        lowest = z + (t if dz > 0 else out) * dz
        if level > 0:
            highest = blocks[shapes[level - 1, 2] + bi * shapes[level - 1, 1] + bj]
            if lowest <= highest:
                level -= 1
                if dz < 0 and z + t * dz > highest:
                    # Nothing in this block is higher: the ray may begin where it comes down to that.
                    t = min(max(t, (highest - z) * per_z), out)
                    begun = False
                    j = onward(x + t * dx, dx, j, left, right - 1)
                    i = onward(y + t * dy, dy, i, low, high - 1)
                continue
        else:
            missing = height[i, j] + height[i, j + 1] + height[i + 1, j] + height[i + 1, j + 1]
            if missing != missing:
                if lowest <= top:
                    return np.nan, NO_DATA
            else:
                hit = first_crossing(height, i, j, start, ray, t, out)
                if hit == hit:
                    if begun and hit == 0.0 and z < patch_height(height, x, y):
                        return np.nan, BELOW
                    return hit, HIT
        if out >= end:
            return np.nan, MISSED
        t = out
        # The border that was crossed says in which cell the walk goes on; rounding has no say in it.
        if tx <= ty:
            j = right if dx > 0 else left - 1
            if tx < ty:
                i = onward(y + t * dy, dy, i, low, high - 1)
        if ty <= tx:
            i = high if dy > 0 else low - 1
            if ty < tx:
                j = onward(x + t * dx, dx, j, left, right - 1)
        if not (0 <= i < rows - 1 and 0 <= j < columns - 1):
            return np.nan, MISSED
        level = min(level + 1, levels)
    return np.nan, NOT_KNOWN


@compiled
def walk_all(
    height: Array, blocks: Array, shapes: Array, starts: Array, rays: Array, furthest: float, top: float
) -> tuple[Array, Array]:
    """`walk` for every row of ``starts`` and ``rays``."""
    count = rays.shape[0]
    at, became = np.empty(count), np.empty(count, np.int8)
    for n in range(count):
        at[n], became[n] = walk(height, blocks, shapes, starts[n], rays[n], furthest, top)
    return at, became
