"""The Schmidt filter against the full augmented filter, and its soundness under any sequence of poses."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tracking.full_filter import beside, full_filter
from tests.tracking.poses import GENERATORS, overflight
from wildlab.tracking import kalman
from wildlab.tracking import sensors as m
from wildlab.tracking.kalman import Considered
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter

CV = partial(constant_velocity, sd_acceleration=0.2)
PIXELS = 4.0 * np.eye(2)
START = Start(0.0, np.zeros(4), np.diag([25.0, 25.0, 9.0, 9.0]))
UNITS = np.repeat([1.0, 0.02], 3)


def random_pose_covariance(rng, spread=0.0):
    """Somewhere about (1 m, 0.02 rad), correlated; ``spread`` is the SD of the log of its size."""
    A = rng.normal(size=(6, 9)) * UNITS[:, None] * np.exp(spread * rng.normal(size=(6, 1)))
    return A @ A.T / 9


def lowest(P, C, P_pose):
    """Least eigenvalue of the joint covariance, in units in which every variance is one."""
    J = np.block([[P, C], [C.T, P_pose]])
    sd = np.sqrt(np.diag(J))
    return np.linalg.eigvalsh(J / np.outer(sd, sd))[0]


def by_full_filter(times, uv, poses, covariances, fade=lambda dt: 1.0, carry=None):
    """Target and pose errors at once; noise of the pose makes its covariance the next one."""

    def look(row, x):
        seen = m.predict_pixel(x[:2], poses.take(row), 0.0)
        return uv[row] - seen.z, np.hstack([seen.H_position, np.zeros((2, 2)), seen.H_pose])

    def move(row, dt):
        before, after = covariances[max(row - 1, 0)], covariances[row]
        phi = fade(dt) * (np.eye(6) if carry is None or not row else carry(before, after))
        return tuple(map(beside, CV(dt), (phi, after - phi @ before @ phi.T)))

    start = Start(0.0, np.zeros(10), beside(START.P, covariances[0]))
    return full_filter(times, PIXELS, look, move, start, estimated=4)


def assert_full(track, full, tolerance):
    """Row by row the states of the full filter, without a cross-covariance that was limited."""
    x, P, S = (np.array(part) for part in zip(*full, strict=True))
    assert np.allclose(track.x, x[:, :4], rtol=tolerance, atol=tolerance)
    assert np.allclose(track.P, P[:, :4, :4], rtol=tolerance, atol=tolerance)
    assert np.allclose(track.S, S, rtol=tolerance)
    assert not track.limited.any()


def growing(n, seed=0):
    """Pose covariances that only grow: with them the thesis's constant C is sound."""
    rng = np.random.default_rng(seed)
    return np.cumsum(
        [random_pose_covariance(rng)] + [0.02 * random_pose_covariance(rng) for _ in range(n - 1)], 0
    )


@pytest.mark.parametrize("correlation_time", [np.inf, 8.0, 0.0])
def test_it_is_the_full_filter_with_no_gain_for_the_pose(correlation_time):
    """As published, C kept: with a pose covariance that does not change."""
    times, uv, poses, _ = overflight(50)
    covariances = np.tile(growing(50)[20], (50, 1, 1))
    pose = Considered(m.POSE, covariances, correlation_time)
    track = run_filter(times, uv, PIXELS, m.pixels(poses, 0.0), CV, START, pose=pose)
    full = by_full_filter(
        times, uv, poses, covariances, lambda dt: np.exp(-dt / correlation_time) if correlation_time else 0.0
    )
    assert_full(track, full, 1e-8)


def by_eigenvectors(function):
    """Of the product's own eigenvectors, not by way of a factor of either covariance."""

    def carry(old, new):
        values, axes = np.linalg.eig(new @ np.linalg.inv(old))
        return np.real(axes @ np.diag(function(np.real(values))) @ np.linalg.inv(axes))

    return carry


def test_it_is_the_full_filter_whose_pose_error_keeps_its_size_in_deviations(rng):
    times, uv, poses, _ = overflight(50)
    covariances = np.array([random_pose_covariance(rng, 0.3) for _ in times])
    pose = Considered(m.POSE, covariances)
    track = run_filter(times, uv, PIXELS, m.pixels(poses, 0.0), CV, START, pose=pose)
    full = by_full_filter(times, uv, poses, covariances, carry=by_eigenvectors(np.sqrt))
    assert_full(track, full, 1e-7)


def test_with_a_perfect_pose_it_is_the_extended_filter():
    times, uv, poses, _ = overflight(50)
    sensor = m.pixels(poses, 0.0)
    plain = run_filter(times, uv, PIXELS, sensor, CV, START)
    pose = Considered(m.POSE, np.zeros((50, 6, 6)))
    track = run_filter(times, uv, PIXELS, sensor, CV, START, pose=pose)
    assert not track.C.any()
    for ours, theirs in zip(track._replace(C=plain.C), plain, strict=True):
        assert np.allclose(ours, theirs, rtol=1e-12, atol=1e-12, equal_nan=True)


