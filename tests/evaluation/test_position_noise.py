"""The noise of logged positions from themselves: known answers, and what it cannot see."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.evaluation.pose_noise import estimate_position_noise


def boat(t: np.ndarray) -> np.ndarray:
    """A circle of 60 m at 3 m/s."""
    return 60 * np.stack([np.cos(t / 20), np.sin(t / 20)], axis=1)


@pytest.mark.parametrize("sd", [0.02, 0.5])
def test_white_noise_is_found_on_a_turning_boat_with_uneven_stamps(sd):
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.choice([0.04, 0.08, 0.12], 2000))
    found = estimate_position_noise(t, boat(t) + rng.normal(0, [sd, 2 * sd], (2000, 2)))
    # Residuals share three of four samples: as if there were half as many.
    assert found == pytest.approx([sd, 2 * sd], rel=4 / np.sqrt(1000))


def test_rounded_positions_are_wrong_by_the_step_over_the_root_of_twelve():
    t = np.arange(0, 200, 0.2)
    assert estimate_position_noise(t, np.round(boat(t) / 0.1) * 0.1) == pytest.approx(
        [0.1 / np.sqrt(12)] * 2, rel=0.1
    )


def test_of_what_wanders_only_the_part_between_samples_is_seen():
    """White 0.1 m and a metre that wanders over a minute, 5 Hz: the metre is left out, by its closed form."""
    rng, left = np.random.default_rng(2), np.exp(-0.2 / 60)
    wander = [rng.normal(size=2)]
    for _ in range(4999):
        wander.append(left * wander[-1] + np.sqrt(1 - left**2) * rng.normal(size=2))
    t = 0.2 * np.arange(5000)
    found = estimate_position_noise(t, boat(t) + np.array(wander) + rng.normal(0, 0.1, (5000, 2)))
    w = np.array([1, -3, 3, -1]) / np.sqrt(20)
    lag = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
    assert found == pytest.approx([np.sqrt(0.1**2 + w @ left**lag @ w)] * 2, rel=0.06)
    assert (found < 0.2).all()
    assert estimate_position_noise(t, boat(t) + 5.0) == pytest.approx(estimate_position_noise(t, boat(t)))


def test_gaps_repeated_stamps_and_missing_rows_are_left_out():
    rng = np.random.default_rng(3)
    t = np.r_[np.arange(0, 40, 0.2), np.arange(300, 340, 0.2)]
    z = boat(t) + rng.normal(0, 0.1, (len(t), 2))
    plain = estimate_position_noise(t, z)
    assert plain == pytest.approx([0.1, 0.1], rel=0.25)
    twice = np.repeat(np.arange(len(t)), 2)
    missing = np.where(np.arange(len(twice))[:, None] % 2, np.nan, z[twice])
    assert np.allclose(estimate_position_noise(t[twice], z[twice]), plain)
    assert np.allclose(estimate_position_noise(t[twice], missing), plain)
    for few in (t[:0], t[:3], 100.0 * np.arange(3)):
        assert np.isnan(estimate_position_noise(few, z[: len(few)])).all()
