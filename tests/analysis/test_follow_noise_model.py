"""What filters are told of sensors and targets: stated, tuned on another flight, assumed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.robots import KNOWN, believed, robot_flight, rows_of
from tests.analysis.survey_twin import Survey, simulate
from wildlab.analysis.tracks.noise_model import (
    ASSUMED,
    ROUGH,
    STATED,
    model_noise,
    model_targets,
    roughness,
    settings_of,
    spread_of,
)
from wildlab.analysis.tracks.scans import predict_scan, scans_of
from wildlab.analysis.tracks.tracker import track
from wildlab.analysis.tracks.tuning import tune_flight
from wildlab.flight.manifest import parse_settings
from wildlab.geometry.covariances import pose_covariance
from wildlab.geometry.frames import euler_to_matrix

# --- what is believed ---------------------------------------------------------------------------------------


def test_stated_goes_before_assumed_and_the_page_is_told():
    flight = robot_flight()
    scans = scans_of(flight, "radar")
    beliefs, said = model_noise(flight, scans, settings_of(flight))
    assert beliefs.white == pytest.approx([0.5, np.radians(0.3)], rel=0.3)
    assert all(one.source.startswith((ASSUMED, ROUGH)) for one in said)
    stated = parse_settings(
        KNOWN + "\n[sensors.radar.considered.heading]\nsd_deg = 2.0\ncorrelation_time_s = 60.0\n"
    )
    beliefs, said = model_noise(flight, scans, settings_of(flight, stated))
    np.testing.assert_allclose(beliefs.white, [0.5, np.radians(0.3)])
    (heading,) = beliefs.considered
    assert heading[:3] == ("heading", pytest.approx(np.radians(2.0)), 60.0)
    assert {one.source for one in said} == {STATED}
    targets, said = model_targets(stated.targets)
    assert targets.density == 0.15 and targets.patience_s == 10.0
    assert {one.source for one in said} == {STATED, ASSUMED}


def test_errors_of_a_camera_that_looks_straight_down_are_tilts_and_a_heading():
    """Against rotations of the camera; and all of them make the covariance of the pose."""
    flight = simulate(Survey(images=6, slant_deg=(90.0, 90.0), stated_heading_deg=4.0))
    scans, beliefs = believed(flight, "", "click", "logged")
    assert [one.name for one in beliefs.considered if one.sd == np.radians(0.7)] == ["roll", "pitch"]
    place = scans.platform + np.array([7.0, -5.0])
    still, small = np.zeros_like(place), 1e-5
    H = predict_scan(scans, place, still).H_pose
    R = scans.poses.R_nb
    seen = []
    for turn in (small, -small):
        turned = replace(scans.poses, R_nb=euler_to_matrix(0.0, 0.0, turn) @ R)
        seen.append(predict_scan(scans._replace(poses=turned), place, still).z)
    np.testing.assert_allclose(H[..., 5], (seen[0] - seen[1]) / (2 * small), rtol=1e-4, atol=1e-2)
    assumed = spread_of(scans, beliefs, H)
    P = pose_covariance(0.7, 0.7, np.radians(0.7), np.radians(4.0), R)
    own = scans._replace(poses=replace(scans.poses, covariance=P))
    stated = spread_of(own, beliefs._replace(considered=()), predict_scan(own, place, still).H_pose)
    assert assumed is not None and stated is not None
    np.testing.assert_allclose(assumed, stated, rtol=1e-9)
    across = np.array([scans.poses.camera.fx * np.radians(0.7)]) ** 2
    assert (np.diagonal(assumed, axis1=1, axis2=2) > across).all()


def test_noise_is_found_from_how_rough_detections_are():
    found = [
        roughness(scans_of(robot_flight(seed, range_sd=0.7, bearing_sd_deg=0.5), "radar"))
        for seed in range(5)
    ]
    np.testing.assert_allclose(np.mean(found, axis=0), [0.7, np.radians(0.5)], rtol=0.12)


@pytest.mark.parametrize(("kind", "clutter"), [("range-bearing", 0), ("range-bearing", 4), ("position", 4)])
def test_clutter_that_nobody_tells_from_a_target_makes_nothing_rough(kind, clutter):
    """With as many false detections as four targets have, and no names: as with names and without any."""
    found, known = (
        [roughness(scans_of(robot_flight(seed, kind=kind, **one), "radar")) for seed in range(4)]
        for one in ({"labelled": False, "clutter": clutter}, {})
    )
    np.testing.assert_allclose(np.mean(found, axis=0), np.mean(known, axis=0), rtol=0.2)


@pytest.mark.parametrize("kind", ["range-bearing", "position", "bearing"])
def test_clutter_alone_says_nothing_of_noise(kind):
    for seed in range(5):
        scans = scans_of(robot_flight(seed, kind=kind, labelled=False, clutter=4), "radar")
        nobody = scans._replace(detections=scans.detections[:, 1:], labels=scans.labels[:, 1:])
        assert np.isnan(roughness(nobody)).all()


# --- tuning -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_truth_tells_a_heading_and_the_other_flight_is_judged_by_it():
    found = tune_flight(robot_flight(8, name="first", heading_off_deg=2.0), ["radar"])
    assert found.against == "truth" and found.flight == "first"
    assert np.degrees(found.sensors["radar"].heading_sd_rad) == pytest.approx(2.0, rel=0.4)
    followed = track(robot_flight(9, heading_off_deg=-2.0), tuned=found)
    assert any(one.source == "tuned on first" for one in followed.given)
    rows = rows_of(followed)
    assert rows.loc["schmidt", "nees"] < rows.loc["ekf", "nees"]
