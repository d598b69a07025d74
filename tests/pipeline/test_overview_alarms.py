"""What went wrong on a flight is found with its size and time, and nothing on a sound one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.store import Flight
from wildlab.pipeline.overviews.overview import look_over
from wildlab.pipeline.overviews.worth_fixing import numbers_of, possible_gain
from wildlab.reporting.overview import counts_of
from wildlab.simulation.twins import simulate_twin


def leapt(twin: Flight, *, speeds: bool = True) -> Flight:
    """A twin whose poses leap by 40 m after 200 samples, once, and lie there from then on."""
    nav = twin.nav["autopilot"].copy()
    nav.loc[200:, "east_m"] += 40.0
    nav = nav if speeds else nav.drop(columns=["v_north_m_s", "v_east_m_s", "v_down_m_s"])
    return Flight(twin.manifest, {"autopilot": nav}, dict(twin.tables))


@pytest.mark.parametrize("speeds", [True, False])
def test_a_leap_is_found_with_and_without_speeds(speeds: bool) -> None:
    twin = simulate_twin("large-ship", 1)
    jump = look_over(leapt(twin, speeds=speeds)).alarms[0]
    nav = twin.nav["autopilot"]
    assert (jump.what, jump.often, jump.broken) == ("jumps", 1, True) and jump.size == pytest.approx(
        40, abs=1
    )
    assert jump.first == pytest.approx(nav["time_s"].iloc[199])
    bare = nav.drop(columns=["v_north_m_s", "v_east_m_s", "v_down_m_s"])
    whole = Flight(twin.manifest, {"autopilot": bare}, dict(twin.tables))
    assert not [one for one in look_over(whole).alarms if one.what == "jumps"]


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
    nav = flight.nav["logged"]
    t = np.arange(float(nav["time_s"].min()), float(nav["time_s"].max()), 0.5)
    at = {name: np.interp(t, nav["time_s"], nav[name]) for name in ("north_m", "east_m", "down_m")}
    gnss = pd.DataFrame({"time_s": t, **at})
    flight.tables["gnss"] = gnss
    assert not look_over(flight).alarms
    gnss.loc[:9, "north_m"] += 12.0
    (apart,) = look_over(flight).alarms
    assert (apart.what, apart.often) == ("apart", 10) and apart.size == pytest.approx(12, abs=1e-6)
    assert apart.share == pytest.approx(10 / len(t))
    # What the receiver itself says it does not know is no contradiction.
    flight.tables["gnss"] = gnss.assign(sd_horizontal_m=6.0)
    assert not look_over(flight).alarms


def test_poses_that_pause_shortly_count_as_trouble(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight(n_images=80)
    nav = flight.nav["logged"]
    assert counts_of(look_over(flight), [], 0, 1, None)["troubled"] == 0
    flight.nav["logged"] = nav[(nav["time_s"] < 10.05) | (nav["time_s"] > 11.95)].reset_index(drop=True)
    assert counts_of(look_over(flight), [], 0, 1, None)["troubled"] == 1


@pytest.mark.parametrize(("gain", "possible"), [(1.6, True), (0.3, False)])
def test_a_gain_that_is_large_and_not_certain_is_possible(gain: float, possible: bool) -> None:
    entry = {"low": 0.28, "high": 2.88, "n": 90}
    numbers = numbers_of([{"metrics": [
        {"name": "gain", "subject": "winner", "value": gain, **entry},
        {"name": "horizontal_error_mean", "subject": "logged-pose", "value": 4.5, **entry},
    ]}])  # fmt: skip
    found = possible_gain(numbers)
    assert (found is not None and found.share == pytest.approx(gain / 4.5)) == possible
