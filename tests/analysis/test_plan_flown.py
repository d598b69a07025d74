"""Errors of a flight have their size, and blurred images of a plan do not count."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.plan_coverage import ExecutionErrors, Looks, displaced, drawn_errors
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import matrix_to_rotation_vector
from wildlab.geometry.georeference import Terrain
from wildlab.planning.courses import fly
from wildlab.planning.gimbal import camera_on_course, look_down, swing_yaw
from wildlab.planning.patterns import lawn_mower

CAMERA = Camera(640, 480, 800.0, 800.0, 320.0, 240.0)
LOOKS = Looks(size=1.5, exposure=0.01, blur_share=0.25, furthest=150.0, range_scale=100.0)
ERRORS = ExecutionErrors(1.5, 2.5, 300.0, *np.radians([0.5, 0.5, 2.0]), 60.0)
FLAT = Terrain(np.zeros((151, 151), np.float32), north=-150.0, east=-150.0, step=2.0)


def flown(rate: float = 2.0, limit: float = 0.0, swing: float = 0.4):
    course = fly(lawn_mower([[-80, -60], [-80, 60], [80, 60], [80, -60]], 25.0), 5.0, turn_time=3.0)
    times = np.arange(0.0, course.duration, 1 / rate)
    places, headings = course.at(times)
    angles = swing_yaw(times, limit, swing, -np.pi / 3) if limit else look_down(times)
    p = np.column_stack([places, np.full(len(times), -50.0)])
    return times, headings, camera_on_course(CAMERA, p, headings, angles)


def test_errors_have_their_size_and_last():
    _, headings, poses = flown()
    off, turned = [], []
    for seed in range(150):
        real = displaced(
            poses, headings, *drawn_errors(len(headings), ERRORS, 0.5, np.random.default_rng(seed))
        )
        off.append((real.p_nc - poses.p_nc)[:2])
        between = real.R_nc @ np.swapaxes(poses.R_nc, -1, -2)
        turned.append(matrix_to_rotation_vector(between)[0])
    sd = np.array(off)[:, 0].std(axis=0)
    assert np.allclose(sd, [1.5, 1.5, 2.5], rtol=0.2)
    # Half a second later nearly the same.
    assert np.abs(np.diff(np.array(off), axis=1)).max() < 1.0
    # At heading h the roll is about the way, the pitch across it.
    h = headings[0]
    along = np.array(turned) @ [np.cos(h), np.sin(h), 0]
    across = np.array(turned) @ [-np.sin(h), np.cos(h), 0]
    assert np.degrees([along.std(), across.std(), np.array(turned)[:, 2].std()]) == pytest.approx(
        [0.5, 0.5, 2.0], rel=0.2
    )
