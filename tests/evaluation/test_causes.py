"""Models are compared by their likelihood, and their gains on what they have not seen."""

import numpy as np
import pytest
from scipy.stats import f

from wildlab.evaluation.causes import (
    MARGIN,
    Linear,
    chance_of,
    gain_of,
    held_out,
    leave_out,
    mean_of_others,
    rank_models,
    told_parameters,
)
from wildlab.evaluation.correlated_errors import Places, PosePoints, WanderNoise
from wildlab.evaluation.pose_noise import KINDS

BLOCKS = np.repeat(np.arange(12), 5)
USED = np.ones(60, bool)
#: White errors of a metre.
POINTS = PosePoints(np.zeros((60, 2, 6)), np.tile(np.eye(2), (60, 1, 1)), np.zeros((60, 2, 2)), BLOCKS * 1.0)
WHITE = WanderNoise(dict.fromkeys(KINDS, 1.0), 0.5, (60.0, 20.0, 20.0))
SHIFT = np.tile(np.eye(2), (60, 1, 1))


def linear(J, errors):
    """A model whose errors are ``errors + J x``, about its least-squares estimate."""
    x = np.linalg.lstsq(J.reshape(-1, J.shape[-1]), -errors.ravel(), rcond=None)[0]
    return Linear(J, errors + J @ x, x, lambda values: errors + J @ values)


def test_no_part_of_a_point_s_own_block_is_in_its_parameters():
    """A block that is far off cannot predict itself."""
    errors = np.zeros((60, 2))
    errors[BLOCKS == 3] = [9.0, 0.0]
    held = held_out(linear(SHIFT, errors), leave_out(BLOCKS, USED, POINTS, WHITE), USED)
    np.testing.assert_allclose(held[BLOCKS == 3], np.tile([9.0, 0.0], (5, 1)), atol=1e-9)
    np.testing.assert_allclose(held[BLOCKS == 0], np.tile([-9.0 / 11, 0.0], (5, 1)), atol=1e-9)


def test_without_known_places_a_point_is_held_against_its_thing_in_other_blocks():
    rng = np.random.default_rng(0)
    things, xy = np.arange(60) % 5, rng.normal(size=(60, 2))
    nothing = Linear(np.empty((60, 2, 0)), xy, np.zeros(0), lambda values: xy)
    folds = leave_out(BLOCKS, USED, POINTS, WHITE, Places(things, np.full(60, np.inf), np.zeros(60, bool)))
    held = held_out(nothing, folds, USED, things)
    others = (things == things[7]) & (BLOCKS[7] != BLOCKS)
    np.testing.assert_allclose(held[7], xy[7] - xy[others].mean(axis=0))
    alone = np.where(np.arange(60) == 7, 99, things)
    assert np.isnan(mean_of_others(xy, alone, BLOCKS[7] != BLOCKS)[7]).all()


def test_a_gain_is_of_the_points_that_both_have():
    errors = np.random.default_rng(0).normal([4.0, 0.0], 1.0, (60, 2))
    held = held_out(linear(SHIFT, errors), leave_out(BLOCKS, USED, POINTS, WHITE), USED)
    gain = gain_of(errors, held, BLOCKS)
    assert gain.counts and gain.gain.estimate == pytest.approx(gain.without - gain.with_)
    lost = np.where(np.arange(60)[:, None] < 30, np.nan, held)
    assert gain_of(errors, lost, BLOCKS).without == pytest.approx(np.hypot(*errors[30:].T).mean())
    none = gain_of(errors, np.full_like(held, np.nan), BLOCKS)
    assert np.isnan(none.gain.estimate) and not none.counts


def test_the_simplest_within_the_odds_wins_and_others_like_it_are_rivals():
    contents = [frozenset(), frozenset("a"), frozenset("b"), frozenset("ac"), frozenset("bc")]
    found = rank_models([100.0, 40.0, 40.0 + MARGIN - 0.1, 39.0, 39.0], contents, 40)
    assert found.winner == 1 and found.rivals == (2,)
    apart = rank_models([100.0, 40.0, 40.1 + MARGIN, 39.0, 60.0], contents, 40)
    assert apart.winner == 1 and apart.rivals == ()
    assert rank_models([45.0, 40.0, 40.0, 38.0, 38.0], contents, 40).winner == 0


def test_held_out_errors_take_a_part_away_and_make_rivals_of_what_places_as_well():
    """The likelihood prefers ``ab`` to its part ``b`` by far, and ``b`` to ``c``; unseen images do not."""
    rng = np.random.default_rng(0)
    blocks = np.repeat(np.arange(20), 5)
    scatter = rng.normal(0, 1.0, (100, 2))
    unit = scatter / np.hypot(*scatter.T)[:, None]
    contents = [frozenset(), frozenset("a"), frozenset("b"), frozenset("ab"), frozenset("c")]
    held = [scatter + one * unit for one in (9.0, 9.0, 0.0, 0.5, 4.0)]
    found = rank_models([900.0, 880.0, 300.0, 100.0, 400.0], contents, 40, {}, held, blocks)
    assert contents[found.winner] == {"b"} and found.rivals == ()
    held[4] = scatter + 0.2 * rng.normal(0, 1.0, (100, 2))
    found = rank_models([900.0, 880.0, 300.0, 100.0, 400.0], contents, 40, {}, held, blocks)
    assert contents[found.winner] == {"b"} and [contents[m] for m in found.rivals] == [{"c"}]
    held[3] = scatter - 0.3 * unit
    found = rank_models([900.0, 880.0, 300.0, 100.0, 400.0], contents, 40, {}, held, blocks)
    assert contents[found.winner] == {"a", "b"}


def test_a_chance_is_that_of_the_f_distribution_for_each_that_was_tried():
    assert chance_of(8.0, 2, 5.0, 10) == pytest.approx(10 * f.sf(4.0, 2, 5.0))
    assert chance_of(0.0, 0, 5.0, 10) == chance_of(0.1, 1, 5.0, 10) == 1.0


def test_a_parameter_whose_noise_is_hardly_known_is_not_told_from_zero():
    """Four standard deviations are, of known noise; with three degrees of freedom one in 36 is so far."""
    x, sd = np.array([4.0, 4.0, -40.0]), np.ones(3)
    assert told_parameters(x, sd, np.array([1e6, 3.0, 3.0]), 30).tolist() == [True, False, True]
