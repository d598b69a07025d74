"""Whether the course tells the heading: by speeds in all directions, within the inertial samples alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.flown import FLYING, why_no_start
from wildlab.flight.store import Flight


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
