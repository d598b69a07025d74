"""Existence, association and the start of a track: every state and every way counted one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.many.enumeration import association_probabilities_by_enumeration
from tests.tracking.poses import GENERATORS
from wildlab.geometry.covariances import gate_threshold
from wildlab.studies.crossing_vessels import pair_scans
from wildlab.tracking.association import (
    association_probabilities,
    belief_propagation,
)
from wildlab.tracking.multitarget_tracks import after_scan, still_there, visible_later, weights

shares = st.floats(0.01, 0.99)


def by_counting(
    r: np.ndarray, v: np.ndarray, d: float, L: np.ndarray, c: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every target is absent, hidden, overlooked or the source of one measurement."""
    n, m = L.shape
    there, seen, own = np.zeros(n), np.zeros(n), np.zeros((n, 1 + m))
    total = 0.0
    for world in product(["absent", "hidden", "overlooked", *range(m)], repeat=n):
        taken = [one for one in world if isinstance(one, int)]
        if len(set(taken)) < len(taken):
            continue
        weight = 1.0
        for i, one in enumerate(world):
            if one == "absent":
                weight *= 1 - r[i]
            elif one == "hidden":
                weight *= r[i] * (1 - v[i])
            elif one == "overlooked":
                weight *= r[i] * v[i] * (1 - d)
            else:
                weight *= r[i] * v[i] * d * L[i, one] / c
        total += weight
        for i, one in enumerate(world):
            there[i] += weight * (one != "absent")
            seen[i] += weight * (one not in ("absent", "hidden"))
            if one != "absent":
                own[i, 1 + one if isinstance(one, int) else 0] += weight
    return there / total, seen / there, own / there[:, None]


@given(GENERATORS, st.integers(1, 3), st.integers(0, 3), shares)
def test_every_state_of_the_world_counted(rng, n, m, d):
    r, v = rng.uniform(0.02, 0.98, n), rng.uniform(0.02, 0.98, n)
    L, c = np.exp(rng.normal(-3, 3, (n, m))) * (rng.random((n, m)) > 0.3), 1e-2
    p = association_probabilities(*weights(r, v, d, L, c))
    for found, expected in zip(after_scan(r, v, d, p), by_counting(r, v, d, L, c), strict=True):
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-12)


@given(shares, shares, st.lists(st.floats(0, 5), min_size=0, max_size=4))
def test_one_target_that_can_be_seen_has_the_closed_form(r, d, L):
    """Musicki, Evans and Stankovic 1994, (14): the textbook's data association with existence."""
    c = 0.3
    p = association_probabilities(*weights([r], [1.0], d, [L], c))
    existence, visible, _ = after_scan([r], [1.0], d, p)
    delta = d * (1 - sum(L) / c)
    assert existence[0] == pytest.approx((1 - delta) * r / (1 - delta * r), rel=1e-9)
    assert visible[0] == pytest.approx(1.0)


def test_what_is_hidden_is_not_missed():
    """A scan without a measurement ends the belief that it can be seen before that in its existence."""
    r, v = np.array([0.9]), np.array([0.5])
    for _ in range(10):
        p = association_probabilities(*weights(r, v, 0.9, np.zeros((1, 0)), 1e-3))
        r, v, own = after_scan(r, v, 0.9, p)
        assert own[0].tolist() == [1.0]
    assert v[0] < 1e-6 and 0.8 < r[0] < 0.9
    certain = association_probabilities(*weights([1.0], [0.0], 0.9, np.zeros((1, 0)), 1e-3))
    assert after_scan([1.0], [0.0], 0.9, certain)[0][0] == 1.0


@given(shares, st.floats(0.1, 100), st.floats(0.1, 100), st.floats(0, 50), st.floats(0, 50))
def test_two_waits_are_one(v, visible_s, hidden_s, one, two):
    at_once = visible_later(v, one + two, visible_s, hidden_s)
    in_two = visible_later(visible_later(v, one, visible_s, hidden_s), two, visible_s, hidden_s)
    assert np.allclose(at_once, in_two, atol=1e-12)
    lasting = visible_s / (visible_s + hidden_s)
    assert min(v, lasting) - 1e-12 <= at_once <= max(v, lasting) + 1e-12
    # The rate at which it hides is one in its mean stay.
    soon = 1e-6 / (1 / visible_s + 1 / hidden_s)
    assert visible_later(1.0, soon, visible_s, hidden_s) == pytest.approx(1 - soon / visible_s, abs=1e-11)


def test_existence_decays_with_its_lifetime():
    assert still_there(0.8, 50.0, 50.0) == pytest.approx(0.8 / np.e)


