"""`check_flight`: one thing wrong at a time, and each is said in a sentence that names it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.checks.inertial_data import FORCE, RATE
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.manifest_parts import IMU_NOISE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned
from wildlab.simulation.twins import simulate_twin

ASSUMED = {
    "pixel_px": 3.0,
    "position_horizontal_m": 2.0,
    "position_vertical_m": 2.0,
    "tilt_deg": 1.0,
    "heading_deg": 2.0,
}


def _set(table: str, column: str, rows: Any, value: Any) -> Callable[[Flight], None]:
    def change(flight: Flight) -> None:
        where = flight.nav if table.startswith("nav/") else flight.tables
        name = table.removeprefix("nav/")
        data = where[name].copy()
        data.loc[rows, column] = value
        where[name] = data

    return change


def _append_row(table: str, row: int) -> Callable[[Flight], None]:
    def change(flight: Flight) -> None:
        data = flight.tables[table]
        flight.tables[table] = pd.concat([data, data.iloc[[row]]], ignore_index=True)

    return change


def _no_covariance(flight: Flight) -> None:
    nav = flight.nav["autopilot"]
    flight.nav["autopilot"] = nav[[name for name in nav if not name.startswith("cov_")]]


def _truth_in_africa(flight: Flight) -> None:
    # latitude and longitude exchanged
    there = geodetic_to_ned(np.radians(10.4), np.radians(63.4), 0.0, flight.manifest.origin_tuple())
    _set("truth", "north_m", 0, there[0])(flight)
    _set("truth", "east_m", 0, there[1])(flight)


def _without(table: str) -> Callable[[Flight], None]:
    return lambda flight: flight.tables.__delitem__(table)


def _poses_of_frames(ids: list[str]) -> Callable[[Flight], None]:
    def change(flight: Flight) -> None:
        flight.nav["autopilot"] = flight.nav["autopilot"].iloc[: len(ids)].assign(frame_id=ids)

    return change


def test_the_right_flight_has_nothing_wrong(make_flight: Callable[..., Flight]) -> None:
    found = check_flight(make_flight(clocks={"camera_offset_s": 0.01}))
    assert found == []


@pytest.mark.parametrize(
    ("change", "level", "table", "field", "said"),
    [
        (
            _set("nav/autopilot", "north_m", [3, 4], np.nan),
            "problem",
            "nav/autopilot",
            "north_m",
            "2 of 20 poses are not a finite",
        ),
        (
            _set("nav/autopilot", "q_w", 5, 2.0),
            "problem",
            "nav/autopilot",
            "q_w",
            "1 of 20 quaternions is not normalised, first in row 5",
        ),
        (
            _set("nav/autopilot", "cov_33", 5, -1.0),
            "problem",
            "nav/autopilot",
            "cov_00",
            "an eigenvalue below zero",
        ),
        (
            _set("nav/autopilot", "time_s", 1, 0.0),
            "problem",
            "nav/autopilot",
            "time_s",
            "not increasing in 1 of",
        ),
        (
            _set("nav/autopilot", "time_s", 5, 1.0),
            "problem",
            "nav/autopilot",
            "time_s",
            "2.000 s in row 4 is followed by 1.000 s",
        ),
        (
            _set("frames", "time_s", 2, 1.5),
            "problem",
            "frames",
            "time_s",
            "2.250 s in row 1 is followed by 1.500 s",
        ),
        (_set("frames", "time_s", 2, 2.25), "warning", "frames", "time_s", "1 frames have the same time"),
        (_set("frames", "time_s", 2, 11.0), "warning", "nav/autopilot", "time_s", "1 of 3 frames is outside"),
        (
            _set("frames", "time_s", slice(None), [3601.0, 3602.0, 3603.0]),
            "problem",
            "nav/autopilot",
            "time_s",
            "they do not overlap in time",
        ),
        (
            _set("frames", "time_s", slice(None), [3601.0, 3602.0, 3603.0]),
            "problem",
            "truth",
            "time_s",
            "the truth of 'boat' run",
        ),
        (
            _set("frames", "time_s", 1, np.inf),
            "problem",
            "frames",
            "time_s",
            "1 of 3 rows is not a finite number",
        ),
        (
            _poses_of_frames(["A", "B", "x"]),
            "warning",
            "nav/autopilot",
            "frame_id",
            "1 of 3 frames is without a pose, first 'C'",
        ),
        (
            _poses_of_frames(["x", "y", "z"]),
            "problem",
            "nav/autopilot",
            "frame_id",
            "3 of 3 frames are without a pose",
        ),
        (
            _poses_of_frames(["A", "B", "B"]),
            "problem",
            "nav/autopilot",
            "frame_id",
            "'B' stands here more than once",
        ),
        (
            _truth_in_africa,
            "problem",
            "truth",
            "north_m",
            "1 of 3 positions is far from the flight: target 'buoy' is",
        ),
        (
            _set("truth", "down_m", slice(None), -101.0),
            "problem",
            "truth",
            "down_m",
            "3 of 3 positions are above the highest pose",
        ),
        (_set("truth", "down_m", 0, -101.0), "warning", "truth", "down_m", "1 of 3 positions is above"),
        (
            _set("truth", "time_s", 1, np.nan),
            "problem",
            "truth",
            "time_s",
            "'boat' has rows with a time and rows without",
        ),
        (
            _set("truth", "time_s", 2, -1.0),
            "problem",
            "truth",
            "time_s",
            "the timestamps of target 'boat' are not increasing",
        ),
        (_append_row("truth", 0), "problem", "truth", "target_id", "'buoy' stands here more than once"),
        (_append_row("frames", 2), "problem", "frames", "frame_id", "'C' stands here more than once"),
        (
            _append_row("detections", 0),
            "problem",
            "detections",
            "detection_id",
            "'1 of click' stands here more than once",
        ),
        (_set("detections", "frame_id", 1, "Z"), "problem", "detections", "frame_id", "first 'Z'"),
        (
            _set("detections", "target_id", 1, "ghost"),
            "warning",
            "detections",
            "target_id",
            "of a target without truth, first 'ghost'",
        ),
        (
            _set("detections", "u_px", 1, np.nan),
            "problem",
            "detections",
            "u_px",
            "without a number here, first '2'",
        ),
        (
            _set("detections", "u_px", 1, 5000.0),
            "warning",
            "detections",
            "u_px",
            "outside of the image of 640 x 512, first (5000, 500)",
        ),
        (
            _set("detections", "v_px", slice(None), 5000.0),
            "problem",
            "detections",
            "u_px",
            "3 of 3 pixels are outside",
        ),
        (
            _set("detections", "plane_down_m", 2, -100.0),
            "warning",
            "detections",
            "plane_down_m",
            "1 of 3 ground planes is above the camera",
        ),
        (
            _set("detections", "plane_down_m", slice(None), -200.0),
            "problem",
            "detections",
            "plane_down_m",
            "3 of 3 ground planes",
        ),
        (
            _set("detections", "plane_down_m", slice(None), np.nan),
            "note",
            "detections",
            "plane_down_m",
            "how high the ground is",
        ),
        (
            _set("detections", "target_id", slice(None), ""),
            "warning",
            "detections",
            "target_id",
            "none names one",
        ),
        (_set("detections", "targetid", slice(None), 0.0), "warning", "detections", "targetid", "not known"),
        (_no_covariance, "warning", "nav/autopilot", "cov_00", "assumes nothing for pixel_px"),
        (
            _without("truth"),
            "warning",
            "truth",
            "",
            "there is no truth: positions can be computed and tracked",
        ),
        (_without("detections"), "warning", "detections", "", "nothing was detected"),
        (_without("frames"), "problem", "frames", "", "no frames they could be in"),
        (lambda flight: flight.nav.clear(), "warning", "nav", "", "there are no poses"),
        (
            lambda flight: flight.nav.update(x=flight.nav["autopilot"].iloc[:0]),
            "problem",
            "nav/x",
            "",
            "no pose in it",
        ),
        (lambda flight: None, "note", "flight.toml", "clocks.camera_offset_s", "taken to agree"),
    ],
)
def test_each_fault_is_a_sentence(
    make_flight: Callable[..., Flight],
    change: Callable[[Flight], None],
    level: str,
    table: str,
    field: str,
    said: str,
) -> None:
    flight = make_flight()
    change(flight)
    found = check_flight(flight)
    assert [
        one.level for one in found if one.table == table and one.field == field and said in one.sentence
    ] == [level], found
    for one in found:
        place = f"{one.table}, {one.field}: " if one.field else f"{one.table}: "
        assert one.sentence.startswith(place)
        assert one.sentence.endswith(".")
        assert one.fix[0].isupper()
        assert one.fix.endswith(".")
    ranks = [("problem", "warning", "note").index(one.level) for one in found]
    assert ranks == sorted(ranks)


@pytest.mark.parametrize(
    ("manifest", "level", "field", "said"),
    [
        ({"time": {"kind": "sequence"}}, "note", "time.kind", "carry no time"),
        ({"vertical": {"reference": "geoid"}}, "warning", "vertical.reference", "nothing was taken off"),
    ],
)
def test_what_the_manifest_admits(
    make_flight: Callable[..., Flight], manifest: dict[str, Any], level: str, field: str, said: str
) -> None:
    found = [one for one in check_flight(make_flight(**manifest)) if one.field == field]
    assert [one.level for one in found] == [level]
    assert said in found[0].sentence


def test_a_camera_that_stretches(make_flight: Callable[..., Flight], manifest_data: dict[str, Any]) -> None:
    camera = {**manifest_data["camera"], "fy_px": 1000.0, "cx_px": 700.0}
    fields = {one.field: one for one in check_flight(make_flight(camera=camera))}
    assert "differ by 10.0 %" in fields["camera.fx_px"].sentence
    assert "(700, 256) lies outside" in fields["camera.cx_px"].sentence


def test_assumed_uncertainty_is_a_note(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight(uncertainty=ASSUMED)
    _no_covariance(flight)
    assert [one.level for one in check_flight(flight) if one.field == "cov_00"] == ["note"]


def test_another_sensor_needs_no_frame(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight()
    radar = pd.DataFrame(
        {
            "detection_id": ["9"],
            "frame_id": [""],
            "source": "radar",
            "kind": "range-bearing",
            "azimuth_rad": 0.1,
            "elevation_rad": 0.0,
            "range_m": 10.0,
            "target_id": [""],
        }
    )
    flight.tables["detections"] = pd.concat([flight.tables["detections"], radar], ignore_index=True)
    assert [one for one in check_flight(flight) if one.level == "problem"] == []


def test_what_it_can_be_used_for(make_flight: Callable[..., Flight]) -> None:
    georeferencing, tracking, navigation = usable_for(make_flight())
    assert georeferencing.usable
    assert georeferencing.why == "3 pixels, poses from autopilot, 2 true targets"
    assert tracking.usable
    assert not navigation.usable
    assert navigation.why == "it lacks inertial measurements (imu) and satellite positions (gnss)"


@pytest.mark.parametrize(
    ("manifest", "change", "usable", "why"),
    [
        ({}, _without("truth"), [False, True], "it lacks truth"),
        ({}, _set("nav/autopilot", "q_w", 5, 2.0), [False, False], "poses without a problem"),
        ({}, _without("detections"), [False, False], "detections of kind pixel"),
        ({}, _append_row("frames", 2), [False, False], "frames without a problem"),
        ({"time": {"kind": "sequence"}}, lambda flight: None, [True, False], "3 pixels"),
    ],
)
def test_what_it_cannot_be_used_for(
    make_flight: Callable[..., Flight],
    manifest: dict[str, Any],
    change: Callable[[Flight], None],
    usable: list[bool],
    why: str,
) -> None:
    flight = make_flight(**manifest)
    change(flight)
    uses = usable_for(flight)
    assert [use.usable for use in uses[:2]] == usable
    assert why in uses[0].why
    assert all(use.why for use in uses)


def test_imu_and_gnss_make_navigation_possible(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight()
    times = {"time_s": [0.0, 1.0]}
    zeros = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
    flight.tables["imu"] = pd.DataFrame(times).assign(**dict.fromkeys(zeros, 0.0))
    flight.tables["imu"]["f_z_m_s2"] = -9.81
    flight.tables["gnss"] = pd.DataFrame(times).assign(north_m=[0.0, 20.0], east_m=0.0, down_m=0.0)
    assert usable_for(flight)[2].usable
    flight.tables["imu"].loc[1, "time_s"] = 0.0
    assert not usable_for(flight)[2].usable


def test_pixels_need_a_camera(make_flight: Callable[..., Flight]) -> None:
    (found,) = [one for one in check_flight(make_flight(camera=None)) if one.field == "camera"]
    assert found.level == "problem"
    assert "there are pixels, and no camera they could be of" in found.sentence


def test_navigation_says_what_a_report_on_it_lacks(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight()
    table = pd.DataFrame({name: np.zeros(3) for name in (*FORCE, *RATE)}).assign(
        time_s=[0.0, 0.1, 0.2], f_z_m_s2=-9.8
    )
    flight.tables["imu"] = table
    flight.tables["gnss"] = pd.DataFrame(
        {"time_s": [0.0, 1.0], "north_m": [0.0, 20.0], "east_m": [0.0, 0.0], "down_m": [0.0, 0.0]}
    )
    use = {one.purpose: one for one in usable_for(flight)}["navigation"]
    assert use.usable and "but no report on it, for imu.velocity_random_walk_m_s_sqrt_h" in use.why
    figures = dict.fromkeys(IMU_NOISE, 1.0)
    flight.manifest = replace_in_manifest(flight.manifest, {"imu": figures})
    use = {one.purpose: one for one in usable_for(flight)}["navigation"]
    assert use.usable and use.why == "imu and gnss are there"


def test_detections_that_are_not_there_are_not_called_broken() -> None:
    twin = simulate_twin("large-ship", 1)
    tables = {name: table for name, table in twin.tables.items() if name != "detections"}
    flight = Flight(twin.manifest, dict(twin.nav), tables)
    (tracking,) = [use for use in usable_for(flight) if use.purpose == "tracking"]
    assert (tracking.usable, tracking.why) == (False, "it lacks detections")
