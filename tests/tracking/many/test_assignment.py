"""Which is which over a matrix: every permutation tried, and features."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wildlab.errors import WildlabError
from wildlab.tracking.association import (
    feature_distances,
    global_nearest,
    image_features,
)

entries = st.one_of(st.integers(-5, 30), st.sampled_from([np.nan, np.inf]))
matrices = st.tuples(st.integers(0, 4), st.integers(0, 4)).flatmap(
    lambda shape: st.lists(entries, min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]).map(
        lambda values: np.array(values, float).reshape(shape)
    )
)
gates = st.integers(-5, 30)


def every_assignment(d, gate):
    """All sets of pairs that are possible."""
    n, m = d.shape
    for size in range(min(n, m) + 1):
        for rows in itertools.combinations(range(n), size):
            for columns in itertools.permutations(range(m), size):
                pairs = list(zip(rows, columns, strict=True))
                if all(np.isfinite(d[pair]) and d[pair] <= gate for pair in pairs):
                    yield pairs


def pairs_of(assignment):
    return [(row, int(column)) for row, column in enumerate(assignment.track) if column >= 0]


@given(matrices, gates)
def test_with_a_gate_against_every_permutation(d, gate):
    found = global_nearest(d, gate)
    ways = list(every_assignment(d, gate))
    assert pairs_of(found) in ways
    assert all(found.measurement[column] == row for row, column in pairs_of(found))
    assert (found.measurement >= 0).sum() == len(pairs_of(found))

    def cost(pairs):
        return sum(d[pair] for pair in pairs) - gate * len(pairs)

    assert cost(pairs_of(found)) == pytest.approx(min(map(cost, ways)))


@given(matrices)
def test_without_a_gate_as_many_as_possible_and_the_least_among_those(d):
    found = pairs_of(global_nearest(d, np.inf))
    ways = list(every_assignment(d, np.inf))
    assert found in ways
    most = max(map(len, ways))
    assert len(found) == most
    least = min(sum(d[pair] for pair in way) for way in ways if len(way) == most)
    assert sum(d[pair] for pair in found) == pytest.approx(least)


def test_the_gate_itself_is_inside():
    assert global_nearest([[9.0]], 9.0).track.tolist() == [0]
    assert global_nearest([[9.1]], 9.0).track.tolist() == [-1]


values = arrays(np.float64, (3, 2), elements=st.floats(-50, 50))


@given(values, values, arrays(np.float64, 2, elements=st.floats(0, 3)))
def test_it_is_the_sum_of_its_features(measured, stored, weights):
    sd = np.array([2.0, 0.5])
    found = feature_distances(measured, stored, sd, weights)
    for i, new in enumerate(measured):
        for j, old in enumerate(stored):
            expected = sum(w * ((a - b) / s) ** 2 for a, b, s, w in zip(new, old, sd, weights, strict=True))
            assert found[i, j] == pytest.approx(expected)


def test_size_on_the_ground_does_not_depend_on_the_distance():
    near = image_features([400.0], [10.0], [[0.2] + [0.0] * 6], 0.25)
    far = image_features([100.0], [10.0], [0.2], 0.5)
    assert np.allclose(near, far)
    assert np.allclose(near, [[np.log(25), 10, np.log(0.2)]])
    assert np.isnan(image_features([0.0], [1.0], [0.0], 1.0)).tolist() == [[True, False, True]]


@pytest.mark.parametrize(
    ("sd", "weights", "words"),
    [
        ([1.0], [1.0, 1.0], "do not go with spreads"),
        ([1.0, 1.0], [1.0], "do not go with spreads"),
        ([1.0, 0.0], [1.0, 1.0], "sd: a spread of"),
        ([1.0, np.nan], [1.0, 1.0], "sd: a spread of"),
        ([1.0, 1.0], [1.0, -1.0], "weights: weights of"),
        ([1.0, 1.0], [1.0, np.inf], "weights: weights of"),
    ],
)
def test_features_that_do_not_fit_are_refused(sd, weights, words):
    with pytest.raises(WildlabError, match=words):
        feature_distances([[1.0, 2.0]], [[1.0, 2.0]], sd, weights)
