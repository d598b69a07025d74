"""Which nodes of a terrain lie in each of many images, compiled: a plan has tens of millions to look at."""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any


@compiled
def edge_of(lens: Array, x: float, y: float, z: float) -> float:
    """How far a point of c is inside the image, pixels; negative outside of it.

    ``lens`` holds width, height, fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 and the tangent of the outermost
    angle that the image shows: far outside the image a lens's polynomial may fold back into it.
    """
    if not z > 0:
        return -1.0
    a, b = x / z, y / z
    r2 = a * a + b * b
    if not r2 <= lens[12] * lens[12]:
        return -1.0
    radial = 1 + r2 * (lens[7] + r2 * (lens[8] + r2 * lens[11]))
    p = a * radial + 2 * lens[9] * a * b + lens[10] * (r2 + 2 * a * a)
    q = b * radial + lens[9] * (r2 + 2 * b * b) + 2 * lens[10] * a * b
    u, v = lens[2] * p + lens[6] * q + lens[4], lens[3] * q + lens[5]
    return float(min(u, lens[0] - u, v, lens[1] - v))


@compiled
def in_images(
    height: Array, grid: Array, lens: Array, first: Array, count: Array, p: Array, R: Array, furthest: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Nodes within each image's block that are in the image and not too far.

    ``grid`` is north and east of the first node, and the step. Image, node, distance, edge, points (S, 3).
    """
    room = 1024
    image, node = np.empty(room, np.int64), np.empty(room, np.int64)
    distance, edge, points = np.empty(room), np.empty(room), np.empty((room, 3))
    n = 0
    columns = height.shape[1]
    for k in range(len(p)):
        for i in range(first[k, 0], first[k, 0] + count[k, 0]):
            for j in range(first[k, 1], first[k, 1] + count[k, 1]):
                north, east = grid[0] + grid[2] * i, grid[1] + grid[2] * j
                down = -np.float64(height[i, j])
                dx, dy, dz = north - p[k, 0], east - p[k, 1], down - p[k, 2]
                far = np.sqrt(dx * dx + dy * dy + dz * dz)
                if not far <= furthest:
                    continue
                inside = edge_of(
                    lens,
                    R[k, 0, 0] * dx + R[k, 1, 0] * dy + R[k, 2, 0] * dz,
                    R[k, 0, 1] * dx + R[k, 1, 1] * dy + R[k, 2, 1] * dz,
                    R[k, 0, 2] * dx + R[k, 1, 2] * dy + R[k, 2, 2] * dz,
                )
                if not inside >= 0:
                    continue
                if n == room:
                    room *= 2
                    image, node = grown(image, room), grown(node, room)
                    distance, edge = grown(distance, room), grown(edge, room)
                    more = np.empty((room, 3))
                    more[:n] = points
                    points = more
                image[n], node[n], distance[n], edge[n] = k, i * columns + j, far, inside
                points[n, 0], points[n, 1], points[n, 2] = north, east, down
                n += 1
    return image[:n], node[:n], distance[:n], edge[:n], points[:n]


@compiled
def grown(values: Array, room: int) -> Array:
    """The same with more room at its end."""
    more = np.empty(room, values.dtype)
    more[: len(values)] = values
    return more
