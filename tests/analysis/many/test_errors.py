"""What detections of a look have in common: by moving the platform, by whole covariances, and end to end."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from tests.analysis.many.test_places import places
from tests.analysis.robots import believed, boat, robot_flight
from wildlab.analysis.georeference import (
    Observations,
    assumed_pose_covariance,
    covariances_of,
    georeference,
    observe,
    pose_errors,
)
from wildlab.analysis.tracks.ground_positions import (
    OF_COVARIANCE,
    CorrelatedErrors,
    _pose_roots,
    align_errors,
    camera_errors,
    counts_twice,
    errors_of_pixels,
    errors_of_poses,
    roots_of_deviations,
)
from wildlab.analysis.tracks.many import track_jointly
from wildlab.analysis.tracks.scans import scans_of
from wildlab.flight.manifest import parse_settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import euler_to_matrix, matrix_to_rotation_vector, rotation_vector_to_matrix
from wildlab.geometry.uncertainty import PoseErrors
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.kalman import transition_of_pose
from wildlab.tracking.sensors import POSE

ALL = """
[sensors.radar.considered.heading]
sd_deg = 2.0
correlation_time_s = 30.0
[sensors.radar.considered.platform_north]
sd_m = 3.0
[sensors.radar.considered.platform_east]
sd_m = 4.0
[sensors.radar.considered.range_bias]
sd_m = 5.0
shared = false
[sensors.radar.considered.clock]
sd_s = 0.5
"""


NOISE = "[sensors.radar.noise]\nrange_m = 0.5\nazimuth_deg = 0.3\n"


def test_a_place_moves_as_what_it_was_computed_from():
    """Each error undone by hand: the place moves by what one standard deviation of it is said to do."""
    flight = robot_flight(seconds=20.0)
    found = places(flight, ALL)
    names = ("platform_north", "platform_east", "heading", "radar: range_bias")
    assert set(found.errors.names) == set(names) and len(found.errors.names) == 4
    assert dict(zip(*found.errors, strict=True))["heading"] == 30.0
    scans = scans_of(flight, "radar")
    for row, scan in enumerate(found.scans):
        r, azimuth = scans.detections[row, 0]
        toward = np.array([np.cos(azimuth), np.sin(azimuth)])
        across = np.array([-np.sin(azimuth), np.cos(azimuth)])
        # What is added to the known value for the true one comes off the place; a bias was measured too.
        expected = {"platform_north": [-3.0, 0.0], "platform_east": [0.0, -4.0],
                    "heading": -r * across * np.radians(2.0), "radar: range_bias": 5.0 * toward}  # fmt: skip
        for i, name in enumerate(found.errors.names):
            assert np.allclose(scan.shared[0, :, i], expected[name]), name


@cache
def _pixels() -> tuple[Flight, Observations]:
    """The last quarter of a twin's detections: more than a hundred."""
    flight = simulate_twin("static-antenna", 3)
    seen = flight.table("detections")
    flight.tables["detections"] = seen.iloc[-len(seen) // 4 :].reset_index(drop=True)
    return flight, observe(flight, "autopilot")


#: The twin's only source, and the poses that are taken for it.
MANUAL = "manual", "autopilot"


def taken(
    flight: Flight, observed: Observations, lasting_s: float = np.inf
) -> tuple[PoseErrors, tuple[np.ndarray, tuple[str, ...]]]:
    belief = believed(flight, "", *MANUAL)[1]
    told = camera_errors(flight, observed, belief)
    return told, errors_of_poses(flight, observed, told, belief, lasting_s)


def test_an_error_stays_itself_along_the_flight():
    """From one look to the next as the Schmidt filter carries it; and a roll moves places as rays say."""
    _, observed = _pixels()
    rows = np.flatnonzero(np.isfinite(observed.poses.p_nb).all(axis=1))[:300]
    some = np.zeros(len(observed.uv), bool)
    some[rows] = True
    observed = observed.take(some)
    errors = pose_errors(observed)
    roots = _pose_roots(observed, errors)
    assert np.allclose(roots @ np.swapaxes(roots, 1, 2), errors.pose, atol=1e-12)
    order = np.argsort(observed.table["time_s"].to_numpy(float), kind="stable")
    for a, b in zip(order[:-1:20], order[1::20], strict=False):
        phi = transition_of_pose(errors.pose[a], errors.pose[b])
        assert np.allclose(phi @ roots[a], roots[b], atol=1e-9)
    points = georeference(observed, np.random.default_rng(0))
    linear = points["ellipse"].to_numpy(str) == "linear"
    of_pose = roots, OF_COVARIANCE
    _, shared, _ = errors_of_pixels(observed, errors, of_pose, covariances_of(points), np.inf)
    small = 1e-4
    for i in (0, 4, 5):
        turn = rotation_vector_to_matrix(small * roots[:, 3:, i])
        poses = replace(
            observed.poses,
            p_nb=observed.poses.p_nb + small * roots[:, :3, i],
            R_nb=observed.poses.R_nb @ turn,
        )
        moved = georeference(replace(observed, poses=poses), np.random.default_rng(0))
        by_hand = (moved[["north_m", "east_m"]] - points[["north_m", "east_m"]]).to_numpy(float) / small
        assert np.allclose(shared[linear][..., i], -by_hand[linear], rtol=0.02, atol=0.02)


def test_errors_of_one_name_are_one_and_those_that_move_nothing_none():
    one = CorrelatedErrors(("heading", "a: bias", "idle"), (30.0, np.inf, 5.0))
    two = CorrelatedErrors(("heading",), (20.0,))
    J, K = np.ones((2, 2, 3)), 7 * np.ones((1, 2, 1))
    J[..., 1], J[..., 2] = 2, 0
    lasting, (first, second) = align_errors([(one, [J, None]), (two, [K])])
    assert lasting == (20.0, np.inf)
    assert np.array_equal(first[0], J[..., :2]) and first[1].shape == (0, 2, 2)
    assert np.array_equal(second[0][..., 0], K[..., 0]) and not second[0][..., 1].any()
    assert align_errors([]) == ((), [])


def test_a_heading_that_is_off_is_in_the_covariance_of_tracks():
    """Three degrees at 100 m are five metres for the whole flight."""
    nees = []
    flight = robot_flight(heading_off_deg=3.0, labelled=False)
    for considered in ("", "[sensors.radar.considered.heading]\nsd_deg = 3.0\n"):
        followed = track_jointly(flight, settings=parse_settings(NOISE + considered))
        own = []
        for one in followed.filtered[20:]:
            e = one.x[:, :2] - boat(np.array([one.time]))
            own += [float(a @ np.linalg.solve(P[:2, :2], a) / 2) for a, P in zip(e, one.P, strict=True)]
        nees.append(np.mean(own))
    assert nees[0] > 10 and 0.2 < nees[1] < 1.2


def test_what_is_considered_of_a_camera_is_in_its_pose():
    """In place of what is assumed, on top of a covariance that poses have; pixels are as noisy as told."""
    flight, observed = _pixels()
    text = "[sensors.manual.noise]\npixel_px = 7.0\n[sensors.manual.considered.heading]\nsd_deg = 9.0\n"
    text += "[sensors.manual.considered.platform_east]\nsd_m = 4.0\n"
    belief = believed(flight, text, *MANUAL)[1]
    usual, told = pose_errors(observed), camera_errors(flight, observed, belief)
    assert np.allclose(told.pixel, 49.0 * np.eye(2))
    assert np.allclose(told.pose[:, 1, 1], 16.0) and np.allclose(told.pose[:, 0, 0], usual.pose[:, 0, 0])
    level = np.abs(observed.poses.R_nb[:, 2, 2]) > 0.999
    assert np.allclose(told.pose[level][:, 5, 5], np.radians(9.0) ** 2, rtol=0.02)
    own = np.tile(np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4]), (len(observed.uv), 1, 1))
    known = replace(observed, poses=replace(observed.poses, covariance=own))
    on_top = camera_errors(flight, known, belief).pose - own
    R = observed.poses.R_nb
    assert np.allclose(on_top[:, :3, :3], np.diag([0, 16.0, 0]))
    in_n = R @ on_top[:, 3:, 3:] @ np.swapaxes(R, 1, 2)
    seen = np.isfinite(R).all(axis=(1, 2))
    assert np.allclose(in_n[seen], np.diag([0, 0, np.radians(9.0) ** 2]), atol=1e-12)


