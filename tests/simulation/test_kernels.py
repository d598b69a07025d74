"""Compiled functions against the same in numpy, where no other test would see a fault."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import matrix_to_quaternion
from wildlab.simulation import kernels
from wildlab.simulation.trajectory import Disturbance


def check_sum_of_sines(seed: int, times: np.ndarray, within: float) -> None:
    """A sum of sines and its first two derivatives (3, N)."""
    rng = np.random.default_rng(seed)
    a, w, phase = rng.normal(size=16), rng.uniform(0.01, 4.0, 16), rng.uniform(0, 2 * np.pi, 16)
    angles = np.outer(times, w) + phase
    expected = [np.sin(angles) @ a, np.cos(angles) @ (a * w), -np.sin(angles) @ (a * w * w)]
    found = Disturbance(a, w, phase)
    for derivative in range(3):
        np.testing.assert_allclose(found.with_derivatives(times)[derivative], expected[derivative], 0, within)
    np.testing.assert_allclose(found(times), expected[0], 0, within)


@given(st.integers(0, 999), st.floats(0, 5000), st.floats(1e-4, 1.0), st.integers(0, 400))
def test_in_equal_steps_a_sum_of_sines_is_the_plain_sum(seed, start, step, count):
    check_sum_of_sines(seed, start + step * np.arange(count), 1e-8)


@pytest.mark.parametrize("off", [1e-9, 1e-3])
def test_times_a_little_off_equal_steps_are_noticed(off):
    jumps = np.concatenate([np.arange(100) * 0.1, 9.9 + np.arange(1, 200) * 0.004, [11.0, 400.0]])
    for times in (jumps, 0.004 * np.arange(300) + off * np.random.default_rng(1).random(300)):
        check_sum_of_sines(1, times, 1e-10)


def test_quaternions_are_those_of_geometry(rng):
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3)[[0, 1, 2, 0]] * [[1.0], [1.0], [1.0], [0.999]])
    nearly = Rotation.from_rotvec(rng.choice([-3.1, 3.1, 1e-9], (300, 3)))
    R = np.concatenate(
        [Rotation.random(300, rng=rng).as_matrix(), half_turns.as_matrix(), nearly.as_matrix()]
    )
    found = np.empty((len(R), 4))
    kernels.quaternions(R, found)
    assert (found[:, 0] >= 0).all()
    # Of a half turn q and -q are the same, and rounding says which.
    expected = matrix_to_quaternion(R)
    sign = np.where(found[:, :1] < 1e-12, np.sign(np.sum(found * expected, axis=1, keepdims=True)), 1.0)
    np.testing.assert_allclose(sign * found, expected, rtol=0, atol=1e-12)
