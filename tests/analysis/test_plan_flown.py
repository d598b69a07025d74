"""A plan beside a flight of it: errors have their size, margins allow for them, blur does not count."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.plans.coverage import ExecutionErrors, Looks, execute, margin_px, with_errors
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import matrix_to_rotation_vector
from wildlab.geometry.terrain import Terrain
from wildlab.planning.courses import fly
from wildlab.planning.gimbal import camera_on_course, look_down, swing_yaw
from wildlab.planning.patterns import lawn_mower

CAMERA = Camera(640, 480, 800.0, 800.0, 320.0, 240.0)
LOOKS = Looks(size=1.5, exposure=0.01, blur_share=0.25, furthest=150.0, range_scale=100.0)
ERRORS = ExecutionErrors(1.5, 2.5, 300.0, *np.radians([0.5, 0.5, 2.0]), 60.0)
NONE = ExecutionErrors(0.0, 0.0, 300.0, 0.0, 0.0, 0.0, 60.0)
FLAT = Terrain(np.zeros((151, 151), np.float32), north=-150.0, east=-150.0, step=2.0)


def flown(rate: float = 2.0, limit: float = 0.0, swing: float = 0.4):
    course = fly(lawn_mower([[-80, -60], [-80, 60], [80, 60], [80, -60]], 25.0), 5.0, turn_time=3.0)
    times = np.arange(0.0, course.duration, 1 / rate)
    places, headings = course.at(times)
    angles = swing_yaw(times, limit, swing, -np.pi / 3) if limit else look_down(times)
    p = np.column_stack([places, np.full(len(times), -50.0)])
    return times, headings, camera_on_course(CAMERA, p, headings, angles)


def test_without_errors_the_flight_is_the_plan():
    times, headings, poses = flown()
    done = execute(FLAT, poses, headings, times, LOOKS, NONE, 2.0, np.random.default_rng(1))
    assert np.array_equal(done.planned.looks, done.flown.looks)
    assert np.array_equal(done.sure, done.planned.seen) and done.margin_px == 0 and done.held == 1


def test_errors_have_their_size_and_last():
    _, headings, poses = flown()
    off, turned = [], []
    for seed in range(150):
        real = with_errors(poses, headings, ERRORS, 0.5, np.random.default_rng(seed))
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


def test_a_margin_is_what_the_parts_make():
    one = ExecutionErrors(3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    assert margin_px(CAMERA, one, [50.0, 100.0], 2.0) == pytest.approx([2 * 800 * 3 / 50, 2 * 800 * 3 / 100])
    tilt = ExecutionErrors(0.0, 0.0, 1.0, 0.0, 0.02, 0.0, 1.0)
    assert margin_px(CAMERA, tilt, 50.0, 1.0) == pytest.approx(16.0)
    rest = ExecutionErrors(0.0, 5.0, 1.0, 0.0, 0.0, 0.03, 1.0)
    assert margin_px(CAMERA, rest, 50.0, 1.0) == pytest.approx(400 * np.hypot(0.1, 0.03))


def test_with_its_margin_a_plan_holds_and_without_one_it_does_not():
    times, headings, poses = flown()
    held, kept = [], []
    for seed in range(8):
        done = execute(FLAT, poses, headings, times, LOOKS, ERRORS, 2.0, np.random.default_rng(seed))
        held.append(done.held)
        kept.append(done.flown.seen[done.planned.seen].mean())
    assert min(held) >= 0.95
    assert np.mean(kept) < np.mean(held)


def test_a_swing_too_fast_sees_nothing_sharply():
    """A rate of 6 rad/s at a half of it across the lens: 24 px, of 0.25 x 1.5 x 800 / 58 = 5 px allowed."""
    times, headings, poses = flown(rate=20.0, limit=0.8, swing=6.0)
    done = execute(FLAT, poses, headings, times, LOOKS, NONE, 2.0, np.random.default_rng(1))
    assert not done.sharp.any() and not done.planned.seen.any() and (done.planned.blurred > 0).any()
    assert np.isnan(done.held)
    slow = flown(rate=2.0, limit=0.8, swing=0.1)
    done = execute(FLAT, slow[2], slow[1], slow[0], LOOKS, NONE, 2.0, np.random.default_rng(1))
    assert done.sharp.mean() > 0.9
