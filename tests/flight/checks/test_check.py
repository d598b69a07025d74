"""`check_flight`: one thing wrong at a time, and each is found where it is."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.flight.checks.found import levels
from tests.flight.conftest import MANIFEST
from wildlab.flight.checks.check import check_flight, usable_for
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned

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


def test_the_right_flight_has_nothing_wrong(make_flight):
    found = check_flight(make_flight(clocks={"camera_offset_s": 0.01}))
    assert found == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            _set("nav/autopilot", "north_m", [3, 4], np.nan),
            "problem nav/autopilot north_m: 2 of 20 poses",
        ),
        (_set("nav/autopilot", "q_w", 5, 2.0), "problem nav/autopilot q_w: first in row 5"),
        (_set("nav/autopilot", "cov_33", 5, -1.0), "problem nav/autopilot cov_00: eigenvalue"),
        (
            _set("nav/autopilot", "time_s", 1, 0.0),
            "problem nav/autopilot time_s: not increasing in 1 of",
        ),
        (
            _set("nav/autopilot", "time_s", 5, 1.0),
            "problem nav/autopilot time_s: followed by 1.000 s",
        ),
        (_set("frames", "time_s", 2, 2.25), "warning frames time_s: 1 frames"),
        (_set("frames", "time_s", 2, 11.0), "warning nav/autopilot time_s: 1 of 3 frames"),
        (
            _set("frames", "time_s", slice(None), [3601.0, 3602.0, 3603.0]),
            "problem nav/autopilot time_s: do not overlap",
        ),
        (
            _set("frames", "time_s", slice(None), [3601.0, 3602.0, 3603.0]),
            "problem truth time_s: 'boat' run",
        ),
        (_poses_of_frames(["A", "B", "x"]), "warning nav/autopilot frame_id: first 'C'"),
        (_poses_of_frames(["A", "B", "B"]), "problem nav/autopilot frame_id: 'B' stands"),
        (_truth_in_africa, "problem truth north_m: 'buoy'"),
        (_set("truth", "down_m", slice(None), -101.0), "problem truth down_m: 3 of 3 positions"),
        (_set("truth", "down_m", 0, -101.0), "warning truth down_m: 1 of 3 positions"),
        (_append_row("frames", 2), "problem frames frame_id: 'C' stands"),
        (_append_row("detections", 0), "problem detections detection_id: '1 of click'"),
        (_set("detections", "frame_id", 1, "Z"), "problem detections frame_id: first 'Z'"),
        (_set("detections", "target_id", 1, "ghost"), "warning detections target_id: 'ghost'"),
        (_set("detections", "u_px", 1, np.nan), "problem detections u_px: first '2'"),
        (_set("detections", "u_px", 1, 5000.0), "warning detections u_px: first (5000, 500)"),
        (
            _set("detections", "plane_down_m", 2, -100.0),
            "warning detections plane_down_m: 1 of 3 ground",
        ),
        (
            _set("detections", "plane_down_m", slice(None), np.nan),
            "note detections plane_down_m: how high the ground is",
        ),
        (
            _set("detections", "target_id", slice(None), ""),
            "warning detections target_id: none names one",
        ),
        (_no_covariance, "warning nav/autopilot cov_00: pixel_px"),
        (_without("truth"), "warning truth: no truth"),
        (_without("detections"), "warning detections: nothing was detected"),
        (_without("frames"), "problem frames: no frames"),
        (lambda flight: flight.nav.clear(), "warning nav: there are no poses"),
        (
            lambda flight: flight.nav.update(x=flight.nav["autopilot"].iloc[:0]),
            "problem nav/x: no pose in it",
        ),
        (lambda flight: None, "note flight.toml clocks.camera_offset_s: taken to agree"),
    ],
)
def test_each_fault_is_found(make_flight, change, said):
    flight = make_flight()
    change(flight)
    found = check_flight(flight)
    level, _, place = said.partition(" ")
    assert levels(found, place) == [level], found
    ranks = [("problem", "warning", "note").index(one.level) for one in found]
    assert ranks == sorted(ranks)


@pytest.mark.parametrize(
    ("manifest", "level", "field"),
    [
        ({"time": {"kind": "sequence"}}, "note", "time.kind"),
        ({"vertical": {"reference": "geoid"}}, "warning", "vertical.reference"),
        ({"camera": None}, "problem", "camera"),
        ({"camera": {**MANIFEST["camera"], "fy_px": 1000.0}}, "note", "camera.fx_px"),
        ({"camera": {**MANIFEST["camera"], "cx_px": 700.0}}, "warning", "camera.cx_px"),
        ({"uncertainty": ASSUMED}, "note", "cov_00"),
    ],
)
def test_what_the_manifest_admits(make_flight, manifest, level, field):
    flight = make_flight(**manifest)
    _no_covariance(flight)
    assert [one.level for one in check_flight(flight) if one.field == field] == [level]


@pytest.mark.parametrize("noise_m", [0.0, 0.3])
def test_what_a_clock_is_worth_is_by_the_flights_own_speed(make_flight, noise_m):
    flight = make_flight()
    nav, rng = flight.nav["autopilot"], np.random.default_rng(0)
    flight.nav["autopilot"] = nav.assign(north_m=nav["north_m"] + rng.normal(0, noise_m, len(nav)))
    (facts,) = (one.facts for one in check_flight(flight) if one.code == "camera-clock")
    assert facts["speed"] == pytest.approx(np.hypot(20.0, 3.0), rel=0.02)
    assert facts["metres"] == pytest.approx(facts["speed"] / 10)


@pytest.mark.parametrize(
    ("manifest", "change", "usable"),
    [
        ({}, lambda flight: None, [True, True]),
        ({}, _without("truth"), [False, True]),
        ({}, _set("nav/autopilot", "q_w", 5, 2.0), [False, False]),
        ({}, _without("detections"), [False, False]),
        ({}, _append_row("frames", 2), [False, False]),
        ({"time": {"kind": "sequence"}}, lambda flight: None, [True, False]),
    ],
)
def test_what_it_can_be_used_for(make_flight, monkeypatch, manifest, change, usable):
    monkeypatch.setattr("wildlab.flight.checks.check.FEWEST_SCANS", 1)
    flight = make_flight(**manifest)
    change(flight)
    uses = usable_for(flight)
    assert [use.usable for use in uses] == [*usable, False]
    assert all(use.why for use in uses)


@pytest.mark.parametrize(("fewest", "usable"), [(3, True), (4, False)])
def test_a_target_seen_in_few_images_has_no_track(make_flight, monkeypatch, fewest, usable):
    flight = make_flight()
    images = flight.tables["frames"]["frame_id"].tolist()[:3]
    seen = flight.tables["detections"].iloc[[0] * 4].assign(frame_id=[*images, images[0]])
    seen = pd.concat([seen, seen.iloc[:1].assign(target_id="seen once")])
    flight.tables["detections"] = seen.assign(detection_id=[f"d{k}" for k in range(5)])
    monkeypatch.setattr("wildlab.flight.checks.check.FEWEST_SCANS", fewest)
    (use,) = [use for use in usable_for(flight) if use.purpose == "tracking"]
    assert use.usable == usable
