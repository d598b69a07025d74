"""Level ground, walls on it, and ways over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wildlab.geometry.terrain import Terrain

#: A kilometre each way about the origin.
FLAT = Terrain(np.zeros((101, 101), np.float32), north=-500.0, east=-500.0, step=10.0)


def with_wall(east: int, height: float) -> Terrain:
    """A wall from south to north."""
    heights = FLAT.height.copy()
    heights[:, 50 + east // 10] = height
    return replace(FLAT, height=heights)


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
