"""Whose look a detection was: frames.sensor and detections.source have to say the same of a sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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
    first, last = flight.table("frames")["time_s"].iloc[[0, -1]]
    times = np.linspace(first, last, len(looks))
    frames = pd.DataFrame({"frame_id": [f"look-{i}" for i in range(len(looks))], "time_s": times})
    flight.tables["frames"] = frames.assign(sensor=list(looks)) if named else frames
    rows = [
        {"detection_id": f"d-{k}", "frame_id": f"look-{look}", "source": source, "kind": "position"}
        for k, (look, source) in enumerate(seen)
    ]
    flight.tables["detections"] = pd.DataFrame(rows).assign(north_m=1.0, east_m=2.0, down_m=0.0)
    return flight


def said(flight: Flight) -> list[Finding]:
    found = [one for one in check_flight(flight) if (one.table, one.field) == ("detections", "source")]
    assert len(found) == len(list(sensors(flight)))  # `wildlab check` says all of it
    return found


LOOKS = ["radar", "lidar", "radar", "lidar"]


def test_detections_in_a_look_of_another_sensor_contradict_it(make_flight: Callable[..., Flight]) -> None:
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "radar"), (2, "radar"), (3, "radar")])
    (problem,) = said(flight)
    assert problem.level == "problem"
    assert (
        "2 of 4 detections of the source 'radar' are in looks of the sensor 'lidar', first 'look-1'"
        in problem.sentence
    )
    assert list(looks_of_others(flight.table("frames"), flight.table("detections"))["detection_id"]) == [
        "d-1",
        "d-3",
    ]
    with pytest.raises(WildlabError, match="2 detections of the source 'radar' are in looks of 'lidar'"):
        scans_of(flight, "radar")


def test_looks_that_name_no_sensor_contradict_a_sensor_too(make_flight: Callable[..., Flight]) -> None:
    flight = detected(make_flight, ["radar", ""], [(0, "radar"), (1, "radar")])
    (problem,) = said(flight)
    assert problem.level == "problem"
    assert "1 of 2 detections of the source 'radar' are in looks that name no sensor" in problem.sentence
    with pytest.raises(WildlabError, match="are in looks of no sensor"):
        scans_of(flight, "radar")


def test_several_sources_in_one_look_are_good_to_know(make_flight: Callable[..., Flight]) -> None:
    flight = detected(make_flight, LOOKS, [(0, "radar"), (0, "program"), (1, "lidar")])
    (note,) = said(flight)
    assert note.level == "note"
    assert "1 of 1 detections of the source 'program' are in looks of the sensor 'radar'" in note.sentence
    assert "left out" in note.sentence
    assert scans_of(flight, "radar").ids.tolist() == [["d-0"], [""]]


def test_a_sensor_whose_detections_have_another_name_is_told_theirs(
    make_flight: Callable[..., Flight],
) -> None:
    flight = detected(make_flight, ["radar", "radar"], [(0, "Radar"), (1, "Radar")])
    (warning,) = said(flight)
    assert warning.level == "warning"
    assert "2 of 2 detections of the source 'Radar' are in looks of the sensor 'radar'" in warning.sentence
    with pytest.raises(
        WildlabError, match="no detection has the source 'radar'; those in its looks have the source 'Radar'"
    ):
        scans_of(flight, "radar")


def test_what_agrees_or_is_not_said_is_no_finding(make_flight: Callable[..., Flight]) -> None:
    assert said(detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar"), (2, "radar")])) == []
    # Images of a camera beside: their detections are no sensor's.
    assert said(detected(make_flight, ["", "radar"], [(0, "click"), (1, "radar")])) == []
    assert said(detected(make_flight, LOOKS, [(0, "radar"), (1, "radar")], named=False)) == []


@pytest.mark.parametrize("named", [True, False])
def test_a_misspelt_sensor_is_told_with_what_may_be_meant(
    make_flight: Callable[..., Flight], named: bool
) -> None:
    seen = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar"), (2, "radar")], named=named)
    told = {"sensors": {"radra": {"rate_hz": 2.0}, "lidar": {"rate_hz": 2.0}}}
    flight = Flight(replace_in_manifest(seen.manifest, told), seen.nav, seen.tables)
    (warning,) = [one for one in check_flight(flight) if one.field.startswith("sensors.")]
    assert warning.level == "warning"
    assert warning.sentence.startswith("flight.toml, sensors.radra: this sensor looked at nothing")
    assert warning.fix.startswith("Did you mean 'radar'?")
    seen.tables["detections"] = seen.tables["detections"].iloc[:0]
    if not named:  # nobody has looked yet
        flight = Flight(replace_in_manifest(seen.manifest, told), seen.nav, seen.tables)
        assert not [one for one in check_flight(flight) if one.field.startswith("sensors.")]


def all_said(flight: Flight) -> str:
    return " ".join(f"{one.sentence} {one.fix}" for one in check_flight(flight))


def test_two_sensors_may_look_at_once_and_one_may_not_look_twice(make_flight: Callable[..., Flight]) -> None:
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar")])
    flight.tables["frames"]["time_s"] = [1.0, 1.0, 2.0, 2.0]
    assert "the same time as the one before" not in all_said(flight)
    flight.tables["frames"]["time_s"] = [1.0, 1.0, 1.0, 2.0]
    assert "1 frames have the same time as the one before of their sensor" in all_said(flight)
    flight.tables["frames"] = (
        flight.tables["frames"].drop(columns="sensor").assign(time_s=[1.0, 1.0, 2.0, 2.0])
    )
    assert "2 frames have the same time as the one before." in all_said(flight)


def test_without_a_camera_it_is_the_sensors_whose_clocks_are_taken_to_agree(
    make_flight: Callable[..., Flight],
) -> None:
    flight = detected(make_flight, LOOKS, [(0, "radar"), (1, "lidar")])
    assert "the clock of the camera" in all_said(flight)
    without = make_manifest(flight.manifest.model_dump(exclude={"camera"}))
    flight = Flight(without, flight.nav, flight.tables)
    said = all_said(flight)
    assert "camera" not in said and "wildlab clock" not in said
    assert "the clocks of 'lidar' and 'radar' are taken to agree with that of the poses" in said
    manifest = replace_in_manifest(without, {"sensors": {"radar": {"clock_offset_s": 0.0}}})
    assert "the clock of 'lidar' is taken to agree" in all_said(Flight(manifest, flight.nav, flight.tables))
    both = {name: {"clock_offset_s": -0.5} for name in ("radar", "lidar")}
    manifest = replace_in_manifest(without, {"sensors": both})
    assert "taken to agree" not in all_said(Flight(manifest, flight.nav, flight.tables))


def test_one_truth_runs_and_the_poses_run(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight()
    flight.tables["frames"]["time_s"] = [1.0, 2.25, 20.0]
    assert "the truth of 'boat' runs from 0.000 s" in all_said(flight)
    assert "the poses run from 0.000 s" in all_said(flight)
