"""Velocities, as from optical flow, as measurements beside positions."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.tracking.imm import run_imm
from wildlab.tracking.measurement import on_state, positions_or_velocities
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
    given = [0.0], [[1.0, 2.0]], np.eye(2), positions_or_velocities([True])
    for run, more in ((run_filter, [rest]), (run_unscented, [rest]), (run_imm, [[rest, rest], [9.0, 9.0]])):
        with pytest.raises(WildlabError, match="4 states"):
            run(*given, *more, start)
    with pytest.raises(WildlabError, match="kinds"):
        positions_or_velocities(True)
