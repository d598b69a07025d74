"""The filter on errors is the filter on positions, moved to the truth."""

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.pipeline.at_rest import METRICS, check_claims, filter_errors, judge_columns, summarise_at_rest
from wildlab.tracking.kalman import filter_at_rest


def test_filtering_errors_is_filtering_positions():
    rng = np.random.default_rng(0)
    truth, n = np.array([400.0, -70.0]), 25
    A = rng.normal(size=(n, 2, 2))
    C = A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(2)
    errors = rng.normal(size=(n, 2))
    judged = pd.DataFrame(
        {"time_s": np.arange(n) * 1.0, "error_north_m": errors[:, 0], "error_east_m": errors[:, 1],
         "cov_nn": C[:, 0, 0], "cov_ne": C[:, 0, 1], "cov_ee": C[:, 1, 1]}
    ).sample(frac=1.0, random_state=1)  # fmt: skip
    direct = filter_at_rest(errors + truth, C)
    ours = filter_errors(judged)
    assert np.allclose(ours.x, direct.x - truth)
    assert np.allclose(ours.P, direct.P)
    assert np.allclose(ours.innovation[1:], direct.innovation[1:])


def test_columns_are_those_the_flight_has_and_none_is_an_error(make_flight):
    flight = make_flight(pixel_px=1.0)
    with pytest.raises(WildlabError, match="no poses named 'autopilot'"):
        judge_columns(flight, np.random.default_rng(0))
    flight.nav["autopilot"] = flight.nav["logged"]
    judged = judge_columns(flight, np.random.default_rng(0))
    assert list(judged) == ["pixhawk-autopilot"]
    found = summarise_at_rest(judged)
    assert found["pixhawk-autopilot", "mae"] == pytest.approx(judged["pixhawk-autopilot"]["error_m"].mean())
    assert found["filter", "at_end"] < found["pixhawk-autopilot", "mae"]


def test_claims_are_decided_flight_by_flight():
    """Two flights, one on which every claim is true and one on which none is."""
    good = {("pixhawk-autopilot", "mae"): 5.0, ("pixhawk-autopilot", "mean_north"): 1.0,
            ("pixhawk-autopilot", "mean_east"): 1.0, ("without-time-synchronization", "mae"): 6.0,
            ("without-misalignment-calibration", "mae"): 16.0, ("filter", "lag1_north"): 0.5,
            ("filter", "lag1_east"): 0.5, ("filter", "after_first_batch"): 0.9,
            ("filter", "at_end"): 0.4}  # fmt: skip
    bad = {**good, ("pixhawk-autopilot", "mean_north"): 3.0, ("without-time-synchronization", "mae"): 4.0,
           ("without-misalignment-calibration", "mae"): 14.0, ("filter", "lag1_east"): 0.05,
           ("filter", "after_first_batch"): 1.1, ("filter", "at_end"): 0.6}  # fmt: skip
    checks = check_claims(pd.DataFrame([good, bad]), bound=0.1)
    assert len(checks) == 6
    assert all(list(true) == [True, False] for true in checks.values())
    assert set(good) <= set(METRICS)
