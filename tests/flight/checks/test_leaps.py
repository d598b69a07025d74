"""A leap of a position is told from a clock that is off, on flights with one, the other, or both."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.conftest import MANIFEST
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.motion import find_leaps, positions, without_leaps
from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight

SPEED = np.array([16.0, 6.0, 0.0])


def way(t: np.ndarray, turning: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (N, 3) of a flight that swings by so many radians about a straight line."""
    turn = turning * np.sin(t / 15)
    v = np.column_stack([np.cos(turn) * SPEED[0], SPEED[1] + np.sin(turn) * SPEED[0], 0 * t])
    p = np.cumsum(v, axis=0) * (t[1] - t[0]) + [0.0, 0.0, -80.0]
    return p, v


def straight_flight(
    *,
    leap: float = 0.0,
    clock: float = 0.0,
    who: str = "gnss",
    velocity: bool = True,
    turning: float = 0.0,
    seed: int = 0,
) -> Flight:
    """Two minutes at 17 m/s, straight on or swinging; ``who`` leaps along its way, a clock is off."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 120.0, 0.1)
    p, v = way(t, turning)
    fixes = slice(None, None, 2)
    along = leap * SPEED / np.linalg.norm(SPEED)
    leapt = np.where((t >= 25.0)[:, None], along, 0.0)
    own = p + (leapt if who == "nav" else 0.0) + rng.normal(0, 0.05, p.shape)
    said = p + (leapt if who == "gnss" else 0.0) + np.cumsum(rng.normal(0, 0.03, p.shape), axis=0)
    columns = ["north_m", "east_m", "down_m"]
    speeds = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
    nav = pd.DataFrame(own, columns=columns).assign(time_s=t, q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0)
    nav[speeds] = v + rng.normal(0, 0.1, v.shape)
    gnss = pd.DataFrame(said[fixes], columns=columns).assign(time_s=t[fixes] - clock)
    if velocity:
        gnss[speeds] = (v + rng.normal(0, 0.2, v.shape))[fixes]
    manifest = make_manifest({key: value for key, value in MANIFEST.items() if key != "camera"})
    return Flight(manifest, {"autopilot": nav}, {"gnss": gnss})


def causes(found: list[Finding]) -> set[str]:
    return {cause for one in found for cause in one.causes}


@pytest.mark.parametrize("who", ["gnss", "nav"])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_leap_is_not_the_clock_though_it_looks_like_one(who, velocity):
    flight = straight_flight(leap=60.0, who=who, velocity=velocity)
    # Without what tells the two apart the clock is blamed: 60 m at 17 m/s are three and a half seconds.
    assert "clock of the receiver" in causes(list(positions(flight)))
    found = find(flight, plain=False)
    assert causes(found) == {"leap of the position"}
    (leap,) = (one for one in found if one.causes)
    assert leap.table == ("gnss" if who == "gnss" else "nav/autopilot")
    assert "60 m at 25.0 s" in leap.sentence


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda p: p - [0, 0, 40.0], "constant height"),
        (lambda p: p * [-1, 1, 1], "gnss: north negated"),
        (lambda p: p[:, [1, 0, 2]], "gnss: north and east exchanged"),
    ],
)
def test_mistakes_about_places_are_named_and_undone(change, cause):
    flight = straight_flight(turning=0.8)
    columns = ["north_m", "east_m", "down_m"]
    flight.tables["gnss"][columns] = change(flight.tables["gnss"][columns].to_numpy())
    found = [one for one in positions(flight) if cause in one.causes]
    assert any(list(positions(undo(flight))) == [] for one in found for undo in one.corrections)


@pytest.mark.parametrize("turning", [0.0, 0.8])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_clock_that_is_off_is_still_named(turning, velocity):
    flight = straight_flight(clock=3.5, velocity=velocity, turning=turning)
    assert "clock of the receiver" in causes(find(flight, plain=False))
    assert without_leaps(flight)[1] == []


def test_both_are_named_where_both_are():
    found = find(straight_flight(leap=60.0, clock=3.5, turning=0.8), plain=False)
    assert {"leap of the position", "clock of the receiver"} <= causes(found)


@settings(max_examples=12, deadline=None)
@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(10, 110), st.booleans(), st.integers(0, 99))
def test_a_leap_comes_off_as_it_went_on(north, east, at, bare, seed):
    clean = straight_flight(seed=seed, turning=0.5).nav["autopilot"]
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
    table = straight_flight().nav["autopilot"]
    stray = table.copy()
    stray.loc[500:502, "north_m"] += 80.0
    assert find_leaps(stray) == []
    assert find_leaps(table[(table["time_s"] < 40) | (table["time_s"] > 60)]) == []
