"""What greed costs a high-level planner."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.planning.planner import SEARCH
from wildlab.studies.information_planning import greedy_tour, shortest_tour

GREEDY = {"alpha": 1.0, "c": 400.0, "speed": 5.0, "walk": 0.25}


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6))
def test_no_order_is_quicker_than_the_shortest(seed):
    rng = np.random.default_rng(seed)
    at, here, end = rng.uniform(0, 200, (4, 2)), rng.uniform(0, 200, 2), rng.uniform(0, 200, 2)
    P = rng.uniform(1, 200, 4)[:, None, None] * np.eye(2)
    best = shortest_tour(at, here, end, 5.0)
    greedy = greedy_tour(at, P, here, end, **GREEDY)
    assert set(greedy.order) == set(best.order) == {0, 1, 2, 3, SEARCH}
    assert greedy.time >= best.time - 1e-9
    steps = np.linalg.norm(np.diff(greedy.path, axis=0), axis=1)
    assert steps.sum() == pytest.approx(5.0 * greedy.time)
    along = np.linalg.norm(np.diff(best.path, axis=0), axis=1)
    assert along.sum() == pytest.approx(5.0 * best.time)


def test_a_greedy_planner_turns_round_where_a_look_ahead_goes_there_first():
    """The way point lies far to the north; to the south an animal becomes worth more on the way."""
    at, end = [[-60.0, 0.0]], [400.0, 0.0]
    greedy = greedy_tour(at, [235 * np.eye(2)], [0, 0], end, alpha=1.0, c=3200.0, speed=5.0, walk=30.0)
    best = shortest_tour(at, [0, 0], end, 5.0)
    assert best.order == greedy.order == (0, SEARCH) and best.time == pytest.approx(104.0)
    assert greedy.broken_off == 1
    # One second to the north and back again.
    assert greedy.time == pytest.approx(106.0) and greedy.path[:, 0].max() == 400
