"""Detections that stand in the table twice."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from wildlab.flight.checks.check import check_flight
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


def test_rows_that_stand_there_again_are_counted(make_flight: Make) -> None:
    flight = seen(make_flight)
    once = flight.table("detections")
    again = once.iloc[[0, 2, 3]].assign(detection_id=["x", "y", "z"], target_id="boat")
    flight.tables["detections"] = pd.concat([once, again], ignore_index=True)
    first = once["frame_id"][0]
    assert said(flight) == [
        "detections, detection_id: 3 of 7 detections are exactly like another one of the same look, in 3 "
        f"looks, first 'x' in {first!r}: a target would be seen twice there."
    ]


def test_the_same_place_in_another_look_or_by_another_sensor_is_no_double(make_flight: Make) -> None:
    flight = seen(make_flight)  # three of its looks have the place (10, 2)
    assert said(flight) == []
    once = flight.table("detections")
    other = once.assign(source="lidar", detection_id=["e", "f", "g", "h"])
    flight.tables["detections"] = pd.concat([once, other], ignore_index=True)
    assert said(flight) == []
    # Without a look nobody knows whether it was at the same time.
    flight.tables["detections"] = once.assign(frame_id="", north_m=1.0)
    assert said(flight) == []


def test_one_among_hundreds_is_a_note(make_flight: Make) -> None:
    """A click too many is worth a word, and no warning."""
    flight = seen(make_flight)
    first = flight.table("detections").iloc[:1]
    many = pd.concat(
        [first.assign(detection_id=f"m{number}", north_m=30.0 + number) for number in range(150)]
    )
    flight.tables["detections"] = pd.concat([many, many.iloc[:1].assign(detection_id="x")], ignore_index=True)
    found = [one for one in check_flight(flight) if one.field == "detection_id"]
    assert [one.level for one in found] == ["note"] and "1 of 151 detections" in found[0].sentence
