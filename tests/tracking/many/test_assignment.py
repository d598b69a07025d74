"""Which is which over a matrix: every permutation tried, and features."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.tracking.association import global_nearest

entries = st.one_of(st.integers(-5, 30), st.sampled_from([np.nan, np.inf]))
matrices = st.tuples(st.integers(0, 4), st.integers(0, 4)).flatmap(
    lambda shape: st.lists(entries, min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]).map(
        lambda values: np.array(values, float).reshape(shape)
    )
)
gates = st.integers(-5, 30)


def every_assignment(d, gate):
    """All sets of pairs that are possible."""
    n, m = d.shape
    for size in range(min(n, m) + 1):
        for rows in itertools.combinations(range(n), size):
            for columns in itertools.permutations(range(m), size):
                pairs = list(zip(rows, columns, strict=True))
                if all(np.isfinite(d[pair]) and d[pair] <= gate for pair in pairs):
                    yield pairs


def pairs_of(assignment):
    return [(row, int(column)) for row, column in enumerate(assignment.track) if column >= 0]


@given(matrices, gates)
def test_with_a_gate_against_every_permutation(d, gate):
    found = global_nearest(d, gate)
    ways = list(every_assignment(d, gate))
    assert pairs_of(found) in ways
    assert all(found.measurement[column] == row for row, column in pairs_of(found))
    assert (found.measurement >= 0).sum() == len(pairs_of(found))

    def cost(pairs):
        return sum(d[pair] for pair in pairs) - gate * len(pairs)

    assert cost(pairs_of(found)) == pytest.approx(min(map(cost, ways)))


@given(matrices)
def test_without_a_gate_as_many_as_possible_and_the_least_among_those(d):
    found = pairs_of(global_nearest(d, np.inf))
    ways = list(every_assignment(d, np.inf))
    assert found in ways
    most = max(map(len, ways))
    assert len(found) == most
    least = min(sum(d[pair] for pair in way) for way in ways if len(way) == most)
    assert sum(d[pair] for pair in found) == pytest.approx(least)


def test_the_gate_itself_is_inside():
    assert global_nearest([[9.0]], 9.0).track.tolist() == [0]
    assert global_nearest([[9.1]], 9.0).track.tolist() == [-1]
