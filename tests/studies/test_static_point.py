"""The filter on errors is the filter on positions, moved to the truth."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.clocks import poses_at
from wildlab.geometry.frames import euler_to_matrix
from wildlab.reporting.published import load_claims
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.static_point import text
from wildlab.studies.static_point.trial import (
    COLUMNS,
    METRICS,
    OBSERVER,
    UNCALIBRATED,
    check_claims,
    evaluate_columns,
    filter_errors,
    navigate_observers,
    summarise_at_rest,
    turned,
)
from wildlab.tracking.kalman import filter_at_rest


def test_filtering_errors_is_filtering_positions():
    rng = np.random.default_rng(0)
    truth, n = np.array([400.0, -70.0]), 25
    A = rng.normal(size=(n, 2, 2))
    C = A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(2)
    errors = rng.normal(size=(n, 2))
    scored = pd.DataFrame(
        {"time_s": np.arange(n) * 1.0, "error_north_m": errors[:, 0], "error_east_m": errors[:, 1],
         "cov_nn": C[:, 0, 0], "cov_ne": C[:, 0, 1], "cov_ee": C[:, 1, 1]}
    ).sample(frac=1.0, random_state=1)  # fmt: skip
    direct = filter_at_rest(errors + truth, C)
    ours = filter_errors(scored)
    assert np.allclose(ours.x, direct.x - truth)
    assert np.allclose(ours.P, direct.P)
    assert np.allclose(ours.innovation[1:], direct.innovation[1:])


def test_columns_are_those_the_flight_has_and_none_is_an_error(make_flight):
    flight = make_flight(pixel_px=1.0)
    with pytest.raises(WildlabError, match="no poses named 'observer'"):
        evaluate_columns(flight, np.random.default_rng(0))
    flight.nav["observer"] = flight.nav["logged"]
    scored = evaluate_columns(flight, np.random.default_rng(0))
    assert list(scored) == ["observer"]
    found = summarise_at_rest(scored)
    assert found["observer", "mae"] == pytest.approx(scored["observer"]["error_m"].mean())
    assert found["filter", "at_end"] < found["observer", "mae"]


def test_only_a_twin_tells_how_the_imu_was_turned(make_flight):
    with pytest.raises(WildlabError, match="how the IMU was turned against the airframe is not known"):
        navigate_observers(make_flight())


def test_what_is_turned_on_a_level_airframe_has_these_angles(make_flight):
    """And on any airframe it has them against it; nothing but the attitude is touched."""
    angles = np.radians([1.1, -5.7, 0.25])
    nav = make_flight().nav["logged"]
    got = turned(nav, euler_to_matrix(*angles))
    names = ["q_w", "q_x", "q_y", "q_z"]
    was, now = (Rotation.from_quat(table[names], scalar_first=True) for table in (nav, got))
    assert np.allclose((was.inv() * now).as_euler("ZYX")[:, ::-1], angles)
    pd.testing.assert_frame_equal(nav.drop(columns=names), got.drop(columns=names))


@pytest.mark.slow
def test_a_simulated_flight_has_every_column_and_the_misalignment_costs_most():
    flight = simulate_twin("static-antenna", 2)
    navigate_observers(flight)
    ours, left_in = (
        poses_at(flight.nav[name], flight.nav["autopilot"]["time_s"])[1] for name in (OBSERVER, UNCALIBRATED)
    )
    theirs, theirs_left_in = (
        poses_at(flight.nav[name], flight.nav["autopilot"]["time_s"])[1]
        for name in ("autopilot", "autopilot-uncalibrated")
    )
    known = np.isfinite(ours).all(axis=(1, 2))
    between = (np.swapaxes(a, 1, 2) @ b for a, b in ((ours, left_in), (theirs, theirs_left_in)))
    of_observer, of_autopilot = between
    assert np.allclose(of_observer[known], of_autopilot[known], atol=1e-6)
    scored = evaluate_columns(flight, np.random.default_rng(2))
    assert list(scored) == list(COLUMNS)
    found = summarise_at_rest(scored)
    assert set(found) == set(METRICS)
    assert found["without-misalignment-calibration", "mae"] == max(found[column, "mae"] for column in COLUMNS)


#: A flight on which every claim of H 5.6.1 is true, and what makes each untrue.
GOOD = {
    ("observer", "mae"): 5.0,
    ("pixhawk-autopilot", "mae"): 4.01,
    ("without-time-synchronization", "mae"): 6.0,
    ("without-misalignment-calibration", "mae"): 16.0,
    ("observer", "mean_north"): 1.0,
    ("observer", "mean_east"): 1.0,
    ("observer", "largest"): 31.0,
    ("observer", "smallest"): 0.2,
    ("filter", "lag1_north"): 0.5,
    ("filter", "lag1_east"): 0.5,
    ("filter", "after_first_batch"): 0.9,
    ("filter", "at_end"): 0.4,
    ("filter", "nees_at_end"): 3.0,
}
OPPOSED = {
    "observer-autopilot-comparable": {("pixhawk-autopilot", "mae"): 3.99},
    "synchronisation-matters": {("without-time-synchronization", "mae"): 4.0},
    "misalignment-matters-most": {("without-misalignment-calibration", "mae"): 5.5},
    "calibration-before-sensors": {("pixhawk-autopilot", "mae"): 3.9},
    "innovations-coloured": {("filter", "lag1_east"): 0.05},
    "metre-after-first-batch": {("filter", "after_first_batch"): 1.1},
    "half-metre-at-end": {("filter", "at_end"): 0.6},
    "mean-within-two-metres": {("observer", "mean_north"): 3.0},
    "single-errors-above-thirty": {("observer", "largest"): 29.0},
    "best-below-thirty-centimetres": {("observer", "smallest"): 0.31},
}


@pytest.mark.parametrize("claim", OPPOSED)
def test_claims_are_decided_flight_by_flight(claim):
    checks = check_claims(pd.DataFrame([GOOD, {**GOOD, **OPPOSED[claim]}]), bound=0.1)
    typed = {entry["id"]: entry for entry in load_claims("static-point")}
    assert set(checks) == set(OPPOSED) == set(typed)
    threshold = float(typed[claim]["threshold"]) if "threshold" in typed[claim] else None
    assert checks[claim].holds(threshold).tolist() == [True, False]
    assert set(GOOD) <= set(METRICS)


def test_words_turn_with_their_numbers():
    published = {
        (OBSERVER, name): value for name, value in (("mean_north", 0.2), ("mean_east", 0.1), ("mae", 6.4))
    }
    published["pixhawk-autopilot", "mae"] = 7.7
    coverage = {("filter", "coverage"): 0.95}
    far = pd.DataFrame([{**GOOD, **coverage}] * 4)
    one, other = (text.partings(far, published, 500, bound) for bound in (0.1, 0.9))
    assert "average out slowly" in one[0] and "average out slowly" not in other[0]
    assert "0 of 4 flights come that near" in one[0] and "met by 4 of 4 flights" in one[1]
    near = far.assign(**{}).copy()
    near[("observer", "mean_north")] = near[("observer", "mean_east")] = 0.0
    assert "average out slowly" not in text.partings(near, published, 500, 0.1)[0]
    assert text.sureness(far) == "surer than it may be on 0 of 4 flights"
    assert text.sureness(pd.DataFrame([{**GOOD, ("filter", "nees_at_end"): 9.0}])).endswith(
        "on 1 of 1 flight"
    )
    ends = pd.DataFrame([{**GOOD, ("filter", "at_end"): value} for value in (0.7, 2.2, 2.0, 2.4, 3.0)])
    assert (
        "at the end it is not typical: 0 of the 4 others have a smaller one, where the median is 2.2 m"
        in text.drawn_words(ends)
    )
    assert "costs another 1.0" in text.summary(far, 0.1)[1] and "helps less" in text.summary(far, 0.1)[2]
    cheap = pd.DataFrame(
        [{**GOOD, **OPPOSED["synchronisation-matters"], **OPPOSED["innovations-coloured"]}] * 2
    )
    assert (
        "costs nothing more" in text.summary(cheap, 0.1)[1] and "not all wrong" in text.summary(cheap, 0.1)[2]
    )
