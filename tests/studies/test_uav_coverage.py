"""What the study of rows over enclosures computes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, said
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import FAILS, NO_PREMISE, decide_check
from wildlab.planning.coverage import nodes_in
from wildlab.simulation.parameters import load_twin
from wildlab.studies.uav_coverage import (
    CASES,
    DOWN,
    LOW,
    LOW_CLOSE,
    LOW_FASTER,
    MORE,
    SPACINGS,
    YAW,
    Case,
    fences_of,
    land_of,
    plan,
    required,
    trial,
)


@pytest.fixture(scope="module")
def draws() -> pd.DataFrame:
    return pd.DataFrame([trial(seed, twin="uav-search", fields=1, rate=1) for seed in (1, 2)])


def made_up(count: int = 40, **changes: float) -> pd.DataFrame:
    """Draws that are all the same, in which every claim is true, with some numbers changed."""
    usual = {
        "seen": 0.9, "in_sight": 5.0, "ground": 1e5, "outside": 2e4, "time": 1000.0
    }  # fmt: skip
    row = {(name, key): value for name in CASES | MORE for key, value in usual.items()}
    row |= {(YAW, "seen"): 0.94, (YAW, "ground"): 1.5e5, (YAW, "in_sight"): 4.0, (LOW, "seen"): 0.8}
    row |= {(LOW_CLOSE, "seen"): 0.97, (DOWN, "in_view"): 1.0}
    for k, spacing in enumerate(SPACINGS):
        row |= {
            (f"rows-{spacing:.0f}m", "time"): 1000.0 - 100 * k,
            (f"rows-{spacing:.0f}m", "missed"): 0.1 * k,
            (f"rows-{spacing:.0f}m", "missed_still"): 0.05 * k,
            (f"rows-{spacing:.0f}m", "unseen"): 0.05 * k,
        }
    row |= {tuple(key.split("/", 1)): value for key, value in changes.items()}  # type: ignore[misc]
    return pd.DataFrame([row] * count)


def test_numbers_agree_with_one_another(draws):
    fence = nodes_in(land_of(1), fences_of(load_twin("uav-search"), 1)) >= 0
    area = fence.sum() * 4.0
    for name in CASES | MORE:
        inside = draws[name, "ground"] - draws[name, "outside"]
        assert np.allclose(inside, draws[name, "seen"] * area)
    assert (draws[YAW, "ground"] > draws[DOWN, "ground"]).all()
    assert (draws[LOW_CLOSE, "time"] > 1.8 * draws[LOW, "time"]).all()


def test_the_platform_keeps_its_height_above_ground():
    twin, land = load_twin("uav-search"), land_of(3)
    flown = plan(twin, land, Case(60.0, 25.0, False), 1, 1.0)
    above = -flown.poses.p_nc[:, 2] - land.heights_at(flown.poses.p_nc[:, :2])
    # Between two points of the profile the way is straight, and the ground is not.
    assert above.min() > 59.0 and np.median(above) < 65


def test_claims_are_those_published_and_turn_with_the_numbers():
    assert all(map(all, said("uav-coverage", checks_of("uav-coverage", made_up())).values()))
    opposed = {
        "yaw-covers-more": {f"{YAW}/ground": 1.05e5},
        "yaw-covers-more-inside": {f"{YAW}/seen": 0.905},
        "no-large-rotations": {f"{YAW}/seen": 0.98},
        "moving-more-less-redundant": {f"{YAW}/in_sight": 6.0},
        "lower-needs-closer": {f"{LOW}/seen": 0.97},
        "lower-needs-closer-or-faster": {f"{LOW_FASTER}/seen": 0.97},
        "convex-covered": {f"{DOWN}/in_view": 0.99},
        "distance-time-missed": {f"rows-{SPACINGS[-1]:.0f}m/missed": 0.0},
        "distance-missed-by-moving": {f"rows-{SPACINGS[-1]:.0f}m/missed_still": 0.25},
        "too-wide-not-whole": {f"rows-{SPACINGS[-1]:.0f}m/unseen": 0.005},
    }
    for claim, change in opposed.items():
        assert not any(said("uav-coverage", checks_of("uav-coverage", made_up(**change)))[claim]), claim
    # Where rows leave nothing unseen, yaw has nothing to add within the enclosures.
    check = checks_of("uav-coverage", made_up(**{f"{DOWN}/seen": 0.999}))["yaw-covers-more-inside"]
    assert decide_check(check, 0.1).verdict == NO_PREMISE


def test_closer_rows_that_do_not_help_are_no_proof():
    check = checks_of("uav-coverage", made_up(**{f"{LOW_CLOSE}/seen": 0.82}))["lower-needs-closer"]
    assert decide_check(check, 0.02).verdict == FAILS


def test_animals_that_stand_are_missed_where_no_image_shows_the_ground(draws):
    for spacing in SPACINGS:
        still, unseen = (draws[f"rows-{spacing:.0f}m", name] for name in ("missed_still", "unseen"))
        # 60 animals: three standard deviations of their share.
        assert (np.abs(still - unseen) < 3 * np.sqrt(unseen * (1 - unseen) / 60) + 0.02).all()
    first, last = (f"rows-{one:.0f}m" for one in (SPACINGS[0], SPACINGS[-1]))
    assert (draws[last, "unseen"] > draws[first, "unseen"]).all()
    assert (draws[last, "missed"] != draws[last, "missed_still"]).any()


def test_a_twin_without_a_survey_is_refused():
    with pytest.raises(WildlabError, match="twin"):
        required(None, "survey")
