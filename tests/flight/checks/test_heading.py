"""Heading and course: what is named on a circle, and where nothing may be said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.inertial_data import POSITION, QUATERNION
from wildlab.flight.checks.sense.heading import follows, headed, heading
from wildlab.flight.manifest_parts import MountPart
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion

T = np.arange(0, 300, 0.5)
COURSE = 2 * np.pi * T / 120


class _Flight:
    def __init__(self, yaw: Any, course: Any = COURSE, speed: float = 15.0) -> None:
        step = speed * 0.5 * np.column_stack([np.cos(course), np.sin(course), 0 * course])
        table = pd.DataFrame({"time_s": T})
        table[list(POSITION)] = np.cumsum(step, axis=0)
        R = euler_to_matrix(0.1 + 0 * T, 0.02 + 0 * T, yaw)
        table[list(QUATERNION)] = matrix_to_quaternion(R)
        self.nav, self.gimbal = {"log": table}, None
        self.manifest = SimpleNamespace(mount=MountPart())


def causes(flight: _Flight) -> list[str]:
    return [cause for one in heading(flight) for cause in one.causes]


def wrapped(angle: Any) -> Any:
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize(
    ("yaw", "cause"),
    [
        (-COURSE, "attitude: sign of yaw"),
        (COURSE - np.pi / 2, "attitude: yaw off by 90 deg"),
        (COURSE + np.pi / 2, "attitude: yaw off by -90 deg"),
        (COURSE + np.pi, "attitude: yaw off by 180 deg"),
        (np.pi / 2 - COURSE, "attitude: yaw counted from east towards north"),
        (np.radians(wrapped(COURSE)), "attitude: yaw in radians, read as degrees"),
    ],
)
def test_the_usual_mistakes_about_yaw_are_named(yaw, cause):
    assert causes(_Flight(yaw)) == [cause]
    assert [(one.level, one.table) for one in heading(_Flight(yaw))] == [("warning", "nav/log")]


@pytest.mark.parametrize(
    "flight",
    [
        _Flight(COURSE),
        _Flight(COURSE + 0.4 * np.sin(T)),  # wind
        _Flight(0 * T + 0.3),  # a multirotor that always looks one way
        _Flight(np.pi / 2 + 0 * T, course=0 * T),  # straight on, sideways
        _Flight(-COURSE, speed=1.0),  # too slow for a course
        _Flight(np.random.default_rng(1).uniform(-np.pi, np.pi, len(T))),
    ],
)
def test_nothing_is_said_where_no_mistake_explains_it(flight):
    assert causes(flight) == []


def test_the_mean_cosine_is_that_of_a_known_angle():
    given = headed(_Flight(COURSE + 0.3).nav["log"])
    # The course over two seconds is that of their middle, but for the half step the positions lie late.
    np.testing.assert_allclose(follows(*given[:2]), np.cos(0.3), atol=0.02)
