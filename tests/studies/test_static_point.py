"""The filter on errors is the filter on positions, moved to the truth."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.flight.clocks import poses_at
from wildlab.geometry.frames import euler_to_matrix
from wildlab.simulation.twins import simulate_twin
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


def test_claims_are_decided_flight_by_flight():
    """Two flights, one on which every claim is true and one on which none is."""
    good = {("observer", "mae"): 5.0, ("pixhawk-autopilot", "mae"): 4.01, ("observer", "mean_north"): 1.0,
            ("observer", "mean_east"): 1.0, ("without-time-synchronization", "mae"): 6.0,
            ("without-misalignment-calibration", "mae"): 16.0, ("filter", "lag1_north"): 0.5,
            ("filter", "lag1_east"): 0.5, ("filter", "after_first_batch"): 0.9,
            ("filter", "at_end"): 0.4}  # fmt: skip
    bad = {**good, ("observer", "mean_north"): 3.0, ("pixhawk-autopilot", "mae"): 3.99,
           ("without-time-synchronization", "mae"): 4.0, ("without-misalignment-calibration", "mae"): 14.0,
           ("filter", "lag1_east"): 0.05, ("filter", "after_first_batch"): 1.1,
           ("filter", "at_end"): 0.6}  # fmt: skip
    checks = check_claims(pd.DataFrame([good, bad]), bound=0.1)
    assert len(checks) == 7
    assert all(list(true) == [True, False] for true in checks.values())
    assert set(good) <= set(METRICS)
