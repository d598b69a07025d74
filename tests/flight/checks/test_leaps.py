"""A leap of a position is told from a clock that is off, on flights with one, the other, or both."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.checks.flights import track
from tests.flight.checks.test_mistakes_named import moved, scale
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.motion import find_leaps, positions, stray_places, without_leaps


def causes(found: list[Finding]) -> set[str]:
    return {cause for one in found for cause in one.causes}


@pytest.mark.parametrize("who", ["gnss", "nav"])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_leap_is_not_the_clock_though_it_looks_like_one(who, velocity):
    flight = track(leap=60.0, who=who, velocity=velocity)
    # Without what tells the two apart the clock is blamed: 60 m at 17 m/s are three and a half seconds.
    assert "clock of the receiver" in causes(list(positions(flight)))
    found = find(flight, plain=False)
    assert causes(found) == {"leap of the position"}
    (leap,) = (one for one in found if one.causes)
    assert leap.table == ("gnss" if who == "gnss" else "nav/autopilot")
    assert "60 m at 25.0 s" in leap.sentence


@pytest.mark.parametrize(
    "spoil", [moved([0, 0, -40.0], "gnss"), scale(["north_m"], -1, "gnss")], ids=["height", "north"]
)
def test_a_mistake_about_places_is_undone(spoil):
    wrong = spoil(track(turning=0.8))
    assert any(list(positions(undo(wrong))) == [] for one in positions(wrong) for undo in one.corrections)


@pytest.mark.parametrize("turning", [0.0, 0.8])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_clock_that_is_off_is_still_named(turning, velocity):
    flight = track(clock=3.5, velocity=velocity, turning=turning)
    assert "clock of the receiver" in causes(find(flight, plain=False))
    assert without_leaps(flight)[1] == []


def test_both_are_named_where_both_are():
    found = find(track(leap=60.0, clock=3.5, turning=0.8), plain=False)
    assert {"leap of the position", "clock of the receiver"} <= causes(found)


@settings(max_examples=12, deadline=None)
@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(10, 110), st.booleans(), st.integers(0, 99))
def test_a_leap_comes_off_as_it_went_on(north, east, at, bare, seed):
    clean = track(seed=seed, turning=0.5).nav["autopilot"]
    table = clean.drop(columns=["v_north_m_s", "v_east_m_s", "v_down_m_s"]) if bare else clean
    behind = table["time_s"].to_numpy() >= at
    leapt = table.assign(
        north_m=table["north_m"] + np.where(behind, north, 0),
        east_m=table["east_m"] + np.where(behind, east, 0),
    )
    assert find_leaps(table) == []
    found = find_leaps(leapt)
    if np.hypot(north, east) > 10:
        (one,) = found
        assert abs(one.time_s - at) <= 0.11
        np.testing.assert_allclose(one.by, [north, east, 0], atol=2.5)
    elif np.hypot(north, east) < 3:
        assert found == []


def test_a_stray_place_and_a_gap_are_no_leaps():
    table = track().nav["autopilot"]
    stray = table.copy()
    stray.loc[500:502, "north_m"] += 80.0
    assert find_leaps(stray) == []
    assert find_leaps(table[(table["time_s"] < 40) | (table["time_s"] > 60)]) == []


@pytest.mark.parametrize(("speed", "radius"), [(15.0, 30.0), (22.0, 60.0), (22.0, 50.0)])
def test_turns_of_a_log_of_a_second_without_velocities_are_no_leaps(speed, radius):
    """One oval of two legs of 500 m, banked by up to 45 degrees."""
    leg, turn = 500.0, np.pi * radius
    times = np.arange(0.0, 2 * (leg + turn) / speed)
    along = speed * times
    back, rest = along >= leg + turn, along % (leg + turn)
    angle = np.clip(rest - leg, 0, None) / radius
    places = np.stack([np.minimum(rest, leg) + radius * np.sin(angle), radius * (1 - np.cos(angle))], axis=1)
    places = np.where(back[:, None], [[leg, 2 * radius]] - places, places)
    places = places + np.random.default_rng(1).normal(0, 0.1, places.shape)
    table = pd.DataFrame(places, columns=["north_m", "east_m"]).assign(down_m=-80.0, time_s=times)
    assert not [one for one in find_leaps(table) if np.hypot(*one.by[:2]) > 25]


@pytest.mark.parametrize(("row", "by", "named"), [(0, 5e4, 1), (300, 5e4, 1), (-1, 9e5, 1), (300, 60.0, 0)])
def test_a_place_that_nothing_goes_to_is_named(row, by, named):
    flight = track()
    nav = flight.nav["autopilot"].copy()
    nav.loc[nav.index[row], "north_m"] += by
    spoilt = replace(flight, nav={"autopilot": nav})
    found = [one for one in stray_places(spoilt)]
    assert len(found) == named and not list(stray_places(flight))
    for one in found:
        assert (one.table, one.facts["n"]) == ("nav/autopilot", 1)
        assert one.facts["size"] == pytest.approx(by, rel=0.01)
        assert one.code in {finding.code for finding in find(spoilt)}
