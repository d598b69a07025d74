"""What candidate steps would tell of a grid, and what images show of a terrain, compiled: planners ask both
hundreds of times a decision.

The sums are those of F (5.4)-(5.10), written out; tests hold them against plain matrices. All of it stands in
one file, for the compiler's cache looks at one file only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any


@compiled
def inverse_trace(a: float, b: float, c: float, d: float, e: float, f: float) -> float:
    """tr(Y^-1) of [[a, b, c], [b, d, e], [c, e, f]]; infinite where it is not positive definite."""
    if not a > 0:
        return np.inf
    l2, l3 = b / a, c / a
    d2 = d - b * l2
    if not d2 > 0:
        return np.inf
    rest = e - c * l2
    m = rest / d2
    d3 = f - c * l3 - m * rest
    if not d3 > 0:
        return np.inf
    return 1 / a + (l2 * l2 + 1) / d2 + ((l2 * m - l3) ** 2 + m * m + 1) / d3


@compiled
def inverse_traces(Y: Array) -> Array:
    """tr(Y^-1) of each matrix (N, 3, 3), (N,). By pivots rather than by the determinant: where one direction
    is known ten million times better than another, that loses all digits."""
    out = np.empty(len(Y))
    for i in range(len(Y)):
        y = Y[i]
        out[i] = inverse_trace(y[0, 0], y[0, 1], y[0, 2], y[1, 1], y[1, 2], y[2, 2])
    return out


@compiled
def add_image(
    points: Array, near: Array, cam: Array, R: Array, clear: Array, half: Array, sd: float, reach: float,
    nearest: float, into: Array, seen: Array,
) -> None:  # fmt: skip
    """Add to ``into`` (N, 6) what an image tells of the points ``near``, and mark those that it shows.

    ``near`` counts points, ``cam`` (3,), ``R`` (3, 3), ``clear`` (N,) or (0,) where nothing hides anything,
    ``seen`` (N,) bool.
    """
    px, py, pz = cam[0], cam[1], cam[2]
    r00, r10, r20 = R[0, 0], R[1, 0], R[2, 0]
    r01, r11, r21 = R[0, 1], R[1, 1], R[2, 1]
    r02, r12, r22 = R[0, 2], R[1, 2], R[2, 2]
    all_clear = len(clear) == 0
    for i in near:
        x, y, z = points[i, 0] - px, points[i, 1] - py, points[i, 2] - pz
        depth = r02 * x + r12 * y + r22 * z
        if not depth > 0 or abs(r00 * x + r10 * y + r20 * z) > half[0] * depth:
            continue
        if abs(r01 * x + r11 * y + r21 * z) > half[1] * depth or not (all_clear or clear[i]):
            continue
        seen[i] = True
        rho2 = x * x + y * y
        rho = np.sqrt(rho2)
        r2 = rho2 + z * z
        told = np.exp(-r2 / (reach * reach)) / (sd * sd)
        cos, sin = (x / rho, y / rho) if rho > 0 else (1.0, 0.0)
        turn = told / max(rho, nearest) ** 2
        u, v, w = cos * z / r2, sin * z / r2, -rho / r2
        into[i, 0] += sin * sin * turn + told * u * u
        into[i, 1] += -sin * cos * turn + told * u * v
        into[i, 2] += told * u * w
        into[i, 3] += cos * cos * turn + told * v * v
        into[i, 4] += told * v * w
        into[i, 5] += told * w * w


@compiled
def close_points(points: Array, weights: Array, cam: Array, limit: float) -> Array:
    """Which points count and lie within ``limit`` of a camera, seen from above."""
    near = np.empty(len(points), np.int64)
    count = 0
    for i in range(len(points)):
        x, y = points[i, 0] - cam[0], points[i, 1] - cam[1]
        if weights[i] > 0 and not x * x + y * y > limit * limit:
            near[count] = i
            count += 1
    return near[:count]


@compiled
def gains_of_steps(
    Y: Array, left: Array, weights: Array, points: Array, parents: Array, cams: Array, R: Array,
    counts: Array, limits: Array, half: Array, sd: float, reach: float, nearest: float,
) -> Array:  # fmt: skip
    """By how much candidate steps would lower what is left to know, (K, G) m^2.

    ``Y`` (B, N, 3, 3) and ``left`` (B, N) are those of the states that steps begin in, ``parents`` (K,) says
    which. ``cams`` (K, L, 3) are the images' positions of a step, ``R`` (K, G, 3, 3) and ``counts``
    (K, G, L) the attitudes to choose from; no image of a step shows a point further than ``limits`` (K,) from
    where the step ends, seen from above. Nothing hides anything.
    """
    out = np.zeros((len(parents), R.shape[1]))
    into = np.zeros((len(points), 6))
    seen = np.zeros(len(points), np.bool_)
    free = np.ones(0, np.bool_)
    for k in range(len(parents)):
        one = parents[k]
        near = close_points(points, weights, cams[k, cams.shape[1] - 1], limits[k])
        for g in range(R.shape[1]):
            for image in range(cams.shape[1]):
                if counts[k, g, image]:
                    add_image(
                        points, near, cams[k, image], R[k, g], free, half, sd, reach, nearest, into, seen
                    )
            for i in near:
                if not seen[i]:
                    continue
                after = inverse_trace(
                    Y[one, i, 0, 0] + into[i, 0], Y[one, i, 0, 1] + into[i, 1], Y[one, i, 0, 2] + into[i, 2],
                    Y[one, i, 1, 1] + into[i, 3], Y[one, i, 1, 2] + into[i, 4], Y[one, i, 2, 2] + into[i, 5],
                )  # fmt: skip
                out[k, g] += weights[i] * (left[one, i] - after)
                seen[i] = False
                into[i] = 0.0
    return out


@compiled
def after_images(
    Y: Array, left: Array, weights: Array, points: Array, cams: Array, R: Array, counts: Array, clear: Array,
    half: Array, sd: float, reach: float, nearest: float,
) -> Array:  # fmt: skip
    """Add what images tell of points that count to ``Y`` (N, 3, 3) and ``left`` (N,), in place.

    ``cams`` (L, 3), ``R`` (L, 3, 3), or (1, 3, 3) for all, ``counts`` (L,), ``clear`` (L, N) or (0, 0). Gives
    (N,) bool, which points the images show.
    """
    into = np.zeros((len(points), 6))
    seen = np.zeros(len(points), np.bool_)
    free = np.ones(0, np.bool_)
    near = close_points(points, weights, cams[0], np.inf)
    for image in range(len(cams)):
        if counts[image]:
            lines = clear[image] if len(clear) else free
            add_image(
                points, near, cams[image], R[min(image, len(R) - 1)], lines, half, sd, reach, nearest, into,
                seen,
            )  # fmt: skip
    for i in range(len(points)):
        if seen[i]:
            y = Y[i]
            y[0, 0] += into[i, 0]
            y[1, 1] += into[i, 3]
            y[2, 2] += into[i, 5]
            y[0, 1] += into[i, 1]
            y[0, 2] += into[i, 2]
            y[1, 2] += into[i, 4]
            y[1, 0], y[2, 0], y[2, 1] = y[0, 1], y[0, 2], y[1, 2]
            left[i] = inverse_trace(y[0, 0], y[0, 1], y[0, 2], y[1, 1], y[1, 2], y[2, 2])
    return seen


@compiled
def worth_beyond(left: Array, middles: Array, parents: Array, ends: Array, length: float) -> Array:
    """What is left to know in blocks, counted less the further they are from where a step ends, (K,) m^2.

    ``left`` (B, S) of each state's blocks, ``middles`` (S, 2), ``ends`` (K, 2) or more columns, ``length``
    the distance at which a block counts 1/e.
    """
    out = np.zeros(len(parents))
    for k in range(len(parents)):
        for i in range(len(middles)):
            if left[parents[k], i] > 0:
                away = np.hypot(middles[i, 0] - ends[k, 0], middles[i, 1] - ends[k, 1])
                out[k] += left[parents[k], i] * np.exp(-away / length)
    return out


@compiled
def grow_old_all(Y: Array, left: Array, q: float) -> None:
    """F (5.5) in place, for a walk with the variance ``q`` both ways; and nothing for its height.

    With A the 2 x 2 block of Y for the ground and n the column beside it, A becomes (I + qA)^-1 A and n
    (I + qA)^-1 n, written out so that nothing is subtracted from what is nearly the same.
    """
    for i in range(len(Y)):
        y = Y[i]
        a, b, d, n0, n1 = y[0, 0], y[0, 1], y[1, 1], y[0, 2], y[1, 2]
        det = (1 + q * a) * (1 + q * d) - q * q * b * b
        both = q * (a * d - b * b)
        m0 = ((1 + q * d) * n0 - q * b * n1) / det
        m1 = ((1 + q * a) * n1 - q * b * n0) / det
        y[0, 0], y[0, 1], y[1, 1] = (a + both) / det, b / det, (d + both) / det
        y[2, 2] -= q * (n0 * m0 + n1 * m1)
        y[0, 2], y[1, 2] = m0, m1
        y[1, 0], y[2, 0], y[2, 1] = y[0, 1], m0, m1
        left[i] = inverse_trace(y[0, 0], y[0, 1], m0, y[1, 1], m1, y[2, 2])


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
) -> tuple[Array, Array, Array, Array]:
    """Nodes within each image's block that are in the image and not too far.

    ``grid`` is north and east of the first node, and the step. Image, node, distance, points (S, 3).
    """
    room = 1024
    image, node = np.empty(room, np.int64), np.empty(room, np.int64)
    distance, points = np.empty(room), np.empty((room, 3))
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
                    distance = grown(distance, room)
                    more = np.empty((room, 3))
                    more[:n] = points
                    points = more
                image[n], node[n], distance[n] = k, i * columns + j, far
                points[n, 0], points[n, 1], points[n, 2] = north, east, down
                n += 1
    return image[:n], node[:n], distance[:n], points[:n]


@compiled
def grown(values: Array, room: int) -> Array:
    """The same with more room at its end."""
    more = np.empty(room, values.dtype)
    more[: len(values)] = values
    return more
