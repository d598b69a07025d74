"""Means of inertial samples, speeds and courses: what tells the heading, and where nothing may be said."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.flight.checks.attitude import follows, headed, heading
from wildlab.flight.checks.inertial import FLYING, Inertial, samples, why_no_start
from wildlab.flight.manifest import MountPart
from wildlab.flight.schema import FORCE, POSITION, QUATERNION, RATE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion

TIMES = np.cumsum(np.concatenate([[2.0], 0.01 + 0.005 * np.sin(np.arange(400))]))


def ramps(offset: float, slope: float) -> Inertial:
    """Columns ``(k + 1) (offset + slope t)``: forces k = 0 to 2, rates k = 3 to 5."""
    columns = {name: (k + 1) * (offset + slope * TIMES) for k, name in enumerate((*FORCE, *RATE))}
    return Inertial(TIMES, columns)


@given(st.floats(-10, 10), st.floats(-5, 5), st.floats(2.01, 4.0), st.floats(0.1, 1.5))
def test_the_mean_of_a_ramp_is_its_value_in_the_middle(offset, slope, start, length):
    imu, end = ramps(offset, slope), start + length
    begin, stop = TIMES[[np.searchsorted(TIMES, at) for at in (start, end)]]
    middle = offset + slope * (begin + stop) / 2
    for names, factors in ((FORCE, [1, 2, 3]), (RATE, [4, 5, 6])):
        found = imu.mean(names, np.array([begin, 0.0, begin]), np.array([stop, stop, 99.0]))
        np.testing.assert_allclose(found[0], middle * np.array(factors), atol=1e-9)
        assert np.isnan(found[1:]).all()


def test_samples_without_a_number_are_left_out():
    class Flight:
        imu = pd.DataFrame({"time_s": TIMES, **{name: 1.0 + 0 * TIMES for name in (*FORCE, *RATE)}})

    Flight.imu.loc[5, "w_y_rad_s"] = np.nan
    found = samples(Flight())
    assert found is not None and len(found.times) == len(TIMES) - 1 and TIMES[5] not in found.times
    Flight.imu.loc[7, "time_s"] = TIMES[3]
    assert samples(Flight()) is None


def flown(make_flight: Callable[..., Flight], north: float, east: float, *, velocities: bool) -> Flight:
    """A straight flight of 20 s at an even speed, with inertial samples in its second half."""
    flight, t = make_flight(), np.arange(21.0)
    zeros = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
    flight.tables["imu"] = pd.DataFrame({"time_s": np.arange(10, 20.1, 0.1)}).assign(
        **dict.fromkeys(zeros, 0.0)
    )
    gnss = pd.DataFrame({"time_s": t, "north_m": north * t, "east_m": east * t, "down_m": -50.0})
    if velocities:
        gnss = gnss.assign(v_north_m_s=north, v_east_m_s=east, v_down_m_s=0.0)
    flight.tables["gnss"] = gnss
    return flight


@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("turn", np.radians([0, 37, 90, 200, 300]))
def test_the_speed_counts_whichever_way_it_goes(make_flight, turn, velocities):
    for speed, fast in ((FLYING + 0.1, True), (FLYING - 0.1, False)):
        flight = flown(make_flight, speed * np.cos(turn), speed * np.sin(turn), velocities=velocities)
        why = why_no_start(flight)
        assert why == "" if fast else f"moves at {speed:.1f} m/s" in why


def test_what_was_fast_before_the_inertial_samples_tells_nothing(make_flight):
    flight = flown(make_flight, 3.0, 0.0, velocities=True)
    flight.tables["gnss"].loc[:8, "v_east_m_s"] = 20.0
    assert "moves at 3.0 m/s" in why_no_start(flight)
    flight.tables["gnss"] = flight.tables["gnss"].loc[:8]
    assert "no satellite position is of a time with inertial measurements" in why_no_start(flight)


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
    np.testing.assert_allclose(follows(given[0], np.angle(given[1])), np.cos(0.3), atol=0.02)
