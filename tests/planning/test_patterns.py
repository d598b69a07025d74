"""Lawn-mower patterns: no point is further than half a row distance from a row, whatever the area's form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.planning.ground import length
from wildlab.planning.patterns import (
    Pattern,
    check_area,
    contains,
    lawn_mower,
    rectangle,
    visit_order,
)

U_SHAPE = [[0, 0], [100, 0], [100, 30], [30, 30], [30, 70], [100, 70], [100, 100], [0, 100]]


def star(seed: int, corners: int = 9) -> NDArray[np.float64]:
    """A polygon that is not convex and does not cross itself."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) / corners
    return check_area(rng.uniform(60, 200, (corners, 1)) * np.stack([np.cos(angles), np.sin(angles)], -1))


def away_from_rows(pattern: Pattern, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points are to the side of the nearest row that they lie beside."""
    nearest = np.full(len(points), np.inf)
    for start, end in pattern.rows:
        length = np.linalg.norm(end - start)
        along = (end - start) / length
        to = points - start
        beside = (to @ along >= -1e-6) & (to @ along <= length + 1e-6)
        aside = np.abs(to[:, 0] * along[1] - to[:, 1] * along[0])
        nearest = np.where(beside, np.minimum(nearest, aside), nearest)
    return nearest


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("direction", [None, 0.0, 0.9])
def test_every_point_is_beside_a_row_within_half_the_distance(seed, direction):
    fence = star(seed)
    pattern = lawn_mower(fence, 25.0, direction=direction)
    points = np.random.default_rng(seed).uniform(-200, 200, (2000, 2))
    points = np.concatenate([points[contains(fence, points)], fence])
    assert pattern.distance[0] <= 25.0
    assert away_from_rows(pattern, points).max() <= pattern.distance[0] / 2 + 1e-6


def test_pieces_of_rows_make_blocks_that_are_flown_each_at_once():
    pattern = lawn_mower(U_SHAPE, 10.0, direction=np.pi / 2)
    middles = pattern.rows.mean(axis=1)
    arm = np.where(middles[:, 0] < 30, 0, np.where(middles[:, 1] < 50, 1, 2))
    changes = (np.diff(arm) != 0).sum()
    assert changes == 2
    assert sorted(np.bincount(arm)) == [3, 7, 7]


def test_rows_run_back_and_forth_and_keep_the_twins_count():
    pattern = lawn_mower(rectangle(0, 0, 240, 180, np.pi / 2), 25.0, direction=np.pi / 2)
    assert len(pattern.rows) == 8 and pattern.distance[0] == pytest.approx(180 / 8)
    assert np.allclose(np.cos(np.diff(pattern.directions)), -1)
    assert pattern.length == pytest.approx(8 * 240 + 7 * 22.5)


def test_the_start_says_at_which_corner_rows_begin():
    fence = rectangle(0, 0, 100, 40, 0.0)
    for corner in fence:
        pattern = lawn_mower(fence, 20.0, start=3 * corner)
        assert np.linalg.norm(pattern.waypoints[0] - corner) <= 10.0 + 1e-9


def test_several_areas_are_visited_in_the_shortest_order():
    """Against every order and every way, by hand."""
    rng = np.random.default_rng(5)
    ways = [list(rng.uniform(0, 100, (2, 1, 2, 2))) for _ in range(5)]

    def flown(order: tuple[int, ...], chosen: tuple[int, ...], back: bool, start: bool) -> float:
        points = np.concatenate([ways[k][w][0] for k, w in zip(order, chosen, strict=True)])
        points = np.concatenate([[[0.0, 0.0]], points]) if start else points
        points = np.concatenate([points, points[:1]]) if back else points
        return length(points)

    for back, start in ((False, False), (False, True), (True, True)):
        least = min(
            flown(order, chosen, back, start)
            for order in itertools.permutations(range(5))
            for chosen in itertools.product(range(2), repeat=5)
        )
        found = visit_order(ways, start=[0.0, 0.0] if start else None, back=back)
        order, chosen = zip(*found, strict=True)
        assert flown(order, chosen, back, start) == pytest.approx(least)
