"""What particles say together: weights, evidence, moments, effective size, and where a cloud starts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.tracking.particles import (
    Cloud,
    effective_size,
    log_likelihood,
    moments,
    sight_of,
    start_gaussian,
    start_inside,
    weigh,
    weigh_unseen,
)


def some_cloud(seed, animals=3, particles=40, n=4):
    rng = np.random.default_rng(seed)
    w = rng.exponential(size=(animals, particles)) ** 2
    return Cloud(rng.normal(0, 30, (animals, particles, n)), w / w.sum(axis=1, keepdims=True))


@given(seed=st.integers(0, 999), far=st.floats(-2000, 2000))
def test_weighing_is_the_rule_of_bayes(seed, far):
    """The shift ``far`` of all logarithms moves the evidence alone, however small the likelihoods are."""
    cloud = some_cloud(seed)
    given_each = np.random.default_rng(seed).normal(0, 3, cloud.w.shape)
    after, log_evidence = weigh(cloud, given_each + far)
    total = (cloud.w * np.exp(given_each)).sum(axis=1)
    np.testing.assert_allclose(after.w, cloud.w * np.exp(given_each) / total[:, None], rtol=1e-9)
    np.testing.assert_allclose(log_evidence, np.log(total) + far, atol=1e-9)
    np.testing.assert_allclose(after.w.sum(axis=1), 1, rtol=1e-12)
    assert after.x is cloud.x


def test_what_is_impossible_takes_all_weight_or_is_left_out():
    cloud = Cloud(np.zeros((3, 2, 2)), np.array([[0.5, 0.5], [0.5, 0.5], [1.0, 0.0]]))
    after, log_evidence = weigh(cloud, [[0.0, -np.inf], [-np.inf, -np.inf], [-np.inf, 0.0]])
    assert after.w.tolist() == [[1, 0], [0.5, 0.5], [1, 0]]
    assert log_evidence.tolist() == [np.log(0.5), -np.inf, -np.inf]


def test_not_seen_is_one_minus_the_probability_of_detection():
    cloud = Cloud(np.zeros((1, 4, 2)), np.full((1, 4), 0.25))
    after, log_evidence = weigh_unseen(cloud, [[0.0, 0.5, 1.0, 0.9]])
    np.testing.assert_allclose(after.w, np.array([[1.0, 0.5, 0.0, 0.1]]) / 1.6, rtol=1e-12)
    np.testing.assert_allclose(np.exp(log_evidence), 0.4)


@given(seed=st.integers(0, 999))
def test_moments_are_those_of_numpy(seed):
    cloud = some_cloud(seed)
    mean, covariance = moments(cloud)
    for a in range(3):
        np.testing.assert_allclose(mean[a], np.average(cloud.x[a], axis=0, weights=cloud.w[a]))
        wanted = np.cov(cloud.x[a].T, aweights=cloud.w[a], ddof=0)
        np.testing.assert_allclose(covariance[a], wanted, atol=1e-9)


@given(weights=st.lists(st.floats(1e-6, 1), min_size=1, max_size=50), copies=st.integers(1, 7))
def test_the_effective_size_is_from_one_to_n_and_counts_copies(weights, copies):
    w = np.array(weights) / np.sum(weights)
    size = float(effective_size(w))
    assert 1 - 1e-9 <= size <= len(w) * (1 + 1e-9)
    assert np.isclose(size, 1 / (w**2).sum())
    # Each particle split into equal ones, and others added that have no weight.
    assert np.isclose(effective_size(np.repeat(w / copies, copies)), copies * size)
    assert np.isclose(effective_size(np.append(w, np.zeros(copies))), size)


def test_a_start_has_its_mean_and_covariance():
    rng = np.random.default_rng(5)
    P = np.array([[400.0, 150.0, 0, 0], [150.0, 100.0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 4.0]])
    N = 40_000
    cloud = start_gaussian([[5.0, -3.0, 1.0, 2.0]] * 2, P, N, rng)
    mean, covariance = moments(cloud)
    sd = np.sqrt(np.diag(P))
    assert (np.abs(mean - [5, -3, 1, 2]) <= 5 * sd / np.sqrt(N) + 1e-9).all()
    # The variance of a sample covariance of normal numbers: (P_ii P_jj + P_ij^2) / N.
    error = np.sqrt((np.outer(sd**2, sd**2) + P**2) / N)
    assert (np.abs(covariance - P) <= 5 * error + 1e-12).all()
    assert not np.array_equal(cloud.x[0], cloud.x[1])


def test_a_start_in_an_enclosure_is_even_in_it():
    def triangle(places):
        return (places[..., 0] > 0) & (places[..., 1] > 0) & (places.sum(axis=-1) < 60)

    cloud = start_inside(triangle, [0, 0], [60, 60], 3, 5000, np.random.default_rng(2))
    assert cloud.x.shape == (3, 5000, 2) and triangle(cloud.x).all()
    # Of a triangle: mean a third of its side, variance side^2 / 18.
    mean, covariance = moments(cloud)
    assert np.abs(mean - 20).max() < 5 * np.sqrt(200 / 5000)
    assert np.abs(covariance[:, 0, 0] - 200).max() < 12


def test_several_measurements_are_multiplied():
    rng = np.random.default_rng(3)
    x, z = rng.normal(0, 5, (2, 7, 2)), rng.normal(0, 5, (3, 2))
    R = np.array([[4.0, 1.0], [1.0, 2.0]])
    from scipy.stats import multivariate_normal

    wanted = sum(multivariate_normal(one, R).logpdf(x) for one in z)
    np.testing.assert_allclose(log_likelihood(x, z, R), wanted)
    np.testing.assert_allclose(log_likelihood(x, z, R, measure=lambda p: p + 0.0), wanted)
    assert (log_likelihood(x, np.zeros((0, 2)), R) == 0).all()


def test_who_cannot_be_measured_has_not_been():
    measure = lambda p: np.where(p[..., :1] > 0, p, np.nan)  # noqa: E731
    given_each = log_likelihood([[1.0, 0.0], [-1.0, 0.0]], [1.0, 0.0], np.eye(2), measure)
    assert np.isfinite(given_each[0]) and given_each[1] == -np.inf


def test_a_footprint_is_read_at_the_nearest_node():
    rng = np.random.default_rng(1)
    mask = rng.random((5, 7)) < 0.5
    sight = sight_of(mask, 100.0, -20.0, 4.0, 0.7)
    at = np.stack(np.meshgrid(np.arange(5), np.arange(7), indexing="ij"), axis=-1)
    places = np.array([100.0, -20.0]) + 4.0 * (at + rng.uniform(-0.49, 0.49, at.shape))
    np.testing.assert_array_equal(sight(places), 0.7 * mask)
    assert (sight(places + np.array([40.0, 0.0])) == 0).all() and (
        sight(places - np.array([0.0, 40.0])) == 0
    ).all()
    assert sight(np.array([np.nan, 0.0])) == 0


def nowhere(places):
    return np.zeros(places.shape[:-1], bool)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: weigh(some_cloud(0, 1, 2), [[0.0, np.nan]]), "not a number"),
        (lambda: weigh(some_cloud(0, 1, 2), [[0.0, np.inf]]), "not a number"),
        (lambda: weigh_unseen(some_cloud(0), -0.1), "0 to 1"),
        (lambda: weigh_unseen(some_cloud(0), 1.1), "0 to 1"),
        (lambda: weigh_unseen(some_cloud(0), np.nan), "0 to 1"),
        (lambda: start_inside(nowhere, [0, 0], [1, 1], 1, 5, np.random.default_rng()), "0 lie"),
        (lambda: start_gaussian([[0.0, 0.0]], np.eye(2), 0, np.random.default_rng()), "at least one"),
        (lambda: log_likelihood([[0.0, 0.0]], [0.0, 0.0], np.diag([1.0, 0.0])), "no inverse"),
        (lambda: log_likelihood([[0.0, 0.0]], [0.0, 0.0], np.diag([1.0, -1.0])), "variance"),
        (lambda: sight_of([[1.5]], 0.0, 0.0, 1.0), "probabilit"),
        (lambda: sight_of([[np.nan]], 0.0, 0.0, 1.0), "probabilit"),
        (lambda: sight_of([[True]], 0.0, 0.0, 0.0), "probabilit"),
    ],
)
def test_refusals(act, words):
    with pytest.raises(WildlabError, match=words):
        act()
