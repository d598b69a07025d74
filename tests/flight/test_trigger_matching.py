"""Images and triggers: made-up flights, whose pairs are known."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import _pair, match_triggers


def flown(rng: np.random.Generator, lines: int = 6, each: int = 30, interval: float = 2.0) -> np.ndarray:
    """Triggers over rows of a survey, with a turn after each."""
    times, at = [], 100.0
    for _ in range(lines):
        for _ in range(each + int(rng.integers(-3, 4))):
            times.append(at)
            at += interval + rng.normal(0, 0.02)
        at += rng.uniform(6, 15)
    return np.array(times)


@pytest.mark.parametrize("resolution", [0.0, 1.0])
@pytest.mark.parametrize("interval", [0.7, 2.0, 5.0])
def test_missing_and_extra_ones_and_hours_between(resolution, interval):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        true = flown(rng, interval=interval)
        offset = rng.uniform(-12, 12) * 3600 + 1.7e9
        has_image, has_record = rng.random(len(true)) > 0.05, rng.random(len(true)) > 0.05
        images = ((true - offset) / (1 + 2e-5) + rng.normal(0, 0.01, len(true)))[has_image]
        if resolution:
            images = np.floor(images / resolution) * resolution
        match = match_triggers(images, true[has_record])
        number = np.full(len(true), -1)
        number[has_record] = np.arange(has_record.sum())
        wanted = number[has_image]
        right = match.trigger == wanted
        if resolution <= interval:
            assert match.certain
            assert right.mean() > (0.97 if resolution else 0.995)
        assert match.images_left == (match.trigger < 0).sum()
        assert match.triggers_left == has_record.sum() - (match.trigger >= 0).sum()


def test_as_many_as_there_are_records():
    times = np.arange(0, 100, 2.0)
    match = match_triggers(times - 7200.0, times)
    assert match.trigger.tolist() == list(range(50))
    assert match.certain
    assert (match.images_left, match.triggers_left) == (0, 0)


def test_evenly_timed_with_one_missing_is_not_certain():
    times = np.arange(0, 100, 2.0)
    match = match_triggers(times[:-1] - 3600.0, times)
    assert not match.certain
    assert (match.images_left, match.triggers_left) == (0, 1)


def test_order_and_missing_stamps():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(1.0, 4.0, 40))
    shuffled = rng.permutation(40)
    stamps = times[shuffled] + 5.0
    stamps[4] = np.nan
    match = match_triggers(stamps, times)
    wanted = shuffled.copy()
    wanted[4] = -1
    assert (match.trigger == wanted).all()


def test_nothing_to_match():
    with pytest.raises(WildlabError, match="no image has a time"):
        match_triggers([np.nan], [1.0])
    with pytest.raises(WildlabError, match="no trigger has a time"):
        match_triggers([1.0], [])
    alone = match_triggers([1.0], [5.0])
    assert alone.trigger.tolist() == [0]
    assert not alone.certain or alone.images_left == 0


def test_the_best_pairs_are_those_of_an_assignment():
    """Nearest pairs do not cross on a line, so a free assignment finds the same sum."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        a, b = (np.sort(rng.uniform(0, 10, rng.integers(1, 12))) for _ in range(2))
        near = rng.uniform(0.2, 2.0)
        worth = np.clip(2.0 - ((b - a[:, None]) / near) ** 2, 0, None) * (np.abs(b - a[:, None]) <= near)
        rows, columns = linear_sum_assignment(-worth)
        found = _pair(a, b, near)
        assert (np.diff(found, axis=0) > 0).all()
        assert worth[found[:, 0], found[:, 1]].sum() == pytest.approx(worth[rows, columns].sum())


def test_many_of_both_in_a_moment():
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.5, 3.0, 1500))
    images = np.delete(times, rng.choice(1500, 50, replace=False)) - 1e5
    match = match_triggers(images, times)
    assert match.images_left == 0 and match.triggers_left == 50 and match.certain
