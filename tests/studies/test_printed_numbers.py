"""The arithmetic of published numbers."""

import numpy as np
import pytest

from wildlab.studies.printed_numbers import (
    MARGIN,
    Pair,
    all_pairs,
    load_words,
    published_number,
)


def test_every_ratio_is_that_of_the_published_numbers():
    """Typed and computed a second time, from the thesis."""
    focal = (1159.2 + 1167.8) / 2
    expected = {
        "noise-by-altitude": 17.5 / 15.0,
        "mean-within-two-metres": np.sqrt(1.98**2 + 0.76**2) / 2,
        "images-in-view": 400 / (42 * 7.5),
        "frame-rate": 141 / 14 / 7.5,
        "images-of-the-first-case": 8000 / (25 * 60 * 7.5),
        "altitude": 1.25,
        "reference": np.sqrt(10.25**2 - (6.40 * 200 / 350) ** 2) / 5.08,
        "pixels-and-metres": 7.0 / (20 * 350 / focal),
        "nis-of-two-noises": 1.04 / (0.60 * (10 / (30 * 300 / focal)) ** 2),
        "nis-of-two-poses-fast": 0.42 / (0.50 * (20 / 30) ** 2),
        "nis-of-two-poses-slow": 1.84 / 1.04,
        "the-same-filter-twice": 1.0,
    }
    assert {pair.key: pair.ratio for pair in all_pairs()} == pytest.approx(expected)
    assert set(load_words()["pair"]) == set(expected)


@pytest.mark.parametrize(
    ("ratio", "apart"),
    [(1.0, False), (MARGIN, False), (1 / MARGIN, False), (1.01 * MARGIN, True), (0.99 / MARGIN, True),
     (np.nan, True)],
)  # fmt: skip
def test_what_is_apart_is_beyond_the_margin_either_way(ratio, apart):
    assert Pair("key", ratio, 1.0).apart is apart


def test_verdicts_turn_with_the_numbers():
    """All of the tables' numbers moved so that what did not agree agrees, and the other way round."""
    opposed = {
        "slow-vessel/observer/mean_north": 1.85,
        "slow-vessel/observer/mae": 6.25,
        "linear-vs-nonlinear-slow/ekf/nis": 1.84,
        "schmidt-fast-vessel/ekf/nis": 0.22,
        "coloured-noise-fast/cv/mae": 20.0,
    }
    before = {pair.key: pair for pair in all_pairs()}
    after = {pair.key: pair for pair in all_pairs(lambda key: opposed.get(key, published_number(key)))}
    assert {key for key in before if before[key].apart != after[key].apart} == {
        "mean-within-two-metres",
        "reference",
        "nis-of-two-noises",
        "nis-of-two-poses-fast",
        "nis-of-two-poses-slow",
        "the-same-filter-twice",
    }
