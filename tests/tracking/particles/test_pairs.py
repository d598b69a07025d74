"""Which detection is of which animal: F's rule and its gate, pairs by trying all."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from tests.tracking.poses import GENERATORS
from wildlab.errors import WildlabError
from wildlab.tracking.particles import mahalanobis_squared, nearest_animal, one_to_one


def covariances(rng, count, n):
    A = rng.normal(size=(count, n, n + 1))
    return A @ np.swapaxes(A, 1, 2)


@given(rng=GENERATORS, animals=st.integers(0, 5), detections=st.integers(0, 6))
def test_each_detection_takes_its_closest_track(rng, animals, detections):
    mean, P = rng.normal(0, 3, (animals, 4)), covariances(rng, animals, 4)
    z, R = rng.normal(0, 3, (detections, 2)), covariances(rng, detections, 2)
    squared = mahalanobis_squared(mean, P, z, R)
    assert squared.shape == (animals, detections)
    taken = nearest_animal(squared, 0.9)
    for j in range(detections):
        roots = []
        for a in range(animals):
            off = z[j] - mean[a, :2]
            roots.append(np.sqrt(off @ np.linalg.inv(P[a, :2, :2] + R[j]) @ off))
            assert np.isclose(roots[a], np.sqrt(squared[a, j]))
        best = int(np.argmin(roots)) if roots else -1
        inside = animals and roots[best] ** 2 <= chi2.ppf(0.9, 2)
        assert taken[j] == (best if inside else -1)


@given(rng=GENERATORS, animals=st.integers(0, 4), detections=st.integers(0, 4))
def test_pairs_gain_as_much_as_the_best_of_all_ways(rng, animals, detections):
    gain = rng.normal(0.5, 2, (animals, detections))
    gain[rng.random(gain.shape) < 0.3] = -np.inf
    taken = one_to_one(gain)
    pairs = [(a, j) for j, a in enumerate(taken) if a >= 0]
    assert len({a for a, _ in pairs}) == len(pairs) and all(gain[p] > 0 for p in pairs)
    # Every way: each track takes one of the detections, or one of as many that stand for none.
    ways = permutations(range(detections + animals), animals)
    best = max(
        sum(gain[a, j] for a, j in enumerate(way) if j < detections and gain[a, j] > 0) for way in ways
    )
    assert np.isclose(sum(gain[p] for p in pairs), best)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_gain_that_is_no_number_is_refused(wrong):
    with pytest.raises(WildlabError, match="not a number"):
        one_to_one([[wrong, 0.0]])


def test_a_group_takes_one_track_by_f_and_each_its_own_when_counted():
    squared = mahalanobis_squared([[0.0, 0.0]], [4 * np.eye(2)], [[0.5, 0.0], [-0.5, 0.0]], np.eye(2))
    assert nearest_animal(squared, 0.99).tolist() == [0, 0]
    assert sorted(one_to_one(9.21 - squared).tolist()) == [-1, 0]
