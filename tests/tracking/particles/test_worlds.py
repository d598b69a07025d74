"""Counts of animals over many small worlds hold what they promise."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tracking.particles.worlds import (
    RULES,
    SIZE,
    inside,
    world,
)
from wildlab.evaluation import share_interval
from wildlab.tracking.particles import (
    count_interval,
    count_probabilities,
    expect,
    step_counting,
)

WORLDS = 200


def held_exactly(p, number, probability):
    """How much of a number lies in the likeliest numbers that hold a probability to the last digit.

    Whole numbers cannot hold 90 % to the digit; the least likely one that is needed is let in
    for the part of it that is needed.
    """
    before = p[p > p[number]].sum()
    return float(np.clip((probability - before) / p[number], 0, 1))


def counted(images):
    """What the 90 % interval held, and the exact one; how probable it said that is; how far off its mean."""
    held, exact, said, off = [], [], [], []
    for seed in range(WORLDS):
        rng = np.random.default_rng([seed, 2024])
        animals = int(rng.poisson(12))
        looks = world(rng, animals, images=images)
        herd = expect(RULES, 12.0, inside, np.zeros(2), SIZE, rng, particles=3000)
        for look in looks:
            herd, _ = step_counting(herd, look, RULES, rng)
        p = count_probabilities(herd.existence, herd.expected_unseen)
        count = count_interval(p, 0.9)
        exact.append(held_exactly(p, animals, 0.9) if animals < len(p) else 0.0)
        held.append(count.low <= animals <= count.high)
        said.append(count.probability)
        off.append(count.mean - animals)
    return np.array(held), np.array(exact), np.array(said), np.array(off)


@pytest.mark.slow
def test_counts_hold_what_they_promise():
    held, exact, said, off = counted(15)
    # Shares of at most one with a mean of 0.9 have a deviation of 0.3 at most.
    assert abs(exact.mean() - 0.9) < 2.5 * 0.3 / np.sqrt(WORLDS)
    between = share_interval(held.sum(), WORLDS, 0.99)
    assert between.low <= said.mean() <= between.high
    assert abs(off.mean()) < 3 * off.std(ddof=1) / np.sqrt(WORLDS)
