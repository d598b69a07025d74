"""Sensors, poses, frames and truth of a flight: what disagrees, lies in a gap or stands there twice."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.flight.checks.watching import level_poses, watch
from tests.flight.conftest import table
from wildlab.analysis.tracks.scans import scans_of
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight, duplicates
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sensors import sensors
from wildlab.flight.clocks import poses_at
from wildlab.flight.manifest import make_manifest, replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin


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


Make = Callable[..., Flight]


def flown(make: Make, seconds: float = 120.0) -> Flight:
    """Poses five times a second, a look of a radar every two seconds with three bearings in each."""
    t, looks = np.arange(0.0, seconds + 0.1, 0.2), np.arange(1.0, seconds, 2.0)
    seen = [{"azimuth_rad": np.linspace(-3, 3, len(looks)), "range_m": 300.0 + k} for k in range(3)]
    return watch(make, level_poses(t, t), looks, *seen)


def of_truths(flight: Flight, spans: dict[str, tuple[float, float]]) -> list[Finding]:
    rows = [
        pd.DataFrame({"target_id": name, "time_s": np.arange(low, high + 0.5)})
        for name, (low, high) in spans.items()
    ]
    truth = pd.concat(rows, ignore_index=True).assign(north_m=900.0, east_m=50.0, down_m=0.0)
    flight.tables["truth"] = truth
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
    whole = flight.nav["log"]
    flight.nav["log"] = whole.iloc[::30].reset_index(drop=True)  # one in six seconds
    assert of_poses(flight) == []
    flight.nav["log"] = whole.iloc[:1]  # of a mast
    assert not any("without a pose" in one.sentence for one in of_poses(flight))


def doubles(flight: Flight) -> list[str]:
    found = [one for one in check_flight(flight) if one.field == "detection_id"]
    assert all(one.level == "warning" for one in found)
    return [one.sentence for one in found]


def seen(make: Make) -> Flight:
    """Four detections in three looks, three of which have the same place."""
    flight = make()
    flight.tables["detections"] = table(
        "detection_id,frame_id,north_m,target_id\na,A,10.0,\nb,A,20.0,\nc,B,10.0,\nd,C,10.0,\n"
    ).assign(source="radar", kind="position", east_m=2.0, down_m=0.0)
    return flight


def with_more(flight: Flight, more: pd.DataFrame) -> Flight:
    tables = {**flight.tables, "detections": pd.concat([flight.table("detections"), more], ignore_index=True)}
    return Flight(flight.manifest, flight.nav, tables)


def test_rows_that_stand_there_again_are_counted(make_flight):
    flight = seen(make_flight)
    again = flight.table("detections").iloc[[0, 2, 3]].assign(detection_id=["x", "y", "z"], target_id="boat")
    (sentence,) = doubles(with_more(flight, again))
    assert "3 of 7" in sentence and "3 looks, first 'x'" in sentence


def test_the_same_place_in_another_look_or_by_another_sensor_is_no_double(make_flight):
    flight = seen(make_flight)
    once = flight.table("detections")
    assert doubles(flight) == []
    assert doubles(with_more(flight, once.assign(source="lidar", detection_id=list("efgh")))) == []
    # Without a look nobody knows whether it was at the same time.
    flight.tables["detections"] = once.assign(frame_id="", north_m=1.0)
    assert doubles(flight) == []


@pytest.mark.parametrize(
    ("source", "rows", "later", "copied"),
    [
        ("radar", 20, 0.0, True),
        ("radar-2", 20, 0.0, True),
        ("radar-2", 12, 0.0, True),
        # Few that are alike, and those of other times, are no copy.
        ("radar-2", 0, 0.0, False),
        ("radar-2", 5, 0.0, False),
        ("radar-2", 20, 0.05, False),
    ],
)
def test_a_log_that_was_read_twice_is_a_problem(make_flight, source, rows, later, copied):
    """The first looks once more, under other names, as from a copy of the log that ends earlier."""
    t = np.linspace(1, 8, 20)
    place = {"north_m": np.random.default_rng(1).normal(0, 50, 20), "east_m": 3.0, "down_m": 0.0}
    flight = watch(make_flight, level_poses(t, t), t, place, kind="position")
    frames = flight.table("frames").drop(columns="sensor")
    more = frames.iloc[:rows].assign(frame_id="again " + frames["frame_id"], time_s=frames["time_s"] + later)
    both = pd.concat([frames, more]).sort_values("time_s", kind="stable", ignore_index=True)
    once = flight.table("detections").iloc[:rows]
    again = with_more(flight, once.assign(frame_id="again " + once["frame_id"], source=source))
    again.tables["frames"] = both
    found = list(duplicates(again))
    assert [one.level for one in found] == ["problem"] * copied
    assert not copied or f"{rows} of {rows}" in found[0].sentence


def test_receivers_that_end_early_are_one_warning_about_the_worst(make_flight):
    (found,) = of_truths(flown(make_flight), {"a": (0.0, 91.0), "b": (0.0, 90.0), "c": (0.0, 119.0)})
    assert found.level == "warning" and "'b' from 0.000 s to 90.000 s" in found.sentence
    assert "15 of 60" in found.sentence and "29.0 s" in found.fix  # 91 to 119 s
    assert found.facts["others"] == 1


def test_truth_of_another_day_is_a_problem_that_names_the_zone(make_flight):
    found = of_truths(flown(make_flight), {"boat": (7200.0, 7300.0)})[0]
    assert found.level == "problem" and "time zone" in found.fix


def test_poses_that_are_held_against_themselves_are_named():
    flight = simulate_twin("large-ship", 1)
    assert "own-truth" not in {one.code for one in check_flight(flight)}
    again = replace(flight, nav={**flight.nav, "truth": flight.nav["autopilot"]})
    assert "own-truth" in {one.code for one in check_flight(again)}
