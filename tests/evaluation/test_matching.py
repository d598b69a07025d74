"""Detections beside labels: who belongs to whom, and what the shares are worth."""

from itertools import permutations

import numpy as np
import pytest

from wildlab.evaluation.matching import match, rates


def test_as_many_as_possible_belong_together_and_then_the_nearest():
    """Against all assignments of small sets, tried one by one."""
    rng = np.random.default_rng(2)
    for _ in range(60):
        found, labels = rng.uniform(0, 30, (4, 2)), rng.uniform(0, 30, (4, 2))
        apart = np.linalg.norm(found[:, None] - labels[None], axis=2)
        tried = []
        for order in permutations(range(4)):
            near = [apart[row, column] for row, column in enumerate(order) if apart[row, column] <= 10]
            tried.append((-len(near), sum(near)))
        best = min(tried)
        pairs = match(found, labels).pairs
        assert len(pairs) == -best[0]
        assert sum(apart[a, b] for a, b in pairs) == pytest.approx(best[1])


def test_a_large_label_reaches_further_and_a_region_is_not_judged():
    large = [[100, 100, 60, 80]]
    assert len(match([[110, 120]], large).pairs) == 1
    assert len(match([[110, 120]], [[130, 140]]).pairs) == 0
    found = match([[5, 5], [50, 50]], [[5, 5]], ignore=[[40, 40, 20, 20]])
    assert found.counts.tolist() == [1, 0, 0] and found.ignored.tolist() == [1]
    # A label inside a region is judged all the same.
    assert len(match([[50, 50]], [[50, 50]], ignore=[[40, 40, 20, 20]]).pairs) == 1


def test_shares_are_those_of_the_sums_and_clips_widen_the_intervals():
    rng = np.random.default_rng(1)
    clip = np.repeat(np.arange(8), 25)
    good = np.repeat(rng.integers(2, 10, 8), 25)
    counts = np.stack([good, 10 - good, 10 - good], axis=1)
    alone, together = rates(counts), rates(counts, clip.tolist())
    assert alone.f1.estimate == together.f1.estimate == pytest.approx(good.sum() / (10 * len(good)))
    assert together.f1.high - together.f1.low > 3 * (alone.f1.high - alone.f1.low)
    assert (together.groups, alone.groups) == (8, 200)
    assert alone.precision.low < alone.precision.estimate < alone.precision.high


def test_intervals_hold_what_they_should():
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(100):
        found = rng.binomial(10, 0.7, 40)
        one = rates(np.stack([found, 0 * found, 10 - found], axis=1)).recall
        held += one.low <= 0.7 <= one.high
    assert 0.90 <= held / 100 <= 0.99


def test_what_has_not_gone_wrong_yet_may_still():
    """Draws of frames that are all alike have no spread: Wilson's interval of as many things stays."""
    z2 = 1.959963984540054**2
    all_found = rates([[2, 0, 0]] * 8)
    for one in (all_found.precision, all_found.recall, all_found.f1):
        assert one.estimate == 1 and one.high == pytest.approx(1)
        assert one.low == pytest.approx(16 / (16 + z2))
    none_found = rates([[0, 1, 1]] * 8)
    assert none_found.recall.low == pytest.approx(0)
    assert none_found.recall.high == pytest.approx(z2 / (8 + z2))
    # Frames that differ much keep the width of the draws.
    uneven = rates([[10, 0, 0], [0, 0, 10]] * 4).recall
    assert uneven.low < 0.25 and uneven.high > 0.75
