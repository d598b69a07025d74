"""Blocks in time order: what they hold, and that intervals from them hold the truth where images do not."""

import numpy as np
import pytest

from wildlab.evaluation.intervals import (
    block_mean,
    compare_halves,
    standard_error,
    time_blocks,
)


def test_blocks_are_stretches_of_time():
    order = np.random.default_rng(0).permutation(60)
    blocks = time_blocks(order, seconds=False)
    assert (np.diff(blocks[np.argsort(order)]) >= 0).all()
    assert len(np.unique(blocks)) == 20
    assert len(np.unique(time_blocks(np.arange(8), seconds=False))) == 6
    assert time_blocks([3, 1, 2], seconds=False).tolist() == [2, 0, 1]


def test_by_the_clock_a_block_is_a_minute_or_more():
    times = np.arange(0.0, 600.0, 2.0)
    blocks = time_blocks(times, seconds=True)
    spans = [np.ptp(times[blocks == b]) for b in np.unique(blocks)]
    assert max(spans) < 60.0 and len(spans) == 10
    # A pause leaves no empty block, and points of one image stay together.
    assert np.unique(time_blocks([0, 0, 100, 900, 900], seconds=True)).tolist() == [0, 1, 2]


def test_intervals_by_blocks_hold_what_they_say_where_errors_wander():
    inside = {"blocks": 0, "images": 0}
    for seed in range(200):
        rng = np.random.default_rng(seed)
        values = np.repeat(rng.normal(0, 1, 12), 10) + rng.normal(0, 0.3, 120)
        for name, labels in (("blocks", np.repeat(np.arange(12), 10)), ("images", np.arange(120))):
            _, low, high = block_mean(values, labels)
            inside[name] += low <= 0 <= high
    assert 0.84 < inside["blocks"] / 200 < 0.96
    assert inside["images"] / 200 < 0.6


def test_what_cannot_be_said_is_nan():
    assert np.isnan(block_mean([1.0, 2.0], [0, 0]).low)
    assert np.isnan(block_mean([np.nan], [0]).estimate)
    assert not compare_halves([1.0, 2.0], [0, 0]).disagree
    assert not compare_halves([np.nan], [0]).disagree


@pytest.mark.parametrize(("step", "disagree"), [(0.0, False), (2.0, True)])
def test_halves_that_disagree_are_found(step, disagree):
    rng = np.random.default_rng(3)
    blocks = np.repeat(np.arange(12), 5)
    values = rng.normal(3.0, 0.5, 60) + step * (blocks >= 6)
    halves = compare_halves(values, blocks)
    assert halves.disagree is disagree
    assert halves.difference.estimate == pytest.approx(halves.second - halves.first)


def test_blocks_of_equal_size_give_the_standard_error_of_their_means():
    rng = np.random.default_rng(3)
    values = rng.normal(size=6)
    assert standard_error(values, np.arange(6)) == pytest.approx(values.std(ddof=1) / np.sqrt(6))
    blocks = np.repeat(np.arange(5), 4)
    many = rng.normal(size=20) + blocks
    means = many.reshape(5, 4).mean(axis=1)
    assert standard_error(many, blocks) == pytest.approx(means.std(ddof=1) / np.sqrt(5))
