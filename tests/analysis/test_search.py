"""The loop of planner and camera: what is found when, and what planners are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.planning.ground import FLAT, with_wall
from wildlab.analysis.search import (
    Rules,
    SearchInRows,
    World,
    found_in,
    rows_at,
    search,
    survey,
)
from wildlab.planning.legs import Flying, Leg, Platform, SearchSensor, look_attitude
from wildlab.planning.planner import SEARCH

SENSOR = SearchSensor((0.3, 0.2), sd=0.2, reach=100.0, nearest=5.0)
FLYING = Flying(5.0, 50.0)
AREAS = (
    np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 60.0], [0.0, 60.0]]),
    np.array([[0.0, 100.0], [60.0, 100.0], [60.0, 160.0], [0.0, 160.0]]),
)
START = Platform(np.zeros(2), 0.0, look_attitude(0.0, 0.0, 0.0))


def world(spots, chance=0.0, images=300, terrain=FLAT, areas=AREAS) -> World:
    at = np.column_stack([np.array(spots, float), np.full(len(spots), -0.5)])
    area_of = np.array([int(east > 80 and len(areas) > 1) for _, east in spots])
    return World(terrain, areas, np.tile(at, (images, 1, 1)), area_of, np.full((images, len(spots)), chance))


def test_an_animal_is_found_by_its_probability_and_in_the_field_of_view():
    leg = Leg(
        np.array([[0.0, 0.0, -50.0]] * 3),
        look_attitude(0.0, 0.0, 0.0)[None],
        np.array([True, False, True]),
        0.0,
        np.arange(1.0, 4.0),
    )
    here, beside = [5.0, 5.0], [30.0, 0.0]
    rows = np.arange(3)
    assert found_in(world([here, beside]), leg, rows, SENSOR).tolist() == [
        [True, False], [False, False], [True, False],
    ]  # fmt: skip
    away = 49.5**2 + 50
    luck = np.exp(-away / 100.0**2)
    assert found_in(world([here], luck - 1e-6), leg, rows, SENSOR).any()
    assert not found_in(world([here], luck + 1e-6), leg, rows, SENSOR).any()


def test_what_the_ground_hides_is_not_found():
    leg = Leg(
        np.array([[0.0, 0.0, -50.0]]), look_attitude(0.0, 0.7, 0.0)[None], np.array([True]), 0.0, np.ones(1)
    )
    assert found_in(world([[0.0, 45.0]]), leg, np.arange(1), SENSOR).all()
    assert not found_in(world([[0.0, 45.0]], terrain=with_wall(20, 45.0)), leg, np.arange(1), SENSOR).any()


def test_a_search_ends_when_all_are_found_and_leaves_an_area_that_is_done():
    rows = SearchInRows(world([[5.0, 5.0], [30.0, 130.0]]), FLYING, 15.0, (0, 1))
    found = search(world([[5.0, 5.0], [30.0, 130.0]]), rows, START, SENSOR, FLYING)
    assert found.found[0] <= 3 and np.isfinite(found.found).all()
    # The first area is left at once: its far corner was never flown to.
    first = found.p_nc[found.p_nc[:, 1] < 75]
    assert not ((first[:, 0] > 40) & (first[:, 1] < 40)).any()


def test_turns_take_time_from_a_search_and_animals_walk_on_meanwhile():
    """One who turns round again and again finds what comes by later; the world goes on while it turns."""
    spots = [[30.0, 30.0]]
    still = world(spots, images=600)
    found = [
        search(still, SearchInRows(still, flying, 15.0, (0,)), START, SENSOR, flying)
        for flying in (FLYING, replace(FLYING, turn_time=4.0))
    ]
    assert found[1].p_nc == pytest.approx(found[0].p_nc)
    heading = np.unwrap(np.arctan2(*np.diff(found[0].p_nc[:, :2], axis=0, prepend=[[0.0, 0.0]]).T[::-1]))
    turned = np.abs(np.diff(heading, prepend=0.0)).sum()
    late = found[1].at[-1] - found[0].at[-1]
    assert late > 1.5 and late == pytest.approx(4 * turned / np.pi, rel=0.35)
    assert found[1].found[0] > found[0].found[0] and found[1].found[0] in found[1].at
    # An animal that is there up to a time is missed by who comes 4 s late.
    gone = world(spots, images=600)
    gone.animals[int(found[0].found[0]) :, 0] += [0.0, 400.0, 0.0]
    flying = replace(FLYING, turn_time=40.0)
    ended = search(gone, SearchInRows(gone, flying, 15.0, (0,)), START, SENSOR, flying)
    assert np.isinf(ended.found).all() and ended.at[-1] <= 600


def test_rows_of_a_world_are_those_that_hold():
    assert rows_at(np.array([1.0, 2.0, 4.6, 5.6, 6.999999999999]), 1.0).tolist() == [0, 1, 3, 4, 6]
    assert rows_at(np.array([0.5, 1.2]), 0.5).tolist() == [0, 1]


# --- search and revisit: who is gone back to, who is lost, and when it ends ---------------------------------

FIELD = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
RULES = Rules(alpha=1.0, c=200.0, walk=0.1, limit=200.0)


def run(spots, rules: Rules = RULES, unseen=((), ()), images=600, areas=(FIELD,)):
    """``unseen``: from which image on each animal is not found any more, and up to which not yet."""
    given = world(spots, 0.5, images, areas=areas)
    for animal, first in enumerate(unseen[0]):
        given.chance[first:, animal] = 1.0
    for animal, last in enumerate(unseen[1]):
        given.chance[:last, animal] = 1.0
    rows, sensor = SearchInRows(given, FLYING, 20.0, range(len(areas))), replace(SENSOR, reach=200.0)
    return survey(given, rows, START, sensor, FLYING, rules, np.random.default_rng(1))


def test_it_ends_when_all_are_known_at_once():
    found = run([[10.0, 10.0], [90.0, 90.0], [50.0, 50.0]])
    assert 10 < found.positioned < 400
    assert found.lost_by_covariance == found.lost_by_search == 0
    assert FLYING.images * len(found.goal) == pytest.approx(found.positioned)


def test_an_enclosure_that_is_done_stays_done():
    """One animal is seen for a while only, but then its enclosure was done; the other takes until the end."""
    areas = (FIELD, FIELD + np.array([0.0, 150.0]))
    spots, soon_lost = [[10.0, 10.0], [50.0, 180.0]], RULES._replace(walk=1.0)
    found = run(spots, soon_lost, ((20,), (0, 300)), 900, areas)
    assert 300 < found.positioned < 900 and found.lost_by_covariance == found.lost_by_search == 0
    assert 0 not in found.goal[1:]


def test_it_goes_back_to_what_is_known_badly():
    fast = Rules(alpha=1.0, c=50.0, walk=2.0, limit=1e6)
    found = run([[10.0, 10.0], [90.0, 90.0]], fast)
    assert set(found.goal.tolist()) > {SEARCH}
    assert (run([[10.0, 10.0], [90.0, 90.0]], fast._replace(c=1e9)).goal == SEARCH).all()


@pytest.mark.parametrize(
    ("rules", "lost"), [({"c": 1e9, "walk": 2.0}, (1, 0)), ({"c": 1e-3, "limit": 1e9}, (0, 1))]
)
def test_an_animal_that_is_unseen_for_long_or_not_where_it_should_be_is_lost(rules, lost):
    """Two animals, of which one is seen at the beginning only, and the other never."""
    found = run([[10.0, 10.0], [90.0, 90.0]], RULES._replace(**rules), ((10, 0), ()))
    assert (found.lost_by_covariance, found.lost_by_search) == lost
