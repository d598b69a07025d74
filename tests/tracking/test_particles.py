"""Clouds of particles: weights, moments, starts, moves, draws and counts, by closed forms and by numpy."""

from functools import partial
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.poses import GENERATORS
from wildlab.tracking.motion import constant_velocity, in_steps
from wildlab.tracking.multitarget_tracks import count_interval, count_probabilities
from wildlab.tracking.particles import (
    Cloud,
    draw,
    effective_size,
    moments,
    move,
    resample,
    start_gaussian,
    stay_inside,
    walk_of,
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


def test_a_start_has_its_mean_and_covariance(rng):
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


def uneven(rng, animals, particles):
    w = rng.exponential(size=(animals, particles)) ** 3
    w[:, ::4] = 0
    return w / w.sum(axis=1, keepdims=True)


def test_copies_are_unbiased(rng):
    """The mean number of copies is N w, within the error of the draws themselves."""
    N, runs = 24, 20_000
    w = uneven(rng, 1, N)[0]
    chosen = draw(np.tile(w, (runs, 1)), rng)
    copies = np.apply_along_axis(np.bincount, 1, chosen, minlength=N)
    assert (copies[:, w == 0] == 0).all() and (copies.sum(axis=1) == N).all()
    part = (N * w) % 1
    variance = part * (1 - part)
    off = np.abs(copies.mean(axis=0) - N * w)
    assert (off <= 4.5 * np.sqrt(variance / runs) + 1e-12).all()
    np.testing.assert_allclose(copies.var(axis=0)[variance > 0.05], variance[variance > 0.05], rtol=0.08)
    assert (np.abs(copies - N * w) < 1).all()


@given(rng=GENERATORS, threshold=st.floats(0, 1))
def test_only_those_at_or_below_the_threshold_are_drawn_anew(rng, threshold):
    power = rng.uniform(0, 3, (6, 1))
    w = rng.exponential(size=(6, 30)) ** power
    w /= w.sum(axis=1, keepdims=True)
    cloud = Cloud(rng.normal(size=(6, 30, 2)), w)
    size = effective_size(w) / 30
    after, due = resample(cloud, rng, threshold)
    clear = np.abs(size - threshold) > 1e-6
    np.testing.assert_array_equal(due[clear], (size < threshold)[clear])
    np.testing.assert_array_equal(after.x[~due], cloud.x[~due])
    np.testing.assert_array_equal(after.w[~due], cloud.w[~due])
    assert (after.w[due] == 1 / 30).all()
    for a in np.flatnonzero(due):
        assert {tuple(one) for one in after.x[a]} <= {tuple(one) for one in cloud.x[a]}


def test_two_thirds_is_the_default_and_one_is_always(rng):
    w = np.full((1, 9), 1 / 9)
    w2 = np.array([[1 / 5] * 5 + [0.0] * 4, [1 / 7] * 7 + [0.0] * 2])
    assert resample(Cloud(np.zeros((2, 9, 2)), w2), rng)[1].tolist() == [True, False]
    assert not resample(Cloud(np.zeros((1, 9, 2)), w), rng)[1].any()
    assert resample(Cloud(np.zeros((1, 9, 2)), w), rng, threshold=1)[1].all()


some = st.lists(st.floats(0, 1), max_size=7)


@given(existence=some)
def test_every_way_of_being_there_is_counted(existence):
    wanted = np.zeros(len(existence) + 1)
    for way in product([0, 1], repeat=len(existence)):
        wanted[sum(way)] += np.prod([r if there else 1 - r for r, there in zip(existence, way, strict=True)])
    np.testing.assert_allclose(count_probabilities(existence), wanted, atol=1e-12)


@given(existence=some, probability=st.floats(0.05, 0.99))
def test_the_interval_is_the_shortest_that_holds_enough(existence, probability):
    p = count_probabilities(existence)
    count = count_interval(p, probability)
    assert np.isclose(count.probability, p[count.low : count.high + 1].sum())
    assert count.probability >= probability - 1e-9
    length = count.high - count.low
    for low in range(len(p)):
        assert p[low : low + length].sum() < probability  # none that is shorter by one holds it
        assert p[low : low + length + 1].sum() <= count.probability + 1e-9
    assert np.isclose(count.mean, np.arange(len(p)) @ p)


N = 40_000


def near(covariance, wanted, count=N):
    """Within five errors of a sample covariance of normal numbers."""
    sd = np.sqrt(np.diag(wanted))
    return (
        np.abs(covariance - wanted) <= 5 * np.sqrt((np.outer(sd, sd) ** 2 + wanted**2) / count) + 1e-9
    ).all()


def test_a_cloud_moves_as_its_model_says(rng):
    start, P = np.array([10.0, 5.0, 1.0, -2.0]), np.diag([9.0, 4.0, 0.25, 1.0])
    motion = partial(constant_velocity, sd_acceleration=0.7)
    F, Q = motion(3.0)
    mean, covariance = moments(move(start_gaussian([start], P, N, rng), motion, 3.0, rng))
    wanted = F @ P @ F.T + Q
    assert (np.abs(mean[0] - F @ start) < 5 * np.sqrt(np.diag(wanted) / N)).all()
    assert near(covariance[0], wanted)


@pytest.mark.parametrize("step", [0.5, 1.0, 3.0])
def test_the_walk_does_not_depend_on_how_often_it_is_predicted(step):
    """It spreads as (4.5) does when (4.5) is taken in its own step, and as (4.5) alone does not."""
    walk = walk_of(0.5, step)

    def printed(dt):
        return np.eye(2), (0.5 * dt) ** 2 * np.eye(2)

    _, half_an_hour = walk(1800.0)
    np.testing.assert_allclose(half_an_hour, in_steps(1800.0, printed, step)[1], rtol=1e-9)
    np.testing.assert_allclose(half_an_hour, 600 * walk(3.0)[1], rtol=1e-9)
    assert not np.allclose(printed(3.0)[1], 30 * printed(0.1)[1])


def test_nobody_leaves_and_all_of_the_enclosure_is_used(rng):
    def half_disc(places):
        return (np.hypot(places[..., 0], places[..., 1]) < 50) & (places[..., 0] > 0)

    tried = rng.uniform([0, -50], [50, 50], (24_000, 2))
    tried = tried[half_disc(tried)][:8_000]
    cloud = Cloud(tried[None], np.full((1, 8_000), 1 / 8_000))
    corner = Cloud(np.full_like(cloud.x, 1.0), cloud.w)
    for _ in range(400):
        cloud = stay_inside(cloud, move(cloud, walk_of(2.0, 1.0), 10.0, rng), half_disc)
        corner = stay_inside(corner, move(corner, walk_of(2.0, 1.0), 10.0, rng), half_disc)
        assert half_disc(cloud.x).all()
    for one in (
        cloud,
        corner,
    ):  # even in the long run, wherever it started: a half disc's middle is 4 r / 3 pi
        mean, covariance = moments(one)
        assert abs(mean[0, 0] - 4 * 50 / (3 * np.pi)) < 0.6 and abs(mean[0, 1]) < 1.0
        assert abs(covariance[0, 1, 1] - 50**2 / 4) < 25


def test_a_velocity_that_led_out_is_given_up():
    before = Cloud(np.array([[[0.0, 0.0, 9.0, 0.0], [0.0, 0.0, 1.0, 0.0]]]), np.full((1, 2), 0.5))
    after = Cloud(np.array([[[9.0, 0.0, 9.0, 0.0], [1.0, 0.0, 1.0, 0.0]]]), np.full((1, 2), 0.5))
    kept = stay_inside(before, after, lambda p: p[..., 0] < 5)
    assert kept.x.tolist() == [[[0, 0, 0, 0], [1, 0, 1, 0]]]
