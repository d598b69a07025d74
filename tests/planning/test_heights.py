"""Heights above ground along a way, within limits of climb and descent."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.geometry.terrain import Terrain
from wildlab.planning.courses import follow_terrain


def rough(seed: int = 1) -> Terrain:
    height = np.random.default_rng(seed).uniform(0, 12, (60, 60)).astype(np.float32)
    return Terrain(height, north=-30.0, east=-30.0, step=4.0)


WAY = [[0.0, 0.0], [180.0, 20.0], [60.0, 150.0]]


def test_without_limits_it_follows_the_ground():
    way = follow_terrain(rough(), WAY, 40.0, spacing=2.0)
    assert np.allclose(way.above, 40.0)
    assert np.allclose(-way.points[:, 2], rough().heights_at(way.points[:, :2]) + 40)
    assert np.linalg.norm(np.diff(way.points[:, :2], axis=0), axis=1).max() <= 2.0 + 1e-9
    for corner in WAY:
        assert np.abs(way.points[:, :2] - corner).max(axis=1).min() < 1e-9


@pytest.mark.parametrize(("climb", "descent"), [(0.2, 0.1), (0.1, np.inf), (np.inf, 0.3)])
def test_it_is_the_lowest_way_within_the_limits(climb, descent):
    """Against a direct statement: the greatest of what every place asks for here."""
    way = follow_terrain(rough(), WAY, 40.0, climb=climb, descent=descent, spacing=2.0)
    far = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way.points[:, :2], axis=0), axis=1))])
    asked = rough().heights_at(way.points[:, :2]) + 40
    ahead = far[None, :] - far[:, None]
    with np.errstate(invalid="ignore"):
        lowered = np.where(ahead >= 0, climb * ahead, descent * -ahead)
    lowered[ahead == 0] = 0
    assert np.allclose(-way.points[:, 2], (asked[None, :] - lowered).max(axis=1))
    assert (way.above >= 40 - 1e-9).all()
    slope = -np.diff(way.points[:, 2]) / np.diff(far)
    assert slope.max() <= climb + 1e-9 and slope.min() >= -descent - 1e-9
