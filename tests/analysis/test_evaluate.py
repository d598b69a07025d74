"""From a flight to errors: what is put in comes out, by both scoring rules, with moving targets too."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.analysis.conftest import changed, score
from wildlab.analysis.accuracy import on_one_heading
from wildlab.analysis.georeference import (
    covariances_of,
    errors_of,
    observe,
    pose_errors,
    recorded_answers,
)
from wildlab.flight.clocks import covariance_columns
from wildlab.geometry.frames import (
    euler_to_matrix,
)


@pytest.mark.parametrize("rule", ["labelled", "nearest"])
def test_a_perfect_flight_has_no_error(make_flight, rule):
    table = score(make_flight(rule=rule))
    assert len(table) == 160
    assert table["error_m"].max() < 1e-6
    assert table["inside_90"].all()


def test_a_moving_target_is_judged_where_it_was_at_the_time(make_flight):
    assert score(make_flight(moving=True))["error_m"].max() < 1e-6


def test_a_clock_offset_shows_and_the_manifest_s_offset_takes_it_off(make_flight):
    flight = make_flight(clock_s=0.5)
    assert score(flight)["error_m"].mean() > 4.0
    assert score(flight, observe(flight, clock_shift=0.5))["error_m"].max() < 1e-6
    assert score(changed(flight, {"clocks": {"camera_offset_s": 0.5}}))["error_m"].max() < 1e-6


def test_a_log_s_own_covariance_is_used_and_can_be_overridden(make_flight):
    flight = make_flight()
    own = np.diag([0.01, 0.01, 0.04, 1e-6, 1e-6, 4e-6])
    nav = flight.nav["logged"]
    flight.nav["logged"] = nav.join(covariance_columns(np.tile(own, (len(nav), 1, 1))))
    observations = observe(flight)
    assert np.allclose(pose_errors(observations).pose, own)
    overridden = pose_errors(observations, {"tilt_deg": 2.0, "heading_deg": 4.0}).pose
    R = observations.poses.R_nb
    assert np.allclose(
        R @ overridden[:, 3:, 3:] @ np.swapaxes(R, 1, 2), np.diag(np.radians([2.0, 2.0, 4.0]) ** 2)
    )


def test_recorded_answers_are_judged_by_the_same_rule_where_they_name_targets(make_flight):
    flight = make_flight()
    table = flight.tables["detections"]
    theirs = table.assign(kind="position", source="other", u_px=np.nan, v_px=np.nan)
    place = flight.truth[["north_m", "east_m", "down_m"]].to_numpy() + np.array([3.0, -4.0, 0.0])
    theirs[["north_m", "east_m", "down_m"]] = place
    nameless = theirs.assign(source="Other 1.2", target_id="")
    flight.tables["detections"] = pd.concat([table, theirs, nameless], ignore_index=True)
    answers, unlabelled = recorded_answers(flight)
    assert list(answers) == ["other"] and unlabelled == ["Other 1.2"]
    assert np.allclose(errors_of(answers["other"]), [3.0, -4.0])
    assert len(score(flight)) == 160


def test_a_line_flown_there_and_back_is_not_one_heading(make_flight):
    seen = observe(make_flight())
    yaw = np.radians(30.0) + np.linspace(-0.2, 0.2, len(seen.uv))
    there = replace(seen, poses=replace(seen.poses, R_nb=euler_to_matrix(0.1, 0.0, yaw)))
    assert on_one_heading(there)
    yaw[::2] += np.pi
    assert not on_one_heading(replace(seen, poses=replace(seen.poses, R_nb=euler_to_matrix(0.1, 0.0, yaw))))


def noisy_truth(flight, sd):
    """Marks logged with an error of that size, stated."""
    off = np.random.default_rng(1).normal(0, sd, (len(flight.truth), 2))
    truth = flight.truth.assign(sd_horizontal_m=sd)
    truth[["north_m", "east_m"]] += off
    return replace(flight, tables={**flight.tables, "truth": truth})


def test_the_stated_error_of_the_truth_is_no_fault_of_the_ellipses(make_flight):
    flight = make_flight(attitude_deg=1.0, position_m=1.0, pixel_px=2.0, n_images=80)
    exact, noisy = score(flight), score(noisy_truth(flight, 3.0))
    silent = noisy_truth(flight, 3.0)
    silent.tables["truth"] = silent.truth.drop(columns="sd_horizontal_m")
    assert 0.86 < exact["inside_90"].mean() < 0.94
    assert 0.86 < noisy["inside_90"].mean() < 0.94
    assert score(silent)["inside_90"].mean() < 0.75
    # What is drawn is the point's own ellipse.
    assert np.allclose(covariances_of(noisy), covariances_of(exact))
    stated_zero = replace(flight, tables={**flight.tables, "truth": flight.truth.assign(sd_horizontal_m=0.0)})
    pd.testing.assert_frame_equal(score(stated_zero), exact)


def test_the_ground_is_the_stated_one_and_the_truth_s_only_where_nothing_else_is_known(make_flight):
    flight = make_flight()
    truth = flight.truth.assign(down_m=flight.truth["down_m"] + 7.0)
    wrong = replace(flight, tables={**flight.tables, "truth": truth})
    table = score(wrong)
    assert table["error_m"].max() < 1e-6 and set(table["ground"]) == {"stated"}
    few = flight.detections.copy()
    few.loc[:9, "plane_down_m"] = np.nan
    some = replace(wrong, tables={**wrong.tables, "detections": few})
    table = score(some)
    assert list(table["ground"][:11]) == ["truth"] * 10 + ["stated"]
    assert table["error_m"][:10].min() > 0.01 and table["error_m"][10:].max() < 1e-6
