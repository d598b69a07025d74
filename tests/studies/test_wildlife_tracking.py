"""The study of animals that are followed: numbers counted by hand, and claims that turn with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.analysis.animal_trackers import (
    Found,
    Known,
    Patrolled,
    found_on_visits,
    next_lap,
    out_of_sight,
    sight_numbers,
    turns,
)
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, decide_check
from wildlab.planning.planner import SEARCH
from wildlab.studies.wildlife_tracking import (
    FILTERS,
    GONDOLA,
    KALMAN,
    NEGATIVE,
    POSITIVE,
    RATES,
    REVISITS,
    ROWS,
    UAV,
    Runs,
    all_runs,
)

N = 80


def spread_of(**changed: float) -> pd.DataFrame:
    """Worlds in which everything is as F has it; ``subject__name`` changes a number."""
    rng = np.random.default_rng(1)
    values: dict[tuple[str, str], np.ndarray] = {}

    def put(subject: str, name: str, value: float, noise: float = 0.0) -> None:
        values[subject, name] = value + noise * rng.standard_normal(N)

    for platform in (GONDOLA, UAV):
        put(platform, "in_view", 1.5)
        put(platform, "at_once", 0.02)
        put(platform, "by_fence_alone", 60.0)
        for number, one in enumerate(FILTERS):
            subject = f"{platform}-{one}"
            for name, value in (
                ("rmse", 20.0 + number), ("sd", 14.0 + number), ("anees", 4.0), ("sd_later", 40.0),
            ):  # fmt: skip
                put(subject, name, value, 0.05)
            put(subject, "later", 10.0)
            put(subject, "right", 4.0)
    for number, subject in enumerate((REVISITS, ROWS)):
        for name, value in (
            ("rmse", 12.0 + number), ("sd", 8.0 + number), ("minutes", 12.0 - number),
            ("visits", 6.0 - 6 * number),
            ("given_up", 0.0), ("turns", 9.0 - 9 * number), ("done", 1.0), ("animals_share", 0.96),
            ("fall", 0.2), ("grew", 1.0),
        ):  # fmt: skip
            put(subject, name, value)
    for key, number in changed.items():
        subject, name = key.split("__")
        values[subject.replace("_", "-"), name] = np.full(N, number)
    return pd.DataFrame(values)


def verdict(claim: str, threshold: float | None = None, **changed: float) -> str:
    return decide_check(checks_of("wildlife-tracking", spread_of(**changed))[claim], threshold).verdict


@pytest.mark.parametrize(
    ("claim", "threshold", "changed"),
    [
        ("falls-on-revisit", 0.5, {f"{REVISITS}__fall": 0.8}),
        ("grows-between", 0.9, {f"{REVISITS}__grew": 0.5}),
        ("particle-filter-performs-well", 0.5, {f"{UAV}-{NEGATIVE}__rmse": 50.0}),
        ("small-part-at-once", 0.1, {f"{UAV}__at_once": 0.3}),
        ("couple-of-seconds", 4.0, {f"{GONDOLA}__in_view": 9.0}),
        ("very-large-a-lap-later", 0.5, {f"{GONDOLA}-{NEGATIVE}__sd_later": 20.0}),
        ("hard-to-associate", 0.1, {f"{GONDOLA}-{NEGATIVE}__right": 10.0}),
        ("same-problem-uav", 0.1, {f"{UAV}-{NEGATIVE}__right": 10.0}),
        ("visits-keep-known", None, {f"{REVISITS}__rmse": 15.0}),
        ("negative-lowers-uncertainty-gondola", None, {f"{GONDOLA}-{NEGATIVE}__sd": 20.0}),
        ("negative-lowers-uncertainty-uav", None, {f"{UAV}-{NEGATIVE}__sd": 20.0}),
        ("negative-lowers-error-gondola", None, {f"{GONDOLA}-{NEGATIVE}__rmse": 30.0}),
        ("negative-lowers-error-uav", None, {f"{UAV}-{NEGATIVE}__rmse": 30.0}),
        ("closer-than-kalman-gondola", None, {f"{GONDOLA}-{KALMAN}__rmse": 10.0}),
        ("closer-than-kalman-uav", None, {f"{UAV}-{KALMAN}__rmse": 10.0}),
    ],
)
def test_each_claim_turns_with_its_number(claim, threshold, changed):
    assert verdict(claim, threshold) == HOLDS
    assert verdict(claim, threshold, **changed) == FAILS


@pytest.mark.parametrize(("cost", "verdict"), [(9.0, HOLDS), (0.5, FAILS)])
def test_the_cost_decides_its_claim(cost, verdict):
    checks = checks_of("wildlife-tracking", spread_of(), {"cost": np.full(N, cost)})
    assert decide_check(checks["dearer-than-ekf"], 1.0).verdict == verdict
    assert "dearer-than-ekf" not in checks_of("wildlife-tracking", spread_of())


def test_worlds_without_a_number_count_neither_way():
    spread = spread_of()
    spread.loc[: N // 4, (f"{UAV}-{NEGATIVE}", "sd")] = np.nan
    spread.loc[: N // 4, (REVISITS, "fall")] = np.nan
    checks = checks_of("wildlife-tracking", spread)
    for claim, threshold in (("negative-lowers-uncertainty-uav", None), ("falls-on-revisit", 0.5)):
        decision = decide_check(checks[claim], threshold)
        assert decision.verdict == HOLDS and decision.met == N - N // 4 - 1


@pytest.mark.parametrize(("wrong", "of", "holds"), [(5, 15, True), (1, 10, False), (2, 100, False)])
def test_animals_seen_again_are_counted_of_all_worlds_together(wrong, of, holds):
    one = {f"{UAV}-{NEGATIVE}__later": of / N, f"{UAV}-{NEGATIVE}__right": (of - wrong) / N}
    checks = checks_of("wildlife-tracking", spread_of(**one))
    share = share_interval(wrong, of)
    decided = decide_check(checks["same-problem-uav"], 0.1).verdict
    assert (decided == HOLDS) == (share.low > 0.1) == holds
    assert (decided == FAILS) == (share.high <= 0.1)


def found(image: int, animal: int, track: int, **other: float) -> Found:
    base = {
        "before": np.nan,
        "after": 1.0,
        "after_last": np.nan,
        "own_before": np.nan,
        "own": 0,
        "away": np.inf,
    }
    return Found(image, animal, track, **(base | other))  # type: ignore[arg-type]


def test_out_of_sight_counts_by_hand():
    times = np.arange(0.0, 100.0, 10.0)
    truth = np.zeros((10, 2, 2))
    truth[:, 1] = [100.0, 0.0]
    # Animal 0 is seen at 0 s, animal 1 at 20 s; then animal 1 takes the track of animal 0 at 70 s.
    log = [found(0, 0, 1), found(2, 1, 2), found(7, 1, 1, before=9.0, after=2.0, own=2, away=50.0)]
    names, P = np.array([1, 2]), np.array([np.diag([4.0, 1.0]), 9 * np.eye(2)])
    known = [Known(k, names, np.array([[2.0, 1.0], [103.0, 0.0]]), P) for k in (3, 5, 6, 8)]
    away = out_of_sight(known, log, times, truth)
    # At 30 s none is out of sight for more than 30 s; at 50 s animal 0 is, at 60 s both, at 80 s animal 0.
    assert away.off.tolist() == [[2, 1], [2, 1], [3, 0], [2, 1]]
    assert away.nees == pytest.approx([2.0, 2.0, 1.0, 2.0])
    assert away.own.tolist() == [True, True, True, False]
    numbers = sight_numbers(away)
    assert numbers["rmse"] == pytest.approx(np.sqrt((5 + 5 + 9 + 5) / 4))
    assert numbers["sd"] == pytest.approx(np.sqrt((5 + 5 + 18 + 5) / 8))
    # Animal 1 counts up to 50 s, animal 0 up to 60 s.
    assert out_of_sight(known, log, times, truth, [60.0, 50.0]).off.tolist() == [[2, 1], [2, 1]]
    assert np.isnan(sight_numbers(out_of_sight(known, log, times, truth, 10.0))["rmse"])


def test_the_next_lap_takes_each_animal_once():
    times = np.arange(0.0, 100.0, 10.0)
    log = [
        found(0, 0, 1), found(1, 1, 2), found(4, 0, 1, own=1, away=40.0),
        found(6, 0, 3, own=1, away=20.0), found(7, 2, 4), found(8, 0, 3, own=3, away=20.0),
        found(9, 1, 2, own=2, away=80.0),
    ]  # fmt: skip
    back = next_lap(log, times, 50.0)
    # Animal 2 was not detected in the first lap; animal 0 comes back at 60 s, to another track.
    assert [(one.animal, one.image, one.track == one.own) for one in back] == [(0, 6, False), (1, 9, True)]


def test_a_visit_is_one_that_found_its_animal():
    goal = np.array([SEARCH, 4, 4, SEARCH, 7, 7, 5])
    log = [
        found(2, 0, 4, own=4, away=60.0), found(3, 1, 9, own=9, away=60.0), found(5, 2, 7, own=6, away=60.0),
        found(6, 3, 5, own=5, away=5.0),
    ]  # fmt: skip
    flown = Patrolled(np.arange(7.0), np.zeros((7, 3)), goal, [], log, [], np.array([np.inf]))
    assert [one.track for one in found_on_visits(flown)] == [4]
    assert turns(flown) == 3


@pytest.fixture(scope="module")
def runs() -> tuple[Runs, dict[tuple[str, str], float]]:
    """With a third of the study's images a second."""
    with pytest.MonkeyPatch.context() as patch:
        for platform, rate in list(RATES.items()):
            patch.setitem(RATES, platform, rate / 3)
        return all_runs(5, "gondola", "uav-tracking")


