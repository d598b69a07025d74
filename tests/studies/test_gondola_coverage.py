"""What the study of a gondola's camera computes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, said
from wildlab.analysis.plan_coverage import as_planned
from wildlab.evaluation.shares import HOLDS, decide_check
from wildlab.simulation.parameters import load_twin
from wildlab.studies.gondola_coverage import (
    ADAPT,
    DOWN,
    ROLL,
    STRATEGIES,
    YAW,
    angles_of,
    near_cable,
    poses_of,
    ride,
)
from wildlab.studies.uav_coverage import LOOKS, fences_of, land_of


def made_up(count: int = 40, **changes: float) -> pd.DataFrame:
    """Draws that are all the same, in which every claim is true, with some numbers changed."""
    usual = {
        "seen": 0.3, "near": 0.5, "in_sight": 2.0, "ground": 1e5, "outside": 6e4
    }  # fmt: skip
    row = {(name, key): value for name in STRATEGIES for key, value in usual.items()}
    for k, name in enumerate((DOWN, *ROLL)):
        row[name, "seen"] = 0.1 + 0.05 * k
    for name in ADAPT:
        row |= {(name, "outside"): 2e4, (name, "seen"): 0.35}
    row |= {(name, "near"): 0.8 for name in YAW}
    row |= {
        (DOWN, "in_sight"): 4.0,
        (DOWN, "ground"): 1e4,
        (DOWN, "outside"): 5e3,
    }
    row |= {tuple(key.split("/", 1)): value for key, value in changes.items()}  # type: ignore[misc]
    return pd.DataFrame([row] * count)


def test_the_cabin_hangs_as_high_as_printed():
    land = land_of(2)
    there = ride(load_twin("gondola"), land, 1.0, 1.0)
    above = -there.places[:, 2] - land.heights_at(there.places[:, :2])
    assert above.min() == pytest.approx(3.0, abs=0.1) and above.max() == pytest.approx(20.0, abs=0.1)
    assert there.times[-1] == pytest.approx(1800, rel=0.03)  # F 7.5.2: about thirty minutes
    # What is near is a band of 30 m along 2.7 km, its ends and bends aside.
    assert near_cable(land, there).sum() * 4.0 == pytest.approx(30 * 1.5 * there.times[-1], rel=0.03)


def test_the_adaptive_camera_turns_round_earlier_outside_than_inside():
    twin, land = load_twin("gondola"), land_of(2)
    there = ride(twin, land, 5.0, 0.2)
    fences = fences_of(twin, 5)
    roll = np.degrees(angles_of("adaptive-75", twin, land, fences, there, 0.0).roll)
    nowhere = [np.array([[900.0, 900.0], [901.0, 900.0], [901.0, 901.0]])]
    outside = np.degrees(angles_of("adaptive-75", twin, land, nowhere, there, 0.0).roll)
    # It overshoots by what it turns between two decisions, 40 degrees a second: not by what it turns between
    # two images.
    assert 15 < np.abs(outside).max() < 15 + 2 and np.abs(roll).max() > 60
    begun = [angles_of("adaptive-75", twin, land, nowhere, there, one).roll[0] for one in (0.0, 0.25, 0.6)]
    assert np.degrees(begun) == pytest.approx([0.0, 15.0, -6.0])


def test_what_the_adaptive_camera_does_and_sees_hardly_hangs_on_the_rate_of_images():
    twin, land = load_twin("gondola"), land_of(2)
    fences = fences_of(twin, 5)
    rides = [ride(twin, land, rate, 0.1) for rate in (5.0, 6.0)]
    rolls = [angles_of("adaptive-60", twin, land, fences, one, 0.3).roll for one in rides]
    count = int(rides[0].times[-1])
    assert rolls[0][: 5 * count : 5] == pytest.approx(rolls[1][: 6 * count : 6], abs=1e-9)
    seen = []
    for one in rides:
        poses = poses_of("adaptive-60", twin, land, fences, one, 2)
        seen.append(as_planned(land, poses, one.times, LOOKS).seen.sum())
    assert seen[0] == pytest.approx(seen[1], rel=0.03)


def test_claims_are_those_published_and_turn_with_the_numbers():
    assert all(map(all, said("gondola-coverage", checks_of("gondola-coverage", made_up())).values()))
    steepest, *_, flattest = YAW
    opposed = {
        "adaptive-least-outside": {"adaptive-75/outside": 7e4},
        "adaptive-sees-more": {"adaptive-60/seen": 0.1},
        "yaw-best-near-the-track": {f"{flattest}/near": 0.4},
        "yaw-best-near-the-track-at-some-pitch": {f"{name}/near": 0.4 for name in YAW},
        "larger-rotations-needed": {"roll-60/seen": 0.05},
        "moving-more-less-redundant": {"roll-60/in_sight": 5.0},
    }
    for claim, change in opposed.items():
        checks = checks_of("gondola-coverage", made_up(**change))
        assert not any(said("gondola-coverage", checks)[claim]), claim
    # One pitch that is not best near the cable leaves the best of them.
    checks = checks_of("gondola-coverage", made_up(**{f"{steepest}/near": 0.4}))
    assert decide_check(checks["yaw-best-near-the-track-at-some-pitch"]).verdict == HOLDS
