"""`check_flight` on inertial and satellite measurements: right ones pass."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.flight.checks.flights import aeroplane, circle, eight, straight
from tests.flight.checks.test_mistakes_named import shift
from tests.sound_logs import NED
from tests.sound_logs import VELOCITY as SPEED
from wildlab.flight.checks.check import Finding, find, usable_for
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.schema import FORCE
from wildlab.flight.store import Flight


@pytest.mark.parametrize(("imu", "gnss", "value"), [(FORCE[0], NED[0], np.nan), ("time_s", "time_s", 0.0)])
def test_what_is_no_number_or_out_of_order_is_left_to_others(right, imu, gnss, value):
    flight = _copy(right)
    flight.tables["imu"].loc[100, imu] = value
    flight.tables["gnss"].loc[3, gnss] = value
    expected = {("imu", imu), ("gnss", gnss)}
    assert {(one.table, one.field) for one in _found(flight)} == expected
    if imu != "time_s":
        flight.tables["imu"].loc[:, imu] = value
        assert {(one.table, one.field) for one in _found(flight)} == expected


@pytest.fixture(scope="module")
def right() -> Flight:
    return aeroplane()


def _copy(flight: Flight, nav: bool = True) -> Flight:
    tables = {name: table.copy() for name, table in flight.tables.items()}
    return Flight(flight.manifest, dict(flight.nav) if nav else {}, tables)


def _found(flight: Flight) -> list[Finding]:
    return [one for one in find(flight, meaning=False) if one.table in ("imu", "gnss")]


@pytest.mark.parametrize("path", [eight, circle(), straight], ids=["eight", "circle", "straight"])
@pytest.mark.parametrize(
    ("nav", "speeds", "noisy"),
    [(True, True, 1.0), (False, False, 1.0), (True, False, 0.0), (False, True, 0.0)],
)
def test_right_measurements_pass(path, nav, speeds, noisy):
    flight = _copy(aeroplane(path, noisy), nav)
    if not speeds:
        flight.tables["gnss"] = flight.tables["gnss"].drop(columns=SPEED)
    assert _found(flight) == []
    assert usable_for(flight)[2].usable


def test_the_suggested_offset_and_a_latency_are_taken_into_account(right):
    flight = shift("gnss", 3.0)(right)

    def stated(parts: dict[str, Any]) -> list[Finding]:
        return _found(replace(flight, manifest=replace_in_manifest(flight.manifest, parts)))

    assert stated({"clocks": {"gnss_offset_s": -3.0}}) == stated({"gnss": {"latency_s": 3.0}}) == []
    found = next(one for one in stated({"clocks": {"gnss_offset_s": 2.0}}) if one.table == "gnss")
    assert "gnss_offset_s = -3.0" in found.fix


@pytest.mark.parametrize("offset", [3.0, -2.0])
def test_an_offset_without_velocities(offset):
    flight = _copy(aeroplane(noisy=0.05), nav=False)  # positions as good as RTK
    flight.tables["gnss"] = flight.tables["gnss"].drop(columns=SPEED)
    (found,) = _found(shift("gnss", -offset)(flight))
    assert f"gnss_offset_s = {offset:.1f}" in found.fix


def test_a_few_samples_say_nothing(right):
    flight = _copy(right)
    for n in (0, 1, 2, 5):
        flight.tables["imu"] = right.tables["imu"].iloc[:n]
        flight.tables["gnss"] = right.tables["gnss"].iloc[:n]
        assert [one for one in _found(flight) if "correlation" in one.sentence] == []