GATE = gate_threshold(0.99, 2)


@given(st.floats(0, 2 * np.pi), st.floats(0.1, 3), st.floats(0, 10), st.floats(0.5, 20))
def test_the_region_is_that_of_noise_about_where_motion_may_lead(angle, dt, speed, sd):
    """Without correlation its edge lies the reach of noise beyond that of motion, all around."""
    edge = speed * dt + np.sqrt(GATE * 2) * sd
    for length, inside in ((0.999 * edge, True), (1.001 * edge, False)):
        point = length * np.array([np.cos(angle), np.sin(angle)])
        found = pair_scans([[0.0, 0.0]], [point], dt, sd**2 * np.eye(2), speed, GATE)
        assert (found.measurement[0] == 0) == inside


def test_a_target_at_rest_is_let_in_as_often_as_the_gate_says(rng):
    R = np.array([[9.0, 4.0], [4.0, 4.0]])
    z = rng.multivariate_normal([0, 0], R, (20000, 2))
    paired = [pair_scans(one[:1], one[1:], 1.0, R, 0.0, GATE).track[0] == 0 for one in z[:3000]]
    assert np.mean(paired) == pytest.approx(0.99, abs=0.006)


def test_of_several_the_nearest_whole_is_taken():
    """All are within reach of both: the sum of squares decides, not the first."""
    found = pair_scans([[0.0, 0.0], [4.0, 0.0]], [[5.0, 0.0], [1.0, 0.0]], 1.0, np.eye(2), 20.0, GATE)
    assert found.measurement.tolist() == [1, 0]


def weights_of(seed: int, n: int, m: int, empty: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    w = np.exp(rng.normal(0.0, 3.0, (n, m))) * (rng.random((n, m)) > empty)
    return w, rng.uniform(0.01, 1.0, n)


@given(st.integers(0, 10_000), st.integers(0, 4), st.integers(0, 4))
def test_sums_are_those_of_every_way(seed, n, m):
    w, w0 = weights_of(seed, n, m)
    found = association_probabilities(w, w0)
    assert found.shape == (n, 1 + m)
    assert np.allclose(found, association_probabilities_by_enumeration(w, w0), rtol=1e-9, atol=1e-12)


@given(st.integers(0, 10_000))
def test_no_measurement_is_given_away_twice(seed):
    w, w0 = weights_of(seed, 7, 9, empty=0.6)
    found = association_probabilities(w, w0)
    assert np.allclose(found.sum(axis=1), 1) and (found >= 0).all()
    assert (found[:, 1:].sum(axis=0) <= 1 + 1e-9).all()
    assert (found[:, 1:][w == 0] == 0).all()


@given(GENERATORS)
def test_messages_are_exact_where_nothing_competes_in_a_loop(rng):
    """A chain: each target shares one measurement with the next."""
    w = np.zeros((5, 6))
    for i in range(5):
        w[i, i : i + 2] = np.exp(rng.normal(0, 2, 2))
    w0 = rng.uniform(0.05, 1, 5)
    assert np.allclose(belief_propagation(w, w0), association_probabilities(w, w0), atol=1e-7)


def test_messages_are_near_where_loops_are():
    """Of 200 crowded clusters the mean difference is below a percent, and large ones take this way."""
    rng, off = np.random.default_rng(1), []
    for _ in range(200):
        place, seen = rng.uniform(0, 30, (6, 2)), rng.uniform(0, 30, (6, 2))
        apart = np.linalg.norm(place[:, None] - seen[None], axis=2)
        w, w0 = 0.9 * np.exp(-((apart / 4) ** 2) / 2) / 0.05, np.full(6, 0.1)
        off.append(np.abs(belief_propagation(w, w0) - association_probabilities(w, w0)).mean())
    assert 0 < np.mean(off) < 0.01
    w, w0 = weights_of(3, 20, 20, empty=0.5)
    assert np.allclose(association_probabilities(w, w0), belief_propagation(w, w0), atol=1e-6)


def test_a_target_that_nothing_is_of_has_none_whatever_others_have():
    """Also one that cannot be missed, and whether few or many are summed at once."""
    for count in (2, 9):
        weights = np.zeros((count, count))
        weights[: count - 1, : count - 1] = 1.0
        missed = np.append(np.full(count - 1, 0.5), 0.0)
        found = association_probabilities(weights, missed)
        assert found[-1].tolist() == [1.0] + [0.0] * count
        assert np.allclose(found[:-1, -1], 0) and np.allclose(found.sum(axis=1), 1)
        assert np.allclose(found[:-1, 1:-1], found[0, 1])
