"""Synthetic land: its size, its relief, and that hills are larger than stones."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.simulation.landscape import TREES_M, UNEVEN, grow_trees, synthetic_landscape


def test_it_has_the_size_and_the_relief_that_are_printed():
    land = synthetic_landscape(3)
    assert land.extent == (-250.0, 250.0, -500.0, 500.0)
    assert land.height.min() == 0 and land.height.max() == pytest.approx(51.0, abs=1e-4)
    assert np.array_equal(land.height, synthetic_landscape(3).height)
    assert not np.allclose(land.height, synthetic_landscape(4).height)


def test_neighbours_are_alike_and_ends_are_not():
    """The longer the distance, the larger the difference of heights, as on natural ground."""
    squares = []
    for seed in range(6):
        h = synthetic_landscape(seed).height.astype(float)
        squares.append([np.mean((h[:, lag:] - h[:, :-lag]) ** 2) for lag in (1, 4, 16, 64)])
        assert abs(h[:, 0] - h[:, -1]).mean() > 1, "it does not repeat itself"
    rises = np.diff(np.log(np.mean(squares, axis=0))) / np.log(4)
    assert (rises > 0.5).all() and (rises < 2.05).all()


def test_land_without_size_is_refused():
    for given in ({"step": 0.0}, {"north": 1.0}, {"relief": -1.0}, {"east": np.inf}):
        with pytest.raises(WildlabError, match="two steps each way"):
            synthetic_landscape(1, **given)


def test_trees_stand_on_their_share_of_the_ground_in_groups():
    land = synthetic_landscape(3)
    grown = grow_trees(land, 5, share=0.2)
    trees = grown.height - land.height
    assert (trees > 0).mean() == pytest.approx(0.2, abs=0.001)
    assert trees[trees > 0].min() >= (1 - UNEVEN) * TREES_M - 1e-3
    assert trees.max() <= (1 + UNEVEN) * TREES_M + 1e-3
    beside = (trees[:, 1:] > 0)[trees[:, :-1] > 0].mean()
    assert beside > 0.8, "beside a tree stands another"
    assert np.array_equal(grown.height, grow_trees(land, 5, share=0.2).height)
    assert grown.extent == land.extent


@pytest.mark.parametrize("given", [{"share": 1.2}, {"height": 0.0}, {"stand": -1.0}])
def test_trees_without_a_size_are_refused(given):
    with pytest.raises(WildlabError, match="a share between 0 and 1"):
        grow_trees(synthetic_landscape(1, north=20, east=20), 1, **given)
