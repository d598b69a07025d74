"""Ellipses and sightings: verdicts follow from numbers that are known."""

import numpy as np
import pytest

from wildlab.evaluation.ellipses import judge_ellipses, spread_of_sightings
from wildlab.evaluation.intervals import time_blocks
from wildlab.evaluation.outliers import largest_visible

BLOCKS = np.arange(240) // 12


def normal(seed, sd=2.0, n=240):
    return np.random.default_rng(seed).normal(0, sd, (n, 2))


@pytest.mark.parametrize(
    ("stated", "word"),
    [(2.0, "honest"), (0.7, "too small"), (6.0, "too large"), (2.1, "honest")],
)
def test_ellipses_are_held_against_the_errors(stated, word):
    errors, blocks = normal(1, n=3000), np.arange(3000) // 100
    P = np.tile(stated**2 * np.eye(2), (3000, 1, 1))
    found = judge_ellipses(errors, P, blocks, np.random.default_rng(0))
    assert found.word == word
    assert found.factor.estimate == pytest.approx(2.0 / stated, rel=0.05)
    assert 0.0 <= found.coverage.low <= found.coverage.high <= 1.0
    wider = judge_ellipses(errors, P * found.factor.estimate**2, blocks, np.random.default_rng(0))
    assert wider.coverage.estimate == pytest.approx(0.9, abs=0.01)


def test_the_interval_of_the_factor_holds_what_it_says():
    P = np.tile(4.0 * np.eye(2), (240, 1, 1))
    inside = wrong = 0
    for seed in range(100):
        found = judge_ellipses(normal(seed), P, BLOCKS, np.random.default_rng(seed))
        inside += found.factor.low <= 1.0 <= found.factor.high
        wrong += found.word in ("too small", "too large")
    assert 0.78 < inside / 100 < 0.98
    assert wrong <= 3


@pytest.mark.parametrize(("images", "points"), [(6, 1), (12, 1), (20, 3)])
def test_few_honest_ellipses_are_rarely_called_dishonest(images, points):
    """No draw with replacement holds a larger error than was seen: few points look better than they are."""
    image = np.repeat(np.arange(images), points)
    P = np.tile(np.eye(2), (len(image), 1, 1))
    words, inside = [], 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        errors = np.sqrt(0.5) * (rng.normal(size=(images, 2))[image] + rng.normal(size=(len(image), 2)))
        found = judge_ellipses(errors, P, time_blocks(image, seconds=False), rng)
        words.append(found.word)
        inside += found.factor.low <= 1.0 <= found.factor.high
    assert words.count("too large") <= 10 and words.count("too small") <= 10
    assert inside >= 85


def test_the_spread_of_sightings_is_that_of_one_and_blind_to_what_all_share():
    things, images = np.repeat(np.arange(60), 4), np.tile(np.arange(4), 60)
    places = np.repeat(np.random.default_rng(1).uniform(-90, 90, (60, 2)), 4, axis=0)
    P = np.tile(4.0 * np.eye(2), (240, 1, 1))
    found = spread_of_sightings(places + normal(4) + np.array([50.0, 0.0]), things, images, P)
    assert found.sd == pytest.approx(2.0, rel=0.15)
    assert found.consistent == pytest.approx(1.0, rel=0.15)
    assert (found.things, found.sightings) == (60, 240)
    assert spread_of_sightings(normal(4), np.arange(240), images) is None
    assert np.isnan(spread_of_sightings(normal(4), things, images).consistent)


def test_beyond_half_the_spacing_an_error_cannot_show():
    grid = np.stack(np.meshgrid(np.arange(5) * 8.0, np.arange(5) * 8.0), -1).reshape(-1, 2)
    assert largest_visible(grid) == pytest.approx(4.0)
    assert largest_visible([[1.0, 2.0]]) == np.inf


@pytest.mark.parametrize("factor", [1.0, 1.08, 1.13, 1.3])
def test_honest_is_said_of_no_ellipses_that_visibly_hold_less_than_they_say(factor):
    """One hundred and fifty blocks: 83 % of the 90 % ellipses, and honest, is a contradiction."""
    P = np.tile((2.0 / factor) ** 2 * np.eye(2), (3000, 1, 1))
    found = judge_ellipses(normal(1, n=3000), P, np.arange(3000) // 20, np.random.default_rng(0))
    assert (found.word == "honest") == (0.87 <= found.coverage.estimate <= 0.93)
    assert (found.word == "too small") == (found.coverage.high < 0.87)
