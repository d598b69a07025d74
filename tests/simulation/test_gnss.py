"""Receivers: where the antennas are, how they move, and how the fixes err."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.motions import restless_loiter
from wildlab.simulation.gnss import PositionErrors, antenna_motion, position_fixes
from wildlab.simulation.trajectory import angular_rates, attitude_along

ARM = np.array([0.5, -0.2, -0.1])


def test_an_antennas_velocity_is_the_derivative_of_its_position():
    trajectory = restless_loiter()
    t, h = np.linspace(5, 500, 400), 1e-3

    def position(times):
        return antenna_motion(trajectory(times), angular_rates(attitude_along(trajectory), times), ARM)[0]

    motion = trajectory(t)
    p, v = antenna_motion(motion, angular_rates(attitude_along(trajectory), t), ARM)
    assert np.linalg.norm(p - motion.position, axis=1) == pytest.approx(np.linalg.norm(ARM), abs=1e-12)
    assert np.abs(v - motion.velocity).max() > 0.05  # the arm matters
    # Truncation: h^2/6 times the third derivative, 2 m/s^3 of the path and the arm times 3 rad/s^3.
    assert np.abs((position(t + h) - position(t - h)) / (2 * h) - v).max() < 2e-6


def test_fixes_scatter_about_the_truth_as_stated():
    runs, count = 300, 200
    true = np.tile([10.0, 20.0, -300.0], (count, 1))
    rng = np.random.default_rng(12)
    off = (
        np.array(
            [
                position_fixes(true, 0.5, PositionErrors((2.0, 3.0), 25.0, (0.5, 1.0)), rng)
                for _ in range(runs)
            ]
        )
        - true
    )
    variance = np.array([2.0**2 + 0.5**2] * 2 + [3.0**2 + 1.0**2])
    # 100 s hold two independent errors of the correlated kind (100 / 2 tau).
    assert (off**2).mean(axis=(0, 1)) == pytest.approx(variance, rel=5 * np.sqrt(2 / (2 * runs)))
    lag = 10  # 5 s
    together = (off[:, :-lag] * off[:, lag:]).mean(axis=(0, 1))
    expected = np.array([4.0, 4.0, 9.0]) * np.exp(-5 / 25)
    assert together == pytest.approx(expected, rel=5 * np.sqrt(2 / (2 * runs)))
    step = np.diff(off, axis=1).var(axis=(0, 1))
    jump = 2 * np.array([0.25, 0.25, 1.0]) + 2 * np.array([4.0, 4.0, 9.0]) * (1 - np.exp(-0.5 / 25))
    assert step == pytest.approx(jump, rel=0.03)
