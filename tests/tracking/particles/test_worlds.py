"""What trackers are worth over many small worlds: counts that hold, and what empty images tell."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tracking.particles.worlds import (
    NOISE,
    RULES,
    SIZE,
    WALK,
    followed,
    footprint,
    inside,
    sight_from,
    world,
)
from wildlab.evaluation import mean_interval, share_interval
from wildlab.tracking.particles import (
    Look,
    count_interval,
    count_probabilities,
    expect,
    moments,
    no_herd,
    step_counting,
    step_nearest,
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
        w = world(rng, animals, images=images)
        herd = expect(RULES, 12.0, inside, np.zeros(2), SIZE, rng, particles=3000)
        *_, (herd, _) = followed(w.looks, herd, step_counting, RULES, rng)
        p = count_probabilities(herd.existence, herd.expected_unseen)
        count = count_interval(p, 0.9)
        exact.append(held_exactly(p, animals, 0.9) if animals < len(p) else 0.0)
        held.append(count.low <= animals <= count.high)
        said.append(count.probability)
        off.append(count.mean - animals)
    return np.array(held), np.array(exact), np.array(said), np.array(off)


@pytest.mark.slow
@pytest.mark.parametrize("images", [8, 15, 30])
def test_counts_hold_what_they_promise(images):
    """Half of the enclosure seen, all of it once, and twice."""
    held, exact, said, off = counted(images)
    assert 0.85 <= exact.mean() <= 0.95
    between = share_interval(held.sum(), WORLDS, 0.99)
    assert between.low <= said.mean() <= between.high
    assert abs(off.mean()) < 3 * off.std(ddof=1) / np.sqrt(WORLDS)


def one_animal(seed, negative, dt=60.0):
    """Seen once, then looked for all over: errors squared in images that do not show it, traces, if lost.

    Nothing else is detected and all detections are its own, so there is no gate: only what empty images say
    differs. The tracker is F's.
    """
    rng, draws = np.random.default_rng([seed, 7]), np.random.default_rng([seed, 8])
    rules = RULES._replace(negative=negative, lost_doubt=1e-2, gate_probability=1.0)
    at, herd, errors, traces, lost = rng.uniform(0, SIZE), no_herd(rules), [], [], False
    for k in range(30):
        if k:
            step = at + rng.standard_normal(2) * np.sqrt(WALK(dt)[1][0, 0])
            at = step if inside(step) else at
        sight = sight_from(footprint(k), 0.8)
        seen = not k or rng.random() < sight(at)
        z = (at + NOISE * rng.standard_normal(2))[None][: int(seen)]
        R = NOISE**2 * np.eye(2)[None][: int(seen)]
        herd, _ = step_nearest(herd, Look(dt * k, z, R, sight), rules, draws)
        lost = lost or bool(herd.lost[0])
        if not seen:
            mean, covariance = moments(herd.cloud)
            errors.append(((mean[0] - at) ** 2).sum())
            traces.append(np.trace(covariance[0]))
    return float(np.mean(errors)), float(np.mean(traces)), lost


@pytest.mark.slow
def test_empty_images_bring_the_estimate_nearer_and_seldom_lose_who_is_there():
    told, untold = (np.array([one_animal(seed, way) for seed in range(WORLDS)]).T for way in (True, False))
    nearer, surer = mean_interval(untold[0] - told[0], 0.99), mean_interval(untold[1] - told[1], 0.99)
    assert nearer.low > 0 and surer.low > 0
    # It knows how well it knows: the squared error is what the trace says, as often with as without.
    assert 0.8 < told[0].mean() / told[1].mean() < 1.25
    assert told[2].sum() <= WORLDS / 50
