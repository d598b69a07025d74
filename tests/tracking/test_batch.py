"""The compiled filters of many runs against the readable filter, run by run."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.tracking.poses import CROOKED, overflight
from tests.tracking.test_schmidt import random_pose_covariance
from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.tracking import sensors as m
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.kalman import Considered
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter

CV = partial(constant_velocity, sd_acceleration=0.2)
N = 40
#: Rows of a `flight` that others of the same time follow.
TWICE = [11, 21, 22]


def agree(ours, track, but=()):
    """Row by row, but for those where the one that follows at the same time counts too."""
    rows = np.setdiff1d(np.arange(len(track.times)), but)
    for name in ("x", "P", "innovation", "nis"):
        one, other = getattr(ours, name)[rows], getattr(track, name)[rows]
        assert np.allclose(one, other, rtol=1e-9, atol=1e-9, equal_nan=True), name
    assert np.array_equal(ours.used, track.used)
    assert np.array_equal(ours.limited, track.limited)


def flight(runs, seed=0):
    """Pixels of each run, and poses: some at one time, some missed, a target out of sight."""
    rng = np.random.default_rng(seed)
    times, uv, poses, _ = overflight(N)
    times[[12, 22, 23]] = times[[11, 21, 21]]
    p_nc, R_nc = poses.p_nc + rng.normal(0, 1, (N, 3)), poses.R_nc.copy()
    R_nc[5] = R_nc[5] @ np.diag([1.0, -1.0, -1.0])
    p_nc[9] = np.nan
    z = uv + rng.normal(0, 2, (runs, N, 2))
    z[rng.random((runs, N)) < 0.1, 0] = np.nan
    return times, z, CameraPoses.at_lens(poses.camera, p_nc, R_nc, poses.R_bc, (0.3, -0.1, 0.2))


@pytest.mark.parametrize("row", [-1, 0])
def test_positions(row):
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0, 2, N))
    times[7] = times[6]
    z = np.cumsum(rng.normal(0, 3, (3, N, 2)), axis=1)
    z[:, rng.random(N) < 0.2] = np.nan
    A = rng.normal(size=(N, 2, 3))
    R = A @ np.swapaxes(A, -1, -2) + np.eye(2)
    R[4], z[1, 12] = np.nan, np.nan
    start = Start(times[0], rng.normal(size=4), np.diag([50.0, 40, 9, 4]), row=row)
    for ours, one in zip(run_batch(times, z, R, CV, start), z, strict=True):
        agree(ours, run_filter(times, one, R, m.positions(), CV, start), but=[6])


def test_pixels():
    times, z, poses = flight(3)
    plane = np.linspace(0, 1, N)
    start = Start(-0.5, np.zeros(4), np.diag([25.0, 25, 9, 9]))
    R = np.diag([4.0, 6.0])
    tracks = run_batch(times, z, R, CV, start, view=BatchCamera(poses, plane))
    for ours, one in zip(tracks, z, strict=True):
        agree(ours, run_filter(times, one, R, m.pixels(poses, plane), CV, start), but=TWICE)
        assert not ours.used[[5, 9]].any()


def test_schmidt(rng):
    runs = 6
    times, z, poses = flight(runs)
    covariance = np.array([[random_pose_covariance(rng, 0.2) for _ in range(N)] for _ in range(runs)])
    covariance[1, 20] = np.nan
    covariance[2, :, 2] = covariance[2, :, :, 2] = 0.0
    covariance[3] = 0.0
    covariance[4:] = 9 * covariance[0]  # in proportion, and all but for one row
    covariance[5, 7] /= 2
    start = Start(0.0, np.zeros(4), np.diag([25.0, 25, 9, 9]))
    R = np.tile(np.diag([4.0, 6.0]), (N, 1, 1))
    view, sensor = BatchCamera(poses, 0.0), m.pixels(poses, 0.0)
    tracks = run_batch(times, z, R, CV, start, view=view, pose=Considered(m.POSE, covariance))
    for ours, one, own in zip(tracks, z, covariance, strict=True):
        pose = Considered(m.POSE, own)
        agree(ours, run_filter(times, one, R, sensor, CV, start, pose=pose), but=TWICE)
    (alone,) = run_batch(times, z[:1], R, CV, start, view=view, pose=Considered(m.POSE, covariance[0]))
    assert np.array_equal(alone.P, tracks[0].P, equal_nan=True)


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
    bad = np.tile(R, (N, 1, 1))
    bad[6] = 0.0
    with pytest.raises(WildlabError, match="R of row 6"):
        run_batch(times, z, bad, CV, start)
    with pytest.raises(WildlabError, match="constant errors of the pose"):
        run_batch(times, z, R, CV, start, pose=Considered(m.POSE, np.eye(6), 5.0))
    with pytest.raises(WildlabError, match="S of row 0"):
        run_batch(times, np.zeros((3, N, 2)), R, lambda dt: (np.eye(4), -99 * np.eye(4)), start)
