"""The Schmidt filter against the extended one: what each subject is, the claims' logic, whole flights."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.pipeline.track import Sighting
from wildlab.reporting.published import load_claims, load_published
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.schmidt.trial import (
    BOUNDS,
    NAMES,
    SUBJECTS,
    check_claims,
    compare,
    inside,
    navigated_sighting,
    only,
    trial,
)

STUDIES = ("schmidt-fast-vessel", "schmidt-slow-vessel-eight", "schmidt-drifting-vessel-eight")


@pytest.fixture(scope="module")
def seen() -> Sighting:
    return navigated_sighting(simulate_twin("fast-vessel", 3))


def test_the_other_block_is_zero_and_this_one_kept() -> None:
    A = np.random.default_rng(0).normal(size=(5, 6, 6))
    P = A @ np.swapaxes(A, 1, 2)
    before = P.copy()
    attitude, position = only(P, attitude=True), only(P, attitude=False)
    np.testing.assert_array_equal(attitude[:, 3:, 3:], P[:, 3:, 3:])
    np.testing.assert_array_equal(position[:, :3, :3], P[:, :3, :3])
    assert not attitude[:, :3].any() and not attitude[:, :, :3].any()
    assert not position[:, 3:].any() and not position[:, :, 3:].any()
    np.testing.assert_array_equal(P, before)


def test_an_average_at_the_bounds_is_inside_and_an_unknown_one_is_not() -> None:
    values = [BOUNDS[0], BOUNDS[1], np.nextafter(BOUNDS[1], 9), 0.0, np.nan]
    assert inside(values).tolist() == [True, True, False, False, False]
    assert pytest.approx((0.0506, 7.38), rel=1e-3) == BOUNDS


def flight_with(**changed: float) -> dict[tuple[str, str], float]:
    """Like the tables of H 7.5: every claim true, but those of the drifting vessel's NIS."""
    row = {(who, name): 1.0 for who in SUBJECTS for name in NAMES}
    row |= {
        ("ekf", "nees"): 17.8,
        ("ekf", "nees_predicted"): 18.0,
        ("ekf", "mae"): 15.0,
        ("schmidt", "mae"): 8.8,
        ("ekf", "rmse_speed"): 1.1,
        ("ekf", "rmse_course"): 1.1,
        ("ekf", "nis"): 1.1,
        ("ekf", "fraction_nees_inside"): 0.05,
        ("schmidt-position-only", "nees"): 17.0,
    }
    return row | {tuple(key.split("__")): value for key, value in changed.items()}  # type: ignore[misc]


@pytest.mark.parametrize(
    ("changed", "lost"),
    [
        ({}, set()),
        ({"schmidt__nees": 7.5}, {"schmidt-nees-inside", "schmidt-pessimistic"}),
        ({"ekf__nees": 7.3}, {"ekf-nees-above", "ekf-needs-more-noise"}),
        ({"ekf__nees_predicted": 7.3}, {"ekf-overconfident-between"}),
        ({"schmidt__fraction_nees_inside": 0.5}, {"schmidt-inside-mostly"}),
        ({"ekf__fraction_nees_inside": 0.1}, {"ekf-hardly-inside"}),
        ({"schmidt__mae": 15.1}, {"schmidt-not-less-accurate"}),
        ({"schmidt__mae": 15.0}, set()),
        ({"schmidt__rmse_speed": 1.1}, {"speed-better"}),
        ({"schmidt__rmse_course": 1.1}, {"course-better"}),
        ({"ekf__nis": 1.3}, {"nis-similar"}),
        ({"schmidt__nis": 1.2}, {"nis-of-ekf-larger"}),
        ({"schmidt__nis": 0.04}, {"nis-similar", "nis-small"}),
        ({"schmidt__fraction_nis_inside": 0.5}, {"nis-inside", "schmidt-nis-inside-mostly"}),
        ({"ekf__fraction_nis_inside": 0.5}, {"nis-inside"}),
        ({"schmidt-attitude-only__nees": 8.0}, {"attitude-makes-the-difference"}),
        ({"schmidt-position-only__nees": 7.0}, {"attitude-makes-the-difference"}),
        ({"ekf-60-pixels__nees": 8.0}, {"ekf-needs-more-noise"}),
    ],
)
def test_each_claim_is_lost_by_what_it_speaks_of_alone(changed: dict[str, float], lost: set[str]) -> None:
    checks = check_claims(pd.DataFrame([flight_with(**changed)]))
    assert {claim for claim, true in checks.items() if not true[0]} == lost


@pytest.mark.parametrize("study", STUDIES)
def test_every_claim_of_a_study_is_decided_and_every_number_has_its_subject(study: str) -> None:
    checks = check_claims(pd.DataFrame([flight_with()]))
    claims = load_claims(study)
    assert claims and {claim["id"] for claim in claims} <= set(checks)
    numbers = load_published(study)
    assert len(numbers) == 10
    assert set(numbers["subject"]) == {"ekf", "schmidt"} and set(numbers["name"]) <= set(NAMES)


def test_position_uncertainty_of_centimetres_changes_next_to_nothing(seen: Sighting) -> None:
    """Which is the extended filter, the limit without any; and attitude uncertainty only adds to P."""
    tracks = compare(seen).tracks
    at_end = {who: tracks[who].P[-1, :2, :2] for who in SUBJECTS}
    np.testing.assert_allclose(at_end["schmidt-position-only"], at_end["ekf"], rtol=0.02)
    added = at_end["schmidt-attitude-only"] - at_end["ekf"]
    assert (np.linalg.eigvalsh(added) > 0).all()


def test_poses_without_covariance_are_refused(seen: Sighting) -> None:
    with pytest.raises(WildlabError, match="the poses have no covariance"):
        compare(seen._replace(poses=replace(seen.poses, covariance=None)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 7))
def test_on_the_fast_flight_schmidt_is_consistent_and_the_extended_filter_is_not(seed: int) -> None:
    found = trial(seed, twin="fast-vessel")
    assert set(found) == {(who, name) for who in SUBJECTS for name in NAMES}
    assert inside(found["schmidt", "nees"]) and found["ekf", "nees"] > BOUNDS[1]
