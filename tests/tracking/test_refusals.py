"""What filters refuse: each error names the field, the row and what was found."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from tests.tracking.poses import overflight
from wildlab.errors import WildlabError
from wildlab.tracking import measurement as m
from wildlab.tracking.association import nearest_within
from wildlab.tracking.batch import View, run_batch
from wildlab.tracking.coloured import run_coloured
from wildlab.tracking.imm import run_imm
from wildlab.tracking.maritime import bearings_from, positions_from
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.schmidt import PoseUncertainty
from wildlab.tracking.unscented import run_unscented

CV = partial(constant_velocity, sd_acceleration=0.2)
N, R = 5, np.eye(2)
TIMES, Z = 0.5 * np.arange(N), np.zeros((N, 2))
START = Start(0.0, np.zeros(4), 9.0 * np.eye(4))


def by_kalman(start=START, **options):
    return run_filter(TIMES, Z, R, m.positions(), CV, start, **options)


def by_coloured(start=START, **options):
    return run_coloured(TIMES, Z, R, CV, start, **options)


def by_unscented(start=START, **options):
    return run_unscented(TIMES, Z, R, m.positions(), CV, start, **options)


def by_imm(start=START, **options):
    return run_imm(TIMES, Z, R, m.positions(), [CV, CV], [5.0, 5.0], start, **options)


def by_batch(start=START, **options):
    return run_batch(TIMES, np.tile(Z, (3, 1, 1)), R, CV, start, **options)


FILTERS = [by_kalman, by_coloured, by_unscented, by_imm, by_batch]


@pytest.mark.parametrize("run", FILTERS)
@pytest.mark.parametrize("wrong", [0.0, 1.0001, np.nan])
def test_a_gate_is_a_probability(run, wrong):
    with pytest.raises(WildlabError, match=r"^gate_probability: "):
        run(gate_probability=wrong)
    with pytest.raises(WildlabError, match=r"^gate_probability: "):
        nearest_within(np.ones((1, 2)), wrong, 2)


def spoilt(value, at=(1, 1)):
    P = 9.0 * np.eye(4)
    P[at] = value
    return P


@pytest.mark.parametrize("run", FILTERS)
@pytest.mark.parametrize(
    ("start", "message"),
    [
        (START._replace(x=np.array([0, 0, np.nan, 0])), r"^start\.x: row 2"),
        (START._replace(time=np.inf), r"^start\.time: "),
        (START._replace(P=np.eye(2)), r"^start: x of the shape"),
        (START._replace(P=spoilt(np.nan)), r"^start\.P: row 1 is not finite"),
        (START._replace(P=spoilt(0.5, (0, 3))), r"^start\.P: not symmetric: row 0"),
        (START._replace(P=spoilt(-4.0, (2, 2))), r"^start\.P: row 2"),
        (
            START._replace(P=spoilt(10.0, (0, 1)) + spoilt(10.0, (1, 0)) - 9 * np.eye(4)),
            r"^start\.P: .* negative",
        ),
    ],
)
def test_a_start_is_finite_and_has_a_covariance(run, start, message):
    with pytest.raises(WildlabError, match=message):
        run(start)


def test_of_many_starts_the_wrong_one_is_named():
    P = np.tile(9.0 * np.eye(4), (3, 1, 1))
    P[2, 1, 1] = -1.0
    with pytest.raises(WildlabError, match=r"^start\.P\[2\]: row 1"):
        by_batch(Start(0.0, np.zeros((3, 4)), P))
    x = np.zeros((3, 4))
    x[1, 3] = np.nan
    with pytest.raises(WildlabError, match=r"^start\.x: row 1, 3"):
        by_batch(Start(0.0, x, P[0]))


def test_a_start_may_be_sure_of_some_states():
    known = np.diag([4.0, 4.0, 0.0, 0.0])
    for run in FILTERS[:2]:
        assert np.isfinite(run(START._replace(P=known)).x).all()
    correlated = np.outer([1.0, 2.0, 3.0, 1e6], [1.0, 2.0, 3.0, 1e6])  # rounding may push it below zero
    assert np.isfinite(by_kalman(START._replace(P=correlated)).x).all()


def test_a_pose_for_each_measurement():
    _, _, poses, _ = overflight(N + 1)
    for sensor in (
        m.pixels(poses, 0.0),
        m.azimuths_elevations(poses, 0.0),
        m.ranges_bearings(np.zeros((N + 1, 2)), np.zeros(N + 1)),
        positions_from(np.ones((N + 1, 2)), np.zeros((N + 1, 2))),
    ):
        with pytest.raises(WildlabError, match=r"^sensor: 6 rows"):
            run_filter(TIMES, Z, R, sensor, CV, START)
    for sensor in (
        m.bearings(np.zeros((N - 1, 2)), np.zeros(N - 1)),
        bearings_from(np.ones((N - 1, 2)), np.zeros((N - 1, 2))),
    ):
        with pytest.raises(WildlabError, match=r"^sensor: 4 rows"):
            run_filter(TIMES, Z[:, :1], R[:1, :1], sensor, CV, START)
    sensor = m.pixels(poses, 0.0)
    for run in (
        lambda: run_unscented(TIMES, Z, R, sensor, CV, START),
        lambda: run_imm(TIMES, Z, R, sensor, [CV, CV], [5.0, 5.0], START),
    ):
        with pytest.raises(WildlabError, match=r"^sensor: 6 rows"):
            run()


def test_a_camera_pose_for_each_row_of_many_runs():
    _, _, poses, _ = overflight(N + 1)
    many = np.tile(Z, (3, 1, 1))
    with pytest.raises(WildlabError, match=r"^measurements: 5 rows"):
        run_batch(TIMES, many, R, CV, START, view=View(poses, 0.0))
    with pytest.raises(WildlabError, match=r"^view\.plane_down: 4 rows"):
        run_batch(TIMES, many, R, CV, START, view=View(poses.take(slice(N)), np.zeros(N - 1)))
    with pytest.raises(WildlabError, match=r"^plane_down: "):
        m.pixels(poses, np.zeros(N))
    with pytest.raises(WildlabError, match=r"^yaw: "):
        m.bearings(np.zeros((N + 1, 2)), np.zeros(N))


def test_a_pose_covariance_for_each_measurement():
    pose = PoseUncertainty(np.tile(np.eye(6), (N + 1, 1, 1)))
    for run, wrong in ((by_kalman, pose), (by_batch, pose), (by_kalman, PoseUncertainty(np.eye(6)))):
        with pytest.raises(WildlabError, match=r"^pose\.covariance: "):
            run(pose=wrong)
