"""Targets followed by any sensor, on made-up flights whose every number is known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.analysis.robots import boat, joined, paused, robot, robot_flight, rows_of
from wildlab.analysis.tracks.scans import SLOTS, predict_scan, scans_of, truths_at
from wildlab.analysis.tracks.tracker import (
    CAUTIOUS,
    CONSISTENT,
    OVERCONFIDENT,
    UNKNOWN,
    compare_sensors,
    estimates_table,
    track,
    verdict,
    write_estimates,
)
from wildlab.evaluation.consistency import average
from wildlab.flight.manifest import Settings

# --- a heading that is off ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_a_considered_heading_is_inside_the_bounds_where_the_white_filter_is_not(seed):
    off = 2.0 if seed % 2 else -2.0
    rows = rows_of(track(robot_flight(seed, heading_off_deg=off, heading_sd_deg=2.0)))
    assert list(rows.index[:2]) == ["ekf", "schmidt"]
    # Its error is one for the whole flight, which decides nothing; nothing speaks against it.
    assert rows.loc["schmidt", "nees_low"] < rows.loc["schmidt", "nees"] < rows.loc["schmidt", "nees_high"]
    assert rows.loc["ekf", "verdict"] == "overconfident" and rows.loc["ekf", "nees"] > 20
    # Both are as far off: nothing estimates the heading.
    assert rows.loc["schmidt", "rmse"] == pytest.approx(rows.loc["ekf", "rmse"], rel=0.1)


@pytest.mark.parametrize("kind", ["range-bearing", "position"])
def test_every_filter_follows(kind):
    flight = robot_flight(2, kind=kind, heading_sd_deg=1.0)
    settings = Settings(sensors={"radar": {"thinning_s": 2.0}})
    names = ("ekf", "ukf", "imm", "coloured", "schmidt", "thinned")
    rows = rows_of(track(flight, filters=names, settings=settings, smooth=True))
    assert set(names) <= set(rows.index)
    assert {"ekf-smoothed", "schmidt-smoothed"} <= set(rows.index) and "coloured-smoothed" not in rows.index
    assert (rows["rmse"] < 3.0).all()
    assert rows.loc["ekf-smoothed", "rmse"] <= rows.loc["ekf", "rmse"]
    # Innovations of a smoothed track are the filter's, and not counted twice.
    assert rows.loc["ekf-smoothed", "detections"] == 0
    assert rows.loc["thinned", "detections"] < rows.loc["ekf", "detections"] / 3


# --- kinds of detections ------------------------------------------------------------------------------------


def test_a_range_along_the_line_of_sight_knows_how_far_below_the_target_is():
    high = 60.0
    flight = robot_flight(3)
    flight.nav["own"]["down_m"] = -high
    seen = flight.tables["detections"]
    level = seen["range_m"].to_numpy(float)
    seen["range_m"] = np.hypot(level, high)
    truth = track(flight)
    assert rows_of(truth).loc["ekf", "rmse"] < 1.5
    # With an elevation nothing has to be known of heights.
    seen["elevation_rad"] = -np.arctan2(high, level)
    flight.tables["truth"]["down_m"] = 500.0
    assert rows_of(track(flight)).loc["ekf", "rmse"] < 1.5


def test_bearings_with_elevation_start_where_they_meet_the_plane():
    high = 60.0
    flight = robot_flight(3, kind="bearing")
    flight.nav["own"]["down_m"] = -high
    seen, t = flight.tables["detections"], flight.tables["frames"]["time_s"].to_numpy()
    distance = np.hypot(*(boat(t) - robot(t)).T)
    noise = np.random.default_rng(0).normal(0, np.radians(0.3), len(t))
    seen["elevation_rad"] = -np.arctan2(high, distance) + noise
    rows = rows_of(track(flight))
    assert rows.loc["ekf", "rmse"] < 4.0 and rows.loc["ekf", "detections"] > 230


@pytest.mark.parametrize("kind", ["position", "range-bearing", "bearing"])
def test_derivatives_for_what_is_considered_are_those_of_the_measurement(kind):
    """By finite differences: the platform moved or turned, the stamp wrong."""
    flight = robot_flight(kind=kind, heading_off_deg=0.0)
    flight.tables["detections"]["plane_down_m"] = 30.0
    scans = scans_of(flight, "radar")
    n = len(scans.times)
    p = np.tile([55.0, -20.0], (n, 1))
    v = np.tile([1.0, -2.0], (n, 1))
    seen, step = predict_scan(scans, p, v), 1e-5

    def shifted(**changes: np.ndarray) -> np.ndarray:
        return predict_scan(scans._replace(**changes), p, v).z

    for i, name in enumerate(("platform_north", "platform_east")):
        if kind == "position":
            continue  # its own position is in what it publishes
        off = np.zeros(2)
        off[i] = step
        column = (shifted(platform=scans.platform + off) - seen.z) / step
        np.testing.assert_allclose(seen.H_pose[..., SLOTS[kind].index(name)], column, atol=1e-4, err_msg=name)
    later = predict_scan(scans, p + step * (v - scans.platform_velocity), v).z
    np.testing.assert_allclose(
        seen.H_pose[..., SLOTS[kind].index("clock")], (later - seen.z) / step, atol=1e-3
    )


# --- whose detection it is ----------------------------------------------------------------------------------


def test_without_names_the_nearest_in_the_gate_is_taken_from_near_the_truth_on():
    flight = robot_flight(4, labelled=False, clutter=3)
    followed = track(flight)
    rows = rows_of(followed)
    assert rows.loc["ekf", "rmse"] < 1.5
    own = followed.tracks[0].detection
    assert all(name.endswith("-0") for name in own[own != ""])  # the boat's, never clutter's


def test_a_named_target_is_found_again_after_a_pause_and_an_unnamed_one_is_not():
    named, unnamed = (
        track(paused(robot_flight(5, labelled=labelled), 31, 61)).tracks[0] for labelled in (True, False)
    )
    assert np.isfinite(named.estimate[-1]).all() and np.isnan(unnamed.estimate[-1]).all()


# --- order --------------------------------------------------------------------------------------------------


def test_late_looks_are_put_in_order_and_change_nothing():
    flight = robot_flight(6)
    straight = track(flight)
    frames = flight.tables["frames"]
    order = np.arange(len(frames))
    order[10:13] = [12, 10, 11]
    flight.tables["frames"] = frames.iloc[order].reset_index(drop=True)
    late = track(flight)
    np.testing.assert_array_equal(straight.tracks[0].estimate, late.tracks[0].estimate)


# --- several sensors ----------------------------------------------------------------------------------------


def test_two_sensors_in_one_track_share_what_the_platform_has_wrong():
    one = robot_flight(1, heading_off_deg=2.0, heading_sd_deg=2.0)
    other = robot_flight(51, kind="position", heading_off_deg=2.0, sensor="lidar")
    followed = track(joined(one, other))
    rows = rows_of(followed, "together")
    # Its error is one for the whole flight, which decides nothing; nothing speaks against it.
    assert rows.loc["schmidt", "nees_low"] < rows.loc["schmidt", "nees"] < rows.loc["schmidt", "nees_high"]
    assert rows.loc["ekf", "verdict"] == "overconfident"
    assert rows.loc["ekf", "detections"] > 470
    (pair,) = (pair for pair in compare_sensors(followed) if pair.filter == "schmidt")
    assert (pair.one, pair.other) == ("radar", "lidar") and pair.rms < 2.0


# --- refusals -----------------------------------------------------------------------------------------------


# --- out ----------------------------------------------------------------------------------------------------


def test_estimates_say_what_was_used_and_how_sure_they_are(tmp_path):
    flight = robot_flight(2, heading_sd_deg=1.0)
    followed = track(flight)
    table = estimates_table(followed.tracks, followed.scans)
    write_estimates(table, tmp_path)
    read = pd.read_parquet(tmp_path / "estimates.parquet")
    pd.testing.assert_frame_equal(read, table)
    assert len(pd.read_csv(tmp_path / "estimates.csv")) == len(table)
    ekf = table[table["filter"] == "ekf"]
    used = ekf[ekf["detection"] != ""]
    assert set(used["detection"]) <= set(flight.tables["detections"]["detection_id"])
    S = np.stack([[used["s_00"], used["s_01"]], [used["s_01"], used["s_11"]]]).transpose(2, 0, 1)
    nu = used[["innovation_range_m", "innovation_azimuth_rad"]].to_numpy()
    known = np.isfinite(nu).all(axis=1)
    nis = np.einsum("ni,nij,nj->n", nu[known], np.linalg.inv(S[known]), nu[known])
    np.testing.assert_allclose(nis, used["nis"].to_numpy()[known])
    P = ekf[["p_00", "p_01", "p_11"]].to_numpy()
    assert (P[:, 0] * P[:, 2] > P[:, 1] ** 2).all()
    truth = truths_at(flight, ekf["time_s"])[0].position
    np.testing.assert_allclose(truth[:, 0] - ekf["north_m"], ekf["error_north_m"], atol=1e-9)


@pytest.mark.parametrize(
    ("mean", "worth", "n", "word"),
    [
        (2.0, 40.0, 100, CONSISTENT),
        # A band about 3.9 that reaches from 0.5 to 4.4 says nothing of the filter, one beyond it does.
        (3.9, 4.0, 100, UNKNOWN),
        (5.0, 4.0, 100, OVERCONFIDENT),
        (0.2, 4.0, 100, CAUTIOUS),
        (3.9, 40.0, 100, OVERCONFIDENT),
        (9.0, 19.0, 19, UNKNOWN),
    ],
)
def test_a_filter_is_consistent_only_where_one_wrong_by_a_factor_of_two_would_not_be(mean, worth, n, word):
    assert verdict(average(np.full(n, mean), 2, worth)) == word
