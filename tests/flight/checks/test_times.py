"""Poses, frames and truth of the same time: what is outside, what lies in a gap, and why."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.check import check_flight
from wildlab.flight.checks.findings import Finding
from wildlab.flight.clocks import poses_at
from wildlab.flight.store import Flight

Make = Callable[..., Flight]


def flown(make: Make, seconds: float = 120.0) -> Flight:
    """Poses five times a second, a look of a radar every two seconds with three bearings in each."""
    flight = make()
    t = np.arange(0.0, seconds + 0.1, 0.2)
    flight.nav.clear()
    nav = pd.DataFrame({"time_s": t, "north_m": t, "east_m": 0.0, "down_m": 0.0, "q_w": 1.0})
    flight.nav["log"] = nav.assign(q_x=0.0, q_y=0.0, q_z=0.0)
    looks = np.arange(1.0, seconds, 2.0)
    ids = [f"l{k}" for k in range(len(looks))]
    flight.tables["frames"] = pd.DataFrame({"frame_id": ids, "time_s": looks, "sensor": "radar"})
    detections = pd.DataFrame({"frame_id": np.repeat(ids, 3), "source": "radar", "kind": "range-bearing"})
    n = len(detections)
    detections = detections.assign(azimuth_rad=np.linspace(-3, 3, n), range_m=300.0 + np.arange(n))
    detections["detection_id"] = [str(k) for k in range(n)]
    flight.tables["detections"] = detections
    del flight.tables["truth"]
    return flight


def of_truths(flight: Flight, spans: dict[str, tuple[float, float]]) -> list[Finding]:
    rows = [
        pd.DataFrame({"target_id": name, "time_s": np.arange(low, high + 0.5), "north_m": 900.0})
        for name, (low, high) in spans.items()
    ]
    flight.tables["truth"] = pd.concat(rows, ignore_index=True).assign(east_m=50.0, down_m=0.0)
    found = [one for one in check_flight(flight) if (one.table, one.field) == ("truth", "time_s")]
    return [one for one in found if one.level != "note"]


def of_poses(flight: Flight) -> list[Finding]:
    return [one for one in check_flight(flight) if (one.table, one.field) == ("nav/log", "time_s")]


def test_a_hole_in_the_poses_is_told_with_its_looks_detections_and_seconds(make_flight):
    flight = flown(make_flight)
    nav = flight.nav["log"]
    flight.nav["log"] = nav[(nav["time_s"] < 30.1) | (nav["time_s"] > 89.9)].reset_index(drop=True)
    # At the last pose before the hole, and the first behind it.
    flight.tables["frames"].loc[[14, 45], "time_s"] = flight.nav["log"]["time_s"][[150, 151]].to_numpy()
    (found,) = of_poses(flight)
    assert found.level == "warning"
    # Looks at 31, 33, ..., 89 s, three detections each.
    for counted in ("30 of 60", "from 30.000 s to 90.000 s", "90 of 180"):
        assert counted in found.sentence
    # It is as those who place them find it.
    p, _, _ = poses_at(flight.nav["log"], flight.table("frames")["time_s"])
    assert np.isnan(p[:, 0]).sum() == 30


def test_poses_as_slow_as_their_own_rate_have_no_hole(make_flight):
    flight = flown(make_flight)
    assert of_poses(flight) == []
    flight.nav["log"] = flight.nav["log"].iloc[::30].reset_index(drop=True)  # one in six seconds
    assert of_poses(flight) == []
    flight.nav["log"] = flight.nav["log"].iloc[:1]  # of a mast
    assert not any("without a pose" in one.sentence for one in of_poses(flight))


def test_receivers_that_end_early_are_one_warning_without_the_zone(make_flight):
    names = [f"collar {k}" for k in range(7)]
    (found,) = of_truths(flown(make_flight), {name: (0.0, 90.0 + 0.3 * k) for k, name in enumerate(names)})
    assert found.level == "warning"
    assert "between 90.000 and 92.000 s" in found.sentence
    assert "15 of 60" in found.sentence and "29.0 s" in found.fix  # 91 to 119 s, of the first to end


def test_receivers_of_different_times_are_told_apart(make_flight):
    found = of_truths(flown(make_flight), {"a": (0.0, 90.0), "b": (0.0, 40.0), "c": (0.0, 91.0)})
    assert ["'b'" in one.sentence for one in found] == [False, True]


@pytest.mark.parametrize(("begins_s", "zone"), [(900.0, True), (930.0, True), (1200.0, False)])
def test_the_zone_is_named_near_quarters_of_an_hour(make_flight, begins_s, zone):
    (found,) = of_truths(flown(make_flight, 2400.0), {"boat": (begins_s, 2500.0)})
    assert ("zone" in found.fix) == zone
    assert (f"{begins_s - 1:.1f} s after" in found.fix) != zone


def test_truth_of_another_day_is_a_problem_that_names_the_zone(make_flight):
    found = of_truths(flown(make_flight), {"boat": (7200.0, 7300.0)})[0]
    assert found.level == "problem" and "time zone" in found.fix
