"""Sensors: predictions against geometry, derivatives against differences; which detection is nearest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.tracking.level_sensors import bearings, measured_from, ranges_bearings
from tests.tracking.poses import CAMERA, CROOKED, PIXEL, POSE, disturbed, posed
from wildlab.geometry.frames import wrap
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel
from wildlab.tracking import sensors as m
from wildlab.tracking import sensors as p
from wildlab.tracking.sensors import combined


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
    seen = p.predict_pixel(target[:2], poses, plane)
    assert np.allclose(seen.z, uv, atol=1e-6)
    by_position = slope(lambda d: p.predict_pixel(target[:2] + d, poses, plane).z, 2, [0.05, 0.05])
    assert np.allclose(seen.H_position, by_position, rtol=1e-5, atol=1e-6)

    def pixel(d):
        wrong = disturbed(poses, d)
        return ground_to_pixel(camera, target, wrong.p_nc, wrong.R_nc)

    by_pose = slope(pixel, 6, POSE_STEP)
    assert np.allclose(seen.H_pose, by_pose, rtol=1e-5, atol=1e-3)


@given(
    target=st.tuples(*(st.floats(-500, 500),) * 2),
    platform=st.tuples(*(st.floats(-500, 500),) * 2),
    yaw=st.floats(-10, 10),
)
def test_range_and_bearing_and_their_derivatives(target, platform, yaw):
    target, platform = np.array(target), np.array(platform)
    assume(np.hypot(*(target - platform)) > 1)
    seen = p.predict_range_bearing(target, platform, yaw)
    assert np.isclose(seen.z[0], np.hypot(*(target - platform)))
    ahead = platform + seen.z[0] * np.array([np.cos(yaw + seen.z[1]), np.sin(yaw + seen.z[1])])
    assert np.allclose(ahead, target, atol=1e-6)
    assert -np.pi <= seen.z[1] < np.pi

    def away(position, at, turned):
        return m.difference(p.predict_range_bearing(position, at, turned).z, seen.z, (False, True))

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
    seen = p.predict_pixel(opposite[:2], poses, opposite[2])
    assert np.isnan(seen.z).all() and np.isnan(seen.H_position).all()
    below = p.predict_pixel(poses.p_nc[:2], poses, poses.p_nc[2])  # the lens itself
    assert np.isnan(below.z).all()


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
        (m.pixels, p.predict_pixel, (together, planes), (singles, planes)),
        (ranges_bearings, p.predict_range_bearing, (platforms, yaws), (platforms, yaws)),
    ):
        sensor = make(*poses)
        for row, own in enumerate(zip(*rows, strict=True)):
            for ours, theirs in zip(sensor.predict(row, position), predict(position, *own), strict=True):
                assert np.allclose(ours, theirs)
    batch = p.predict_pixel(np.tile(position, (2, 1)), together, planes)
    assert np.allclose(batch.z[1], p.predict_pixel(position, singles[1], 2.0).z)


@given(pose=POSE, seed=st.integers(0, 99))
def test_many_positions_are_seen_as_each_alone(pose, seed):
    """What an unscented filter asks of a sensor for all its points at once."""
    poses = posed(pose, CAMERA)
    at = poses.p_nb[:2]
    sensors = [
        m.positions(),
        m.pixels(poses, 0.0),
        ranges_bearings(at, 0.3),
        bearings(at, 0.3),
        measured_from(at),
        combined([ranges_bearings(at, 0.3), m.positions()], [0]),
    ]
    states = np.random.default_rng(seed).normal([*at, 0.0, 0.0], 200.0, (7, 4))
    for sensor in sensors:
        seen = sensor.predict(0, states[:, : sensor.states])
        alone = [sensor.predict(0, one[: sensor.states]) for one in states]
        for many, single in zip(seen, zip(*alone, strict=True), strict=True):
            together = np.broadcast_to(many, (7, *np.shape(single[0])))
            np.testing.assert_allclose(together, single, rtol=1e-12, atol=1e-12)
