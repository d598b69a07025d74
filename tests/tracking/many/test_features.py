"""Features in association: their sum, what is not known, and the veto."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wildlab.errors import WildlabError
from wildlab.tracking.many.assignment import Assignment
from wildlab.tracking.many.features import feature_distances, image_features, veto, with_features

values = arrays(np.float64, (3, 2), elements=st.floats(-50, 50))


@given(values, values, arrays(np.float64, 2, elements=st.floats(0, 3)))
def test_it_is_the_sum_of_its_features(measured, stored, weights):
    sd = np.array([2.0, 0.5])
    found = feature_distances(measured, stored, sd, weights)
    for i, new in enumerate(measured):
        for j, old in enumerate(stored):
            expected = sum(w * ((a - b) / s) ** 2 for a, b, s, w in zip(new, old, sd, weights, strict=True))
            assert found[i, j] == pytest.approx(expected)


def test_what_is_not_known_adds_nothing():
    found = feature_distances([[np.nan, 3.0]], [[1.0, 1.0], [np.nan, np.nan]], [1.0, 1.0], [1.0, 1.0])
    assert found.tolist() == [[4.0, 0.0]]


def test_nothing_to_compare():
    assert feature_distances(np.empty((0, 2)), [[1.0, 2.0]], [1.0, 1.0], [1.0, 1.0]).shape == (0, 1)


def test_size_on_the_ground_does_not_depend_on_the_distance():
    near = image_features([400.0], [10.0], [[0.2] + [0.0] * 6], 0.25)
    far = image_features([100.0], [10.0], [0.2], 0.5)
    assert np.allclose(near, far)
    assert np.allclose(near, [[np.log(25), 10, np.log(0.2)]])
    assert np.isnan(image_features([0.0], [1.0], [0.0], 1.0)).tolist() == [[True, False, True]]


def test_the_gate_is_one_of_distance_alone():
    d = np.array([[1.0, 9.3], [np.nan, 9.2]])
    found = with_features(d, [[100.0, 0.0], [0.0, 0.0]], gate=9.21)
    assert found.tolist() == [[101.0, np.inf], [np.inf, 9.2]]


def test_a_veto_undoes_a_pair_on_both_sides_and_leaves_the_others():
    made = Assignment(np.array([1, 0, -1]), np.array([1, 0]))
    features = [[0.0, 5.0], [3.0, 0.0], [0.0, 0.0]]
    assert [one.tolist() for one in veto(made, features, 4.0)] == [[-1, 0, -1], [1, -1]]
    assert [one.tolist() for one in veto(made, features, 5.0)] == [[1, 0, -1], [1, 0]]
    assert made.track.tolist() == [1, 0, -1]
    unknown = [[0.0, np.nan], [0.0, 0.0], [0.0, 0.0]]
    assert veto(made, unknown, 4.0).track.tolist() == [-1, 0, -1]


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
def test_what_is_refused(sd, weights, words):
    with pytest.raises(WildlabError, match=words):
        feature_distances([[1.0, 2.0]], [[1.0, 2.0]], sd, weights)


def test_a_veto_with_features_of_other_measurements_is_refused():
    with pytest.raises(WildlabError, match="do not go with"):
        veto(Assignment(np.array([0]), np.array([0])), [[1.0, 2.0]], 4.0)
