"""What filters are told of sensors and targets: stated, tuned on another flight, assumed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.robots import KNOWN, believed, robot_flight, rows_of
from tests.analysis.survey_twin import Survey, simulate
from tests.refused import refused
from wildlab.analysis.tracks.noise_model import (
    ASSUMED,
    ROUGH,
    STATED,
    of_flight,
    of_sensor,
    of_targets,
    roughness,
    spread_of,
)
from wildlab.analysis.tracks.scans import predict_scan, scans_of
from wildlab.analysis.tracks.tracker import track
from wildlab.analysis.tracks.tuning import tune_flight
from wildlab.flight.manifest import manifest_toml, parse_manifest
from wildlab.flight.tracking_settings import parse_settings
from wildlab.geometry.attitude_uncertainty import pose_covariance
from wildlab.geometry.frames import euler_to_matrix, wrap

# --- what is believed ---------------------------------------------------------------------------------------


def test_stated_goes_before_assumed_and_the_page_is_told():
    flight = robot_flight()
    scans = scans_of(flight, "radar")
    beliefs, said = of_sensor(flight, scans, of_flight(flight))
    assert beliefs.white == pytest.approx([0.5, np.radians(0.3)], rel=0.3)
    assert all(one.source.startswith((ASSUMED, ROUGH)) for one in said)
    stated = parse_settings(
        KNOWN + "\n[sensors.radar.considered.heading]\nsd_deg = 2.0\ncorrelation_time_s = 60.0\n"
    )
    beliefs, said = of_sensor(flight, scans, of_flight(flight, stated))
    np.testing.assert_allclose(beliefs.white, [0.5, np.radians(0.3)])
    (heading,) = beliefs.considered
    assert heading[:3] == ("heading", pytest.approx(np.radians(2.0)), 60.0)
    assert {one.source for one in said} == {STATED}
    targets, said = of_targets(stated.targets)
    assert targets.density == 0.15 and targets.patience_s == 10.0
    assert {one.source for one in said} == {STATED, ASSUMED}


def test_settings_stand_in_the_manifest_too():
    parts = {
        "sensors": {"radar": {"clock_offset_s": -0.5, "noise": {"range_m": 0.7}}},
        "targets": {"gate_probability": 0.95},
    }
    manifest = robot_flight(manifest=parts).manifest
    again = parse_manifest(manifest_toml(manifest), __file__)  # type: ignore[arg-type]
    assert again == manifest and again.sensors["radar"].noise.range_m == 0.7
    flight = robot_flight(manifest=parts)
    told = of_flight(flight, parse_settings("[targets]\npatience_s = 3.0"))
    assert (told.targets.gate_probability, told.targets.patience_s) == (0.95, 3.0)
    assert of_sensor(flight, scans_of(flight, "radar"), told)[0].offset_s == -0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[sensors.radar.considered.wind]\nsd_m = 1.0", "'wind'"),
        ("[sensors.radar.considered.heading]\nsd_m = 1.0", "in deg"),
        ("[sensors.radar.noise]\nrange_m = -1.0", "greater than 0"),
        ("[targets]\nsped = 1.0", "sped"),
        ("[targets", "TOML"),
    ],
)
def test_settings_that_make_no_sense_are_refused(text, said):
    with refused(said):
        parse_settings(text)


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
        [roughness(scans_of(robot_flight(seed, kind=kind, **one), "radar")) for seed in range(8)]
        for one in ({"labelled": False, "clutter": clutter}, {})
    )
    np.testing.assert_allclose(np.mean(found, axis=0), np.mean(known, axis=0), rtol=0.15)


@pytest.mark.parametrize("kind", ["range-bearing", "position", "bearing"])
def test_clutter_alone_says_nothing_of_noise(kind):
    for seed in range(5):
        scans = scans_of(robot_flight(seed, kind=kind, labelled=False, clutter=4), "radar")
        nobody = scans._replace(detections=scans.detections[:, 1:], labels=scans.labels[:, 1:])
        assert np.isnan(roughness(nobody)).all()


def test_bearings_near_south_are_neighbours():
    rng = np.random.default_rng(2)
    scans = scans_of(robot_flight(kind="bearing", labelled=False), "radar")
    azimuth = wrap(np.pi + rng.normal(0, 0.02, (len(scans.times), 1, 1)))
    clutter = rng.uniform(-np.pi, np.pi, (len(scans.times), 3, 1))
    both = np.concatenate([azimuth, clutter], axis=1)
    found = roughness(scans._replace(detections=both, labels=np.full(both.shape[:2], "", object)))
    assert found[0] == pytest.approx(0.02, rel=0.5)


def test_noise_that_nobody_knows_is_asked_for():
    flight = robot_flight(seconds=1.6)
    with refused("'range'"):
        track(flight)


# --- tuning -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_truth_tells_a_heading_and_the_other_flight_is_judged_by_it():
    found = tune_flight(robot_flight(8, name="first", heading_off_deg=2.0), ["radar"])
    assert found.against == "truth" and found.flight == "first"
    assert np.degrees(found.sensors["radar"].heading_sd_rad) == pytest.approx(2.0, rel=0.4)
    followed = track(robot_flight(9, heading_off_deg=-2.0), tuned=found)
    assert any(one.source == "tuned on first" for one in followed.said)
    rows = rows_of(followed)
    assert rows.loc["schmidt", "nees"] < rows.loc["ekf", "nees"]


def test_truth_that_is_not_there_is_no_teacher():
    with refused("no truth"):
        tune_flight(robot_flight(truth=False), ["radar"], against="truth")
    with refused("only"):
        tune_flight(robot_flight(truth=False, seconds=6.0), ["radar"])


def test_targets_at_rest_have_neither_acceleration_nor_speed():
    still = "[targets]\nacceleration_m_s_sqrt_s = 0\nstart_speed_m_s = 0\n"
    targets, _ = of_targets(parse_settings(still).targets)
    assert targets == targets.at_rest and not targets.motion()(3.0)[1].any()
    with refused("acceleration_m_s_sqrt_s = 0"):
        parse_settings("[targets]\nstart_speed_m_s = 0\n")
