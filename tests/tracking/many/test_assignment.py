"""Which is which over a matrix: every permutation tried, features, and tracks that are recognised."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import multivariate_normal, norm

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import gate_threshold
from wildlab.tracking.association import (
    Assignment,
    feature_distances,
    global_nearest,
    image_features,
    veto,
    with_features,
)
from wildlab.tracking.many.life import look_differences, place_costs, reachable, recognise

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


@pytest.mark.parametrize(
    ("distances", "gate", "words"),
    [
        ([1.0, 2.0], 9.0, "no matrix"),
        ([[-np.inf]], 9.0, "no size"),
        ([[1.0]], np.nan, "no size"),
        ([[1.0]], -np.inf, "no size"),
    ],
)
def test_what_is_refused(distances, gate, words):
    with pytest.raises(WildlabError, match=words):
        global_nearest(distances, gate)


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
def test_features_that_do_not_fit_are_refused(sd, weights, words):
    with pytest.raises(WildlabError, match=words):
        feature_distances([[1.0, 2.0]], [[1.0, 2.0]], sd, weights)


def test_a_veto_with_features_of_other_measurements_is_refused():
    with pytest.raises(WildlabError, match="do not go with"):
        veto(Assignment(np.array([0]), np.array([0])), [[1.0, 2.0]], 4.0)


GATE = gate_threshold(0.99, 2)
LIKELIER = 19.0
MARGIN = 2 * np.log(LIKELIER)
COSTS = st.floats(-30, 30)


def alone(places, possible=None, looks=None, limit=np.inf, likelier=LIKELIER):
    """`recognise` of places, without looks where none are given."""
    costs = np.asarray(places, float)
    may = np.ones(costs.shape, bool) if possible is None else np.asarray(possible, bool)
    differ = np.zeros((*costs.shape, 0)) if looks is None else np.asarray(looks, float)
    return recognise(may, costs, differ, limit, likelier).track.tolist()


@given(st.floats(0, 2 * np.pi), st.floats(0, 100), st.floats(0, 5), st.floats(0.5, 20), st.floats(0.5, 20))
def test_the_edge_of_reach_lies_noise_of_both_beyond_motion(angle, seconds, speed, sd, old_sd):
    edge = speed * seconds + np.sqrt(GATE * (sd**2 + old_sd**2))
    for length, inside in ((0.999 * edge, True), (1.001 * edge, False)):
        place = [[length * np.cos(angle), length * np.sin(angle)]]
        spreads = [sd**2 * np.eye(2)], [old_sd**2 * np.eye(2)]
        found = reachable(place, spreads[0], [[0.0, 0.0]], spreads[1], [seconds], speed, GATE)
        assert found.tolist() == [[inside]]


def test_no_pair_is_no_matrix_entry():
    none = np.empty((0, 2)), np.empty((0, 2, 2))
    assert reachable(*none, [[0.0, 0.0]], [np.eye(2)], [1.0], 1.0, GATE).shape == (0, 1)
    assert place_costs([[0.0, 0.0]], [np.eye(2)], *none).shape == (1, 0)
    assert recognise(np.ones((1, 0), bool), np.ones((1, 0)), np.ones((1, 0, 2)), 9.0, LIKELIER).track[0] == -1


def test_costs_of_places_are_those_of_the_normal_density(rng):
    new, old = rng.normal(0, 9, (2, 2)), rng.normal(0, 9, (3, 2))
    A, B = (one @ np.swapaxes(one, 1, 2) + np.eye(2) for one in (rng.normal(size=(k, 2, 2)) for k in (2, 3)))
    costs = place_costs(new, A, old, B)
    for i, j in itertools.product(range(2), range(3)):
        density = multivariate_normal(old[j], A[i] + B[j]).logpdf(new[i])
        assert costs[i, j] == pytest.approx(-2 * density - 2 * np.log(2 * np.pi))


def test_looks_summed_are_the_feature_distance_where_all_is_known(rng):
    new, old = rng.normal(size=(3, 2)), rng.normal(size=(4, 2))
    sd, weights = [0.5, 2.0], [1.0, 0.3]
    summed = look_differences(new, old, sd, weights).sum(axis=-1)
    assert np.allclose(summed, feature_distances(new, old, sd, weights))
    new[1, 0] = np.nan
    assert np.isnan(look_differences(new, old, sd, weights)[1, :, 0]).all()


def test_one_alone_is_taken_whatever_it_costs_and_none_beyond_the_limits():
    assert alone([[500.0]]) == [0]
    assert alone([[0.0]], possible=[[False]]) == [-1]
    assert alone([[0.0]], looks=[[[10.9]]], limit=10.8) == [-1]
    assert alone([[0.0]], looks=[[[10.7]]], limit=10.8) == [0]


@given(COSTS, st.floats(0.0, 2 * MARGIN).filter(lambda apart: abs(apart - MARGIN) > 1e-6))
def test_of_two_kept_or_two_new_ones_the_ratio_of_likelihoods_decides(cost, apart):
    """Two normal densities whose ratio is known: taken from that ratio on."""
    sure = apart > MARGIN
    assert alone([[cost, cost + apart]]) == [0 if sure else -1]
    assert alone([[cost + apart, cost]]) == [1 if sure else -1]
    assert alone([[cost], [cost + apart]]) == [0 if sure else -1, -1]
    ratio = norm.pdf(np.sqrt(apart)) / norm.pdf(0.0)
    assert (1 / ratio >= LIKELIER) == sure


@given(COSTS, st.floats(0, 9))
def test_two_look_alikes_in_one_place_are_not_guessed(cost, look):
    assert alone([[cost, cost]], looks=[[[look], [look]]]) == [-1]
    assert alone([[cost, cost]], looks=[[[look], [look + 1.01 * MARGIN]]]) == [0]


def test_what_is_not_known_of_both_rivals_tells_nothing():
    """A feature that one of the two kept ones lacks is no reason to take that one: what is not known fits."""
    lacking = [[[0.1, MARGIN + 2], [0.1, np.nan]]]
    assert alone([[0.0, 0.0]], looks=lacking) == [-1]
    assert alone([[0.0, 0.0]], looks=np.nan_to_num(lacking)) == [1]
    assert alone([[2 * MARGIN + 2, 0.0]], looks=lacking) == [1]


def test_several_are_assigned_at_once():
    """Each is the likeliest of its own alone, by far."""
    far = 3 * MARGIN
    costs = np.full((3, 3), far)
    order = [2, 0, 1]
    costs[range(3), order] = 0.0
    assert alone(costs) == order


def test_two_assignments_as_likely_as_each_other_leave_both_new():
    """Every pair but one is then in one of the two alone; none of them is taken."""
    assert alone([[0.0, MARGIN + 1], [2 * MARGIN, 3 * MARGIN + 1]]) == [-1, -1]


@given(arrays(float, (2, 2), elements=st.sampled_from([0.0, 3.0, 7.0, 14.0])), arrays(bool, (2, 2)))
def test_the_order_of_tracks_changes_nothing_with_ties(costs, possible):
    found = np.array(alone(costs, possible))
    turned = np.array(alone(costs[:, ::-1], possible[:, ::-1]))
    assert turned.tolist() == [-1 if one < 0 else 1 - one for one in found]
    assert alone(costs[::-1], possible[::-1]) == found[::-1].tolist()


@given(arrays(float, (3, 3), elements=COSTS), arrays(bool, (3, 3)))
def test_what_is_taken_is_within_the_limits_once_and_far_likelier(costs, possible):
    found = recognise(possible, costs, np.zeros((3, 3, 0)), np.inf, LIKELIER)
    for row, column in enumerate(found.track):
        if column < 0:
            continue
        assert possible[row, column] and found.measurement[column] == row
        others = np.append(costs[row][possible[row]], costs[:, column][possible[:, column]])
        assert (np.sort(others)[2:] >= costs[row, column] + MARGIN).all()
    assert (found.measurement >= 0).sum() == (found.track >= 0).sum()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: reachable([[0, 0]], [np.eye(2)], [[0, 0]], [np.eye(2)], [-1.0], 5.0, GATE), "times of"),
        (lambda: reachable([[0, 0]], [np.eye(2)], [[0, 0]], [np.eye(2)], [1.0], np.inf, GATE), "inf m/s"),
        (lambda: look_differences([[0.0]], [[0.0, 1.0]], [1.0], [1.0]), "do not go with"),
        (lambda: look_differences([[0.0]], [[0.0]], [0.0], [1.0]), "spreads of"),
        (lambda: look_differences([[0.0]], [[0.0]], [1.0], [-1.0]), "weights of"),
        (lambda: recognise([[True]], [[0.0, 1.0]], [[[0.0]]], 1.0, 19.0), "do not go together"),
        (lambda: recognise([[True]], [[0.0]], [[[0.0]]], 1.0, 1.0), "a ratio of 1"),
        (lambda: recognise([[True]], [[0.0]], [[[0.0]]], 1.0, np.inf), "a ratio of inf"),
    ],
)
def test_what_cannot_be_recognised_is_refused(call, words):
    with pytest.raises(WildlabError, match=words):
        call()
