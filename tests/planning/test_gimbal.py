"""Strategies of a gimbal: where the camera looks, how fast it turns, and when it turns round."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.geometry.camera import Camera
from wildlab.geometry.georeference import Terrain
from wildlab.planning.gimbal import (
    NADIR,
    GimbalAngles,
    adapt_roll,
    blur,
    camera_attitudes,
    camera_on_course,
    look_down,
    swing,
    swing_rate,
    swing_roll,
    view_inside,
)
from wildlab.planning.patterns import rectangle

CAMERA = Camera(100, 80, 200.0, 200.0, 50.0, 40.0)
FLAT = Terrain(np.zeros((3, 3), np.float32), north=-500.0, east=-500.0, step=500.0)


def test_a_swing_keeps_its_rate_and_its_limits():
    t = np.linspace(0, 20, 4001)
    angle = swing(t, 0.7, 0.35)
    assert np.abs(angle).max() == pytest.approx(0.7, abs=1e-3)
    rates = np.abs(np.diff(angle)) / np.diff(t)
    assert np.median(rates) == pytest.approx(0.35) and rates.max() <= 0.35 + 1e-9
    assert np.allclose(swing(t + 8.0, 0.7, 0.35), angle)  # 4 x 0.7 / 0.35
    assert np.allclose(swing(t, 0.7, 0.35, start=0.5), -angle)
    assert (swing(t, 0.0, 1.0) == 0).all()


def test_what_one_swing_shows_the_next_shows_again_to_the_overlap():
    rate = swing_rate(0.6, 20.0, 5.0, overlap=0.3)
    period = 4 * 0.6 / rate
    t = np.linspace(0, 3, 50)
    assert np.allclose(swing(t + period, 0.6, rate), swing(t, 0.6, rate))
    assert 1 - 5.0 * period / 20.0 == pytest.approx(0.3)


def test_where_the_lens_points():
    """Heading east: ahead is east, left is north."""
    axis = np.array([0.0, 0.0, 1.0])
    east = np.array([np.pi / 2])

    def looks(roll: float, pitch: float, yaw: float) -> np.ndarray:
        angles = GimbalAngles(*(np.array([one]) for one in (0.0, roll, pitch, yaw)))
        return np.asarray(camera_attitudes(east, angles)[0] @ axis)

    assert np.allclose(looks(0, NADIR, 0), [0, 0, 1])
    assert np.allclose(looks(0, np.radians(-30), 0), [0, np.cos(np.pi / 6), 0.5])
    assert np.allclose(looks(0.4, NADIR, 0), [np.sin(0.4), 0, np.cos(0.4)])  # left, to the north
    right = looks(0, np.radians(-60), np.pi / 2)
    assert np.allclose(right, [-0.5, 0, np.sqrt(0.75)])
    # The top of a level camera's image is ahead.
    assert np.allclose(camera_attitudes(east, look_down([0.0]))[0] @ [0, -1, 0], [0, 1, 0], atol=1e-12)


def test_blur_is_angle_rate_times_exposure_times_focal_length():
    t = np.arange(0.0, 4.0, 0.1)
    still = np.tile([0.0, 0.0, -50.0], (len(t), 1))

    def blurred(p: np.ndarray, headings: np.ndarray, angles: GimbalAngles) -> np.ndarray:
        return blur(CAMERA, camera_on_course(CAMERA, p, headings, angles), t, 0.02, 50.0)

    assert np.allclose(blurred(still, 0 * t, swing_roll(t, 10.0, 0.6)), 0.6 * 0.02 * 200)
    # Where it turns round, that of the faster side.
    assert blurred(still, 0 * t, swing_roll(t, 0.6, 0.6)).min() > 0.99 * 0.6 * 0.02 * 200
    moving = still + np.outer(t, [5.0, 0.0, 0.0])
    assert np.allclose(blurred(moving, 0 * t, look_down(t)), 5.0 / 50 * 0.02 * 200)
    # About the optical axis, the corner: a camera that looks down on a platform that turns.
    assert np.allclose(blurred(still, 0.3 * t, look_down(t)), 0.3 * 0.02 * np.hypot(50, 40))


def test_the_view_is_inside_as_its_corners_are():
    """From 20 m the image is 10 m by 8 m (a top to the north, so 8 m along north)."""
    p = np.array([[0.0, 0.0, -20.0], [0.0, 8.0, -20.0], [900.0, 0.0, -20.0]])
    fences = [rectangle(0, 0, 20, 20, 0.0)]
    rolls = np.radians([-80.0, -20.0, 0.0])
    inside = view_inside(CAMERA, p, np.zeros(3), rolls, NADIR, fences, FLAT)
    # At 8 m east half of the view is outside; rolled to the right (negative) it is further out.
    assert inside.tolist() == [[False, False, True], [False, False, False], [False, False, False]]
    assert view_inside(CAMERA, p[1:2], [0.0], np.radians([20.0]), NADIR, fences, FLAT).all()


def test_inside_the_camera_swings_to_the_maximum_and_outside_to_the_minimum():
    t = np.arange(0.0, 400.0, 0.1)
    rolls = np.linspace(-1, 1, 21)
    for inside, limit in ((True, 0.9), (False, 0.3)):
        known = np.full((len(t), 21), inside)
        roll = adapt_roll(t, known, rolls, (0.3, 0.9), 0.2).roll
        assert roll.max() == pytest.approx(limit, abs=0.021) and roll.min() == pytest.approx(
            -limit, abs=0.021
        )
        turns = np.flatnonzero(np.diff(np.sign(np.diff(roll))) != 0)
        # It never turns round twice in a row, as the printed algorithm would.
        assert np.diff(turns).min() > 2 * limit / 0.2 / 0.1 * 0.9
