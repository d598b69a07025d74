"""The inverse of lens distortion, compiled: each point by Newton's method of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any


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