@pytest.mark.slow
def test_a_world_follows_as_it_should(runs):
    done, numbers = runs
    # The Kalman filter of animals that are never mixed up: its covariance is that of their walk.
    images, kalman = done.worlds[UAV].images, done.followed[UAV, KALMAN]
    away = out_of_sight(kalman.known, kalman.found, images.times, images.truth)
    assert away.nees[away.own].mean() == pytest.approx(2.0, abs=0.7)
    for (platform, _), one in done.followed.items():
        images = done.worlds[platform].images
        assert len(one.found) == np.isfinite(images.z).all(axis=1).sum()
        assert {f.animal for f in one.found} <= set(range(images.truth.shape[1]))
    looks = {one: done.followed[UAV, one].steps for one in FILTERS}
    assert looks[POSITIVE] == looks[KALMAN] < looks[NEGATIVE]
    assert numbers[REVISITS, "visits"] > 0 == numbers[ROWS, "visits"]


def test_a_false_detection_is_no_sighting_and_mixes_a_track():
    truth, times = np.zeros((4, 2, 2)), np.arange(4) * 20.0
    one = Known(3, np.array([1, 2]), np.array([[3.0, 4.0], [9.0, 9.0]]), np.tile(np.eye(2), (2, 1, 1)))
    seen = [found(0, 1, 1), found(2, -1, 2)]
    away = out_of_sight([one], seen, times, truth)
    # The last animal, seen 60 s ago, keeps its own track, though nobody's was detected 20 s ago.
    np.testing.assert_array_equal(away.off, [[3.0, 4.0]])
    assert away.own.tolist() == [True]
    mixed = out_of_sight([one], [*seen[:1], found(1, -1, 1, own=0)], times, truth)
    assert mixed.own.tolist() == [False]
