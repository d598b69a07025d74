"""The vessel's points, its filter, and the numbers that stand for them."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, said
from wildlab.simulation.twins import simulate_twin
from wildlab.studies import slow_vessel as slow_vessel
from wildlab.studies.slow_vessel import (
    SD_MEASUREMENT,
    SUBJECTS,
    evaluate_sources,
    first_case,
    navigate_vessel,
    subset_of,
    summarise_vessel,
    track_vessel,
)


def scored_points(times, errors, truth):
    """A scored table, in no order."""
    xy = truth + errors
    table = pd.DataFrame(
        {"time_s": times, "north_m": xy[:, 0], "east_m": xy[:, 1], "error_north_m": errors[:, 0],
         "error_east_m": errors[:, 1], "error_m": np.hypot(*errors.T)}
    )  # fmt: skip
    return table.sample(frac=1.0, random_state=4)


def test_the_filter_is_a_straight_line_through_the_first_points_where_nothing_accelerates(monkeypatch):
    """Without process noise a constant-velocity filter is weighted least squares with its start as prior."""
    monkeypatch.setattr(slow_vessel, "SD_ACCELERATION", 0.0)
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.1, 20.0, 30))
    truth = np.array([50.0, -20.0]) + np.outer(times, [0.3, -0.1])
    errors = rng.normal(0, 5, (30, 2))
    got = track_vessel(scored_points(times, errors, truth))
    t, z = times - times[0], truth + errors
    for axis in range(2):
        A = np.column_stack([np.ones(30), t])
        weight = np.full(30, SD_MEASUREMENT**-2)
        # The start is the first measurement, which has the same deviation, and a speed of 0 +- 1 m/s.
        A, b = np.vstack([A, [0.0, 1.0]]), np.append(z[:, axis], 0.0)
        W = np.append(weight, 1.0)
        line = np.linalg.solve(A.T * W @ A, A.T * W @ b)
        assert got.error[-1, axis] == pytest.approx(line[0] + line[1] * t[-1] - truth[-1, axis], abs=1e-8)
    assert np.allclose(got.measured, errors) and np.all(np.diff(got.times) > 0)


#: A flight on which every claim of H 5.6.2 is true, and what makes each untrue.
GOOD = {(subject, name): 1.0 for subject in SUBJECTS for name in ("mean_north", "mean_east")}
GOOD |= {
    (subject, name): 7.0 for subject in ("observer", "pixhawk-autopilot") for name in ("sd_north", "sd_east")
}
GOOD |= {
    ("observer", "mae"): 10.0,
    ("pixhawk-autopilot", "mae"): 9.0,
    ("observer-subset", "mae"): 7.0,
    ("pixhawk-autopilot-subset", "mae"): 7.1,
    ("first-case", "mae"): 6.0,
    ("observer", "mae_without_reference_error"): 5.9,
    ("observer", "largest_error"): 39.0,
    ("observer", "share_below_20_m"): 0.6,
    ("observer", "share_5_to_10_m"): 0.6,
    ("observer", "mean_error_last_tenth"): 11.0,
    ("vessel", "speed_beginning"): 2.0,
    ("vessel", "speed_beginning_subset"): 0.5,
    ("filter", "filter_error_beginning"): 9.0,
    ("filter-subset", "filter_error_beginning"): 8.0,
    ("filter", "filter_error_at_end"): 4.0,
}
OPPOSED = {
    "observer-autopilot-comparable": {("pixhawk-autopilot", "mae"): 8.0},
    "sds-comparable": {("observer", "sd_east"): 9.0},
    "subset-comparable": {("pixhawk-autopilot-subset", "mae"): 9.0},
    "observer-best-on-subset": {("pixhawk-autopilot-subset", "mae"): 6.9},
    "mean-about-two-metres": {("observer", "mean_north"): -3.0},
    "larger-than-first-case": {("first-case", "mae"): 10.1},
    "reference-explains": {("observer", "mae_without_reference_error"): 6.1},
    "largest-almost-forty": {("observer", "largest_error"): 41.0},
    "majority-below-twenty": {("observer", "share_below_20_m"): 0.4},
    "better-part-five-to-ten": {("observer", "share_5_to_10_m"): 0.4},
    "grows-at-end": {("observer", "mean_error_last_tenth"): 9.0},
    "beginning-larger-on-whole-flight": {("filter", "filter_error_beginning"): 7.0},
    "few-metres-at-end": {("filter", "filter_error_at_end"): 6.0},
}


@pytest.mark.parametrize("claim", OPPOSED)
def test_claims_are_decided_flight_by_flight(claim):
    checks = checks_of("slow-vessel", pd.DataFrame([GOOD, {**GOOD, **OPPOSED[claim]}]))
    assert set(checks) == set(OPPOSED)
    assert said("slow-vessel", checks)[claim] == [True, False]


def test_flights_without_what_a_claim_is_about_are_not_asked():
    calm = {("vessel", "speed_beginning"): 0.4}
    checks = checks_of(
        "slow-vessel", pd.DataFrame([GOOD, {**GOOD, **calm}, {**GOOD, **OPPOSED["larger-than-first-case"]}])
    )
    assert list(checks["beginning-larger-on-whole-flight"].premise) == [True, False, True]
    assert list(checks["reference-explains"].premise) == [True, True, False]


@pytest.mark.slow
def test_a_simulated_flight_gives_every_number():
    flight = simulate_twin("slow-vessel", 2)
    navigate_vessel(flight)
    scored = evaluate_sources(flight, np.random.default_rng(2))
    found = summarise_vessel(flight, scored) | {("first-case", "mae"): first_case(2, "static-antenna")}
    assert set(GOOD) <= set(found)
    table = scored["observer"]
    assert (len(table), len(subset_of(table))) == (3635, 1250)
    assert np.allclose(table["down_m"], 0.0, atol=1e-9), "points lie on the sea, not at the receiver"
    assert found["observer", "mae"] == pytest.approx(table["error_m"].mean())
    # The receiver is metres off, and a metre behind the middle: that is all that lies between the two truths.
    apart = found["observer", "mae"] - found["observer", "mae_without_reference_error"]
    assert abs(apart) < found["reference", "mae"] < 5.0
