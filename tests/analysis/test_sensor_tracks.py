"""Sensors tuned and targets followed on made-up flights whose clocks, noises and correlations are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.analysis.robots import robot, robot_flight, seen_only
from wildlab.analysis.tracks.noise_model import SensorTuning, noise_of_tuning
from wildlab.analysis.tracks.scans import errors_near, scans_of, sensors_of, truths_at
from wildlab.analysis.tracks.single_target import SensorTrack, start_near
from wildlab.studies.autoferry import BOATS, follow_flight, tracks_table, tune_sensor

EXACT = {"kind": "position", "range_sd": 0.0, "bearing_sd_deg": 0.0, "position_sd": 0.0}


# --- scans --------------------------------------------------------------------------------------------------


def test_looks_keep_those_that_saw_nothing():
    whole = robot_flight()
    n = len(whole.table("frames"))
    flight = seen_only(whole, np.arange(n) % 7 != 3)
    scans = scans_of(flight, "radar")
    assert sensors_of(flight) == ["radar"]
    assert scans.detections.shape == (n, 1, 2)
    empty = np.isnan(scans.detections).all(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(empty), np.arange(3, n, 7))
    assert scans.interval_s == pytest.approx(0.5)
    np.testing.assert_allclose(scans.platform, robot(scans.times), atol=0.02)
    slope = (robot(scans.times + 1e-3) - robot(scans.times - 1e-3)) / 2e-3
    np.testing.assert_allclose(scans.platform_velocity, slope, atol=0.01)


def test_what_a_late_sensor_saw_stands_where_the_platform_was_then():
    flight = robot_flight(late_s=1.5, **EXACT)

    def errors(offset_s: float) -> np.ndarray:
        scans = scans_of(flight, "radar", offset_s)
        error, which = errors_near(scans, truths_at(flight, scans.times)[0], BOATS.reach_m)
        assert (which >= 0).sum() > 150
        return np.hypot(*error[which >= 0].T)

    assert errors(-1.5).max() < 0.02
    assert errors(0.0).mean() > 1


# --- tuning -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_clock_noise_and_correlation_come_back():
    correlation = float(np.exp(-0.5 / 6.0))
    given = EXACT | {"position_sd": 2.0, "late_s": 1.5, "correlation": correlation, "seconds": 700.0}
    found = [tune_sensor(robot_flight(seed, **given), "radar") for seed in range(6)]
    assert np.mean([one.offset_s for one in found]) == pytest.approx(-1.5, abs=0.15)
    inside = [one.offset_low_s - 0.05 <= -1.5 <= one.offset_high_s + 0.05 for one in found]
    assert sum(inside) >= 5
    assert np.mean([one.sd for one in found]) == pytest.approx(2.0, rel=0.12)
    assert np.mean([one.correlation_time_s for one in found]) == pytest.approx(6.0, rel=0.4)
    assert np.mean([one.next_correlation for one in found]) == pytest.approx(correlation, abs=0.05)


# --- following ----------------------------------------------------------------------------------------------


def quiet(**changes: float) -> SensorTuning:
    base = SensorTuning(
        "radar", "position", 0, 0, 0, 2.0, 0.8, 5.0, 1.5, 0.1, 0.01, 100, 50, 0.5, 100, (1.0, 1.0)
    )
    return base._replace(**changes)


def test_a_track_does_not_start_on_another_target():
    # One is where the boat is, but three metres beside it; only the boat was seen.
    flight = robot_flight(6, labelled=False, **(EXACT | {"position_sd": 0.1}))
    truth = flight.tables["truth"]
    beside = truth.assign(target_id="another", north_m=truth["north_m"] + 3.0)
    flight.tables["truth"] = pd.concat([beside, truth], ignore_index=True)
    scans, tuning = scans_of(flight, "radar"), quiet()
    one, other = truths_at(flight, scans.times)
    assert start_near(scans, one, noise_of_tuning(tuning), BOATS) is not None
    assert start_near(scans, one, noise_of_tuning(tuning), BOATS, [other]) is None
    start = start_near(scans, other, noise_of_tuning(tuning), BOATS, [one])
    assert start is not None
    np.testing.assert_allclose(start.x[:2], other.position[0], atol=0.5)
    np.testing.assert_allclose(start.P[:2, :2], np.eye(2) * BOATS.reach_m**2)
    rows = tracks_table(follow_flight(flight, {"radar": tuning}, BOATS)).set_index("target").loc["another"]
    assert (rows["share_followed"] == 0).all()
    assert rows["rmse"].isna().all()


def test_a_track_is_with_its_target_where_it_is_near_it_while_that_is_seen():
    n = 40
    estimate, near = np.zeros((n, 4)), np.arange(n) < 30
    error = np.zeros((n, 4))
    error[10:, 0] = BOATS.size_m + 1.0  # it strays
    error[20:] = np.nan  # and ends, while the target is still seen
    nan, known = np.full(n, np.nan), np.ones(n, bool)
    one = SensorTrack(
        "radar",
        "one",
        "kf",
        np.arange(n) / 2,
        estimate,
        error,
        nan,
        np.full((n, 2), np.nan),
        nan,
        known,
        near,
        np.tile(np.eye(4), (n, 1, 1)),
    )
    (row,) = tracks_table([one], BOATS.size_m).to_dict(orient="records")
    assert row["share_with_target"] == pytest.approx(1 / 3)
    unseen = tracks_table([one._replace(near=np.zeros(n, bool))], BOATS.size_m).iloc[0]
    assert np.isnan(unseen["share_with_target"])
