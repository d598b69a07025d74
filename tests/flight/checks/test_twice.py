"""Detections that stand in the table twice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.check import check_flight
from wildlab.flight.checks.twice import twice
from wildlab.flight.store import Flight

Make = Callable[..., Flight]


def said(flight: Flight) -> list[str]:
    found = [one for one in check_flight(flight) if one.field == "detection_id"]
    assert all(one.level == "warning" for one in found)
    return [one.sentence for one in found]


def seen(make: Make) -> Flight:
    """Four detections in three looks, all different."""
    flight = make()
    frames = flight.table("frames")["frame_id"]
    flight.tables["detections"] = pd.DataFrame(
        {
            "detection_id": list("abcd"),
            "frame_id": [frames[0], frames[0], frames[1], frames[2]],
            "source": "radar",
            "kind": "position",
            "target_id": "",
            "north_m": [10.0, 20.0, 10.0, 10.0],
            "east_m": 2.0,
            "down_m": 0.0,
        }
    )
    return flight


def test_rows_that_stand_there_again_are_counted(make_flight):
    flight = seen(make_flight)
    once = flight.table("detections")
    again = once.iloc[[0, 2, 3]].assign(detection_id=["x", "y", "z"], target_id="boat")
    flight.tables["detections"] = pd.concat([once, again], ignore_index=True)
    (sentence,) = said(flight)
    assert "3 of 7" in sentence and "3 looks, first 'x'" in sentence


def test_the_same_place_in_another_look_or_by_another_sensor_is_no_double(make_flight):
    flight = seen(make_flight)  # three of its looks have the place (10, 2)
    assert said(flight) == []
    once = flight.table("detections")
    other = once.assign(source="lidar", detection_id=["e", "f", "g", "h"])
    flight.tables["detections"] = pd.concat([once, other], ignore_index=True)
    assert said(flight) == []
    # Without a look nobody knows whether it was at the same time.
    flight.tables["detections"] = once.assign(frame_id="", north_m=1.0)
    assert said(flight) == []


def scans_of(make: Make, n: int = 20) -> Flight:
    """One detection of a radar in each of `n` looks."""
    flight = make()
    looks = [f"L{k}" for k in range(n)]
    flight.tables["frames"] = pd.DataFrame({"frame_id": looks, "time_s": np.linspace(1, 8, n)})
    flight.tables["detections"] = pd.DataFrame(
        {"detection_id": looks, "frame_id": looks, "source": "radar", "kind": "position", "target_id": ""}
    ).assign(north_m=np.random.default_rng(1).normal(0, 50, n), east_m=3.0, down_m=0.0)
    return flight


def read_again(flight: Flight, source: str, rows: int, later: float = 0.0) -> Flight:
    """The first looks once more, under another name, as from a copy of the log that ends earlier."""
    frames, seen = (flight.table(name).iloc[:rows] for name in ("frames", "detections"))
    more = frames.assign(frame_id="again " + frames["frame_id"], time_s=frames["time_s"] + later)
    frames = pd.concat([flight.table("frames"), more]).sort_values("time_s", kind="stable")
    flight.tables["frames"] = frames.reset_index(drop=True)
    doubles = seen.assign(frame_id="again " + seen["frame_id"], source=source)
    flight.tables["detections"] = pd.concat([flight.table("detections"), doubles], ignore_index=True)
    return flight


@pytest.mark.parametrize(("source", "rows"), [("radar", 20), ("radar-2", 20), ("radar-2", 12)])
def test_a_log_that_was_read_twice_is_a_problem(make_flight, source, rows):
    (found,) = twice(read_again(scans_of(make_flight), source, rows))
    assert found.level == "problem" and f"{rows} of {rows}" in found.sentence


@pytest.mark.parametrize(("rows", "later"), [(0, 0.0), (5, 0.0), (20, 0.05)])
def test_few_that_are_alike_and_those_of_other_times_are_no_copy(make_flight, rows, later):
    assert list(twice(read_again(scans_of(make_flight), "radar-2", rows, later))) == []
