"""Differenced measurements against the augmented filter they stand for, and thinning."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.full_filter import beside, full_filter
from wildlab.errors import WildlabError
from wildlab.tracking import measurement as m
from wildlab.tracking.coloured import difference_model, run_coloured, thin
from wildlab.tracking.motion import constant_velocity, singer
from wildlab.tracking.run import Start, run_filter, start_from_first

CV = partial(constant_velocity, sd_acceleration=0.3)
SINGER = partial(singer, alpha=0.1, variance=0.2)
R_W = np.array([[0.5, 0.1], [0.1, 0.8]])
SLOW = np.array([[0.9, 0.05], [-0.02, 0.8]])


def data(n=40, longest=0.9, seed=0):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.02, longest, n)), np.cumsum(rng.normal(0, 1.5, (n, 2)), axis=0)


def augmented(times, z, motion, prior, F_c):
    """Target and noise in one state, measured without any noise; ``prior`` is for the first row."""
    n = len(prior.x)
    H = np.hstack([np.eye(2, n), np.eye(2)])
    start = Start(times[0], np.append(prior.x, [0.0, 0.0]), beside(prior.P, R_W))

    def move(row, dt):
        still = np.eye(n + 2), np.zeros((n + 2, n + 2))
        return tuple(map(beside, motion(dt), (F_c, R_W))) if row else still

    return full_filter(times, np.zeros((2, 2)), lambda row, x: (z[row] - H @ x, H), move, start)


@pytest.mark.parametrize("F_c", [np.eye(2), SLOW], ids=["constant", "fading"])
@pytest.mark.parametrize(("motion", "n"), [(CV, 4), (SINGER, 6)], ids=["constant velocity", "singer"])
def test_differencing_is_the_augmented_filter(motion, n, F_c):
    """Exactly: once the target is known, the noise is the rest of the measurement.

    Both use the first measurement with noise R_w; the differences begin at the second.
    """
    times, z = data()
    prior = Start(times[0], np.ones(n), np.diag([30.0, 20, 9, 4, 0.3, 0.2])[:n, :n])
    track = run_coloured(times, z, R_W, motion, prior, F_c=F_c)
    assert track.used.all()
    for row, (x, P, _) in enumerate(augmented(times, z, motion, prior, F_c)):
        assert np.allclose(track.x[row], x[:n], rtol=1e-8, atol=1e-8)
        assert np.allclose(track.P[row], P[:n, :n], rtol=1e-8, atol=1e-8)


def test_the_model_is_the_print():
    F, Q = SINGER(0.4)
    H = np.eye(2, 6)
    model = difference_model(F, Q, H, SLOW, R_W)
    R = H @ Q @ H.T + R_W
    T = Q @ H.T @ np.linalg.inv(R)
    assert np.allclose(model.H, H @ F - SLOW @ H)
    assert np.allclose(model.R, R)
    assert np.allclose(model.T, T)
    assert np.allclose(model.F, F - T @ model.H)
    assert np.allclose(model.Q, Q - Q @ H.T @ np.linalg.inv(R) @ H @ Q)


def test_after_a_gap_the_position_itself_is_used():
    times, z = data(20)
    times[10:] += 5.0
    start = start_from_first(times, z, 1.0, 3.0)
    track = run_coloured(times, z, R_W, CV, start)
    before = run_coloured(times[:10], z[:10], R_W, CV, start)
    direct = run_filter(
        times[10:11], z[10:11], R_W, m.positions(), CV, Start(times[9], before.x[-1], before.P[-1])
    )
    assert np.allclose(track.x[10], direct.x[0])
    assert np.allclose(track.P[10], direct.P[0])
    assert np.allclose(track.S[10], direct.S[0])
    patient = run_coloured(times, z, R_W, CV, start, longest_gap=10.0)
    assert not np.allclose(patient.x[10], direct.x[0])


def test_a_measurement_that_is_not_used_is_no_reference():
    times, z = data(20, longest=0.3)
    start = start_from_first(times, z, 1.0, 3.0)
    far, gone = z.copy(), z.copy()
    far[8] += 500
    gone[8] = np.nan
    left_out = run_coloured(np.delete(times, 8), np.delete(z, 8, 0), R_W, CV, start, output_times=times)
    gated = run_coloured(times, far, R_W, CV, start, gate_probability=0.9999)
    assert not gated.used[8]
    assert gated.nis[8] > 100
    missing = run_coloured(times, gone, R_W, CV, start)
    assert np.isnan(missing.nis[8])
    for track in (gated, missing):
        assert track.used.sum() == 19
        assert np.allclose(track.x, left_out.x)
        assert np.allclose(track.P, left_out.P)


def test_two_at_once_say_nothing_of_the_velocity():
    times, z = data(6)
    times[3] = times[2]
    start = start_from_first(times, z, 1.0, 3.0)
    track = run_coloured(times, z, R_W, CV, start, output_times=times)
    assert track.used.all()
    without = run_coloured(times[:3], z[:3], R_W, CV, start)
    assert np.allclose(track.x[3], without.x[2])
    assert np.allclose(track.P[3], without.P[2])


def test_several_detections_are_refused():
    times, z = data(4)
    with pytest.raises(WildlabError, match="several detections"):
        run_coloured(times, np.stack([z, z], axis=1), R_W, CV, start_from_first(times, z, 1.0))


@given(
    steps=st.lists(st.floats(0, 3), min_size=1, max_size=60),
    interval=st.floats(0.01, 5),
    seed=st.integers(0, 99),
)
def test_thinning_keeps_as_many_as_it_may(steps, interval, seed):
    times = np.cumsum(steps)
    usable = np.random.default_rng(seed).random(len(times)) < 0.8
    kept = thin(times, interval, usable)
    assert not kept[~usable].any()
    assert (np.diff(times[kept]) >= interval * (1 - 1e-8)).all()
    for row in np.flatnonzero(usable & ~kept):  # none left out without one kept shortly before
        before = times[:row][kept[:row]]
        assert len(before)
        assert times[row] - before[-1] < interval
    assert np.array_equal(thin(times, interval), thin(times, interval, np.ones(len(times), bool)))
