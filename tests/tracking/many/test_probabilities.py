"""Fast sums over all ways to deal measurements out are those of counting the ways one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.poses import GENERATORS
from wildlab.errors import WildlabError
from wildlab.tracking.many.probabilities import (
    association_probabilities,
    association_probabilities_by_enumeration,
    belief_propagation,
)


def weights_of(seed: int, n: int, m: int, empty: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    w = np.exp(rng.normal(0.0, 3.0, (n, m))) * (rng.random((n, m)) > empty)
    return w, rng.uniform(0.01, 1.0, n)


@given(st.integers(0, 10_000), st.integers(0, 4), st.integers(0, 4))
def test_sums_are_those_of_every_way(seed: int, n: int, m: int) -> None:
    w, w0 = weights_of(seed, n, m)
    found = association_probabilities(w, w0)
    assert found.shape == (n, 1 + m)
    assert np.allclose(found, association_probabilities_by_enumeration(w, w0), rtol=1e-9, atol=1e-12)


@given(st.integers(0, 10_000))
def test_no_measurement_is_given_away_twice(seed: int) -> None:
    w, w0 = weights_of(seed, 7, 9, empty=0.6)
    found = association_probabilities(w, w0)
    assert np.allclose(found.sum(axis=1), 1) and (found >= 0).all()
    assert (found[:, 1:].sum(axis=0) <= 1 + 1e-9).all()
    assert (found[:, 1:][w == 0] == 0).all()


@given(st.integers(0, 10_000), st.floats(1e-8, 1e8))
def test_a_targets_weights_may_be_scaled(seed: int, factor: float) -> None:
    w, w0 = weights_of(seed, 4, 4)
    before = association_probabilities(w, w0)
    w[1] *= factor
    w0[1] *= factor
    assert np.allclose(association_probabilities(w, w0), before, atol=1e-9)


def test_many_targets_in_one_cluster_lose_no_digits() -> None:
    w = np.full((40, 10), 1e-3)
    found = association_probabilities(w, np.full(40, 0.5))
    # All alike: each measurement is shared by all.
    assert np.allclose(found, found[0]) and np.allclose(found[:, 1:], found[0, 1])


@given(GENERATORS)
def test_messages_are_exact_where_nothing_competes_in_a_loop(rng: np.random.Generator) -> None:
    """A chain: each target shares one measurement with the next."""
    w = np.zeros((5, 6))
    for i in range(5):
        w[i, i : i + 2] = np.exp(rng.normal(0, 2, 2))
    w0 = rng.uniform(0.05, 1, 5)
    assert np.allclose(belief_propagation(w, w0), association_probabilities(w, w0), atol=1e-7)


def test_messages_are_near_where_loops_are() -> None:
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


@pytest.mark.parametrize(
    ("weights", "missed", "words"),
    [
        ([[1.0]], [1.0, 2.0], "do not fit"),
        ([[-1.0]], [1.0], "negative"),
        ([[np.nan]], [1.0], "not a number"),
        ([[1.0], [1.0]], [0.0, 0.0], "no way to deal them out"),
    ],
)
def test_what_cannot_be_is_said(weights: list[list[float]], missed: list[float], words: str) -> None:
    with pytest.raises(WildlabError, match=words):
        association_probabilities(weights, missed)


def test_messages_need_targets_that_can_be_missed() -> None:
    with pytest.raises(WildlabError, match="cannot be missed"):
        belief_propagation([[1.0]], [0.0])


def test_a_target_that_nothing_is_of_has_none_whatever_others_have() -> None:
    """Also one that cannot be missed, and whether few or many are summed at once."""
    for count in (2, 9):
        weights = np.zeros((count, count))
        weights[: count - 1, : count - 1] = 1.0
        missed = np.append(np.full(count - 1, 0.5), 0.0)
        found = association_probabilities(weights, missed)
        assert found[-1].tolist() == [1.0] + [0.0] * count
        assert np.allclose(found[:-1, -1], 0) and np.allclose(found.sum(axis=1), 1)
        assert np.allclose(found[:-1, 1:-1], found[0, 1])