@given(rng=GENERATORS)
def test_update_is_the_print(rng):
    """H (7.34), (7.35) and (7.38) term by term."""
    A = rng.normal(size=(10, 12))
    J = A @ A.T
    P, C, Po = J[:4, :4], J[:4, 4:], J[4:, 4:]
    H, Ho, R, v = rng.normal(size=(2, 4)), rng.normal(size=(2, 6)), np.diag([1.0, 2.0]), rng.normal(size=2)
    done = kalman.update_schmidt(np.zeros(4), P, C, Po, v, H, Ho, R)
    S = H @ P @ H.T + H @ C @ Ho.T + Ho @ C.T @ H.T + Ho @ Po @ Ho.T + R
    K = (P @ H.T + C @ Ho.T) @ np.linalg.inv(S)
    left = np.eye(4) - K @ H
    P_new = (
        left @ P @ left.T - C @ Ho.T @ K.T + K @ H @ C @ Ho.T @ K.T - K @ Ho @ C.T
        + K @ Ho @ C.T @ H.T @ K.T + K @ Ho @ Po @ Ho.T @ K.T + K @ R @ K.T
    )  # fmt: skip
    scale = np.abs(J).max()
    assert np.allclose(done.S, S)
    assert np.allclose(done.gain, K)
    assert np.allclose(done.x, K @ v)
    assert np.allclose(done.P, P_new, atol=1e-10 * scale)
    assert np.allclose(done.C, C - K @ (H @ C + Ho @ Po), atol=1e-10 * scale)


@given(rng=GENERATORS, shrink=st.floats(1e-6, 1))
def test_a_cross_covariance_is_shortened_only_where_it_must_be(rng, shrink):
    A = rng.normal(size=(10, 14)) * np.concatenate([np.array([5, 5, 1, 1.0]), UNITS])[:, None]
    J = A @ A.T
    P, C, Po = J[:4, :4], J[:4, 4:], J[4:, 4:]
    same, limited = kalman.limit_cross(C, P, Po)
    assert same is C
    assert not limited
    mixed = np.diag(rng.uniform(shrink, 1, 6) ** 0.5)
    after = mixed @ Po @ mixed
    sound = lowest(P, C, after) > 1e-9
    new, limited = kalman.limit_cross(C, P, after)
    assert limited == (not sound)
    assert lowest(P, new, after) > -1e-12
    again, limited = kalman.limit_cross(new, P, after)
    assert np.allclose(again, new, rtol=1e-8)


@given(rng=GENERATORS)
def test_transitions_lead_from_one_pose_covariance_to_the_next(rng):
    before, after = random_pose_covariance(rng, 1.0), random_pose_covariance(rng, 1.0)
    unit = np.outer(UNITS, UNITS)
    bias = kalman.transition_of_pose(before, after)
    assert np.allclose(bias @ before @ bias.T / unit, after / unit, rtol=1e-7, atol=1e-9)
    back = kalman.transition_of_pose(after, before)
    assert np.allclose(back @ bias * np.outer(1 / UNITS, UNITS), np.eye(6), atol=1e-6)
    degrees = np.repeat([1.0, np.degrees(1)], 3)
    scale = np.outer(degrees, degrees)
    assert np.allclose(kalman.transition_of_pose(before, before), np.eye(6), atol=1e-8)
    other = kalman.transition_of_pose(before * scale, after * scale)
    assert np.allclose(
        other * np.outer(1 / degrees / UNITS, degrees * UNITS), bias * np.outer(1 / UNITS, UNITS), atol=1e-6
    )


def test_a_row_without_a_pose_covariance_is_passed_over(rng):
    covariances = np.array([random_pose_covariance(rng) for _ in range(4)])
    covariances[1] = np.nan
    phi = kalman.transitions_of_pose(covariances)
    assert np.array_equal(phi[:2], [np.eye(6)] * 2)
    assert np.allclose(phi[2] @ covariances[0] @ phi[2].T, covariances[2])


def test_many_transitions_are_those_of_each_pair(rng):
    """Also where nothing changes, and from a pose without variance in some direction, or in none."""
    covariances = np.array([random_pose_covariance(rng) for _ in range(12)])
    covariances[3] = covariances[2]
    covariances[5, 2] = covariances[5, :, 2] = 0.0
    covariances[7] = 0.0
    covariances[9] = np.outer(np.arange(1, 7), np.arange(1, 7)) * 1e-4
    phi = kalman.transitions_of_pose(covariances)
    for k in range(1, 12):
        expected = kalman.transition_of_pose(covariances[k - 1], covariances[k])
        assert np.allclose(phi[k], np.eye(6) if k == 3 else expected, rtol=1e-6, atol=1e-6), k
    assert kalman.transitions_of_pose(covariances[:1]) == pytest.approx(np.eye(6)[None])


def hard_flight(n, seed=0):
    """Pose covariances of any size and shape from one frame to the next, as no navigation filter has them."""
    rng = np.random.default_rng(seed)
    period = 200
    _, uv, poses, _ = overflight(period, sd_pixel=1.0)
    rows = np.arange(n) % period
    repeated = poses.take(rows)
    steps = rng.uniform(0, 0.3, n)
    A = rng.normal(size=(n, 6, 7)) * UNITS[:, None] * np.exp(2.0 * rng.normal(size=(n, 6, 1)))
    covariances = A @ np.swapaxes(A, 1, 2) / 7
    return np.cumsum(steps), uv[rows], repeated, covariances


def test_covariance_stays_one_with_a_new_pose_in_every_frame():
    times, uv, poses, covariances = hard_flight(1500)
    pose = Considered(m.POSE, covariances)
    track = run_filter(times, uv, PIXELS, m.pixels(poses, 0.0), CV, START, pose=pose)
    assert track.used.mean() > 0.9
    assert np.array_equal(track.P, np.swapaxes(track.P, 1, 2))
    sd = np.sqrt(np.diagonal(track.P, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(track.P / (sd[:, :, None] * sd[:, None, :])).min() > 0
    assert (np.linalg.eigvalsh(track.S[track.used]) > 0).all()
    assert track.limited.mean() < 1e-3
