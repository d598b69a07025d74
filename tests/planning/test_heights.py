"""Heights above ground along a way, within limits of climb and descent."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.geometry.georeference import Terrain
from wildlab.planning.courses import follow_terrain


def rough(seed: int = 1) -> Terrain:
    height = np.random.default_rng(seed).uniform(0, 12, (60, 60)).astype(np.float32)
    return Terrain(height, north=-30.0, east=-30.0, step=4.0)


WAY = [[0.0, 0.0], [180.0, 20.0], [60.0, 150.0]]


def test_it_keeps_its_way_points_and_looks_at_the_ground_every_few_metres():
    way = follow_terrain(rough(), WAY, 40.0, 9.0)
    assert np.linalg.norm(np.diff(way.points[:, :2], axis=0), axis=1).max() <= 5.0 + 1e-9
    for corner in WAY:
        assert np.abs(way.points[:, :2] - corner).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("slope", [0.1, 0.3, 9.0])
def test_it_is_the_lowest_way_within_the_limits(slope):
    """Against a direct statement: the greatest of what every place asks for here."""
    way = follow_terrain(rough(), WAY, 40.0, slope)
    far = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way.points[:, :2], axis=0), axis=1))])
    asked = rough().heights_at(way.points[:, :2]) + 40
    lowered = slope * np.abs(far[None, :] - far[:, None])
    assert np.allclose(-way.points[:, 2], (asked[None, :] - lowered).max(axis=1))
    np.testing.assert_allclose(way.above, -way.points[:, 2] - (asked - 40), atol=1e-9)
    assert (way.above >= 40 - 1e-9).all()
    assert np.abs(np.diff(way.points[:, 2]) / np.diff(far)).max() <= slope + 1e-9
