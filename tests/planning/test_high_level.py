"""The high-level planner: the objective, and the rules by which animals are lost."""

import numpy as np
import pytest

from tests.refused import refused
from wildlab.planning.planner import (
    SEARCH,
    best_goal,
    utilities,
)


def test_utilities_are_reward_over_distance():
    worth = utilities([[0, 50], [0, 100]], [8 * np.eye(2), 18 * np.eye(2)], [0, 0], [30, 40], alpha=0.5, c=10)
    assert worth == pytest.approx([4 / 50, 6 / 100, 10 / 50])
    assert np.isneginf(utilities([[0, 50]], [np.eye(2)], [0, 0], None, alpha=1, c=1)[-1])
    assert np.isinf(utilities([[0, 0]], [np.eye(2)], [0, 0], None, alpha=1, c=1)[0])


def test_the_greatest_utility_is_the_goal():
    P = [50 * np.eye(2), 500 * np.eye(2)]
    at = [[0, 50], [0, 100]]
    assert best_goal(at, P, [0, 0], [0, 10], alpha=1, c=1) == 1
    assert best_goal(at, P, [0, 0], [0, 10], alpha=1, c=200) == SEARCH
    assert best_goal(at, P, [0, 45], [0, 10], alpha=1, c=1) == 0
    with refused("no goal"):
        best_goal(np.zeros((0, 2)), np.zeros((0, 2, 2)), [0, 0], None, alpha=1, c=1)
