"""Two motions at once: one target is the filter of one target; hulls and motions do not mix."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.many.test_run import POINTS, looks
from tests.tracking.many.test_update import OPEN, SURE
from tests.tracking.poses import GENERATORS
from wildlab.tracking.filters import run_imm
from wildlab.tracking.many.run import follow_many
from wildlab.tracking.many.target_model import (
    POINT,
    Hull,
    at_least,
    each_motion,
    interact,
    largest_of,
    of_hulls,
)
from wildlab.tracking.motion import white_acceleration
from wildlab.tracking.records import Start
from wildlab.tracking.sensors import positions

BOTH = (Hull("boat", 6.0, 2.0, 0.6), Hull("ship", 30.0, 8.0, 0.4))


@given(GENERATORS, st.floats(0.05, 0.9), st.floats(2.0, 60.0))
@settings(max_examples=20, deadline=None)
def test_one_target_is_the_filter_of_one_target(rng, calm, stay_s):
    way = np.cumsum(np.cumsum(rng.normal(0, 0.5, (12, 1, 2)), axis=0), axis=0)
    scans = looks(way, rng)
    targets = OPEN._replace(density=0.8, calm=calm, stay_s=stay_s)
    start = Start(0.0, np.array([*scans[0].z[0], 0.0, 0.0]), np.diag([1.0, 1.0, 9.0, 9.0]), row=0)
    motions = [partial(white_acceleration, density=density) for density in (0.8, 0.8 * calm)]
    z = np.array([scan.z[0] for scan in scans])
    right = run_imm(
        np.arange(12.0), z, np.eye(2), positions(), motions, (stay_s, stay_s), start
    )  # fmt: skip
    for k, (tracks, _) in enumerate(follow_many(scans, [SURE], targets)):
        x, P = tracks.estimate()
        assert np.allclose(tracks.kinds[0], right.probabilities[k], atol=1e-9)
        assert np.allclose(x[0], right.track.x[k]) and np.allclose(P[0], right.track.P[k])


def test_one_motion_is_none_beside_another():
    targets = POINTS._replace(calm=1.0)
    assert each_motion([SURE], targets) == ((SURE,), targets)
    eyes, told = each_motion(
        [SURE._replace(rough_m=(1.0, 2.0), along_m=(3.0, 4.0), near_side_m=(5.0, 6.0))],
        POINTS._replace(hulls=BOTH, calm=0.5),
    )
    assert eyes[0].rough_m == (1.0, 1.0, 2.0, 2.0) and eyes[0].near_side_m == (5.0, 5.0, 6.0, 6.0)
    assert eyes[0].near_end_m == ()
    assert [hull.name for hull in told.hulls] == ["boat", "boat", "ship", "ship"]
    assert [hull.share for hull in told.hulls] == pytest.approx([0.3, 0.3, 0.2, 0.2])
    assert largest_of(told.hulls).tolist() == [False, False, True, True]
    assert largest_of((POINT,)).tolist() == [True]


@given(GENERATORS, st.floats(0.0, 100.0))
def test_mixing_keeps_hulls_means_and_what_is_shared(rng, dt):
    """The mixture of both motions has the same mean, covariance and cross-covariance before and after."""
    x, C, kinds = rng.normal(size=(2, 4, 4)), rng.normal(size=(2, 4, 4, 3)), rng.dirichlet(np.ones(4), 2)
    root = rng.normal(size=(2, 4, 4, 4))
    P = root @ np.swapaxes(root, -1, -2)

    def moments(x: np.ndarray, P: np.ndarray, C: np.ndarray, kinds: np.ndarray) -> list[np.ndarray]:
        found = []
        for hull in (slice(0, 2), slice(2, 4)):
            w = kinds[:, hull] / kinds[:, hull].sum(axis=1, keepdims=True)
            mean = np.einsum("tk,tki->ti", w, x[:, hull])
            off = x[:, hull] - mean[:, None]
            spread = np.einsum("tk,tkij->tij", w, P[:, hull] + off[..., :, None] * off[..., None, :])
            found += [kinds[:, hull].sum(axis=1), mean, spread, np.einsum("tk,tkij->tij", w, C[:, hull])]
        return found

    after = interact(x, P, C, kinds, dt, 10.0)
    for a, b in zip(moments(x, P, C, kinds), moments(*after), strict=True):
        assert np.allclose(a, b)
    if dt == 0:
        assert all(np.allclose(a, b) for a, b in zip(after, (x, P, C, kinds), strict=True))
    # Long enough, and both motions of a hull are as probable as each other, and the same.
    long = interact(x, P, C, kinds, 1e4, 10.0)
    assert np.allclose(long[3][:, 0], long[3][:, 1]) and np.allclose(long[0][:, 0], long[0][:, 1])


def test_no_hull_is_ruled_out_and_a_motion_may_be():
    targets = POINTS._replace(hulls=BOTH, calm=0.5)
    found = at_least(np.array([[0.9, 0.1, 0.0, 0.0], [0.2, 0.2, 0.6, 0.0]]), 0.02, targets)
    assert np.allclose(found, [[0.9, 0.1, 0.01, 0.01], [0.2, 0.2, 0.6, 0.0]])
    assert np.allclose(of_hulls(found, targets), [[1.0, 0.02], [0.4, 0.6]])
    alone = np.array([[0.999, 0.001]])
    assert np.array_equal(at_least(alone, 0.02, POINTS._replace(calm=0.5)), alone)
    assert of_hulls(np.zeros((0, 4)), targets).shape == (0, 2)
