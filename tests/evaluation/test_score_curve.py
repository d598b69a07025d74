"""Curves along a score: worked by hand, and held against what rates and single thresholds say."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.evaluation.matching import (
    ScoredFrame,
    curve_along_score,
    difference_of_f1,
    match,
    rates,
)

NONE = np.zeros((0, 4))


def places(rng: np.random.Generator, below: int) -> np.ndarray:
    corners = rng.uniform(0, 500, (int(rng.integers(0, below)), 2))
    return np.hstack([corners, 0 * corners + 8])


def drawn(seed: int, frames: int = 30) -> list[ScoredFrame]:
    """Frames with labels of which some are found, and with things that are none."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(frames):
        labels = places(rng, 5)
        found = labels[rng.random(len(labels)) < 0.7]
        wrong = places(rng, 4)
        boxes = np.concatenate([found, wrong])
        scores = np.concatenate([rng.normal(1, 1, len(found)), rng.normal(0, 1, len(wrong))])
        made.append(ScoredFrame(boxes, scores, labels, NONE))
    return made


def test_by_hand():
    """Three labels; right, wrong, right, wrong by falling score, one never found; COCO's mean of 101 recalls.

    Recall 1/3 with precision 1 up to recall 0.33 (34 points), 2/3 with precision 2/3 up to 0.66 (33 points).
    """
    places = np.array([[0, 0, 4, 4], [300, 0, 4, 4], [100, 0, 4, 4], [300, 90, 4, 4]], float)
    labels = np.array([[0, 0, 4, 4], [100, 0, 4, 4], [200, 0, 4, 4]], float)
    one = ScoredFrame(places, np.array([0.9, 0.8, 0.7, 0.1]), labels, NONE)
    curve = curve_along_score([one])
    assert curve.levels.tolist() == [0.9, 0.8, 0.7, 0.1]
    assert curve.counts.tolist() == [[1, 0, 2], [1, 1, 2], [2, 1, 1], [2, 2, 1]]
    assert curve.average_precision.estimate == pytest.approx((34 + 33 * 2 / 3) / 101)
    assert np.isnan(curve.average_precision.low)  # of one frame there is no interval


def test_each_level_is_what_matching_says_of_what_is_above_it():
    frames = drawn(1)
    curve = curve_along_score(frames)
    for row in (0, 7, len(curve.levels) - 1):
        level = curve.levels[row]
        counts = [match(f.boxes[f.scores >= level], f.labels).counts for f in frames]
        assert curve.counts[row].tolist() == np.sum(counts, axis=0).tolist()
    whole = rates(counts)
    assert curve.f1[-1] == pytest.approx(whole.f1.estimate)
    assert (np.diff(curve.recall) >= 0).all()
    low, high = curve.average_precision[1:]
    assert low < curve.average_precision.estimate < high


def test_scores_that_are_stretched_change_nothing_and_reversed_ones_do():
    frames = drawn(2)
    same = [one._replace(scores=np.exp(one.scores)) for one in frames]
    turned = [one._replace(scores=-one.scores) for one in frames]
    areas = [curve_along_score(one).average_precision for one in (frames, same, turned)]
    assert areas[0] == areas[1] and areas[2].estimate < areas[0].low


def test_a_difference_is_of_the_same_draws():
    """Two detectors that differ by nothing but one frame each: hard frames are hard for both."""
    rng = np.random.default_rng(1)
    counts = np.column_stack([rng.integers(0, 9, 40), rng.integers(0, 9, 40), rng.integers(0, 9, 40)])
    assert difference_of_f1(counts, counts) == (0, 0, 0)
    better = counts + [1, 0, -1] * (counts[:, 2:] > 0)
    found = difference_of_f1(better, counts)
    alone = rates(counts).f1
    assert 0 < found.low < found.estimate < found.high < found.low + (alone.high - alone.low) / 2
    assert np.isnan(difference_of_f1(counts[:3], counts[:3]).low)
    with pytest.raises(WildlabError, match="clip"):
        difference_of_f1(counts, counts, [1, 2, 3])
