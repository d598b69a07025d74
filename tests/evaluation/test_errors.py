"""Error summaries against closed forms and simulated truth."""

import warnings

import numpy as np
import pytest

from wildlab.evaluation.errors import bootstrap_interval, scatter_by_image, summarise


def test_summary_of_a_known_set():
    errors = np.array([[3.0, 4.0], [0.0, 0.0], [-3.0, -4.0], [np.nan, 1.0]])
    s = summarise(errors)
    assert (s.n, s.max, s.median) == (3, 5.0, 5.0)
    assert s.mean == pytest.approx(10 / 3)
    assert (s.bias_north, s.bias_east) == (0.0, 0.0)
    assert (s.sd_north, s.sd_east) == pytest.approx((3.0, 4.0))


def test_scatter_finds_what_was_put_in():
    rng = np.random.default_rng(0)
    image = np.repeat(np.arange(800), 4)
    errors = (
        np.array([1.0, -2.0])
        + rng.normal(0, [3.0, 1.5], (800, 2))[image]
        + rng.normal(0, [0.5, 1.0], (3200, 2))
    )
    scatter = scatter_by_image(errors, image)
    assert np.allclose(scatter.between_sd, [3.0, 1.5], rtol=0.08)
    assert np.allclose(scatter.within_sd, [0.5, 1.0], rtol=0.05)
    assert scatter.whole_m == pytest.approx(np.sqrt((errors**2).sum(axis=1).mean()))
    assert np.linalg.norm(scatter.parts_m) == pytest.approx(scatter.whole_m, rel=0.01)


def test_scatter_of_single_clicks_per_image_is_not_guessed():
    assert np.isnan(scatter_by_image(np.ones((5, 2)), np.arange(5)).whole_m)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(scatter_by_image(np.full((3, 2), np.nan), np.arange(3)).whole_m)
    errors = np.random.default_rng(1).normal(0, 1, (38, 2))
    for pairs, known in ((9, False), (10, True)):
        images = np.r_[np.arange(28), np.arange(pairs)]
        assert np.isfinite(scatter_by_image(errors[: len(images)], images).whole_m) == known


def test_bootstrap_by_image_is_wider_than_by_click_and_covers():
    """Clicks share their image's error: the interval must be that of 40 images, not of 400 clicks."""
    hits, trials = 0, 60
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        image = np.repeat(np.arange(40), 10)
        errors = rng.normal(0, 1, (40, 2))[image] + [0.5, 0]
        low, high = bootstrap_interval(lambda e: e[:, 0].mean(), errors, image, rng, draws=200)
        hits += low <= 0.5 <= high
    # 90 % intervals over 60 trials: fewer than 45 hits has a chance below one in a thousand.
    assert hits >= 45
    assert high - low > 3 * 2 * 1.645 / np.sqrt(400) / 1.5
