"""Drawn anew: as many copies in the mean as the weights say, and only where the particles have run thin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.poses import GENERATORS
from wildlab.errors import WildlabError
from wildlab.tracking.particles import SCHEMES, Cloud, draw, effective_size, resample
from wildlab.tracking.particles.kernels import pick, take


def uneven(rng, animals, particles):
    w = rng.exponential(size=(animals, particles)) ** 3
    w[:, ::4] = 0
    return w / w.sum(axis=1, keepdims=True)


@given(rng=GENERATORS, animals=st.integers(1, 4), particles=st.integers(2, 60))
def test_the_compiled_walk_finds_what_a_search_finds(rng, animals, particles):
    cumulative = np.cumsum(uneven(rng, animals, particles), axis=1)
    cumulative /= cumulative[:, -1:]
    points = np.sort(rng.random((animals, particles)), axis=1)
    points[:, 0] = 0.0
    wanted = [np.searchsorted(c, p, side="right") for c, p in zip(cumulative, points, strict=True)]
    np.testing.assert_array_equal(pick(cumulative, points), wanted)


@given(rng=GENERATORS, n=st.integers(1, 5))
def test_the_compiled_choice_takes_what_numpy_takes(rng, n):
    x, chosen = rng.normal(size=(3, 20, n)), rng.integers(0, 20, (3, 9))
    np.testing.assert_array_equal(take(x, chosen), np.take_along_axis(x, chosen[..., None], axis=1))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_copies_are_unbiased(scheme):
    """The mean number of copies is N w, within the error of the draws themselves."""
    rng = np.random.default_rng(7)
    N, runs = 24, 20_000
    w = uneven(rng, 1, N)[0]
    chosen = draw(np.tile(w, (runs, 1)), rng, scheme)
    copies = np.apply_along_axis(np.bincount, 1, chosen, minlength=N)
    assert (copies[:, w == 0] == 0).all() and (copies.sum(axis=1) == N).all()
    part = (N * w) % 1
    variance = part * (1 - part) if scheme == "systematic" else N * w * (1 - w)
    off = np.abs(copies.mean(axis=0) - N * w)
    assert (off <= 4.5 * np.sqrt(variance / runs) + 1e-12).all()
    np.testing.assert_allclose(copies.var(axis=0)[variance > 0.05], variance[variance > 0.05], rtol=0.08)
    if scheme == "systematic":
        assert (np.abs(copies - N * w) < 1).all()


@given(rng=GENERATORS, threshold=st.floats(0, 1))
def test_only_those_at_or_below_the_threshold_are_drawn_anew(rng, threshold):
    power = rng.uniform(0, 3, (6, 1))
    w = rng.exponential(size=(6, 30)) ** power
    w /= w.sum(axis=1, keepdims=True)
    cloud = Cloud(rng.normal(size=(6, 30, 2)), w)
    size = effective_size(w) / 30
    after, due = resample(cloud, rng, "systematic", threshold)
    clear = np.abs(size - threshold) > 1e-6
    np.testing.assert_array_equal(due[clear], (size < threshold)[clear])
    np.testing.assert_array_equal(after.x[~due], cloud.x[~due])
    np.testing.assert_array_equal(after.w[~due], cloud.w[~due])
    assert (after.w[due] == 1 / 30).all()
    for a in np.flatnonzero(due):
        assert {tuple(one) for one in after.x[a]} <= {tuple(one) for one in cloud.x[a]}


def test_two_thirds_is_the_default_and_one_is_always():
    w = np.full((1, 9), 1 / 9)
    w2 = np.array([[1 / 5] * 5 + [0.0] * 4, [1 / 7] * 7 + [0.0] * 2])
    rng = np.random.default_rng(0)
    assert resample(Cloud(np.zeros((2, 9, 2)), w2), rng)[1].tolist() == [True, False]
    assert not resample(Cloud(np.zeros((1, 9, 2)), w), rng)[1].any()
    assert resample(Cloud(np.zeros((1, 9, 2)), w), rng, threshold=1)[1].all()


@pytest.mark.parametrize("arguments", [{"scheme": "residual", "threshold": 1}, {"threshold": 1.2}])
def test_what_there_is_not_is_refused(arguments):
    cloud = Cloud(np.zeros((1, 2, 2)), np.full((1, 2), 0.5))
    with pytest.raises(WildlabError, match="multinomial, systematic" if "scheme" in arguments else "0 to 1"):
        resample(cloud, np.random.default_rng(0), **arguments)
