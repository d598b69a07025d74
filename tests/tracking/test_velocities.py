"""Velocities, as from optical flow, as measurements beside positions."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.tracking.imm import run_imm
from wildlab.tracking.measurement import on_state, positions, positions_or_velocities
from wildlab.tracking.motion import constant_velocity, rest
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.unscented import run_unscented

MOTION = partial(constant_velocity, sd_acceleration=0.1)
STATE = np.array([10.0, -20.0, 3.0, -1.5])
WIDE = Start(0.0, np.zeros(4), np.diag([400.0, 400.0, 100.0, 100.0]))


@pytest.mark.parametrize("is_velocity", [False, True])
def test_derivatives_are_those_of_differences(is_velocity):
    sensor = positions_or_velocities([is_velocity])
    H = on_state(sensor.predict(0, STATE).H_position, 4)
    step = 1e-3
    truth = [
        (sensor.predict(0, STATE + d).z - sensor.predict(0, STATE - d).z) / (2 * step)
        for d in step * np.eye(4)
    ]
    assert np.allclose(H, np.stack(truth, axis=-1))
    assert np.array_equal(sensor.predict(0, STATE).z, STATE[2:] if is_velocity else STATE[:2])


def test_one_velocity_is_the_update_of_a_kalman_filter_by_hand():
    R = np.array([[0.5, 0.1], [0.1, 0.8]])
    start = Start(0.0, np.array([5.0, 6.0, 1.0, 0.0]), np.diag([4.0, 9.0, 2.0, 3.0]) + 0.5)
    track = run_filter([0.0], STATE[None, 2:], R, positions_or_velocities([True]), MOTION, start)
    H = np.array([[0, 0, 1.0, 0], [0, 0, 0, 1.0]])
    information = np.linalg.inv(start.P) + H.T @ np.linalg.inv(R) @ H
    P = np.linalg.inv(information)
    x = P @ (np.linalg.inv(start.P) @ start.x + H.T @ np.linalg.inv(R) @ STATE[2:])
    assert np.allclose(track.x[0], x)
    assert np.allclose(track.P[0], P)
    assert np.allclose(track.innovation[0], STATE[2:] - start.x[2:])


def test_a_velocity_starts_a_track_that_positions_follow():
    rng = np.random.default_rng(3)
    times = np.array([0.0, 0.0, 1.0, 2.0, 3.0])
    kinds = [False, True, False, False, False]
    place = STATE[:2] + times[:, None] * STATE[2:]
    z = np.where(np.array(kinds)[:, None], STATE[2:], place) + 0.1 * rng.standard_normal((5, 2))
    R = np.where(np.array(kinds)[:, None, None], 0.01 * np.eye(2), 0.01 * np.eye(2))
    fed = run_filter(times, z, R, positions_or_velocities(kinds), MOTION, WIDE)
    alone = run_filter(times[[0, 2]], z[[0, 2]], R[0], positions(), MOTION, WIDE)
    # With the velocity the speed is known at once, and without it not after the first position.
    assert np.abs(fed.x[1, 2:] - STATE[2:]).max() < 0.4
    assert fed.P[1, 2, 2] < 0.011 < alone.P[0, 2, 2]
    assert np.allclose(fed.x[-1], [*place[-1], *STATE[2:]], atol=0.4)
    assert fed.used.all()


def test_all_filters_take_it_alike():
    times = np.array([0.0, 0.5, 1.0])
    z = np.array([[10.0, -20.0], [3.0, -1.4], [3.1, -1.6]])
    R, sensor = 0.2 * np.eye(2), positions_or_velocities([False, True, True])
    one = run_filter(times, z, R, sensor, MOTION, WIDE)
    two = run_unscented(times, z, R, sensor, MOTION, WIDE)
    three = run_imm(times, z, R, sensor, [MOTION, MOTION], [10.0, 10.0], WIDE)
    assert np.allclose(one.x, two.x)
    assert np.allclose(one.x, three.track.x)
    assert np.allclose(one.P, two.P)


def test_what_does_not_fit_is_refused():
    start = Start(0.0, np.zeros(2), np.eye(2))
    for run in (run_filter, run_unscented):
        with pytest.raises(WildlabError, match="a sensor of 4 states for a motion model of 2"):
            run([0.0], [[1.0, 2.0]], np.eye(2), positions_or_velocities([True]), rest, start)
    with pytest.raises(WildlabError, match="a sensor of 4 states for a motion model of 2"):
        run_imm(
            [0.0], [[1.0, 2.0]], np.eye(2), positions_or_velocities([True]), [rest, rest], [9.0, 9.0], start
        )
    with pytest.raises(WildlabError, match="kinds of the shape"):
        positions_or_velocities(True)
