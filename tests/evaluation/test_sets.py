"""GOSPA: closed forms, the axioms of a metric, and against its definition by brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wildlab.evaluation.identities import gospa

coordinates = st.floats(-40, 40, allow_nan=False, width=32)
points = st.integers(0, 4).flatmap(lambda n: arrays(np.float64, (n, 2), elements=coordinates))
cutoffs = st.floats(0.5, 30)
NONE = np.empty((0, 2))


def test_empty_sets():
    assert gospa(NONE, NONE, 10).distance == 0
    three = np.arange(6.0).reshape(3, 2)
    assert gospa(three, NONE, 10) == pytest.approx((np.sqrt(150), 0, np.sqrt(150), 0, 3, 0))
    assert gospa([], three, 10) == pytest.approx((np.sqrt(150), 0, 0, np.sqrt(150), 0, 3))


def by_definition(x, y, cutoff):
    """The distance over every way to pair the points."""
    x, y = sorted((x, y), key=len)
    d = [[min(np.linalg.norm(a - b), cutoff) ** 2 for b in y] for a in x]
    best = min(
        (sum(d[i][j] for i, j in enumerate(way)) for way in itertools.permutations(range(len(y)), len(x))),
        default=0.0,
    )
    surplus = cutoff**2 * (len(y) - len(x))
    return (best + surplus / 2) ** 0.5


@given(points, points, cutoffs)
def test_against_every_pairing(x, y, cutoff):
    assert gospa(x, y, cutoff).distance == pytest.approx(by_definition(x, y, cutoff), abs=1e-9)


@given(points, points, cutoffs)
def test_parts_add_up(x, y, cutoff):
    g = gospa(x, y, cutoff)
    assert g.distance**2 == pytest.approx(g.localisation**2 + g.missed**2 + g.false**2, abs=1e-6)
    assert len(x) - g.n_missed == len(y) - g.n_false
