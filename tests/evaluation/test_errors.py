"""Error summaries against closed forms and simulated truth."""

import numpy as np
import pytest

from wildlab.evaluation.errors import bootstrap_interval, summarise


def test_summary_of_a_known_set():
    errors = np.array([[3.0, 4.0], [0.0, 0.0], [-3.0, -4.0], [np.nan, 1.0]])
    s = summarise(errors)
    assert (s.n, s.max, s.median) == (3, 5.0, 5.0)
    assert s.mean == pytest.approx(10 / 3)
    assert (s.bias_north, s.bias_east) == (0.0, 0.0)
    assert (s.sd_north, s.sd_east) == pytest.approx((3.0, 4.0))


def test_bootstrap_by_image_is_wider_than_by_click_and_covers():
    """Clicks share their image's error: the interval must be that of 40 images, not of 400 clicks."""
    hits, trials = 0, 60
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        image = np.repeat(np.arange(40), 10)
        errors = rng.normal(0, 1, (40, 2))[image] + [0.5, 0]
        low, high = bootstrap_interval(lambda e: e[:, 0].mean(), errors, image, rng)
        hits += low <= 0.5 <= high
    # 90 % intervals over 60 trials: fewer than 45 hits has a chance below one in a thousand.
    assert hits >= 45
    assert high - low > 3 * 2 * 1.645 / np.sqrt(400) / 1.5
