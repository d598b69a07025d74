"""Attitudes between two others: what must hold of any turn."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import between_attitudes


def attitudes(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 4)) * rng.uniform(0.1, 10.0, (count, 1))


def some_rows(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed + 1)
    return rng.integers(0, count, 200), rng.integers(0, count, 200), rng.uniform(0, 1, 200)


@given(st.floats(1e-16, 1e-3), st.floats(0, 1))
def test_small_turns_keep_their_digits(angle, share):
    ends = Rotation.from_rotvec([[0.3, -0.2, 0.9], [0.3, -0.2, 0.9]])
    ends = ends * Rotation.from_rotvec([[0.0, 0.0, 0.0], [angle, 0.0, 0.0]])
    q = ends.as_quat(scalar_first=True)
    R = between_attitudes(q, np.array([0]), np.array([1]), np.array([share]))[0]
    turned = (ends[0].inv() * Rotation.from_matrix(R)).as_rotvec()
    # Rounding alone: a few products of matrices, each with the last place of a number near one.
    assert np.abs(turned - [share * angle, 0.0, 0.0]).max() < 8 * np.finfo(float).eps


def test_a_quaternion_and_its_negative_are_the_same_attitude():
    q, (before, after, share) = attitudes(30, 5), some_rows(30, 5)
    turned = q * np.where(np.arange(30) % 2, -1.0, 1.0)[:, None]
    same = between_attitudes(q, before, after, share) - between_attitudes(turned, before, after, share)
    assert np.abs(same).max() < 1e-12


def test_what_is_not_known_is_nan_in_its_row():
    q = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [np.nan, 0, 0, 0], [0, 0, 0, 0.0], [np.inf, 0, 0, 0]])
    before, after = np.array([0, 0, 2, 3, 0, 4, 0]), np.array([0, 2, 0, 0, 1, 0, 1])
    R = between_attitudes(q, before, after, np.array([0.5, 0.5, 0.5, 0.5, np.nan, 0.5, 1.0]))
    assert np.isnan(R).all(axis=(1, 2)).tolist() == [False, True, True, True, True, True, False]
    assert np.isfinite(R[[0, 6]]).all()
