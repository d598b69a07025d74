"""Models are compared on what they have not seen: noise gains nothing, a constant error does."""

import numpy as np
import pytest

from wildlab.evaluation.causes import Gain, Linear, distances, draw_folds, gain_of, held_out, rank_models
from wildlab.evaluation.runs import Interval

BLOCKS = np.repeat(np.arange(12), 5)


def linear(J, errors):
    """A model whose errors are ``errors + J x``, about its least-squares estimate."""
    x = np.linalg.lstsq(J.reshape(-1, J.shape[-1]), -errors.ravel(), rcond=None)[0]
    return Linear(J, errors + J @ x, x, lambda values: errors + J @ values)


def drawn(seed, shift=0.0):
    rng = np.random.default_rng(seed)
    errors = np.repeat(rng.normal(0, 1, (12, 2)), 5, axis=0) + rng.normal(0, 0.5, (60, 2)) + [shift, 0.0]
    constant = np.tile(np.eye(2), (60, 1, 1))
    of_chance = rng.normal(size=(60, 2, 4))
    rounds = [draw_folds(BLOCKS, rng) for _ in range(4)]
    nothing = Linear(np.empty((60, 2, 0)), errors, np.zeros(0), lambda values: errors)
    models = [nothing, linear(constant, errors), linear(np.concatenate([constant, of_chance], 2), errors)]
    return errors, [held_out(model, rounds) for model in models]


CONTENTS = [frozenset(), frozenset("ab"), frozenset("abcdef")]


def ranked(held):
    return rank_models([distances(one) for one in held], CONTENTS, BLOCKS)


def test_folds_keep_blocks_whole():
    folds = draw_folds(BLOCKS, np.random.default_rng(0))
    assert len(np.unique(folds)) == 5
    assert all(len(set(folds[b == BLOCKS])) == 1 for b in range(12))


def test_no_part_of_a_point_s_own_block_is_in_its_parameters():
    """A block that is far off cannot predict itself."""
    errors = np.zeros((60, 2))
    errors[BLOCKS == 3] = [9.0, 0.0]
    model = linear(np.tile(np.eye(2), (60, 1, 1)), errors)
    (held,) = held_out(model, [BLOCKS])
    assert np.allclose(held[BLOCKS == 3], [9.0, 0.0], atol=0.02)


def test_a_constant_error_wins_with_its_gain():
    errors, held = drawn(0, shift=4.0)
    found = ranked(held)
    assert found.winner == 1
    gain = gain_of(errors, held[1], BLOCKS)
    assert gain.counts
    assert gain.gain.estimate == pytest.approx(gain.without - gain.with_)
    assert gain.gain.low < gain.gain.estimate < gain.gain.high


def test_where_nothing_is_wrong_nothing_is_named():
    """A gain is certain by chance on few flights: it must win and its interval must leave zero out."""
    named = 0
    for seed in range(40):
        errors, held = drawn(seed)
        winner = ranked(held).winner
        named += winner != 0 and gain_of(errors, held[winner], BLOCKS).counts
    assert named <= 4


def test_a_model_that_loses_points_gains_nothing_by_it():
    errors, held = drawn(0, shift=4.0)
    lost = held[1].copy()
    lost[:, np.argsort(-distances(lost))[:30]] = np.nan
    whole, part = ranked(held), ranked([held[0], lost, held[2]])
    assert whole.winner == 1 and part.winner != 1
    assert part.means[1] > whole.means[1]
    # A gain is of the points that both have.
    gain = gain_of(errors, lost, BLOCKS)
    both = np.isfinite(distances(lost))
    assert gain.without == pytest.approx(np.hypot(*errors[both].T).mean())


def test_rivals_are_named_and_larger_sums_are_not():
    rng = np.random.default_rng(0)
    same = np.linspace(1.0, 2.0, 60)
    like = same + 0.1 * rng.normal(size=60)
    contents = [frozenset(), frozenset("a"), frozenset("b"), frozenset("ac")]
    found = rank_models([same + 3.0, same, like - like.mean() + same.mean() + 1e-3, same], contents, BLOCKS)
    assert found.winner == 1 and found.rivals == (2,)


def test_a_widened_gain_has_both_ends_farther_from_its_estimate():
    gain = Gain(5.0, 3.0, Interval(2.0, 1.5, 2.25))
    assert gain.widened(2.0) == Gain(5.0, 3.0, Interval(2.0, 1.0, 2.5))
    assert gain.counts and not gain.widened(5.0).counts
