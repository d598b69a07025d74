"""The compiled filters of many runs against the readable filter, run by run."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.tracking.poses import CAMERA, CROOKED, overflight
from tests.tracking.test_schmidt import random_pose_covariance
from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.tracking import sensors as m
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.schmidt import PoseUncertainty

CV = partial(constant_velocity, sd_acceleration=0.2)
N = 40
#: Rows of a `flight` that others of the same time follow.
TWICE = [11, 21, 22]


def agree(batch, run, track, but=()):
    """Row by row, but for those where the one that follows at the same time counts too."""
    rows = np.setdiff1d(np.arange(len(track.times)), but)
    shared = {"x": track.x, "P": track.P, "innovation": track.innovation, "nis": track.nis}
    for name, theirs in shared.items():
        ours = getattr(batch, name)[run]
        assert np.allclose(ours[rows], theirs[rows], rtol=1e-9, atol=1e-9, equal_nan=True), name
    assert np.array_equal(batch.used[run], track.used)
    assert np.array_equal(batch.limited[run], track.limited)


def flight(runs, seed=0):
    """Pixels, poses and noise of each run: some at one time, some missed, a target out of sight."""
    rng = np.random.default_rng(seed)
    times, uv, poses, _ = overflight(N)
    times[[12, 22, 23]] = times[[11, 21, 21]]
    p_nc = poses.p_nc + rng.normal(0, 1, (runs, N, 3))
    R_nc = np.tile(poses.R_nc, (runs, 1, 1, 1))
    R_nc[runs // 2, 5] = R_nc[runs // 2, 5] @ np.diag([1.0, -1.0, -1.0])
    p_nc[0, 9] = np.nan
    z = uv + rng.normal(0, 2, (runs, N, 2))
    z[rng.random((runs, N)) < 0.1, 0] = np.nan
    z[1, 12] += 300
    return times, z, CameraPoses.at_lens(CAMERA, p_nc, R_nc, poses.R_bc, (0.3, -0.1, 0.2))


@pytest.mark.parametrize(("runs", "gate", "alike"), [(3, 1.0, False), (4, 0.99, False), (1, 1.0, True)])
@pytest.mark.parametrize("row", [-1, 0])
def test_positions(runs, gate, alike, row):
    rng = np.random.default_rng(runs)
    times = np.cumsum(rng.uniform(0, 2, N))
    times[7] = times[6]
    z = np.cumsum(rng.normal(0, 3, (runs, N, 2)), axis=1)
    z[:, rng.random(N) < 0.2] = np.nan
    A = rng.normal(size=(N, 2, 3) if alike else (runs, N, 2, 3))
    R = A @ np.swapaxes(A, -1, -2) + np.eye(2)
    if not alike:
        R[0, 4], z[1, 12] = np.nan, np.nan
    start = Start(times[0], rng.normal(size=(runs, 4)), np.diag([50.0, 40, 9, 4]), row=row)
    batch = run_batch(times, z, R, CV, start, gate_probability=gate)
    for run in {0, 1, runs // 2, runs - 1} & set(range(runs)):
        own, noise = start._replace(x=start.x[run]), R if alike else R[run]
        agree(
            batch,
            run,
            run_filter(times, z[run], noise, m.positions(), CV, own, gate_probability=gate),
            but=[6],
        )


@pytest.mark.parametrize("gate", [1.0, 0.99])
def test_pixels(gate):
    runs = 5
    times, z, poses = flight(runs)
    plane = np.linspace(0, 1, N)
    start = Start(-0.5, np.zeros(4), np.diag([25.0, 25, 9, 9]))
    R = np.diag([4.0, 6.0])
    batch = run_batch(times, z, R, CV, start, view=BatchCamera(poses, plane), gate_probability=gate)
    for run in (0, 1, 2, 4):
        sensor = m.pixels(poses.take(run), plane)
        agree(batch, run, run_filter(times, z[run], R, sensor, CV, start, gate_probability=gate), but=TWICE)
    assert not batch.used[2, 5]


@pytest.mark.parametrize(
    ("correlation_time", "change"), [(np.inf, "bias"), (5.0, "navigated"), (0.0, "bias")]
)
def test_schmidt(correlation_time, change, rng):
    runs = 7
    times, z, poses = flight(runs)
    covariance = np.array([[random_pose_covariance(rng, 0.2) for _ in range(N)] for _ in range(runs)])
    covariance[3, 20] = np.nan
    covariance[4, :, 2] = covariance[4, :, :, 2] = 0.0
    covariance[5] = 0.0
    start = Start(0.0, np.zeros(4), np.tile(np.diag([25.0, 25, 9, 9]), (runs, 1, 1)))
    R = np.tile(np.diag([4.0, 6.0]), (N, 1, 1))
    pose = PoseUncertainty(covariance, correlation_time, change)
    batch = run_batch(times, z, R, CV, start, view=BatchCamera(poses, 0.0), pose=pose, gate_probability=0.999)
    for run in (0, 3, 4, 5, 6):
        own = start._replace(P=start.P[run])
        track = run_filter(
            times, z[run], R, m.pixels(poses.take(run), 0.0), CV, own,
            pose=pose._replace(covariance=covariance[run]), gate_probability=0.999,
        )  # fmt: skip
        agree(batch, run, track, but=TWICE)


def test_only_the_rows_asked_for_are_kept():
    times, z, poses = flight(3)
    start = Start(times[1], np.ones(4), np.diag([25.0, 25, 9, 9]), row=1)
    arguments = dict(view=BatchCamera(poses, 0.0), gate_probability=0.99)
    full = run_batch(times, z, np.eye(2), CV, start, **arguments)
    rows = [0, 1, 17, N - 1]
    some = run_batch(times, z, np.eye(2), CV, start, rows=rows, **arguments)
    assert np.array_equal(some.times, times[rows])
    assert np.array_equal(some.x, full.x[:, rows], equal_nan=True)
    assert np.array_equal(some.P, full.P[:, rows], equal_nan=True)
    assert np.isnan(some.x[:, 0]).all()
    assert np.array_equal(some.x[:, 1], np.ones((3, 4)))
    for ours, theirs in zip(some[3:], full[3:], strict=True):
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype == float)


def test_bad_input_is_named():
    times, z, poses = flight(3)
    start = Start(0.0, np.zeros(4), np.eye(4))
    R = np.eye(2)
    with pytest.raises(WildlabError, match="runs, times, 2"):
        run_batch(times, z[0], R, CV, start)
    with pytest.raises(WildlabError, match="distorts"):
        run_batch(times, z, R, CV, start, view=BatchCamera(replace(poses, camera=CROOKED), 0.0))
    with pytest.raises(WildlabError, match="row 3 at"):
        run_batch(np.where(np.arange(N) == 3, -1.0, times), z, R, CV, start)
    bad = np.tile(R, (3, N, 1, 1))
    bad[1, 6] = 0.0
    with pytest.raises(WildlabError, match="R of row 6"):
        run_batch(times, z, bad, CV, start)
    nothing = np.zeros((3, N, 2))
    for gate in (1.0, 0.99):  # the second by the compiled filter
        with pytest.raises(WildlabError, match="S of row 0"):
            run_batch(
                times, nothing, R, lambda dt: (np.eye(4), -99 * np.eye(4)), start, gate_probability=gate
            )
