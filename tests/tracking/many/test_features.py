"""Features in association: their sum, what is not known, and the veto."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from wildlab.errors import WildlabError
from wildlab.tracking.many.assignment import Assignment, global_nearest
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


@given(values, values)
def test_weights_scale_as_spreads_do(measured, stored):
    """Twice the spread is a quarter of the weight."""
    wide = feature_distances(measured, stored, [2.0, 2.0], [1.0, 1.0])
    light = feature_distances(measured, stored, [1.0, 1.0], [0.25, 0.25])
    assert np.allclose(wide, light)


def test_with_unit_weights_it_is_chi_square():
    rng = np.random.default_rng(5)
    sd = np.array([0.3, 4.0, 0.05])
    found = feature_distances(rng.normal(0, sd, (4000, 3)), np.zeros((1, 3)), sd, np.ones(3))[:, 0]
    assert stats.kstest(found, stats.chi2(3).cdf).pvalue > 0.01


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


def test_features_turn_a_crossing_round():
    """By distance each measurement goes to the other's track, by what it looks like it does not."""
    d = np.array([[2.0, 1.0], [1.0, 2.0]])
    looks = feature_distances([[0.1], [0.9]], [[0.0], [1.0]], [0.3], [1.0])
    assert global_nearest(d, 9.21).track.tolist() == [1, 0]
    assert global_nearest(with_features(d, looks, 9.21), np.inf).track.tolist() == [0, 1]


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
    with pytest.raises(WildlabError, match="do not go with 1 measurements and 1 tracks"):
        veto(Assignment(np.array([0]), np.array([0])), [[1.0, 2.0]], 4.0)
