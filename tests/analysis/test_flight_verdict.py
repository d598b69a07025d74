"""One verdict for a flight and its reports, and the alarms that decide it."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.analysis.conftest import build, receiver
from wildlab.analysis.overview import Overview, look_over
from wildlab.analysis.verdict import (
    Evidence,
    Verdict,
    verdict_of,
)
from wildlab.evaluation.intervals import Interval
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin

NAN = math.nan
#: Nothing is against it.
GOOD = Evidence(lost=0.1, gain=0.02, possible=0.0, points=90, excess=(Interval(1.0, 0.9, 1.2),), judged=1)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, Verdict.SOUND),
        ({"judged": 0}, Verdict.UNJUDGED),
        ({"excess": (Interval(1.3, 1.1, 1.6),)}, Verdict.LOOK),
        ({"excess": (Interval(1.3, 0.9, 1.6),)}, Verdict.SOUND),  # may be by chance
        ({"excess": (Interval(1.02, 1.01, 1.03),)}, Verdict.SOUND),  # certain, and of no consequence
        ({"excess": (Interval(0.2, 0.1, 0.4),)}, Verdict.LOOK),  # ellipses five times too long
        ({"excess": (Interval(0.6, 0.4, 0.9),)}, Verdict.SOUND),
        ({"excess": (Interval(NAN, NAN, NAN),)}, Verdict.SOUND),
        ({"points": 9}, Verdict.LOOK),
        ({"points": NAN}, Verdict.SOUND),
        ({"possible": 0.1}, Verdict.LOOK),
        ({"possible": NAN, "gain": NAN, "lost": NAN}, Verdict.SOUND),
        ({"troubled": 1}, Verdict.LOOK),
        ({"gain": 0.1, "troubled": 1}, Verdict.FIX),
        ({"gain": 0.9, "alarmed": 1}, Verdict.LOOK),
        ({"gain": 0.9, "lost": 0.21}, Verdict.MEND),
        ({"gain": 0.9, "problems": 1}, Verdict.MEND),
        ({"problems": 1, "broken": 1}, Verdict.ALARM),
    ],
)
def test_each_number_turns_the_verdict(changes, verdict):
    assert verdict_of(GOOD._replace(**changes)) == verdict


verdicts = st.sampled_from(list(Verdict))


@given(st.lists(verdicts, max_size=3), st.integers(0, 1), st.integers(0, 2))
def test_no_part_presses_more_than_the_flight(parts, problems, judged):
    whole = verdict_of(Evidence(problems=problems, judged=judged, parts=tuple(parts)))
    assert whole.level >= max((one.level for one in parts), default=-1)
    assert whole != Verdict.SOUND or not any(one.level > 0 for one in parts)


# --- what went wrong on a flight is found with its size and time, and nothing on a sound one


@pytest.mark.parametrize("speeds", [True, False])
def test_a_leap_is_found_with_and_without_speeds(speeds):
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
    assert jump.size == pytest.approx(40, abs=1) and jump.worst == nav["time_s"].iloc[199]
    (trouble,) = [one for one in seen(leap).troubles if one.what == "position jumps"]
    assert trouble.spells == pytest.approx(nav["time_s"].to_numpy()[None, 199:201])


def test_an_airframe_that_leans_as_nobody_flies_went_wrong():
    twin = simulate_twin("large-ship", 1)
    nav = twin.nav["autopilot"].copy()
    half = np.radians(113.0) / 2
    nav.loc[300:309, ["q_w", "q_x", "q_y", "q_z"]] = [np.cos(half), np.sin(half), 0.0, 0.0]
    flight = Flight(twin.manifest, {"autopilot": nav}, dict(twin.tables))
    (lean,) = look_over(flight).alarms
    assert (lean.what, lean.broken) == ("leans", True) and lean.size == pytest.approx(113)
    assert lean.share == pytest.approx(10 / len(nav))
    assert not look_over(twin, "autopilot").alarms


def shaken(size: float) -> pd.DataFrame:
    """An inertial sensor of the flight of twenty images, of which one second shakes at 20 Hz."""
    t = np.arange(-2.0, 22.0, 0.005)
    force = np.where((t > 12) & (t < 13), size * np.sin(2 * np.pi * 20 * t), 0.0)
    turns = {"w_x_rad_s": 0.075 * np.cos(0.5 * t), "w_y_rad_s": -0.09 * np.sin(0.9 * t), "w_z_rad_s": 0.4}
    return pd.DataFrame({"time_s": t, "f_x_m_s2": force, "f_y_m_s2": 0.0, "f_z_m_s2": -9.81, **turns})


def test_harmful_shaking_is_an_alarm():
    flight = build(n_images=20)
    flight.tables["imu"] = shaken(150.0)
    (shaking,) = look_over(flight).alarms
    assert 12 < shaking.worst < 13.1 and shaking.size > 60 and not shaking.broken
    flight.tables["imu"] = shaken(50.0)
    assert not look_over(flight).alarms


def test_poses_that_contradict_the_satellites_are_an_alarm():
    flight = build(n_images=40)
    gnss = flight.tables["gnss"] = receiver(flight)
    assert not look_over(flight).alarms
    gnss.loc[:9, "north_m"] += 12.0
    (apart,) = look_over(flight).alarms
    assert (apart.what, apart.often) == ("apart", 10) and apart.size == pytest.approx(12, abs=1e-6)
    assert apart.share == pytest.approx(10 / len(gnss))
    # What the receiver itself says it does not know is no contradiction.
    flight.tables["gnss"] = gnss.assign(sd_horizontal_m=6.0)
    assert not look_over(flight).alarms
