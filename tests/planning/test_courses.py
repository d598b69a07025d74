"""Courses: times by the wind triangle, turns that can be flown."""

from __future__ import annotations

import numpy as np
import pytest

from tests.planning.ground import length
from wildlab.geometry.frames import wrap
from wildlab.planning.courses import dubins, fly
from wildlab.planning.patterns import lawn_mower, rectangle


def curvature(points: np.ndarray) -> np.ndarray:
    step = np.diff(points, axis=0)
    far = np.linalg.norm(step, axis=1)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    return np.abs(np.diff(heading)) / ((far[1:] + far[:-1]) / 2)


def test_a_dubins_way_turns_no_tighter_and_keeps_both_headings():
    rng = np.random.default_rng(1)
    for _ in range(200):
        end, a, b = rng.uniform(-60, 60, 2), *rng.uniform(-np.pi, np.pi, 2)
        way = dubins([0.0, 0.0], a, end, b, 20.0, 0.2)
        step = np.diff(way, axis=0)
        heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        assert np.abs(np.diff(heading)).max() < 0.013
        assert abs(wrap(heading[0] - a)) < 0.01 and abs(wrap(heading[-1] - b)) < 0.01
        assert np.allclose(way[-1], end)


def test_no_way_of_random_turns_is_shorter():
    """Ways of up to four arcs and lines that happen to arrive bound the shortest one from above."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        here, angle, flown = np.zeros(2), 0.0, 0.0
        for _ in range(4):
            sense, part = int(rng.integers(-1, 2)), float(rng.uniform(0, 2.5))
            if sense:
                centre = here + sense * np.array([-np.sin(angle), np.cos(angle)])
                angle += sense * part
                here = centre - sense * np.array([-np.sin(angle), np.cos(angle)])
            else:
                here = here + part * np.array([np.cos(angle), np.sin(angle)])
            flown += part
        way = dubins([0.0, 0.0], 0.0, here, angle, 1.0, 0.01)
        assert length(way) <= flown + 1e-6


def test_wind_along_and_across_a_leg():
    leg = [[0.0, 0.0], [120.0, 0.0]]
    assert fly(leg, 10.0, wind=[2.0, 0.0]).duration == pytest.approx(10.0)
    assert fly(leg, 10.0, wind=[-4.0, 0.0]).duration == pytest.approx(20.0)
    assert fly(leg, 10.0, wind=[0.0, 6.0]).duration == pytest.approx(15.0)


def test_stops_take_their_time_and_the_heading_turns_meanwhile():
    course = fly([[0.0, 0.0], [50.0, 0.0], [50.0, 20.0]], 5.0, turn_time=4.0)
    points, headings = course.at([9.0, 12.0, 14.0, 16.0])
    assert np.allclose(points, [[45, 0], [50, 0], [50, 0], [50, 10]])
    assert np.allclose(course.distances([9.0, 12.0, 14.0, 16.0]), [45, 50, 50, 60])
    assert np.allclose(headings, [0, np.pi / 4, np.pi / 2, np.pi / 2])
    assert course.on_row.tolist() == [True, False, True, False]


def test_what_cannot_stop_flies_every_row_and_turns_between_no_tighter_than_it_can():
    pattern = lawn_mower(rectangle(0, 0, 300, 100, 0.3), 20.0)
    course = fly(pattern, 15.0, turn_radius=30.0, spacing=0.5)
    assert curvature(course.points).max() < 1 / 30.0 * 1.001
    for row in pattern.rows:
        assert np.abs(course.points[:, None] - row[None]).max(axis=2).min(axis=0).max() < 1e-9
    on = np.linalg.norm(np.diff(course.points, axis=0), axis=1)[course.on_row[:-1]].sum()
    assert on == pytest.approx(np.linalg.norm(pattern.rows[:, 1] - pattern.rows[:, 0], axis=1).sum())
    windy = fly(pattern, 15.0, turn_radius=30.0, wind=[5.0, 0.0])
    assert windy.duration > course.duration and curvature(windy.points).max() < 1 / 30.0 / (4 / 3) ** 2 * 1.01
