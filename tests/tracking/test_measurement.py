"""Sensors: predictions against geometry, derivatives against differences; which detection is nearest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.stats import chi2

from tests.tracking.poses import CAMERA, CROOKED, PIXEL, POSE, disturbed, overflight, posed, turned
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import wrap
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel
from wildlab.tracking import measurement as m
from wildlab.tracking.association import distances, gate_threshold, nearest_within
from wildlab.tracking.combined import combined
from wildlab.tracking.considering import considering
from wildlab.tracking.maritime import (
    CLOCK,
    EAST,
    NORTH,
    YAW,
    bearings_from,
    positions_from,
    predict_bearing,
    predict_position,
    white_acceleration,
)
from wildlab.tracking.noise import constant_noise, noise_by_altitude
from wildlab.tracking.platforms import measured_from, polar


def slope(function, k, step):
    """Derivative by central differences of the fourth order, columns one after the other."""
    columns = []
    for i in range(k):
        d = np.zeros(k)
        d[i] = step[i]
        near, far = function(d) - function(-d), function(2 * d) - function(-2 * d)
        columns.append((8 * near - far) / (12 * step[i]))
    return np.stack(columns, axis=-1)


POSE_STEP = np.repeat([0.05, 1e-4], 3)


def target_at(poses, share, plane):
    camera = poses.camera
    uv = np.array([share[0] * camera.width, share[1] * camera.height])
    target = georeference_pixels(poses, uv, plane)
    assume(np.isfinite(target).all() and np.linalg.norm(target - poses.p_nc) < 3000)
    return uv, target


@pytest.mark.parametrize("camera", [CAMERA, CROOKED], ids=["pinhole", "distorting"])
@given(pose=POSE, share=PIXEL, plane=st.floats(-3, 3))
def test_pixel_and_its_derivatives(camera, pose, share, plane):
    poses = posed(pose, camera)
    uv, target = target_at(poses, share, plane)
    seen = m.predict_pixel(target[:2], poses, plane)
    assert np.allclose(seen.z, uv, atol=1e-6)
    by_position = slope(lambda d: m.predict_pixel(target[:2] + d, poses, plane).z, 2, [0.05, 0.05])
    assert np.allclose(seen.H_position, by_position, rtol=1e-5, atol=1e-6)

    def pixel(d):
        wrong = disturbed(poses, d)
        return ground_to_pixel(camera, target, wrong.p_nc, wrong.R_nc)

    by_pose = slope(pixel, 6, POSE_STEP)
    assert np.allclose(seen.H_pose, by_pose, rtol=1e-5, atol=1e-3)


@given(pose=POSE, share=PIXEL, plane=st.floats(-3, 3))
def test_azimuth_and_elevation_and_their_derivatives(pose, share, plane):
    poses = posed(pose, CROOKED)
    uv, target = target_at(poses, share, plane)
    assume(np.hypot(*(uv - [318, 250])) > 20)  # near the axis the azimuth turns faster than differences see
    seen = m.predict_azimuth_elevation(target[:2], poses, plane)
    assert np.allclose(seen.z, m.azimuth_elevation_of_pixel(CROOKED, uv), atol=1e-8)

    def away(prediction):
        return m.difference(prediction.z, seen.z, (True, False))

    by_position = slope(
        lambda d: away(m.predict_azimuth_elevation(target[:2] + d, poses, plane)), 2, [0.01, 0.01]
    )
    assert np.allclose(seen.H_position, by_position, rtol=1e-5, atol=1e-8)
    by_pose = slope(
        lambda d: away(m.predict_azimuth_elevation(target[:2], disturbed(poses, d), plane)),
        6, POSE_STEP / 5,
    )  # fmt: skip
    assert np.allclose(seen.H_pose, by_pose, rtol=1e-5, atol=1e-4)


@given(
    target=st.tuples(*(st.floats(-500, 500),) * 2),
    platform=st.tuples(*(st.floats(-500, 500),) * 2),
    yaw=st.floats(-10, 10),
)
def test_range_and_bearing_and_their_derivatives(target, platform, yaw):
    target, platform = np.array(target), np.array(platform)
    assume(np.hypot(*(target - platform)) > 1)
    seen = m.predict_range_bearing(target, platform, yaw)
    assert np.isclose(seen.z[0], np.hypot(*(target - platform)))
    ahead = platform + seen.z[0] * np.array([np.cos(yaw + seen.z[1]), np.sin(yaw + seen.z[1])])
    assert np.allclose(ahead, target, atol=1e-6)
    assert -np.pi <= seen.z[1] < np.pi

    def away(position, p, turned):
        return m.difference(m.predict_range_bearing(position, p, turned).z, seen.z, (False, True))

    step = 1e-3 * min(seen.z[0], 10)
    by_position = slope(lambda d: away(target + d, platform, yaw), 2, [step] * 2)
    assert np.allclose(seen.H_position, by_position, atol=1e-6)
    by_pose = slope(lambda d: away(target, platform + d[:2], yaw + d[5]), 6, [step] * 3 + [1e-3] * 3)
    assert np.allclose(seen.H_pose, by_pose, atol=1e-6)


@given(pose=POSE, share=PIXEL)
def test_behind_the_camera_nothing_is_seen(pose, share):
    """The point opposite has the same quotients x/z, y/z: only its depth gives it away."""
    poses = posed(pose)
    _, target = target_at(poses, share, 0.0)
    opposite = 2 * poses.p_nc - target
    for seen in (
        m.predict_pixel(opposite[:2], poses, opposite[2]),
        m.predict_azimuth_elevation(opposite[:2], poses, opposite[2]),
    ):
        assert np.isnan(seen.z).all()
        assert np.isnan(seen.H_position).all()
    below = m.predict_pixel(poses.p_nc[:2], poses, poses.p_nc[2])  # the lens itself
    assert np.isnan(below.z).all()


def test_where_an_angle_is_not_defined_there_is_none():
    poses = CameraPoses.at_lens(CAMERA, [0.0, 0.0, -100.0], np.eye(3), np.eye(3))
    assert np.isnan(m.predict_azimuth_elevation([0.0, 0.0], poses, 0.0).z).all()
    assert np.isnan(m.azimuth_elevation_of_pixel(CAMERA, [318.0, 250.0])).all()
    assert np.isnan(m.predict_range_bearing([3.0, 4.0], [3.0, 4.0], 0.0).z).all()


def test_angles_differ_by_the_short_way_round():
    assert np.allclose(wrap([np.pi, 3 * np.pi, -np.pi, 0.1]), [-np.pi, -np.pi, -np.pi, 0.1])
    gap = m.difference([3.1, 3.1], [-3.1, -3.1], (True, False))
    assert np.allclose(gap, [6.2 - 2 * np.pi, 6.2])


def test_rows_of_a_run_have_their_own_poses():
    drawn = [(10.0, 20.0, 100.0, 0.1, -0.2, 1.0, (0.0, 0.1, 0.0), (0.5, 0.0, 0.0)),
             (-10.0, 5.0, 120.0, -0.1, 0.1, 2.0, (0.0, 0.1, 0.0), (0.5, 0.0, 0.0))]  # fmt: skip
    singles = [posed(one) for one in drawn]
    p_nb, R_nb = (np.stack(part) for part in zip(*((one.p_nb, one.R_nb) for one in singles), strict=True))
    together = replace(singles[0], p_nb=p_nb, R_nb=R_nb)
    planes, position = np.array([0.0, 2.0]), np.array([3.0, 4.0])
    platforms, yaws = np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([0.0, 0.5])
    for make, predict, poses, rows in (
        (m.pixels, m.predict_pixel, (together, planes), (singles, planes)),
        (m.azimuths_elevations, m.predict_azimuth_elevation, (together, planes), (singles, planes)),
        (m.ranges_bearings, m.predict_range_bearing, (platforms, yaws), (platforms, yaws)),
    ):
        sensor = make(*poses)
        for row, own in enumerate(zip(*rows, strict=True)):
            for ours, theirs in zip(sensor.predict(row, position), predict(position, *own), strict=True):
                assert np.allclose(ours, theirs)
    batch = m.predict_pixel(np.tile(position, (2, 1)), together, planes)
    assert np.allclose(batch.z[1], m.predict_pixel(position, singles[1], 2.0).z)
    for ours, theirs in zip(
        m.bearings(platforms, yaws).predict(1, position), sensor.predict(1, position), strict=True
    ):
        assert np.allclose(ours, theirs[1:])


def test_noise_follows_the_altitude():
    R = noise_by_altitude([100.0, 350.0])
    assert np.allclose(R[1], 17.5**2 * np.eye(2))
    assert np.allclose(constant_noise(2, 3.0, 4.0), np.tile(np.diag([9.0, 16.0]), (2, 1, 1)))


@given(pose=POSE, seed=st.integers(0, 99))
def test_many_positions_are_seen_as_each_alone(pose, seed):
    """What an unscented filter asks of a sensor for all its points at once."""
    poses = posed(pose, CAMERA)
    at, level = poses.p_nb[:2], np.zeros(2)
    pixels = m.pixels(poses, 0.0)
    sensors = [
        m.positions(),
        m.positions_or_velocities([True, False])._replace(rows=None),
        pixels,
        m.azimuths_elevations(poses, 0.0),
        m.ranges_bearings(at, 0.3),
        m.bearings(at, 0.3),
        measured_from(at),
        polar(poses.p_nb, poses.R_nb, 0.0),
        considering(pixels, ("u_bias", "clock", "focal", "platform_north"), camera=CAMERA),
        considering(m.azimuths_elevations(poses, 0.0), ("focal", "heading")),
        considering(measured_from(at), ("clock",), velocity=level + 2.0),
        combined([m.ranges_bearings(at, 0.3), m.positions()], [0]),
    ]
    states = np.random.default_rng(seed).normal([*at, 0.0, 0.0], 200.0, (7, 4))
    for sensor in sensors:
        seen = sensor.predict(0, states[:, : sensor.states])
        alone = [sensor.predict(0, one[: sensor.states]) for one in states]
        for many, single in zip(seen, zip(*alone, strict=True), strict=True):
            together = np.broadcast_to(many, (7, *np.shape(single[0])))
            np.testing.assert_allclose(together, single, rtol=1e-12, atol=1e-12)


TARGET, PLATFORM, DRIFT = np.array([120.0, -40.0]), np.array([10.0, 30.0]), np.array([2.0, -1.5])


def logged(error: np.ndarray) -> np.ndarray:
    """Where a platform puts the target that has its position, yaw and stamp too small by the error."""
    there = TARGET + DRIFT * error[CLOCK] - PLATFORM
    turn = -error[YAW]
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return PLATFORM - error[[NORTH, EAST]] + R @ there


def test_positions_with_a_wrong_pose_and_clock():
    found = predict_position(TARGET, PLATFORM, DRIFT)
    np.testing.assert_allclose(found.z, logged(np.zeros(6)))
    for i in (NORTH, EAST, CLOCK, YAW):
        step = np.eye(6)[i] * 1e-6
        numeric = (logged(step) - logged(-step)) / 2e-6
        np.testing.assert_allclose(found.H_pose[:, i], numeric, atol=1e-6)
    np.testing.assert_array_equal(found.H_position, np.eye(2))


def test_bearings_with_a_wrong_pose_and_clock():
    found = predict_bearing(TARGET, PLATFORM, DRIFT)

    def bearing(error: np.ndarray) -> float:
        # The position error moves the sensor itself, and the heading turns what it sees.
        there = TARGET + DRIFT * error[CLOCK] - (PLATFORM + error[[NORTH, EAST]])
        return float(np.arctan2(there[1], there[0])) - error[YAW]

    assert found.z == pytest.approx([bearing(np.zeros(6))])
    for i in (NORTH, EAST, CLOCK, YAW):
        step = np.eye(6)[i] * 1e-6
        assert found.H_pose[0, i] == pytest.approx((bearing(step) - bearing(-step)) / 2e-6, abs=1e-6)


def test_rows_have_their_own_platform():
    platform, drift = np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 3.0]])
    position = np.array([5.0, 10.0])
    for make, single in ((positions_from, predict_position), (bearings_from, predict_bearing)):
        sensor = make(platform, drift)
        for row in (0, 1):
            for ours, theirs in zip(
                sensor.predict(row, position), single(position, platform[row], drift[row]), strict=True
            ):
                np.testing.assert_array_equal(ours, theirs)
    assert bearings_from(platform, drift).angles == (True,)
    assert np.isnan(predict_bearing([5.0, 0.0], [5.0, 0.0], [0.0, 1.0]).z).all()


def test_process_noise_by_van_loans_integral():
    A, L = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2)), np.kron([[0.0], [0.3]], np.eye(2))
    block = expm(np.block([[-A, L @ L.T], [np.zeros((4, 4)), A.T]]) * 1.7)
    F, Q = white_acceleration(1.7, 0.3)
    np.testing.assert_allclose(F, block[4:, 4:].T, atol=1e-12)
    np.testing.assert_allclose(Q, block[4:, 4:].T @ block[:4, 4:], atol=1e-12)


P = np.diag([20.0, 12.0, 4.0, 4.0])
ANGLES = {"position": (False, False), "pixel": (False, False), "azimuth and elevation": (True, False)}
NOISE = {"position": np.diag([100.0, 100.0]), "pixel": np.diag([360.0, 160.0]),
         "azimuth and elevation": np.diag(np.radians([6.0, 3.0]) ** 2)}  # fmt: skip


def expected(kind, position, poses):
    if kind == "position":
        shape = (*np.shape(position)[:-1], 1, 1)
        return m.Prediction(np.asarray(position), np.tile(np.eye(2), shape), np.zeros((*shape[:-2], 2, 6)))
    if kind == "pixel":
        return m.predict_pixel(position, poses, 0.0)
    return m.predict_azimuth_elevation(position, poses, 0.0)


@pytest.mark.parametrize("kind", ANGLES)
def test_many_tracks_at_once_are_as_one_after_the_other(kind, rng):
    _, _, poses, truth = overflight(30)
    there = truth[:, :2] + rng.normal(0, 3, (30, 2))
    both = np.stack([truth[:, :2], truth[:, :2] + [10.0, 15.0]], axis=1)
    each = poses.take((slice(None), None))
    z = expected(kind, both, each).z
    z[3, 1] = np.nan
    seen = expected(kind, there, poses)
    nis = distances(seen, ANGLES[kind], P, z, NOISE[kind])
    assert nis.shape == (30, 2)
    for k in range(30):
        H = seen.H_position[k]
        S = H @ P[:2, :2] @ H.T + NOISE[kind]
        for j in range(2):
            if (k, j) == (3, 1):
                assert np.isnan(nis[k, j])
                continue
            v = z[k, j] - seen.z[k]
            if kind == "azimuth and elevation":
                v[0] = np.angle(np.exp(1j * v[0]))
            assert np.isclose(nis[k, j], v @ np.linalg.inv(S) @ v)
    assert nearest_within(nis, 0.99, 2)[3] == 0


@pytest.mark.parametrize("kind", ["pixel", "azimuth and elevation"])
def test_who_is_not_in_sight_has_no_detection(kind):
    _, _, poses, truth = overflight(1)
    up = turned(poses, slice(None))
    nis = distances(expected(kind, truth[:, :2], up), ANGLES[kind], P, np.zeros((1, 3, 2)), NOISE[kind])
    assert np.isnan(nis).all()
    assert nearest_within(nis, 1.0, 2).tolist() == [-1]


def test_outside_the_gate_there_is_no_neighbour():
    nis = np.array([[5.0, 3.0, np.nan], [np.nan, np.nan, np.nan], [30.0, 20.0, 10.0]])
    assert nearest_within(nis, 0.95, 2).tolist() == [1, -1, -1]
    assert nearest_within(nis, 1.0, 2).tolist() == [1, -1, 2]
    assert gate_threshold(0.95, 3) == pytest.approx(chi2.ppf(0.95, 3))
