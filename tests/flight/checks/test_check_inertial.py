"""`check_flight` on inertial and satellite measurements: right ones pass, one fault at a time is found."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.flight.checks.found import levels
from tests.flight.checks.test_sound_flights import shift
from tests.flight.conftest import MANIFEST
from tests.sound_logs import NED, QUATERNION
from tests.sound_logs import VELOCITY as SPEED
from wildlab.flight.checks.check import Finding, find, usable_for
from wildlab.flight.checks.inertial import FORCE, RATE
from wildlab.flight.checks.mistakes import Correction, change_columns
from wildlab.flight.manifest import make_manifest, replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, matrix_to_quaternion
from wildlab.simulation import (
    angular_rates,
    attitude_along,
    fixed_wing_trajectory,
    loiter_path,
    specific_forces,
)

DURATION = 240.0


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


def _eight(times: Array) -> tuple[Array, Array, Array]:
    """A figure of eight over 200 m by 120 m in 40 s, briskly up and down, never twice alike."""
    size = np.array([100.0, 60.0, 6.0, 5.0])
    pace = 2 * np.pi / np.array([40.0, 20.0, 10.7, 8.1])
    angle = np.multiply.outer(np.asarray(times, float), pace) + np.array([0.3, 0.9, 0.0, 0.5])

    def in_n(parts: Array) -> Array:
        return np.column_stack([parts[:, :2], parts[:, 2] + parts[:, 3]])

    position = in_n(size * np.sin(angle)) - np.array([0.0, 0.0, 100.0])
    return position, in_n(size * pace * np.cos(angle)), in_n(-size * pace**2 * np.sin(angle))


def _flight(path: Any = _eight, noisy: float = 1.0) -> Flight:
    """IMU at 50 Hz, GNSS at 2 Hz and poses at 10 Hz of one motion, with noise of small sensors."""
    rng = np.random.default_rng(4)
    trajectory = fixed_wing_trajectory(path, trim_pitch=0.05)
    attitude = attitude_along(trajectory)

    def noise(sd: float, n: int) -> np.ndarray:
        return noisy * sd * rng.standard_normal((n, 3))

    t = np.arange(0.0, DURATION, 0.02)
    motion = trajectory(t)
    imu = pd.DataFrame({"time_s": t})
    imu[list(FORCE)] = specific_forces(motion) + noise(0.5, len(t)) + noisy * np.array([0.2, -0.1, 0.15])
    imu[list(RATE)] = angular_rates(attitude, t) + noise(0.02, len(t)) + noisy * np.array([0.01, -0.01, 0.02])
    t = np.arange(0.0, DURATION - 0.02, 0.5)
    position, velocity, _ = path(t)
    gnss = pd.DataFrame({"time_s": t})
    gnss[NED], gnss[SPEED] = position + noise(1.0, len(t)), velocity + noise(0.1, len(t))
    t = np.arange(0.0, DURATION - 0.02, 0.1)
    motion = trajectory(t)
    nav = pd.DataFrame({"time_s": t})
    nav[NED], nav[QUATERNION] = motion.position, matrix_to_quaternion(motion.R_nb)
    manifest = make_manifest({key: value for key, value in MANIFEST.items() if key != "camera"})
    return Flight(manifest, {"autopilot": nav}, {"imu": imu, "gnss": gnss})


@pytest.fixture(scope="module")
def right() -> Flight:
    return _flight()


def _copy(flight: Flight, nav: bool = True) -> Flight:
    tables = {name: table.copy() for name, table in flight.tables.items()}
    return Flight(flight.manifest, dict(flight.nav) if nav else {}, tables)


def _found(flight: Flight) -> list[Finding]:
    return [one for one in find(flight, meaning=False) if one.table in ("imu", "gnss")]


def _circle() -> Any:
    return loiter_path([0.0, 0.0], 150.0, 100.0, 20.0, wind=(6.0, 2.0))


def _straight(times: Array) -> tuple[Array, Array, Array]:
    t = np.asarray(times, float)
    v = np.tile([20.0, 3.0, 0.0], (len(t), 1))
    return t[:, None] * v - np.array([0, 0, 100.0]), v, np.zeros_like(v)


@pytest.mark.parametrize("path", [_eight, _circle(), _straight], ids=["eight", "circle", "straight"])
@pytest.mark.parametrize(
    ("nav", "speeds", "noisy"),
    [(True, True, 1.0), (False, False, 1.0), (True, False, 0.0), (False, True, 0.0)],
)
def test_right_measurements_pass(path, nav, speeds, noisy):
    flight = _copy(_flight(path, noisy), nav)
    if not speeds:
        flight.tables["gnss"] = flight.tables["gnss"].drop(columns=SPEED)
    assert _found(flight) == []
    assert usable_for(flight)[2].usable


def _drop(table: str, start: float, end: float) -> Correction:
    def change(flight: Flight) -> Flight:
        rows = flight.tables[table]
        kept = rows[~rows["time_s"].between(start, end)]
        return replace(flight, tables={**flight.tables, table: kept})

    return change


def _scale(columns: tuple[str, ...], factor: float) -> Correction:
    return change_columns("imu", columns, lambda x: x * factor)


def _turn(matrix: Any, *parts: tuple[str, ...]) -> Correction:
    """What a sensor measures whose axes are the rows of a matrix, in the axes of the body."""
    M = np.kron(np.eye(len(parts)), matrix)
    return change_columns("imu", [name for part in parts for name in part], lambda x: x @ M.T)


def _gravity_off(flight: Flight) -> Flight | None:
    t = flight.tables["imu"]["time_s"].to_numpy()
    up = fixed_wing_trajectory(_eight, trim_pitch=0.05)(t).R_nb[:, 2, :]
    return change_columns("imu", FORCE, lambda f: f + 9.81 * up)(flight)


def _other_flight(flight: Flight) -> Flight | None:
    rng = np.random.default_rng(9)
    return change_columns("gnss", SPEED, lambda v: 20 + np.cumsum(rng.standard_normal(v.shape), axis=0))(
        flight
    )


FLU = np.diag([1, -1, -1])
FALSE_EXCHANGE = [[0, 0, 1], [0, 1, 0], [1, 0, 0]]
#: Fault, and what is found.
CASES: list[Any] = [
    (_drop("imu", 31.01, 32.99), "warning imu time_s: for 2.0 s after 31.000 s"),
    (_drop("gnss", 100.1, 159.9), "warning gnss time_s: for 60.0 s after 100.000 s"),
    (_drop("gnss", 180, 999), "warning gnss time_s: for 60.5 s after 179.500 s"),
    (shift("gnss", 1e6), "problem gnss time_s: do not overlap"),
    (shift("gnss", 180), "warning gnss time_s: only 60 s"),
    (shift("gnss", 3.0), "warning gnss time_s: gnss_offset_s = -3.0"),
    (shift("imu", 0.6), "warning gnss time_s: gnss_offset_s = 0.6"),
    (_other_flight, "warning gnss time_s: nothing in common"),
    (_scale(FORCE, 1 / 9.80665), 'problem imu f_z_m_s2: unit = "g"'),
    (_gravity_off, "problem imu f_z_m_s2: gravity was taken off"),
    (_scale(RATE, 180 / np.pi), 'problem imu w_z_rad_s: unit = "deg/s"'),
    (_scale(RATE, np.pi / 180), 'problem imu w_z_rad_s: unit = "rad/s"'),
    (_turn(FLU, FORCE, RATE), "problem imu f_z_m_s2: z points up"),
    (_scale(FORCE, -1), "problem imu f_z_m_s2: z points down"),
    (_turn(FALSE_EXCHANGE, FORCE, RATE), "problem imu f_x_m_s2: down is along x"),
    (_turn(np.diag([-1, -1, 1]), FORCE, RATE), "warning imu w_x_rad_s: y goes with minus y"),
    (_turn(np.diag([1, -1, 1]), RATE), "warning imu w_y_rad_s: y goes with minus y"),
    (_turn(np.diag([1, 1, -1]), RATE), "warning imu w_z_rad_s: z goes with minus z"),
    (_turn(np.diag([-1, 1, 1]), FORCE), "warning imu f_x_m_s2: x goes with minus x"),
]


@pytest.mark.parametrize(("change", "said"), CASES)
def test_each_fault_is_found(right, change, said):
    flight = change(right)
    found = _found(flight)
    level, _, place = said.partition(" ")
    assert levels(found, place) == [level], found
    assert usable_for(flight)[2].usable == (level == "warning")


@pytest.mark.parametrize(
    ("change", "level", "field"),
    [
        (_scale(RATE, 180 / np.pi), "problem", "w_z_rad_s"),
        (_scale(RATE, np.pi / 180), "warning", "w_z_rad_s"),
        (_turn(np.diag([1, 1, -1]), RATE), "warning", "w_z_rad_s"),
        (_turn(np.diag([-1, -1, 1]), FORCE, RATE), "warning", "w_y_rad_s"),
        (_turn(FLU, FORCE, RATE), "problem", "f_z_m_s2"),
    ],
)
def test_without_any_attitude(right, change, level, field):
    flight = replace(change(right), nav={})
    assert (level, field) in [(one.level, one.field) for one in _found(flight)]


def test_degrees_without_anything_to_compare_with(right):
    flight = replace(_scale(RATE, 180 / np.pi)(right), nav={})
    del flight.tables["gnss"]
    (found,) = _found(flight)
    assert found.level == "problem" and "deg/s" in found.sentence


def test_the_suggested_offset_and_a_latency_are_taken_into_account(right):
    flight = shift("gnss", 3.0)(right)

    def stated(parts: dict[str, Any]) -> list[Finding]:
        return _found(replace(flight, manifest=replace_in_manifest(flight.manifest, parts)))

    assert stated({"clocks": {"gnss_offset_s": -3.0}}) == stated({"gnss": {"latency_s": 3.0}}) == []
    found = next(one for one in stated({"clocks": {"gnss_offset_s": 2.0}}) if one.table == "gnss")
    assert "gnss_offset_s = -3.0" in found.fix


@pytest.mark.parametrize("offset", [3.0, -2.0])
def test_an_offset_without_velocities(offset):
    flight = _copy(_flight(noisy=0.05), nav=False)  # positions as good as RTK
    flight.tables["gnss"] = flight.tables["gnss"].drop(columns=SPEED)
    (found,) = _found(shift("gnss", -offset)(flight))
    assert f"gnss_offset_s = {offset:.1f}" in found.fix


def test_a_few_samples_say_nothing(right):
    flight = _copy(right)
    for n in (0, 1, 2, 5):
        flight.tables["imu"] = right.tables["imu"].iloc[:n]
        flight.tables["gnss"] = right.tables["gnss"].iloc[:n]
        assert [one for one in _found(flight) if "correlation" in one.sentence] == []