def test_mount_and_ground_are_in_what_is_shared_and_stay():
    _, observed = _pixels()
    errors = pose_errors(observed)._replace(mount=np.diag([1e-4, 4e-4, 9e-4]), plane=9.0)
    points = georeference(observed, np.random.default_rng(0), errors)
    linear = points["ellipse"].to_numpy(str) == "linear"
    of_pose = _pose_roots(observed, errors), OF_COVARIANCE
    R, shared, found = errors_of_pixels(
        observed, errors, of_pose, np.full((len(observed.uv), 2, 2), np.nan), 7.0
    )
    whole = R + shared @ np.swapaxes(shared, 1, 2)
    assert linear.sum() > 100 and np.allclose(whole[linear], covariances_of(points)[linear], rtol=1e-6)
    assert found.lasting_s == (7.0,) * 6 + (np.inf,) * 4
    assert (np.abs(shared[linear][..., 6:]).max(axis=(0, 1)) > 0.01).all()


def test_an_error_of_the_heading_stays_one_whichever_way_the_body_lies():
    """A turn about the vertical; and the whole is the covariance that poses without one are given."""
    angles = np.random.default_rng(5).uniform(-1, 1, (50, 3)) * np.pi
    angles[:5, 1] = -np.pi / 2
    R = euler_to_matrix(*angles.T)
    sd = np.array([2.0, 2.0, 3.0, *np.radians([1.5, 1.5, 4.0])])
    roots = roots_of_deviations(R, sd)
    usual = {"position_horizontal_m": 2.0, "position_vertical_m": 3.0, "tilt_deg": 1.5, "heading_deg": 4.0}
    assert np.allclose(roots @ np.swapaxes(roots, 1, 2), assumed_pose_covariance(R, usual))
    h = 1e-6
    turned = euler_to_matrix(0.0, 0.0, h) @ R
    by_hand = matrix_to_rotation_vector(np.swapaxes(R, 1, 2) @ turned) / h
    assert np.allclose(roots[:, 3:, 5], by_hand * sd[5], atol=1e-6)


