"""Level ground, walls on it, ways over it, and what an image tells by the letter of F (5.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wildlab.geometry.georeference import Terrain
from wildlab.planning.legs import SearchSensor

#: A kilometre each way about the origin.
FLAT = Terrain(np.zeros((101, 101), np.float32), north=-500.0, east=-500.0, step=10.0)


def with_wall(east: int, height: float) -> Terrain:
    """A wall from south to north."""
    heights = FLAT.height.copy()
    heights[:, 50 + east // 10] = height
    return replace(FLAT, height=heights)


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def bearing_jacobian(points: np.ndarray, p_nc: np.ndarray, nearest: float = 0.0) -> np.ndarray:
    """How azimuth and elevation, F (5.7), change with the point: (north, clockwise) and above the horizon.

    With ``rho`` the horizontal distance and ``r`` the distance, the azimuth turns by 1 / rho a metre across
    the view, and the elevation by 1 / r a metre across it. As rho = r cos(theta), the azimuth brings the
    factor 1 / cos(theta)^2 into the information, which F (A.1) leaves out.
    """
    d = np.asarray(points, float) - np.asarray(p_nc, float)
    rho = np.hypot(d[..., 0], d[..., 1])
    r2 = rho**2 + d[..., 2] ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        below = (rho == 0) & (nearest > 0)
        # Straight below any bearing would do; north is taken.
        cos = np.where(below, 1.0, d[..., 0] / rho)
        sin = np.where(below, 0.0, d[..., 1] / rho)
        turn = 1 / np.maximum(rho, nearest)
        H = np.empty((*rho.shape, 2, 3))
        H[..., 0, 0], H[..., 0, 1], H[..., 0, 2] = -sin * turn, cos * turn, 0.0
        H[..., 1, 0], H[..., 1, 1] = cos * d[..., 2] / r2, sin * d[..., 2] / r2
        H[..., 1, 2] = -rho / r2
    return H


def bearing_information(points: np.ndarray, p_nc: np.ndarray, sensor: SearchSensor) -> np.ndarray:
    """What one image of a camera that sees a point for certain tells of it: H^T R^-1 H of F (5.4)."""
    H = bearing_jacobian(points, p_nc, sensor.nearest)
    return np.asarray(np.swapaxes(H, -1, -2) @ H / sensor.sd**2)
