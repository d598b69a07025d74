"""A sharp detection at the edge of a wide cloud: what is left is a cloud, not a point."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.tracking.particles import (
    Look,
    Rules,
    effective_size,
    moments,
    move,
    no_herd,
    step_nearest,
    walk_of,
)

R = 0.04 * np.eye(2)


def nothing(places: np.ndarray) -> np.ndarray:
    return np.zeros(places.shape[:-1])


def rules(particles: int = 500) -> Rules:
    walk = walk_of(0.5, 1.0)
    return Rules(
        lambda cloud, seen, dt, rng: move(cloud, walk, dt, rng), particles, 0.999, scheme="systematic"
    )


def test_it_is_what_a_kalman_filter_would_have() -> None:
    off, covariances, means = 20.0, [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        herd, _ = step_nearest(no_herd(rules()), Look(0.0, np.zeros((1, 2)), R[None], nothing), rules(), rng)
        # 1600 s later an animal may be 20 m off each way: of 500 particles hardly one is as near as 0.2 m.
        found = Look(1600.0, np.array([[off, 0.0]]), R[None], nothing)
        herd, names = step_nearest(herd, found, rules(), rng)
        assert names.tolist() == [1]
        mean, covariance = moments(herd.cloud)
        means.append(mean[0])
        covariances.append(covariance[0])
    gain = 400.04 / 400.08
    assert np.mean(means, axis=0) == pytest.approx([gain * off, 0.0], abs=0.1)
    assert np.mean(covariances, axis=0) == pytest.approx(gain * R, abs=0.004)
    assert min(np.linalg.eigvalsh(one).min() for one in covariances) > 0.02


def test_a_handful_of_particles_is_not_taken_for_what_is_known() -> None:
    """Of n points drawn from a distribution the variance about their own mean is 1 - 1/n of its own.

    After 32 s an animal may be sqrt(8) m off: of 500 particles the detection leaves 2 * 500 * 0.04 / 8 = 5.
    """
    covariances = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        herd, _ = step_nearest(no_herd(rules()), Look(0.0, np.zeros((1, 2)), R[None], nothing), rules(), rng)
        herd, _ = step_nearest(herd, Look(32.0, np.zeros((1, 2)), R[None], nothing), rules(), rng)
        covariances.append(moments(herd.cloud)[1][0])
    assert np.trace(np.mean(covariances, axis=0)) == pytest.approx(2 * 0.04 * 8.04 / 8.08, rel=0.05)


def test_a_cloud_with_particles_enough_stays_its_own() -> None:
    rng = np.random.default_rng(3)
    wide = 4.0 * np.eye(2)
    herd, _ = step_nearest(no_herd(rules()), Look(0.0, np.zeros((1, 2)), wide[None], nothing), rules(), rng)
    before = herd.cloud.x.copy()
    herd, _ = step_nearest(herd, Look(0.0, np.array([[1.0, 0.0]]), wide[None], nothing), rules(), rng)
    # No time has passed: what is left of it are its own particles.
    assert np.isin(herd.cloud.x[0, :, 0], before[0, :, 0]).all()
    assert effective_size(herd.cloud.w)[0] > 100
