"""Starts whose covariance is that of their errors, and rays that do not meet."""

import numpy as np
import pytest
from scipy.stats import chi2

from tests.tracking.level_sensors import bearings
from wildlab.errors import WildlabError
from wildlab.tracking.initiation import start_from_rays
from wildlab.tracking.sensors import positions

RUNS = 200


@pytest.mark.slow
def test_start_from_bearings_alone():
    """A platform goes by a target that moves as it is supposed to."""
    rng, sd_velocity, sd = np.random.default_rng(4), 0.2, 0.003
    times = np.arange(40.0)
    platform = np.column_stack([5 * times - 50, np.zeros(40)])
    squares = []
    for _ in range(RUNS):
        v = rng.normal(0, sd_velocity, 2)
        truth = np.column_stack([np.tile([60.0, 180.0], (40, 1)) + np.outer(times, v), np.tile(v, (40, 1))])
        offset = truth[:, :2] - platform
        z = (np.arctan2(offset[:, 1], offset[:, 0]) + sd * rng.normal(size=40))[:, None]
        start = start_from_rays(
            times, z, [[sd**2]], bearings(platform, 0.0), sd_velocity=sd_velocity, least_crossing=0.6
        )
        assert 10 < start.row < 39 and start.time == times[start.row]
        e = truth[start.row] - start.x
        squares.append(e @ np.linalg.solve(start.P, e))
    low, high = chi2.ppf([0.025, 0.975], 4 * RUNS) / RUNS
    assert low < np.mean(squares) < high


def test_rays_of_a_target_at_rest_meet_exactly():
    """Two rays at right angles: across each, its own error times its length."""
    sensor = bearings(np.array([[0.0, 0.0], [100.0, -50.0]]), 0.0)
    start = start_from_rays([0.0, 1.0], [[0.0], [np.pi / 2]], [[[1e-4]], [[4e-4]]], sensor, sd_velocity=0.0)
    np.testing.assert_allclose(start.x, [100.0, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(start.P[:2, :2], np.diag([(50 * 0.02) ** 2, (100 * 0.01) ** 2]), atol=1e-9)
    assert start.row == 1 and not start.P[2:].any()


FIXED, TIMES, SEEN = bearings([0.0, 0.0], 0.0), [0.0, 1.0, 2.0], [[0.1], [0.1], [0.1]]


@pytest.mark.parametrize(
    ("seen", "R", "sensor", "words"),
    [
        (SEEN, [[1e-4]], FIXED, "parallel"),
        ([[0.1], [np.nan], [np.nan]], [[1e-4]], FIXED, "1 ray"),
        (np.full((3, 1), np.nan), [[1e-4]], FIXED, "0 rays"),
        (np.zeros((3, 2)), np.eye(2), positions(), "no rays"),
    ],
)
def test_what_cannot_be_a_start_is_said(seen, R, sensor, words):
    with pytest.raises(WildlabError, match=words):
        start_from_rays(TIMES, seen, R, sensor, sd_velocity=1.0)
