"""Errors against a reference: known ones come out as they were put in, whatever the attitude."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.analysis.conftest import first_seconds
from wildlab.analysis.navigate import (
    AXES,
    PUBLISHED_LIKE,
    comparison_times,
    errors_against,
    navigate_mekf,
    summarise,
)
from wildlab.flight.clocks import covariance_columns
from wildlab.flight.schema import QUATERNION, VELOCITY
from wildlab.flight.store import Flight
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate
from wildlab.studies.navigation import (
    normalised_innovations,
    numbers_of,
    shares_within,
    study_navigation,
    summarise_innovations,
    unit_of,
)


def table(times: np.ndarray, attitude: Rotation, p: np.ndarray, v: np.ndarray) -> pd.DataFrame:
    q = attitude.as_quat(scalar_first=True)
    columns = ["time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z", *VELOCITY]
    return pd.DataFrame(np.column_stack([times, p, q, v]), columns=columns)


@pytest.fixture
def pair() -> tuple[pd.DataFrame, pd.DataFrame, np.ndarray]:
    """A reference and an estimate with known errors, over loops: nose straight up in between."""
    times = np.linspace(0.0, 10.0, 41)
    rng = np.random.default_rng(0)
    loop = Rotation.from_euler("ZYX", np.column_stack([np.full(41, 0.3), 2 * np.pi * times / 10, 0 * times]))
    error = rng.normal(0.0, [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.02, 0.03, 0.04], (41, 9))
    p, v = rng.normal(0, 100, (41, 3)), rng.normal(0, 20, (41, 3))
    estimate = table(times, loop * Rotation.from_rotvec(-error[:, 6:]), p - error[:, :3], v - error[:, 3:6])
    return table(times, loop, p, v), estimate, error


def test_errors_are_truth_less_estimate_in_the_estimated_body(pair):
    truth, estimate, error = pair
    found = errors_against(truth, estimate, truth["time_s"])
    assert np.abs(found.error[:, :6] - error[:, :6]).max() < 1e-9
    # Four times the modified Rodrigues parameters are the rotation vector but for its third power.
    assert np.abs(found.error[:, 6:] - error[:, 6:]).max() < 2e-5
    q = Rotation.from_quat(estimate[QUATERNION].to_numpy(), scalar_first=True)
    back = q * Rotation.from_mrp(found.error[:, 6:] / 4)
    true = Rotation.from_quat(truth[QUATERNION].to_numpy(), scalar_first=True)
    assert (back.inv() * true).magnitude().max() < 1e-9
    assert np.isnan(found.sd).all()
    assert all(np.isnan(values).all() for values in found.nees.values())


def test_nees_and_deviations_are_of_the_stated_covariance(pair):
    truth, estimate, error = pair
    sd = np.array([1.0, 2.0, 3.0, 0.02, 0.03, 0.04])
    estimate = estimate.join(covariance_columns(np.tile(np.diag(sd**2), (41, 1, 1))))
    found = errors_against(truth, estimate, truth["time_s"], np.tile(np.diag([0.01, 0.04, 0.09]), (41, 1, 1)))
    expected = (error / [1, 2, 3, 0.1, 0.2, 0.3, 0.02, 0.03, 0.04]) ** 2
    for block, columns in (("position", slice(0, 3)), ("velocity", slice(3, 6)), ("attitude", slice(6, 9))):
        assert found.nees[block] == pytest.approx(expected[:, columns].sum(axis=1), rel=5e-3)
    numbers = summarise(found, 2.0, 8.0)
    part = (truth["time_s"] >= 2.0) & (truth["time_s"] < 8.0)
    assert numbers["rms_east"] == pytest.approx(np.sqrt((error[part, 1] ** 2).mean()))
    assert numbers["rms_pitch"] == pytest.approx(np.degrees(np.sqrt((error[part, 7] ** 2).mean())), rel=1e-3)
    assert numbers["mean_sd_yaw"] == pytest.approx(np.degrees(0.04))
    assert shares_within(found, 2.0)["inside_roll"] == pytest.approx(
        (np.abs(error[truth["time_s"] >= 2.0, 6]) < 0.04).mean()
    )


@pytest.fixture(scope="module")
def early() -> Flight:
    """Two minutes of a twin whose sensors are what is said of them."""
    exact = load_twin("fast-vessel").model_copy(update={"tolerance": None})
    return first_seconds(simulate(exact, 4), 120.0)


def test_a_twin_is_judged_by_the_truth_of_its_payload(early):
    studied = study_navigation(early)
    assert studied.reference == "truth-payload"
    assert set(studied.scored) == {
        "mekf",
        "observer",
        "mekf-published-like",
        "mekf-published-like-turning",
        "mekf-published-like-long",
        "autopilot",
    }
    numbers = numbers_of(studied, 60.0)
    assert numbers["mekf", "nees_attitude"] > 0
    assert numbers["mekf", "mean_sd_roll"] < 0.3
    assert numbers["mekf", "rms_roll"] < 0.5 < numbers["autopilot", "rms_roll"]
    assert ("observer", "nees_attitude") not in numbers
    assert 0 <= numbers["mekf-published-like", "inside_yaw"] <= 1
    for (_, name), value in numbers.items():
        assert np.isfinite(value)
        assert unit_of(name) in ("m", "m/s", "deg", "1")
    innovations = summarise_innovations(studied.found["mekf"], 30.0)
    assert innovations["nis"].between(2.7, 3.3).all()
    assert (innovations["lag1"].abs() < 3 * innovations["bound"]).all()
    assert np.std(normalised_innovations(studied.found["mekf"].innovations.iloc[300:])) == pytest.approx(
        1, abs=0.05
    )


def test_the_tuning_like_the_published_one_gives_deviations_like_the_published_ones(early):
    """H 7.5.3 prints 8, 8 and 7 cm, 1.35, 1.30 and 2.65 deg."""
    times = comparison_times(early, "truth-payload")
    found = navigate_mekf(early, times, tuning=PUBLISHED_LIKE)
    numbers = summarise(errors_against(early.nav["truth-payload"], found.nav, times), 60.0)
    ours = [numbers[f"mean_sd_{name}"] for name in ("north", "east", "down", *AXES)]
    assert ours == pytest.approx([0.08, 0.08, 0.07, 1.35, 1.30, 2.65], rel=0.15)
    assert "velocity" not in set(found.innovations["source"])
