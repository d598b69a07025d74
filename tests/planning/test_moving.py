"""Animals that walk within a fence, and when images show them first."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.terrain import Terrain
from wildlab.planning.areas import check_area, contains, rectangle
from wildlab.planning.moving import first_seen, walks
from wildlab.planning.sightings import Sightings

FENCE = check_area([[0, 0], [0, 60], [30, 60], [30, 20], [80, 20], [80, 0]])


def test_walks_stay_inside_and_begin_anywhere() -> None:
    ways = walks(FENCE, np.arange(200.0), 300, 0.5, 1.0, np.random.default_rng(1))
    assert ways.shape == (300, 200, 2)
    # Straight lines between steps may cut a concave corner; at whole steps every animal is inside.
    assert contains(FENCE, ways.reshape(-1, 2)).all()
    share = (ways[:, 0, 0] > 30).mean()
    assert share == pytest.approx(1000 / 2800, abs=3 * np.sqrt(0.36 * 0.64 / 300))


def test_far_from_a_fence_the_spread_grows_with_the_root_of_time() -> None:
    big = rectangle(0, 0, 1e4, 1e4, 0.0)
    ways = walks(big, [0.0, 100.0], 2000, 0.5, 4.0, np.random.default_rng(2))
    assert (ways[:, 1] - ways[:, 0]).std() == pytest.approx(0.5 * 4.0 * 5, rel=0.05)


def test_first_seen_is_the_first_sharp_image_with_the_nearest_node() -> None:
    flat = Terrain(np.zeros((5, 5), np.float32), north=0.0, east=0.0, step=10.0)
    found = Sightings(np.array([0, 1, 1, 2]), np.array([6, 7, 12, 7]), np.zeros(4), np.zeros(4))
    times = np.array([0.0, 5.0, 9.0])
    there = np.array(
        [[12.0, 22.0], [18.0, 17.0], [40.0, 40.0], [-50.0, 0.0]]
    )  # nodes 7, 12, 24 and off the map
    ways = np.repeat(there[:, None], 3, axis=1)
    sharp = np.array([True, True, True])
    assert np.array_equal(first_seen(found, flat, times, sharp, ways), [5, 5, np.nan, np.nan], equal_nan=True)
    sharp[1] = False
    assert np.array_equal(
        first_seen(found, flat, times, sharp, ways), [9, np.nan, np.nan, np.nan], equal_nan=True
    )
    nothing = Sightings(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0))
    assert np.isnan(first_seen(nothing, flat, times, sharp, ways)).all()


def test_a_step_of_nothing_is_refused() -> None:
    with pytest.raises(WildlabError, match="0 s"):
        walks(FENCE, [0.0], 1, 0.5, 0, np.random.default_rng(1))
