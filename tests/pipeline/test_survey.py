"""Search and revisit in a plain world: who is gone back to, who is lost, and when it ends."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.pipeline.search import SearchInRows, World
from wildlab.pipeline.survey import Rules, survey
from wildlab.planning.high_level import SEARCH
from wildlab.planning.information import SearchSensor
from wildlab.planning.legs import Flying, Platform, look_attitude
from wildlab.simulation.landscape import synthetic_landscape

SENSOR = SearchSensor(0.3, 0.2, sd=0.2, reach=200.0, nearest=5.0)
FLYING = Flying(5.0, 50.0)
AREA = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
LAND = synthetic_landscape(1, relief=0.0)
START = Platform(np.zeros(2), 0.0, look_attitude(0.0, 0.0, 0.0))
RULES = Rules(alpha=1.0, c=200.0, walk=0.1, limit=200.0)


def world(spots, images=600) -> World:
    at = np.column_stack([np.array(spots, float), np.full(len(spots), -0.5)])
    return World(
        LAND,
        (AREA,),
        np.tile(at, (images, 1, 1)),
        np.zeros(len(spots), int),
        np.full((images, len(spots)), 0.5),
    )


def run(given: World, rules: Rules = RULES, seed: int = 1):
    rows = SearchInRows(given, FLYING, 20.0, (0,))
    return survey(given, rows, START, SENSOR, FLYING, rules, np.random.default_rng(seed))


def test_it_ends_when_all_are_known_at_once():
    found = run(world([[10.0, 10.0], [90.0, 90.0], [50.0, 50.0]]))
    assert 10 < found.positioned < 400 and found.known[-1] == 3
    assert found.lost_by_covariance == found.lost_by_search == 0
    assert len(found.p_nc) == FLYING.images * len(found.goal) == pytest.approx(found.positioned)
    assert np.nanmax(found.error) < 8


def test_an_enclosure_that_is_done_stays_done():
    """One animal is seen for a while only, but then its enclosure was done; the other takes until the end."""
    at = np.column_stack([[[10.0, 10.0], [50.0, 180.0]], np.full(2, -0.5)])
    areas = (AREA, AREA + np.array([0.0, 150.0]))
    chance = np.full((900, 2), 0.5)
    chance[20:, 0], chance[:300, 1] = 1.0, 1.0
    given = World(LAND, areas, np.tile(at, (900, 1, 1)), np.array([0, 1]), chance)
    rows = SearchInRows(given, FLYING, 20.0, (0, 1))
    soon_lost = RULES._replace(walk=1.0)
    found = survey(given, rows, START, SENSOR, FLYING, soon_lost, np.random.default_rng(1))
    assert 300 < found.positioned < 900 and found.lost_by_covariance == found.lost_by_search == 0
    assert 0 not in found.goal[1:]


def test_nobody_to_find_ends_with_the_time():
    given = world([[10.0, 10.0]], images=90)
    given.chance[:] = 1.0
    found = run(given)
    assert np.isinf(found.positioned) and (found.goal == SEARCH).all() and found.revisits == 0


def test_it_goes_back_to_what_is_known_badly():
    fast = Rules(alpha=1.0, c=50.0, walk=2.0, limit=1e6)
    found = run(world([[10.0, 10.0], [90.0, 90.0]]), fast)
    assert found.revisits > 0 and set(found.goal.tolist()) > {SEARCH}
    never = run(world([[10.0, 10.0], [90.0, 90.0]]), fast._replace(c=1e9))
    assert never.revisits == 0


def test_an_animal_that_is_not_seen_for_long_is_lost():
    given = world([[10.0, 10.0], [90.0, 90.0]])
    given.chance[10:, 0] = 1.0  # seen at the beginning only
    given.chance[:, 1] = 1.0
    found = run(given, RULES._replace(c=1e9, walk=2.0))
    assert found.lost_by_covariance == 1 and found.known.max() == 1 and found.known[-1] == 0


def test_an_animal_that_is_not_where_it_should_be_is_lost():
    given = world([[10.0, 10.0], [90.0, 90.0]])
    given.chance[10:, 0] = 1.0
    given.chance[:, 1] = 1.0
    found = run(given, RULES._replace(c=1e-3, limit=1e9))
    assert found.lost_by_search == 1 and found.lost_by_covariance == 0
