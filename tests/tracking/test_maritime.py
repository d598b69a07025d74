"""Sensors afloat against finite differences of what a platform with a wrong pose and clock would say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from wildlab.tracking.maritime import (
    CLOCK,
    EAST,
    NORTH,
    YAW,
    bearings_from,
    positions_from,
    predict_bearing,
    predict_position,
    white_acceleration,
)

TARGET, PLATFORM, DRIFT = np.array([120.0, -40.0]), np.array([10.0, 30.0]), np.array([2.0, -1.5])


def logged(error: np.ndarray) -> np.ndarray:
    """Where a platform puts the target that has its position, yaw and stamp too small by the error."""
    there = TARGET + DRIFT * error[CLOCK] - PLATFORM
    turn = -error[YAW]
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return PLATFORM - error[[NORTH, EAST]] + R @ there


def test_positions_with_a_wrong_pose_and_clock():
    found = predict_position(TARGET, PLATFORM, DRIFT)
    np.testing.assert_allclose(found.z, logged(np.zeros(6)))
    for i in (NORTH, EAST, CLOCK, YAW):
        step = np.eye(6)[i] * 1e-6
        numeric = (logged(step) - logged(-step)) / 2e-6
        np.testing.assert_allclose(found.H_pose[:, i], numeric, atol=1e-6)
    np.testing.assert_array_equal(found.H_position, np.eye(2))


def test_bearings_with_a_wrong_pose_and_clock():
    found = predict_bearing(TARGET, PLATFORM, DRIFT)

    def bearing(error: np.ndarray) -> float:
        # The position error moves the sensor itself, and the heading turns what it sees.
        there = TARGET + DRIFT * error[CLOCK] - (PLATFORM + error[[NORTH, EAST]])
        return float(np.arctan2(there[1], there[0])) - error[YAW]

    assert found.z == pytest.approx([bearing(np.zeros(6))])
    for i in (NORTH, EAST, CLOCK, YAW):
        step = np.eye(6)[i] * 1e-6
        assert found.H_pose[0, i] == pytest.approx((bearing(step) - bearing(-step)) / 2e-6, abs=1e-6)


def test_rows_have_their_own_platform():
    platform, drift = np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 3.0]])
    position = np.array([5.0, 10.0])
    for make, single in ((positions_from, predict_position), (bearings_from, predict_bearing)):
        sensor = make(platform, drift)
        for row in (0, 1):
            for ours, theirs in zip(
                sensor.predict(row, position), single(position, platform[row], drift[row]), strict=True
            ):
                np.testing.assert_array_equal(ours, theirs)
    assert bearings_from(platform, drift).angles == (True,)
    assert np.isnan(predict_bearing([5.0, 0.0], [5.0, 0.0], [0.0, 1.0]).z).all()


def test_process_noise_by_van_loans_integral():
    A, L = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2)), np.kron([[0.0], [0.3]], np.eye(2))
    block = expm(np.block([[-A, L @ L.T], [np.zeros((4, 4)), A.T]]) * 1.7)
    F, Q = white_acceleration(1.7, 0.3)
    np.testing.assert_allclose(F, block[4:, 4:].T, atol=1e-12)
    np.testing.assert_allclose(Q, block[4:, 4:].T @ block[:4, 4:], atol=1e-12)
