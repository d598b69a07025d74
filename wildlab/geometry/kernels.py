"""Compiled: lenses without their distortion, attitudes between two others, rays over terrain.

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
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.compilation import announced, compiled
from wildlab.geometry.rays import BELOW, HIT, MISSED, NO_DATA, NOT_KNOWN


@compiled
def undistort_rows(
    points: Array, k1: float, k2: float, p1: float, p2: float, k3: float, tolerance: float
) -> None:
    """`wildlab.geometry.camera.undistort` of ``points`` (N, 2), in place."""
    for i in range(len(points)):
        u, v = points[i]
        x, y = u, v
        for step in range(51):
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
            a = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
            b = slope * x * y + 2 * p1 * x + 2 * p2 * y
            d = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
            determinant = a * d - b * b
            miss_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) - u
            miss_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y - v
            miss = max(abs(miss_x), abs(miss_y))
            if not miss > tolerance or step == 50:
                break
            step_x = (d * miss_x - b * miss_y) / determinant
            step_y = (a * miss_y - b * miss_x) / determinant
            # A long step would leap over the fold of the polynomial.
            length = np.hypot(step_x, step_y)
            shortened = min(1.0, 0.3 / length) if length > 0 else 1.0
            x, y = x - step_x * shortened, y - step_y * shortened
        one_to_one = determinant > 0 and a > 0
        solved = miss <= max(tolerance, 1e-12)
        points[i, 0] = x if one_to_one and solved else np.nan
        points[i, 1] = y if one_to_one and solved else np.nan


Array = Any
Rows = NDArray[np.intp]


def between_attitudes(q_nb: ArrayLike, before: Rows, after: Rows, share: ArrayLike) -> Array:
    """Rotations on the way from some attitudes to others, turning at an even rate the shorter way (slerp).

    Parameters
    ----------
    q_nb
        (M, 4) quaternions w, x, y, z, of any length but zero.
    before, after
        (N,) their rows to start from and to end at.
    share
        (N,) how far on the way, 0 at the start and 1 at the end.

    Returns
    -------
    (N, 3, 3), takes a vector from b to n; NaN where the share or one of both quaternions is NaN or zero.

    Examples
    --------
    Half-way from north to east is north-east:

    >>> q = np.array([[1.0, 0.0, 0.0, 0.0], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    >>> R = between_attitudes(q, np.array([0]), np.array([1]), np.array([0.5]))
    >>> print(np.round(R[0] @ [1.0, 0.0, 0.0], 3))
    [0.707 0.707 0.   ]
    """
    q, s = np.ascontiguousarray(q_nb, float), np.ascontiguousarray(share, float)
    R = np.empty((len(s), 3, 3))
    with announced("attitudes between two others"):
        _fill(q, np.ascontiguousarray(before), np.ascontiguousarray(after), s, R)
    return R


@compiled
def _fill(q: Array, before: Rows, after: Rows, share: Array, R: Array) -> None:
    for k in range(len(share)):
        i, j, s = before[k], after[k], share[k]
        a, b, c, d = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        e, f, g, h = q[j, 0], q[j, 1], q[j, 2], q[j, 3]
        size, other = np.sqrt(a * a + b * b + c * c + d * d), np.sqrt(e * e + f * f + g * g + h * h)
        if not (np.isfinite(s) and np.isfinite(size) and np.isfinite(other) and size > 0 and other > 0):
            R[k] = np.nan
            continue
        a, b, c, d = a / size, b / size, c / size, d / size
        e, f, g, h = e / other, f / other, g / other, h / other
        # The turn from one to the other: the first backwards, then the second.
        w = a * e + b * f + c * g + d * h
        x = a * f - b * e - c * h + d * g
        y = a * g + b * h - c * e - d * f
        z = a * h - b * g + c * f - d * e
        if w < 0:  # the same turn the shorter way
            w, x, y, z = -w, -x, -y, -z
        length = np.sqrt(x * x + y * y + z * z)
        half = np.arctan2(length, w)
        # sin(s half) / sin(half), which is s where both vanish.
        scale = np.sin(s * half) / length if length > 1e-12 else s
        w, x, y, z = np.cos(s * half), scale * x, scale * y, scale * z
        a, b, c, d = (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        )
        size = a * a + b * b + c * c + d * d
        R[k, 0, 0], R[k, 0, 1], R[k, 0, 2] = (
            1 - 2 * (c * c + d * d) / size,
            2 * (b * c - a * d) / size,
            2 * (b * d + a * c) / size,
        )
        R[k, 1, 0], R[k, 1, 1], R[k, 1, 2] = (
            2 * (b * c + a * d) / size,
            1 - 2 * (b * b + d * d) / size,
            2 * (c * d - a * b) / size,
        )
        R[k, 2, 0], R[k, 2, 1], R[k, 2, 2] = (
            2 * (b * d - a * c) / size,
            2 * (c * d + a * b) / size,
            1 - 2 * (b * b + c * c) / size,
        )


#: Any array: the types are the compiler's business.

#: Cells along each side of the smallest block that is stepped over, as a power of two.
FIRST = 2
#: Of a direction, what is as good as nothing.
TINY = 1e-150


@compiled
def highest_of_blocks(height: Array, side: int, lone: float) -> Array:
    """Highest node of each block of ``side`` cells, both edges included; missing nodes count as ``lone``."""
    cells = (height.shape[0] - 1, height.shape[1] - 1)
    out = np.empty((-(-cells[0] // side), -(-cells[1] // side)), np.float32)
    for bi in range(out.shape[0]):
        for bj in range(out.shape[1]):
            top = -np.inf
            for i in range(bi * side, min((bi + 1) * side, cells[0]) + 1):
                for j in range(bj * side, min((bj + 1) * side, cells[1]) + 1):
                    h = height[i, j]
                    top = max(top, h if h == h else lone)
            out[bi, bj] = top
    return out


@compiled
def highest_of_four(below: Array) -> Array:
    """Highest of each two by two blocks."""
    out = np.empty((-(-below.shape[0] // 2), -(-below.shape[1] // 2)), np.float32)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            top = -np.inf
            for a in range(2 * i, min(2 * i + 2, below.shape[0])):
                for b in range(2 * j, min(2 * j + 2, below.shape[1])):
                    top = max(top, below[a, b])
            out[i, j] = top
    return out


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
    """`walk` for every row of ``starts`` and ``rays``; one start may stand for all."""
    count = rays.shape[0]
    at, became = np.empty(count), np.empty(count, np.int8)
    one = starts.shape[0] == 1
    for n in range(count):
        at[n], became[n] = walk(height, blocks, shapes, starts[0 if one else n], rays[n], furthest, top)
    return at, became
