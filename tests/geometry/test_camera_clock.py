"""The offset of a camera's clock by the motion of a plane, on flights whose images are exact."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wildlab.detection.flow import plane_motion
from wildlab.geometry.camera_clock import clock_by_motion, translation_over_ground

#: Speed, and wind to north and east, m/s; s between instants; how many of these between samples of the log.
SPEED, WIND, STEP_S, LOGGED = 20.0, (-7.0, 5.0), 0.05, 4


def attitude(t):
    """Roll and pitch: sines whose periods do not repeat within the flight."""
    rates, phases = 2 * np.pi / np.array([4.9, 7.0, 11.2]), np.array([0.3, 2.0, 4.4])
    roll, pitch = (np.sin(np.outer(t, share * rates) + share * phases).sum(axis=1) for share in (1.0, 0.64))
    return 0.08 * roll, 0.04 * pitch


def flown(tilt_deg, height):
    """Times, positions and attitudes (camera to north-east-down) turning in wind over a plane at zero."""
    t = np.arange(0, 60, STEP_S)
    roll, pitch = attitude(t)
    yaw = np.cumsum(9.81 / SPEED * np.tan(roll)) * STEP_S
    velocity = SPEED * np.stack([np.cos(yaw), np.sin(yaw)], axis=1) + WIND
    north_east = np.cumsum(velocity, axis=0) * STEP_S
    airframe = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    mount = Rotation.from_euler("y", tilt_deg, degrees=True)
    return t, np.column_stack([north_east, np.full(len(t), -height)]), (airframe * mount).as_matrix()


def seen(p, R):
    """Motion (N, 3) between images: rays of the first meet the plane, the second sees where."""
    grid = np.stack(np.meshgrid(np.linspace(-0.22, 0.22, 8), np.linspace(-0.18, 0.18, 6)), axis=-1)
    rays = np.concatenate([grid.reshape(-1, 2), np.ones((48, 1))], axis=1)
    motion = []
    for k in range(len(p) - 1):
        down = rays @ R[k].T
        points = p[k] - down * (p[k, 2] / down[:, 2])[:, None]
        x, y, depth = ((points - p[k + 1]) @ R[k + 1]).T
        motion.append(plane_motion(rays[:, :2], np.stack([x / depth, y / depth], axis=1)))
    return np.array(motion)


@pytest.mark.parametrize(("offset", "taken"), [(0.0, 2), (0.4, 8)])
@pytest.mark.parametrize(("tilt", "height"), [(-45, 60), (-30, 80), (0, 60), (0, 120), (30, 80), (60, 120)])
def test_a_tilted_camera_over_a_plane_gets_its_offset_back(tilt, height, offset, taken):
    t, p, R = flown(tilt, height)
    images, log = slice(60, 1140, taken), slice(None, None, LOGGED)
    spans = np.stack([t[images][:-1], t[images][1:]], axis=1) - offset
    motion = seen(p[images], R[images])
    t, p, R = t[log], p[log], R[log]
    turns = Rotation.from_matrix(np.swapaxes(R[:-1], 1, 2) @ R[1:]).as_rotvec()
    turned = np.vstack([np.zeros(3), np.cumsum(turns, axis=0)])
    found = clock_by_motion(spans, motion, t, turned, translation_over_ground(p, R))
    assert found is not None and found.certain
    assert found.offset_s == pytest.approx(offset, abs=0.003)
    assert abs(found.offset_s - offset) < 3 * found.sd_s < 0.015
    assert found.gain == pytest.approx(1.0, abs=0.02)
