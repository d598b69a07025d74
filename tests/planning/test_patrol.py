"""Places visited again and again, and shared areas, beside closed forms and beside every way to cut."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.planning.ground import length
from tests.refused import refused
from wildlab.planning.patrol import Call, border_course, longest_gaps, plan_calls, share_rows


def test_a_border_is_gone_round_once():
    fence = np.array([[0.0, 0.0], [100.0, 0.0], [60.0, 50.0], [100.0, 90.0], [0.0, 90.0]])
    course = border_course(fence, start=[55.0, 45.0])
    assert course[0] == pytest.approx([60.0, 50.0]) and np.array_equal(course[0], course[-1])
    assert length(course) == pytest.approx(length(np.vstack([fence, fence[:1]])))
    with refused():
        border_course([[0, 0], [1, 1], [1, 0], [0, 1]])


def test_two_places_are_visited_in_turn_at_the_speed_there_is():
    calls = plan_calls([[100.0, 0.0], [-100.0, 0.0]], [60.0, 60.0], [0, 0], speed=10, stay=5, horizon=100)
    assert [one.place for one in calls] == [0, 1, 0, 1]
    assert [one.arrives for one in calls] == pytest.approx([10.0, 35.0, 60.0, 85.0])
    assert [one.late for one in calls] == pytest.approx([10 - 60, 35 - 60, 50 - 60, 50 - 60])


def test_what_is_asked_for_twice_as_often_is_visited_more_often():
    rng = np.random.default_rng(1)
    places = rng.uniform(-300, 300, (6, 2))
    every = np.array([60.0, 60.0, 60.0, 240.0, 240.0, 240.0])
    calls = plan_calls(places, every, [0, 0], speed=10.0, stay=0.0, horizon=20_000.0)
    counts = np.bincount([one.place for one in calls], minlength=6)
    assert counts[:3].min() > 1.5 * counts[3:].max() and counts.min() > 10
    times = np.array([one.arrives for one in calls])
    at = places[[one.place for one in calls]]
    assert np.diff(times) == pytest.approx(np.linalg.norm(np.diff(at, axis=0), axis=1) / 10.0)


def test_gaps_count_from_the_start_and_to_the_end():
    calls = [Call(0, 10.0, 0.0), Call(1, 30.0, 0.0), Call(0, 70.0, 0.0)]
    assert longest_gaps(calls, 3, 100.0).tolist() == [60.0, 70.0, 100.0]


def test_one_place_or_none():
    assert plan_calls(np.zeros((0, 2)), [], [0, 0], speed=5, stay=0, horizon=100) == []
    alone = plan_calls([[50.0, 0.0]], [30.0], [0, 0], speed=5, stay=0, horizon=100)
    assert [one.arrives for one in alone] == [10.0]
    stays = plan_calls([[50.0, 0.0]], [30.0], [0, 0], speed=5, stay=20, horizon=60)
    assert [one.arrives for one in stays] == [10.0, 30.0, 50.0]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(1, 4))
def test_no_cut_has_a_shorter_longest_part(seed, count, aircraft):
    rng = np.random.default_rng(seed)
    rows = rng.uniform(0, 100, (count, 2, 2))
    whose = share_rows(rows, aircraft)
    assert (np.diff(whose) >= 0).all() and whose[0] == 0 and whose[-1] < aircraft

    def longest(cuts):
        parts = np.split(np.arange(count), cuts)
        return max(length(rows[part].reshape(-1, 2)) for part in parts if len(part))

    best = min(
        longest(list(cuts)) for k in range(min(aircraft, count)) for cuts in combinations(range(1, count), k)
    )
    assert longest(np.flatnonzero(np.diff(whose)) + 1) == pytest.approx(best, rel=1e-9)


def test_what_cannot_be_is_refused():
    with refused("2 intervals"):
        plan_calls([[0, 0]], [1, 2], [0, 0], speed=1, stay=0, horizon=1)
    with refused("above zero"):
        plan_calls([[0, 0]], [0], [0, 0], speed=1, stay=0, horizon=1)
    with refused("0 aircraft"):
        share_rows(np.zeros((2, 2, 2)), 0)
    assert len(share_rows(np.zeros((0, 2, 2)), 2)) == 0
