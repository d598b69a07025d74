"""Sensors of detections: frames.sensor and detections.source have to agree."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sensors import looks_of_others, sensors
from wildlab.flight.manifest import make_manifest, replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.pipeline.scans import scans_of


def detected(
    make: Callable[..., Flight], looks: Sequence[str], seen: Sequence[tuple[int, str]], named: bool = True
) -> Flight:
    """A flight whose looks are of the sensors named, and whose detections are (look, source)."""
    flight = make()
    ids = [f"look-{i}" for i in range(len(looks))]
    frames = pd.DataFrame({"frame_id": ids, "time_s": np.linspace(1.0, 8.0, len(looks))})
    flight.tables["frames"] = frames.assign(sensor=list(looks)) if named else frames
    rows = [(f"d-{k}", f"look-{look}", source) for k, (look, source) in enumerate(seen)]
    detections = pd.DataFrame(rows, columns=["detection_id", "frame_id", "source"])
    flight.tables["detections"] = detections.assign(kind="position", north_m=1.0, east_m=2.0, down_m=0.0)
    return flight


def said(flight: Flight) -> list[Finding]:
    found = [one for one in check_flight(flight) if (one.table, one.field) == ("detections", "source")]
    assert len(found) == len(list(sensors(flight)))  # `wildlab check` says all of it
    return found


LOOKS = ["radar", "lidar", "radar", "lidar"]


@pytest.mark.parametrize(
    ("looks", "seen", "level", "counted", "refused"),
    [
        (LOOKS, [(k, "radar") for k in range(4)], "problem", "2 of 4", "looks of 'lidar'"),
        (["radar", ""], [(0, "radar"), (1, "radar")], "problem", "1 of 2", "looks of no sensor"),
        (["radar"] * 2, [(0, "Radar"), (1, "Radar")], "warning", "2 of 2", "the source 'Radar'"),
    ],
)
def test_detections_in_looks_of_another_sensor_contradict_it(
    make_flight, looks, seen, level, counted, refused
):
    flight = detected(make_flight, looks, seen)
    (found,) = said(flight)
    assert found.level == level and counted in found.sentence
    with pytest.raises(WildlabError, match=refused):
        scans_of(flight, "radar")


def test_the_rows_in_looks_of_others_are_given(make_flight):
    flight = detected(make_flight, LOOKS, [(k, "radar") for k in range(4)])
    others = looks_of_others(flight.table("frames"), flight.table("detections"))
    assert others["detection_id"].tolist() == ["d-1", "d-3"] and set(others["sensor"]) == {"lidar"}


def test_a_misspelt_sensor_is_named(make_flight):
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar"), (2, "radar")])
    told = {"sensors": {"radra": {"rate_hz": 2.0}, "lidar": {"rate_hz": 2.0}}}
    found = check_flight(replace(flight, manifest=replace_in_manifest(flight.manifest, told)))
    assert [(one.level, one.field) for one in found if one.field.startswith("sensors.")] == [
        ("warning", "sensors.radra")
    ]


def test_several_sources_in_one_look_are_good_to_know(make_flight):
    flight = detected(make_flight, LOOKS, [(0, "radar"), (0, "program"), (1, "lidar")])
    (note,) = said(flight)
    assert note.level == "note" and "1 of 1" in note.sentence
    assert scans_of(flight, "radar").ids.tolist() == [["d-0"], [""]]


def test_what_agrees_or_is_not_said_is_no_finding(make_flight):
    assert said(detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar"), (2, "radar")])) == []
    # Images of a camera beside: their detections are no sensor's.
    assert said(detected(make_flight, ["", "radar"], [(0, "click"), (1, "radar")])) == []
    assert said(detected(make_flight, LOOKS, [(0, "radar"), (1, "radar")], named=False)) == []


@pytest.mark.parametrize(
    ("times", "named", "repeated"),
    [
        ([1.0, 1.0, 2.0, 2.0], True, []),
        ([1.0, 1.0, 1.0, 2.0], True, ["1"]),
        ([1.0, 1.0, 2.0, 2.0], False, ["2"]),
    ],
)
def test_two_sensors_may_look_at_once_and_one_may_not_look_twice(make_flight, times, named, repeated):
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar")], named)
    flight.tables["frames"]["time_s"] = times
    found = [one for one in check_flight(flight) if (one.table, one.field) == ("frames", "time_s")]
    assert [one.sentence.split()[2] for one in found] == repeated


@pytest.mark.parametrize(
    ("camera", "stated", "silent"),
    [
        (True, {}, []),
        (False, {}, [["lidar", "radar"]]),
        (False, {"radar": {"clock_offset_s": 0.0}}, [["lidar"]]),
        (False, {"radar": {"clock_offset_s": -0.5}, "lidar": {"clock_offset_s": -0.5}}, []),
    ],
)
def test_without_a_camera_it_is_the_sensors_whose_clocks_are_taken_to_agree(
    make_flight, camera, stated, silent
):
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar")])
    data = flight.manifest.model_dump(exclude=set() if camera else {"camera"})
    manifest = replace_in_manifest(make_manifest(data), {"sensors": stated})
    found = check_flight(replace(flight, manifest=manifest))
    assert [re.findall("'([a-z]+)'", one.sentence) for one in found if one.field == "sensors"] == silent
