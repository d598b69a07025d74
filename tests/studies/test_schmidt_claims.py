"""Claims of H 7.5.3 and 7.5.4: each is lost by what it speaks of alone, and asks for its own premise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.reporting.published import load_claims, load_published
from wildlab.studies.schmidt import (
    FACTORS,
    FILTERS,
    MORE_NAMES,
    NAMES,
    NEES_NAMES,
    PUBLISHED,
    SUBJECTS,
    covariances_table,
    curve_table,
    predicted_error,
)

STUDIES = ("schmidt-fast-vessel", "schmidt-slow-vessel-eight", "schmidt-drifting-vessel-eight")
#: What the claims of all three studies need for their vague words; the strictest where they differ.
THRESHOLDS = {
    claim["id"]: float(claim["threshold"])
    for study in reversed(STUDIES)
    for claim in load_claims(study)
    if "threshold" in claim
}


def flight_with(**changed: float) -> dict[tuple[str, str], float]:
    """Like the tables of H 7.5: every claim true but those that contradict others."""
    row = {(who, name): 1.0 for who in SUBJECTS for name in NEES_NAMES}
    row |= {(who, name): 1.0 for who in FILTERS for name in NAMES}
    row |= {(who, name): 1.0 for who in PUBLISHED for name in MORE_NAMES}
    row |= {(who, f"{what}_worth"): 5.0 for who in FILTERS for what in ("nees", "nis")}
    row |= {
        ("ekf", "nees"): 17.8,
        ("schmidt-position-only", "nees"): 17.0,
        ("schmidt-1.5-deg-5-m", "nees"): 0.7,
        ("schmidt-1.5-deg-2.5-m", "nees"): 0.9,
        ("ekf", "nis"): 1.1,
        ("schmidt", "nis"): 0.95,
        ("ekf", "fraction_nees_inside"): 0.05,
        ("ekf", "mean_north"): 1.1,
        ("flight", "detections"): 300.0,
        ("flight", "pauses"): 2.0,
        ("flight", "turning"): 0.3,
        ("flight", "moving"): 1.0,
        ("flight", "crab"): 7.0,
        ("flight", "settled"): 300.0,
    }
    row |= {("ekf", name): 1.1 for name in ("mae", "rmse_speed", "rmse_course", "oscillation", "mean_speed")}
    row |= {("ekf", name): 1.1 for name in ("mae_predicted", "mae_first_pause", "rmse_speed_start")}
    row |= {("ekf", "rmse_course_start"): 1.1}
    pose = {f"{what}_{axis}": 1.0 for what in ("rms", "difference") for axis in ("roll", "pitch", "yaw")}
    pose |= {f"mean_sd_{axis}": 1.4 for axis in ("roll", "pitch", "yaw")} | {"sd_spread": 0.1}
    pose |= {f"outside_{axis}": 0.1 for axis in ("roll", "pitch")} | {
        "outside_yaw": 0.4,
        "shift_px": 18.0,
        "largest_shift_px": 70.0,
    }
    pose |= {"difference_turning": 2.0, "difference_straight": 1.0}
    row |= {("mekf", name): value for name, value in (pose | {"difference_yaw": 2.0}).items()}
    return row | {tuple(key.split("__")): value for key, value in changed.items()}  # type: ignore[misc]


def false_with(**changed: float) -> set[str]:
    checks = checks_of("schmidt", pd.DataFrame([flight_with(**changed)]))
    return {claim for claim, check in checks.items() if not check.holds(THRESHOLDS.get(claim))[0]}


#: Of the flight above.
AT_FIRST = false_with()


def test_what_the_tables_print_makes_all_claims_true_that_do_not_contradict_others():
    assert {"nis-differs", "nis-small", "ekf-mean-error-smaller", "schmidt-pessimistic"} == AT_FIRST


@pytest.mark.parametrize(
    ("changed", "lost"),
    [
        ({"schmidt__nees": 4.2}, {"schmidt-nees-inside", "schmidt-fits", "attitude-makes-the-difference"}),
        ({"ekf__nees": 3.9}, {"ekf-nees-above", "ekf-needs-more-noise", "attitude-makes-the-difference"}),
        ({"ekf-60-pixels__nees": 4.2}, {"ekf-needs-more-noise"}),
        ({"ekf-60-pixels__nees": 4.2, "ekf-60-pixels__nees_worth": 1.0}, set()),
        ({"ekf__fraction_above_predicted": 0.5}, {"ekf-overconfident-between"}),
        ({"ekf__pauses_above": 0.9}, {"ekf-overconfident-in-every-pause"}),
        ({"schmidt__fraction_nees_inside": 0.5}, {"schmidt-inside-mostly"}),
        ({"ekf__fraction_nees_inside": 0.1}, {"ekf-hardly-inside"}),
        ({"schmidt-1-deg__fraction_nees_inside": 0.5}, {"one-to-two-degrees"}),
        ({"schmidt-2-deg__fraction_nees_inside": 0.5}, {"one-to-two-degrees"}),
        ({"schmidt-1.5-deg__fraction_nees_inside": 0.1}, set()),
        ({"schmidt-1.5-deg-2.5-m__nees": 0.79}, {"position-negligible-below"}),
        ({"schmidt-1.5-deg-5-m__nees": 0.81}, {"position-matters-from"}),
        ({"schmidt-attitude-only__nees": 1.3}, {"attitude-makes-the-difference"}),
        ({"schmidt-position-only__nees": 13.0}, {"attitude-makes-the-difference"}),
        ({"schmidt__mae": 1.1}, {"schmidt-more-accurate"}),
        ({"schmidt__mae": 1.4}, {"schmidt-more-accurate", "accuracy-comparable"}),
        ({"schmidt__mean_east": 1.2}, {"schmidt-mean-error-smaller"}),
        ({"schmidt__mae_predicted": 1.1}, {"ekf-drifts-more"}),
        ({"schmidt__mae_first_pause": 1.1}, {"ekf-drifts-more-at-first"}),
        ({"schmidt__oscillation": 1.1}, {"schmidt-oscillates-less"}),
        ({"schmidt__mean_speed": 1.1}, {"schmidt-speed-lower"}),
        ({"schmidt__rmse_speed": 1.1}, {"speed-better"}),
        ({"schmidt__rmse_speed_start": 1.1}, {"speed-better-at-first"}),
        ({"schmidt__rmse_course": 1.1}, {"course-better"}),
        ({"schmidt__rmse_course_start": 1.1}, {"course-better-at-first"}),
        ({"ekf__nis": 1.2}, {"nis-similar"}),
        ({"schmidt__nis": 1.15}, {"nis-of-ekf-larger"}),
        ({"schmidt__nis": 0.1}, {"nis-similar", "nis-mean-inside", "schmidt-fits"}),
        ({"schmidt__fraction_nis_inside": 0.5}, {"nis-inside", "schmidt-nis-inside-mostly"}),
        ({"ekf__fraction_nis_inside": 0.5}, {"nis-inside"}),
        ({"ekf__fraction_nis_above": 0.02}, {"ekf-nis-too-large"}),
        ({"schmidt__nis_top_after_pauses": 0.5}, {"high-nis-after-pauses"}),
        ({"mekf__sd_spread": 0.3}, {"covariance-constant"}),
        ({"mekf__difference_pitch": 2.1}, {"yaw-errors-largest"}),
        ({"mekf__outside_roll": 0.5}, {"yaw-errors-outside"}),
        ({"mekf__difference_turning": 0.9}, {"largest-errors-in-turns"}),
    ],
)
def test_each_claim_is_lost_by_what_it_speaks_of_alone(changed, lost):
    assert false_with(**changed) - AT_FIRST == lost


@pytest.mark.parametrize(
    ("changed", "of"),
    [
        ({"mekf__shift_px": 2.9}, "ekf-nees-above"),
        ({"mekf__largest_shift_px": 59.0}, "ekf-nis-too-large"),
        ({"flight__pauses": 0.0}, "ekf-overconfident-between"),
        ({"flight__pauses": 1.0}, "high-nis-after-pauses"),
        ({"flight__moving": 0.4}, "course-better"),
        ({"flight__turning": 0.05}, "schmidt-oscillates-less"),
        ({"flight__turning": 0.95}, "schmidt-oscillates-less"),
        ({"flight__turning": 0.05}, "largest-errors-in-turns"),
        ({"flight__crab": 4.0}, "yaw-errors-outside"),
        ({"flight__settled": 30.0}, "covariance-constant"),
    ],
)
def test_each_premise_is_lost_by_what_it_speaks_of(changed, of):
    flights = (pd.DataFrame([flight_with(**one)]) for one in ({}, changed))
    with_it, without = (checks_of("schmidt", one)[of].premise for one in flights)
    assert with_it is not None and with_it[0]
    assert without is not None and not without[0]


@pytest.mark.parametrize("times", [0.2, 5.0])
def test_premises_do_not_depend_on_what_the_filters_gave(times):
    """Nor on how well the stated deviations of the poses fit their errors: that is what NEES measures."""
    first = flight_with()
    other = {
        key: value * (times if key[0] not in ("flight", "mekf") or "rms_" in key[1] else 1)
        for key, value in first.items()
    }
    before, after = (checks_of("schmidt", pd.DataFrame([one])) for one in (first, other))
    for name, check in before.items():
        assert np.array_equal(check.premise, after[name].premise), name  # type: ignore[arg-type]


@pytest.mark.parametrize("study", STUDIES)
def test_every_claim_is_decided_and_every_number_has_its_subject(study):
    checks = checks_of("schmidt", pd.DataFrame([flight_with()]))
    claims = load_claims(study)
    assert len(claims) > 15 and len({claim["id"] for claim in claims}) == len(claims)
    for claim in claims:
        check = checks[claim["id"]]
        assert check.premise is None or claim["premise"], claim
        assert ("threshold" in claim) == ("reason" in claim) == (check.measured is not None), claim
        check.holds(float(claim["threshold"]) if "threshold" in claim else None)
    numbers = load_published(study)
    assert len(numbers) == 10
    assert set(numbers["subject"]) == {"ekf", "schmidt"} and set(numbers["name"]) <= set(NAMES)


def test_an_average_is_held_against_the_band_of_what_it_is_worth():
    low, high = chi_square_interval(2, runs=20)
    rows = [
        flight_with(schmidt__nees=value, schmidt__nees_worth=20.0) for value in (low, high, 0.9 * low, 5.0)
    ]
    checks = checks_of("schmidt", pd.DataFrame(rows))
    assert checks["schmidt-nees-inside"].holds().tolist() == [True, True, False, False]
    assert checks["schmidt-pessimistic"].holds().tolist() == [False, False, True, False]


def flights(nees: float = 2.0, size: int = 60) -> pd.DataFrame:
    """Flights whose NEES at a drawn moment are quantiles of chi-square, scaled to the mean ``nees``."""
    drawn = -nees * np.log((np.arange(size) + 0.5) / size)
    rows = [flight_with() | {(who, "nees_drawn"): one for who in SUBJECTS} for one in drawn]
    frame = pd.DataFrame(rows)
    for who in SUBJECTS:
        frame[who, "nees"] = nees
    for axis in ("roll", "pitch", "yaw"):
        frame["mekf-data-sheet", f"mean_sd_{axis}"] = frame["mekf-data-sheet", f"rms_{axis}"] = 0.005
        frame["estimated", f"mean_sd_{axis}"] = 0.8
    return frame


@pytest.mark.parametrize(("nees", "inside"), [(2.0, True), (8.0, False), (0.5, False)])
def test_a_filters_errors_beside_what_it_predicts(nees, inside):
    found = predicted_error(flights(nees), "schmidt")
    assert found.drawn.inside == inside
    assert found.ratio == pytest.approx(np.sqrt(nees / 2))
    assert predicted_error(flights(nees, size=4), "schmidt").drawn.high > found.drawn.high
    # The test is on the drawn moments, whatever the averages are.
    others = flights(nees)
    others["schmidt", "nees"] = 2.5
    assert predicted_error(others, "schmidt").drawn == found.drawn


def test_the_lenient_band_counts_averages_within_the_bounds_of_single_values():
    half = flights()
    half["schmidt", "nees"] = np.where(np.arange(len(half)) % 2, 7.3, 7.5)
    assert predicted_error(half, "schmidt").inside == 0.5


def test_the_curve_is_over_the_deviations_that_each_factor_gives():
    curve = curve_table(flights())
    assert curve["sd"].to_numpy() == pytest.approx(1.4 * np.array(FACTORS))
    assert covariances_table(flights())["sd_yaw"].tolist() == pytest.approx([1.4, 0.005, 0.8])
