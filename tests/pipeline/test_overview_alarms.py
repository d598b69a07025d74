"""What went wrong on a flight is found with its size and time, and nothing on a sound one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from tests.pipeline.conftest import receiver
from wildlab.flight.store import Flight
from wildlab.pipeline.overviews.overview import Overview, look_over
from wildlab.simulation.twins import simulate_twin


@pytest.mark.parametrize("speeds", [True, False])
def test_a_leap_is_found_with_and_without_speeds(speeds: bool) -> None:
    twin = simulate_twin("large-ship", 1)
    nav = twin.nav["autopilot"]
    if not speeds:
        nav = nav.drop(columns=["v_north_m_s", "v_east_m_s", "v_down_m_s"])

    def seen(nav: pd.DataFrame) -> Overview:
        return look_over(Flight(twin.manifest, {"autopilot": nav}, dict(twin.tables)))

    assert not seen(nav).alarms and not seen(nav).troubles
    leap = nav.assign(east_m=nav["east_m"] + 40.0 * (nav.index >= 200))
    jump = seen(leap).alarms[0]
    assert (jump.what, jump.often, jump.broken) == ("jumps", 1, True)
    assert jump.size == pytest.approx(40, abs=1) and jump.first == nav["time_s"].iloc[199]
    (trouble,) = [one for one in seen(leap).troubles if one.what == "position jumps"]
    assert trouble.spells == pytest.approx(nav["time_s"].to_numpy()[None, 199:201])


def test_an_airframe_that_leans_as_nobody_flies_went_wrong() -> None:
    twin = simulate_twin("large-ship", 1)
    nav = twin.nav["autopilot"].copy()
    half = np.radians(113.0) / 2
    nav.loc[300:309, ["q_w", "q_x", "q_y", "q_z"]] = [np.cos(half), np.sin(half), 0.0, 0.0]
    flight = Flight(twin.manifest, {"autopilot": nav}, dict(twin.tables))
    (lean,) = look_over(flight).alarms
    assert (lean.what, lean.broken) == ("leans", True) and lean.size == pytest.approx(113)
    assert lean.share == pytest.approx(10 / len(nav)) and lean.first == nav["time_s"].iloc[300]
    assert not look_over(twin, "autopilot").alarms


def shaken(size: float) -> pd.DataFrame:
    """An inertial sensor of the flight of twenty images, of which one second shakes at 20 Hz."""
    t = np.arange(-2.0, 22.0, 0.005)
    force = np.where((t > 12) & (t < 13), size * np.sin(2 * np.pi * 20 * t), 0.0)
    turns = {"w_x_rad_s": 0.075 * np.cos(0.5 * t), "w_y_rad_s": -0.09 * np.sin(0.9 * t), "w_z_rad_s": 0.4}
    return pd.DataFrame({"time_s": t, "f_x_m_s2": force, "f_y_m_s2": 0.0, "f_z_m_s2": -9.81, **turns})


def test_harmful_shaking_is_an_alarm(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight(n_images=20)
    flight.tables["imu"] = shaken(150.0)
    (shaking,) = look_over(flight).alarms
    assert 12 < shaking.worst < 13.1 and shaking.size > 60 and not shaking.broken
    flight.tables["imu"] = shaken(50.0)
    assert not look_over(flight).alarms


def test_poses_that_contradict_the_satellites_are_an_alarm(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight(n_images=40)
    gnss = flight.tables["gnss"] = receiver(flight)
    assert not look_over(flight).alarms
    gnss.loc[:9, "north_m"] += 12.0
    (apart,) = look_over(flight).alarms
    assert (apart.what, apart.often) == ("apart", 10) and apart.size == pytest.approx(12, abs=1e-6)
    assert apart.share == pytest.approx(10 / len(gnss))
    # What the receiver itself says it does not know is no contradiction.
    flight.tables["gnss"] = gnss.assign(sd_horizontal_m=6.0)
    assert not look_over(flight).alarms
