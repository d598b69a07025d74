"""Blocks in time order: what they hold, and that intervals from them hold the truth."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm, t

from wildlab.evaluation.intervals import (
    block_mean,
    independent_blocks,
    time_blocks,
    widening,
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
    assert all(0.86 < held / 200 < 0.98 for held in inside.values())


@pytest.mark.parametrize(("seconds", "lasts"), [(136.0, 20.0), (300.0, 20.0), (900.0, 60.0), (136.0, 0.2)])
def test_intervals_hold_what_they_say_where_errors_outlast_a_block(seconds, lasts):
    """Of 300 flights at 7.5 Hz; by independent blocks it would be 40 to 60 % where errors last for 20 s."""
    times = np.arange(0.0, seconds, 0.133)
    blocks, keep = time_blocks(times, seconds=True), np.exp(-0.133 / lasts)
    rng, n, before = np.random.default_rng(1), len(times), int(8 * lasts / 0.133)
    white = rng.normal(size=(300, n + before)) * np.sqrt(1 - keep**2)
    white[:, 0] /= np.sqrt(1 - keep**2)
    errors = lfilter([1.0], [1.0, -keep], white)[:, before:]
    found = [block_mean(one, blocks) for one in errors]
    assert 0.84 < np.mean([one.low <= 0 <= one.high for one in found]) < 0.96
    ratio = np.median([independent_blocks(one, blocks) for one in errors]) / (blocks.max() + 1)
    assert ratio > 0.7 if lasts < 1 else ratio < 0.4


def test_an_interval_of_many_blocks_is_widened_to_those_that_count():
    wave = np.sin(np.arange(20) / 4)
    assert widening(wave, np.arange(20)) == pytest.approx(np.sqrt(20 / 3) * t.ppf(0.95, 2) / norm.ppf(0.95))
    quick = np.where(np.arange(400) % 2, 1.0, -1.0)
    assert widening(quick, np.arange(400)) == pytest.approx(1.0, abs=0.01)


def test_blocks_of_equal_size_give_the_interval_of_their_means():
    """Student's, written out: with all blocks where neighbours are not alike, else with those that count."""
    alternating = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    rng, blocks = np.random.default_rng(3), np.repeat(np.arange(5), 4)
    many = rng.normal(size=20) + blocks
    for values, group, worth in (
        (alternating, np.arange(6), 6.0),
        (many, blocks, independent_blocks(many, blocks)),
    ):
        means = [values[group == one].mean() for one in np.unique(group)]
        half = t.ppf(0.95, worth - 1) * np.std(means, ddof=1) / np.sqrt(worth)
        assert block_mean(values, group).high == pytest.approx(values.mean() + half)
