"""Line of sight as F 2.5.2 has it, compiled: rays in fixed steps, and angles along a line of grid points.

Coordinates are those of the grid: ``x`` in columns (east), ``y`` in rows (north), ``z`` metres upwards. The
height between nodes is written out here again, and not taken from the walk over terrain: the compiler's
cache looks at one file only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any


@compiled
def cast_all(
    height: Array,
    rows: Array,
    columns: Array,
    lens: Array,
    metres: float,
    step: float,
    near: float,
    top: float,
    lone: float,
) -> tuple[Array, Array]:
    """F algorithm 1 for each node: whether a ray to it ends near it, and how many steps that took.

    Rays begin at the height ``top``; where a node is missing, the ground is as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, steps = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        dx, dy, dz = j - x, i - y, height[i, j] - z
        length = np.sqrt((dx * dx + dy * dy) * metres * metres + dz * dz)
        if not length > 0:
            clear[n] = length == 0
            continue
        dx, dy, dz = dx / length, dy / length, dz / length
        # Nothing is above the highest ground: a ray from above begins there.
        t = (top - z) / dz if dz < 0 and z > top else 0.0
        while True:
            at_x, at_y = x + t * dx, y + t * dy
            if 0 <= at_x <= last_column and 0 <= at_y <= last_row:
                a, b = min(int(at_y), last_row - 1), min(int(at_x), last_column - 1)
                u, v = at_x - b, at_y - a
                low = (1 - u) * height[a, b] + u * height[a, b + 1]
                high = (1 - u) * height[a + 1, b] + u * height[a + 1, b + 1]
                ground = (1 - v) * low + v * high
                if not z + t * dz > (ground if ground == ground else lone):
                    break
            elif t >= length:
                break  # it has left the map; one that begins beside it goes on
            t += step
            steps[n] += 1
        clear[n] = abs(t - length) <= near
    return clear, steps


@compiled
def compare_all(
    height: Array,
    rows: Array,
    columns: Array,
    lens: Array,
    metres: float,
    itself: bool,
    signed: bool,
    lone: float,
) -> tuple[Array, Array]:
    """F (2.24) for each node: whether no grid point before it has an angle as small, and how many were asked.

    A count of -1 is a line that has no direction. A missing node counts as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, asked = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        if height[i, j] != height[i, j]:
            continue
        dx, dy = x - j, y - i
        own = np.arctan2(z - height[i, j], metres * np.sqrt(dx * dx + dy * dy))
        furthest = max(abs(dx), abs(dy))
        along_y = dx <= dy if signed else abs(dx) <= abs(dy)
        span = abs(dy) if along_y else abs(dx)
        if span == 0:
            # Straight below the camera there is nothing between; by the letter it is a division by zero.
            clear[n], asked[n] = furthest == 0 and not itself, -1 if signed else 0
            continue
        clear[n] = True
        for k in range(0 if itself else 1, int(np.ceil(furthest))):
            b, a = int(np.floor(j + k * dx / span + 0.5)), int(np.floor(i + k * dy / span + 0.5))
            if not (0 <= a <= last_row and 0 <= b <= last_column):
                continue
            asked[n] += 1
            ex, ey = x - b, y - a
            there = height[a, b] if height[a, b] == height[a, b] else lone
            if np.arctan2(z - there, metres * np.sqrt(ex * ex + ey * ey)) <= own:
                clear[n] = False
                break
    return clear, asked