def test_a_platforms_errors_move_pixels_as_they_move_a_radars_places():
    """North, east and heading, by the same closed form: a radar on board has one and the same error."""
    flight, observed = _pixels()
    told, of_pose = taken(flight, observed, 30.0)
    assert of_pose[1] == POSE
    nothing = np.full((len(observed.uv), 2, 2), np.nan)
    _, shared, errors = errors_of_pixels(observed, told, of_pose, nothing, 30.0)
    assert errors.names[:6] == POSE and set(errors.lasting_s[:6]) == {30.0}
    sd = flight.manifest.uncertainty
    points = georeference(observed, np.random.default_rng(0), told)
    away = points[["north_m", "east_m"]].to_numpy(float) - observed.poses.p_nb[:, :2]
    known = np.isfinite(shared).all(axis=(1, 2))
    assert known.sum() > 100
    assert np.allclose(shared[known][..., 0], [-sd.position_horizontal_m, 0.0])
    assert np.allclose(shared[known][..., 1], [0.0, -sd.position_horizontal_m])
    turned = -np.radians(sd.heading_deg) * np.stack([-away[:, 1], away[:, 0]], axis=-1)
    assert np.allclose(shared[known][..., 5], turned[known], rtol=1e-6, atol=1e-6)


def test_errors_of_a_platform_are_one_where_it_is_stated_how_long_they_last():
    flight, observed = _pixels()
    radar = CorrelatedErrors(("heading", "radar: range_bias"), (np.inf, np.inf))
    for lasting_s, twice in ((0.0, True), (30.0, False)):
        told, of_pose = taken(flight, observed, lasting_s)
        camera = CorrelatedErrors(of_pose[1], (lasting_s,) * 6)
        assert counts_twice(camera, radar) is twice
        known = replace(observed, poses=replace(observed.poses, covariance=told.pose))
        of_pose = errors_of_poses(flight, known, told, believed(flight, "", *MANUAL)[1], lasting_s)
        assert counts_twice(CorrelatedErrors(of_pose[1], (lasting_s,) * 6), radar)
        assert not counts_twice(camera, CorrelatedErrors(("radar: range_bias",), (np.inf,)))
    text = "[sensors.manual]\ncorrelation_time_s = 9.0\n[sensors.manual.considered.heading]\nsd_deg = 3.0\n"
    apart = believed(flight, text + "shared = false\n", *MANUAL)[1]
    names = errors_of_poses(flight, observed, told, apart, 9.0)[1]
    assert names == (*POSE[:5], "manual: heading")
