"""The operator's view: moments by hand-made counts, tracks by closed forms, claims by opposed numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.evaluation.shares import Check
from wildlab.flight.store import Flight
from wildlab.replay.scene import Points
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.replay import (
    CLOCK,
    EVERY_S,
    NONE,
    OFF_S,
    ONE,
    SINGLE,
    STEP_S,
    WALK,
    Moments,
    clock_errors,
    moments_of,
    off_of,
    track_targets,
)


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1)


def test_captions_are_read_as_counts():
    rows = [  # in view, detected, running, right: which screenshot
        (1, 1, 3, True, {ONE, SINGLE}),
        (1, 1, 1, True, {SINGLE}),
        (1, 1, 3, False, {SINGLE}),
        (2, 1, 3, False, {SINGLE}),
        (0, 0, 2, True, {NONE}),
        (0, 0, 1, True, set()),
        (0, 1, 5, False, {SINGLE}),
        (1, 0, 5, False, set()),
    ]
    columns = [np.array([row[k] for row in rows]) for k in range(4)]
    moments = Moments(np.arange(len(rows), dtype=float), *columns)  # type: ignore[arg-type]
    for kind in (ONE, SINGLE, NONE):
        assert moments.of(kind).tolist() == [kind in row[4] for row in rows]


def test_what_is_detected_was_in_view_and_tracks_never_end():
    two = simulate_twin("crossing-vessels", 1, ("imu", "gnss"))
    moments = moments_of(two)
    seen = moments.detected > 0
    # But for vessels that the image's edge cuts: their middle lies outside.
    assert (moments.in_view[seen] >= 1).mean() > 0.95
    assert (np.diff(moments.running) >= 0).all() and moments.running[-1] == 2
    assert moments.running[np.flatnonzero(seen)[0]] >= 1
    assert (np.diff(moments.times) >= 0).all()
    away = two.table("truth").assign(north_m=1e5)
    moved = moments_of(replace(two, tables=two.tables | {"truth": away}))
    assert moved.in_view.max() == 0 and not moved.of(ONE).any()


def test_a_clock_is_set_to_the_nearest_step(ship):
    assert {abs(off_of(seed)) <= OFF_S for seed in range(30)} == {True}
    assert len({off_of(seed) for seed in range(30)}) == 30
    # A whole number of steps is taken off whole.
    right = clock_errors(ship, 0.0)[0]
    unset, after = clock_errors(ship, 8 * STEP_S)
    assert after == pytest.approx(right) and unset != pytest.approx(right)


def test_a_track_is_the_mean_of_what_was_seen_and_spreads_as_a_walk_does(ship):
    R = np.tile(9.0 * np.eye(2), (3, 1, 1))
    places = np.array([[0.0, 0.0, -1.0], [4.0, -2.0, -1.0], [2.0, 2.0, -1.0]])
    nan = np.full(3, np.nan)
    names = np.array(["a", "a", "b"], object)
    points = Points(np.array([10.0, 10.0, 12.0]), places, R, names, nan, nan)
    first, second = track_targets(replace(ship, tables={}), points, 0.0, 50.0)
    assert (first.target, second.target) == ("a", "b")
    assert first.times[0] == 10.0 and first.times[-1] == pytest.approx(50.0, abs=EVERY_S)
    assert first.places[-1, :2] == pytest.approx([4 / 2, -2 / 2])
    # Two sightings at once are worth twice one; then the walk alone.
    spread = first.covariance[:, 0, 0]
    assert spread[0] == pytest.approx(9.0 / 2)
    assert np.diff(spread) == pytest.approx(WALK * np.diff(first.times))
    assert second.covariance[-1, 1, 1] == pytest.approx(9.0 + WALK * (second.times[-1] - 12.0))
    assert np.isnan(first.nees).all()


def spread_of(gain: float, kinds: dict[str, float]) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    unset = 4.0 + rng.normal(0, 0.1, 12)
    columns = {(CLOCK, "error_unset"): unset, (CLOCK, "error_set"): unset - gain - rng.normal(0, 0.01, 12)}
    return pd.DataFrame(columns | {(kind, "share_of_frames"): np.full(12, v) for kind, v in kinds.items()})


def test_claims_follow_the_numbers():
    all_there = {ONE: 0.1, SINGLE: 0.2, NONE: 0.7}
    checks = checks_of("replay", spread_of(0.5, all_there | {NONE: 0.0}))
    truths = {id: bool(np.all(check.true)) for id, check in checks.items() if isinstance(check, Check)}
    assert truths == {
        "one-of-several-in-view": True,
        "one-detected": True,
        "none-in-view-several-tracks": False,
        "manual-sync-increases-precision": True,
    }
    assert not np.any(checks_of("replay", spread_of(-0.5, all_there))["manual-sync-increases-precision"].true)
