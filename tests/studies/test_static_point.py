"""The filter on errors is the filter on positions, moved to the truth."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, said
from wildlab.errors import WildlabError
from wildlab.flight.clocks import poses_at
from wildlab.geometry.frames import matrix_to_euler
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.static_point import (
    COLUMNS,
    OBSERVER,
    UNCALIBRATED,
    evaluate_columns,
    filter_errors,
    navigate_observers,
    summarise_at_rest,
)
from wildlab.tracking.motion import rest
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import positions


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
    z = errors + truth
    direct = run_filter(np.arange(n), z, C, positions(), rest, Start(0.0, z[0], C[0], 0))
    ours = filter_errors(scored)
    assert np.allclose(ours.x, direct.x - truth)
    assert np.allclose(ours.P, direct.P)
    assert np.allclose(ours.innovation[1:], direct.innovation[1:])


def test_only_a_twin_tells_how_the_imu_was_turned(make_flight):
    with pytest.raises(WildlabError, match="IMU"):
        navigate_observers(make_flight())


@pytest.mark.slow
def test_a_simulated_flight_has_every_column_and_the_misalignment_costs_most():
    flight = simulate_twin("static-antenna", 2)
    sources = set(flight.nav)
    imu = flight.table("imu").copy()
    navigate_observers(flight)
    pd.testing.assert_frame_equal(flight.table("imu"), imu)
    assert set(flight.nav) == sources | {OBSERVER, UNCALIBRATED}
    times = flight.nav["autopilot"]["time_s"].to_numpy()
    (ours_at, ours, _), (theirs_at, theirs, _) = (
        poses_at(flight.nav[name], times) for name in (OBSERVER, UNCALIBRATED)
    )
    settled = np.isfinite(ours).all(axis=(1, 2)) & (times > 350)
    apart = np.degrees(matrix_to_euler(np.swapaxes(ours, 1, 2) @ theirs)[settled])
    # Gravity shows an observer roll and pitch of the axes that it believes in. The heading comes from two
    # antennas, whose baseline it knows in the axes of the airframe: that part of the misalignment is lost.
    assert apart.mean(axis=0)[:2] == pytest.approx([1.1, -5.7], abs=0.1)
    assert abs(apart.mean(axis=0)[2]) < 0.1
    assert apart.std(axis=0).min() > 1e-4, "it is found, not put behind"
    assert np.abs(ours_at - theirs_at)[settled].max() > 1e-3
    scored = evaluate_columns(flight, np.random.default_rng(2))
    assert list(scored) == list(COLUMNS)
    found = summarise_at_rest(scored)
    assert set(GOOD) <= set(found)
    assert found["without-misalignment-calibration", "mae"] == max(found[column, "mae"] for column in COLUMNS)


#: A flight on which every claim of H 5.6.1 is true, and what makes each untrue.
GOOD = {
    ("observer", "mae"): 5.0,
    ("pixhawk-autopilot", "mae"): 4.01,
    ("without-time-synchronization", "mae"): 6.0,
    ("without-misalignment-calibration", "mae"): 16.0,
    ("observer", "mean_north"): 1.0,
    ("observer", "mean_east"): 1.0,
    ("observer", "largest_error"): 31.0,
    ("observer", "smallest_error"): 0.2,
    ("observer", "lag1_autocorrelation_north"): 0.5,
    ("observer", "lag1_autocorrelation_east"): 0.5,
    ("observer", "filter_error_after_first_batch"): 0.9,
    ("observer", "filter_error_at_end"): 0.4,
}
OPPOSED = {
    "observer-autopilot-comparable": {("pixhawk-autopilot", "mae"): 3.99},
    "synchronisation-matters": {("without-time-synchronization", "mae"): 4.0},
    "misalignment-matters-most": {("without-misalignment-calibration", "mae"): 5.5},
    "calibration-before-sensors": {("pixhawk-autopilot", "mae"): 3.9},
    "innovations-coloured": {("observer", "lag1_autocorrelation_east"): 0.05},
    "metre-after-first-batch": {("observer", "filter_error_after_first_batch"): 1.1},
    "half-metre-at-end": {("observer", "filter_error_at_end"): 0.6},
    "mean-within-two-metres": {("observer", "mean_north"): 3.0},
    "single-errors-above-thirty": {("observer", "largest_error"): 29.0},
    "best-below-thirty-centimetres": {("observer", "smallest_error"): 0.31},
}


@pytest.mark.parametrize("claim", OPPOSED)
def test_claims_are_decided_flight_by_flight(claim):
    checks = checks_of("static-point", pd.DataFrame([GOOD, {**GOOD, **OPPOSED[claim]}]), {"bound": 0.1})
    assert set(checks) == set(OPPOSED)
    assert said("static-point", checks)[claim] == [True, False]
