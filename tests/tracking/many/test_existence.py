"""Existence and visibility: every state of the world counted one by one, and the textbook's closed form."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.poses import GENERATORS
from wildlab.tracking.many.existence import after_scan, still_there, visible_later, weights
from wildlab.tracking.many.probabilities import association_probabilities

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
def test_every_state_of_the_world_counted(rng: np.random.Generator, n: int, m: int, d: float) -> None:
    r, v = rng.uniform(0.02, 0.98, n), rng.uniform(0.02, 0.98, n)
    L, c = np.exp(rng.normal(-3, 3, (n, m))) * (rng.random((n, m)) > 0.3), 1e-2
    p = association_probabilities(*weights(r, v, d, L, c))
    for found, expected in zip(after_scan(r, v, d, p), by_counting(r, v, d, L, c), strict=True):
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-12)


@given(shares, shares, st.lists(st.floats(0, 5), min_size=0, max_size=4))
def test_one_target_that_can_be_seen_has_the_closed_form(r: float, d: float, L: list[float]) -> None:
    """Musicki, Evans and Stankovic 1994, (14): the textbook's data association with existence."""
    c = 0.3
    p = association_probabilities(*weights([r], [1.0], d, [L], c))
    existence, visible, _ = after_scan([r], [1.0], d, p)
    delta = d * (1 - sum(L) / c)
    assert existence[0] == pytest.approx((1 - delta) * r / (1 - delta * r), rel=1e-9)
    assert visible[0] == pytest.approx(1.0)


def test_what_is_hidden_is_not_missed() -> None:
    """A scan without a measurement ends the belief that it can be seen before that in its existence."""
    r, v = np.array([0.9]), np.array([0.5])
    for _ in range(10):
        p = association_probabilities(*weights(r, v, 0.9, np.zeros((1, 0)), 1e-3))
        r, v, own = after_scan(r, v, 0.9, p)
        assert own[0].tolist() == [1.0]
    assert v[0] < 1e-6 and 0.8 < r[0] < 0.9
    certain = association_probabilities(*weights([1.0], [0.0], 0.9, np.zeros((1, 0)), 1e-3))
    assert after_scan([1.0], [0.0], 0.9, certain)[0][0] == 1.0


def test_what_cannot_be_there_stays_away() -> None:
    p = association_probabilities(*weights([0.0], [1.0], 1.0, [[3.0]], 1.0))
    existence, _, own = after_scan([0.0], [1.0], 1.0, p)
    assert existence[0] == 0 and own[0].tolist() == [1.0, 0.0]


@given(shares, st.floats(0.1, 100), st.floats(0.1, 100), st.floats(0, 50), st.floats(0, 50))
def test_two_waits_are_one(v: float, visible_s: float, hidden_s: float, one: float, two: float) -> None:
    at_once = visible_later(v, one + two, visible_s, hidden_s)
    in_two = visible_later(visible_later(v, one, visible_s, hidden_s), two, visible_s, hidden_s)
    assert np.allclose(at_once, in_two, atol=1e-12)
    lasting = visible_s / (visible_s + hidden_s)
    assert min(v, lasting) - 1e-12 <= at_once <= max(v, lasting) + 1e-12
    # The rate at which it hides is one in its mean stay.
    soon = 1e-6 / (1 / visible_s + 1 / hidden_s)
    assert visible_later(1.0, soon, visible_s, hidden_s) == pytest.approx(1 - soon / visible_s, abs=1e-11)


def test_existence_decays_with_its_lifetime() -> None:
    assert still_there(0.8, 50.0, 50.0) == pytest.approx(0.8 / np.e)
