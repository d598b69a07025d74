"""Each mistake that the checks name, made in a flight that is right but for it: a row is one mistake."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.analysis.survey_twin import Survey, simulate
from tests.flight.checks.flights import aeroplane, boats, eight, track
from tests.flight.checks.watching import add_sensor
from tests.flight.conftest import small_flight
from tests.sound_flights import simulate_sound_flight
from tests.sound_logs import NED, VELOCITY
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Correction, change_columns, state
from wildlab.flight.schema import FORCE, RATE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import geodetic_to_ned, ned_to_geodetic
from wildlab.simulation import fixed_wing_trajectory

ORIGIN = (np.radians(63.4), np.radians(10.4), 40.0)
#: Makes a mistake, in the flight or in the copy that it gives.
Spoil = Callable[[Flight], Flight | None]


# -- mistakes


def put(table: str, column: str, rows: Any, value: Any) -> Spoil:
    """Other values in some rows of a column."""

    def spoil(flight: Flight) -> Flight:
        where = flight.nav if table.startswith("nav/") else flight.tables
        data = where[table.removeprefix("nav/")].copy()
        data.loc[rows, column] = value
        where[table.removeprefix("nav/")] = data
        return flight

    return spoil


def rows(table: str, kept: Callable[[pd.DataFrame], pd.DataFrame]) -> Spoil:
    """Other rows of a table."""

    def spoil(flight: Flight) -> Flight:
        where = flight.nav if table.startswith("nav/") else flight.tables
        where[table.removeprefix("nav/")] = kept(where[table.removeprefix("nav/")])
        return flight

    return spoil


def again(table: str, *which: int, **other: Any) -> Spoil:
    """Some rows once more, with other names."""
    return rows(table, lambda data: pd.concat([data, data.iloc[[*which]].assign(**other)], ignore_index=True))


def without(table: str) -> Spoil:
    def spoil(flight: Flight) -> Flight:
        flight.tables.pop(table)
        return flight

    return spoil


def drop(table: str, start: float, end: float) -> Spoil:
    return rows(table, lambda data: data[~data["time_s"].between(start, end)].reset_index(drop=True))


def shift(table: str, seconds: float) -> Correction:
    return change_columns(table, ["time_s"], lambda t: t + seconds)


def scale(columns: tuple[str, ...], factor: Any, table: str = "imu") -> Correction:
    return change_columns(table, columns, lambda x: x * factor)


def turn(matrix: Any, *parts: tuple[str, ...]) -> Correction:
    """What a sensor measures whose axes are the rows of a matrix, in the axes of the body."""
    M = np.kron(np.eye(len(parts)), matrix)
    return change_columns("imu", [name for part in parts for name in part], lambda x: x @ M.T)


def euler(table: str, change: Callable[[np.ndarray], np.ndarray]) -> Correction:
    """Roll, pitch, yaw (degrees, (N, 3)) as a wrong recipe would have read them."""

    def turned(q: np.ndarray) -> np.ndarray:
        angles = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)[:, ::-1]
        read = Rotation.from_euler("ZYX", change(angles)[:, ::-1], degrees=True)
        return np.asarray(read.as_quat(scalar_first=True, canonical=True))

    return change_columns(table, ["q_w", "q_x", "q_y", "q_z"], turned)


def geodetic(table: str, change: Callable[..., tuple[Any, ...]]) -> Correction:
    """Latitude, longitude (rad) and height as a wrong recipe would have read them."""
    return change_columns(
        table, NED, lambda p: geodetic_to_ned(*change(*ned_to_geodetic(p, ORIGIN).T), ORIGIN)
    )


def both(*spoils: Spoil) -> Spoil:
    def spoil(flight: Flight) -> Flight | None:
        for one in spoils:
            flight = one(flight) or flight
        return flight

    return spoil


def poses_of_frames(*ids: str) -> Spoil:
    return rows("nav/autopilot", lambda nav: nav.iloc[: len(ids)].assign(frame_id=ids))


def without_covariance(flight: Flight) -> Flight:
    nav = flight.nav["autopilot"]
    return replace(flight, nav={"autopilot": nav[[one for one in nav if not one.startswith("cov_")]]})


def read_twice(flight: Flight) -> Flight:
    """The looks once more, under other names, as of a copy of the log."""
    for table, names in (("frames", ["frame_id"]), ("detections", ["frame_id", "detection_id"])):
        data = flight.table(table)
        again = data.assign(**{name: "again " + data[name] for name in names})
        flight.tables[table] = pd.concat([data, again], ignore_index=True)
    frames = flight.table("frames").sort_values("time_s", kind="stable", ignore_index=True)
    flight.tables["frames"] = frames.drop(columns="sensor")
    return flight


def gravity_off(flight: Flight) -> Flight | None:
    t = flight.tables["imu"]["time_s"].to_numpy()
    up = fixed_wing_trajectory(eight, trim_pitch=0.05)(t).R_nb[:, 2, :]
    return change_columns("imu", FORCE, lambda f: f + 9.81 * up)(flight)


def other_flight(flight: Flight) -> Flight | None:
    walk = np.random.default_rng(9).standard_normal((len(flight.tables["gnss"]), 3)).cumsum(axis=0)
    return change_columns("gnss", VELOCITY, lambda v: 20 + walk)(flight)


def nothing(flight: Flight) -> Flight:
    return flight


def moved(by: list[float], *tables: str) -> Spoil:
    return both(*(change_columns(one, NED, lambda p: p + by) for one in tables))


def leap(table: str, metres: float, lasting_s: float) -> Spoil:
    """At 25 s, along the way, in so many seconds."""

    def spoil(flight: Flight) -> Flight | None:
        t = (flight.tables.get(table) if table == "gnss" else flight.nav["autopilot"])["time_s"].to_numpy()
        share = np.clip((t - 25.0) / max(lasting_s, 1e-9), 0, 1)
        return change_columns(table, NED, lambda p: p + metres * share[:, None] * [0.94, 0.35, 0.0])(flight)

    return spoil


def everywhere(change: Callable[..., tuple[Any, ...]]) -> Spoil:
    """Of poses, truth and the origin, which is the first pose."""

    def spoil(flight: Flight) -> Flight | None:
        here = flight.manifest.origin_tuple()
        there = change(*here)

        def read(p: np.ndarray) -> np.ndarray:
            return geodetic_to_ned(*change(*ned_to_geodetic(p, here).T), there)

        latitude, longitude = np.degrees(there[:2]).tolist()
        for table in ("nav/logged", "truth"):
            flight = change_columns(table, NED, read)(flight) or flight
        return state({"origin": {"latitude_deg": latitude, "longitude_deg": longitude}})(flight)

    return spoil


def other_names(flight: Flight) -> Flight:
    names = flight.tables["detections"]["target_id"].to_numpy()
    return rows("detections", lambda d: d.assign(target_id=names[::-1]))(flight) or flight


def mark_off(flight: Flight) -> Flight | None:
    name = flight.tables["detections"]["target_id"].mode()[0]
    return rows("truth", lambda d: d.assign(north_m=d["north_m"] + 100.0 * (d["target_id"] == name)))(flight)


def with_lidar(flight: Flight) -> Flight:
    """Places of a lidar beside the bearings of the radar."""
    places = boats(small_flight, kind="position").tables["detections"]
    add_sensor(flight, "lidar", places)
    return flight


def of_lidar(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    def spoil(flight: Flight) -> None:
        seen = flight.tables["detections"]
        lidar = seen["source"] == "lidar"
        seen.loc[lidar, NED[:2]] = change(seen.loc[lidar, NED[:2]].to_numpy())

    return spoil


def beside(flight: Flight) -> Flight | None:
    return rows("truth", lambda d: d.assign(north_m=d["north_m"] + 25.0 * (d["target_id"] == "a")))(flight)


FLU, NO_Y, NO_Z = np.diag([1, -1, -1]), np.diag([1, -1, 1]), np.diag([1, 1, -1])
EXCHANGED = [[0, 0, 1], [0, 1, 0], [1, 0, 0]]
OBLIQUE = Rotation.from_euler("XY", [45, 35.3], degrees=True).as_matrix()
ALL = slice(None)
NAV, LOGGED, LOOKS = "nav/autopilot", "nav/logged", "nav/log"
DEGREES = 180 / np.pi
TURNS = ("q_x", "q_y", "q_z")
MAGNETOMETER = ("field_x_ut", "field_y_ut", "field_z_ut")
CAMERA = "flight.toml camera"
EXPLAINED, WRONG = "points-explained", f"problem {LOGGED}"
FELT, FIELD = "felt-explained", "problem magnetometer field_x_ut"
PLACES = ("positions-explained", f"problem {NAV} north_m")
SPEEDS = ("motion-explained", "problem gnss v_north_m_s")
SEEN = ("source-explained", "problem detections north_m")
LEAPT = ("leap", "problem gnss north_m", "leap of the position")
#: Mistake; code and place of the finding; and of a usual mistake how it is called.
CASES: dict[str, list[tuple[Any, ...]]] = {
    "small": [
        # Rows of tables.
        (put(NAV, "north_m", [3, 4], np.nan), "pose-not-finite", f"problem {NAV} north_m"),
        (put(NAV, "q_w", 5, 2.0), "not-normalised", f"problem {NAV} q_w"),
        (put(NAV, "cov_33", 5, -1.0), "no-covariance", f"problem {NAV} cov_00"),
        (put("truth", "east_m", 1, np.nan), "not-finite", "problem truth east_m"),
        (put(NAV, "velocity", ALL, 1.0), "unknown-column", f"warning {NAV} velocity"),
        (put(NAV, "north_m", 5, 1e9), "beyond-bounds", f"problem {NAV} north_m"),
        (put(NAV, "time_s", 1, 0.0), "not-increasing", f"problem {NAV} time_s"),
        (put("truth", "time_s", 1, np.nan), "times-missing", "problem truth time_s"),
        (put("frames", "time_s", 2, 2.25), "same-time", "warning frames time_s"),
        (put("truth", "north_m", 0, 5e6), "truth-far", "problem truth north_m"),
        (put("truth", "north_m", ALL, 5e6), "all-truth-far", "problem truth north_m"),
        (put("truth", "down_m", 0, -101.0), "truth-above", "warning truth down_m"),
        (put("truth", "down_m", ALL, -101.0), "truth-above", "problem truth down_m"),
        (poses_of_frames("A", "B", "B"), "pose-twice", f"problem {NAV} frame_id"),
        (again("frames", 2), "frame-twice", "problem frames frame_id"),
        (again("truth", 0), "point-twice", "problem truth target_id"),
        (again("detections", 0), "detection-twice", "problem detections detection_id"),
        (again("detections", 0, detection_id="x"), "alike-in-one-look", "warning detections detection_id"),
        (put("detections", "frame_id", 1, "Z"), "frame-unknown", "problem detections frame_id"),
        (put("detections", "target_id", 1, "ghost"), "target-unknown", "warning detections target_id"),
        # Times.
        (poses_of_frames("A", "B", "x"), "frame-without-pose", f"warning {NAV} frame_id"),
        (put("frames", "time_s", 2, 11.0), "times-outside", f"warning {NAV} time_s"),
        (put("frames", "time_s", ALL, [61.0, 62.0, 63.0]), "times-apart", "problem truth time_s"),
        (shift("frames", 7200.0), "stamps-of-another-zone", "problem frames time_s", "zone (-2 h)"),
        # The camera.
        (put("detections", "u_px", 1, np.nan), "detection-not-finite", "problem detections u_px"),
        (state({"camera": None}), "no-camera", f"problem {CAMERA}"),
        (put("detections", "u_px", 1, 5000.0), "pixel-outside", "warning detections u_px"),
        (state({"camera": {"fy_px": 1000.0}}), "focal-lengths-differ", f"note {CAMERA}.fx_px"),
        (state({"camera": {"cx_px": 700.0}}), "centre-outside", f"warning {CAMERA}.cx_px"),
        (state({"camera": {"cx_px": 500.0}}), "centre-far", f"warning {CAMERA}.cx_px"),
        (
            state({"camera": {"cx_px": 256.0, "cy_px": 320.0}}),
            *("centre-explained", f"warning {CAMERA}.cx_px", "cx and cy exchanged"),
        ),
        (
            state({"camera": {"cx_px": 160.0, "cy_px": 128.0}}),
            *("centre-explained", f"warning {CAMERA}.cx_px", "calibration of an image 0.5 times"),
        ),
        (
            state({"camera": {"fx_px": 19.0, "fy_px": 19.0}}),
            *("view-wide", f"problem {CAMERA}.fx_px", "focal length in mm"),
        ),
        (state({"camera": {"fx_px": 1e5, "fy_px": 1e5}}), "view-narrow", f"warning {CAMERA}.fx_px"),
        (put("detections", "plane_down_m", ALL, np.nan), "no-ground-height", "note detections plane_down_m"),
        (put("detections", "plane_down_m", 2, -100.0), "plane-above", "warning detections plane_down_m"),
        # What is missing or assumed.
        (lambda flight: replace(flight, nav={}), "no-poses", "warning nav"),
        (lambda flight: flight.nav.update(x=flight.nav["autopilot"].iloc[:0]), "no-pose", "problem nav/x"),
        (without("truth"), "no-truth", "warning truth"),
        (without("detections"), "no-detections", "warning detections"),
        (rows("detections", lambda d: d.iloc[:0]), "none-detected", "warning detections"),
        (without("frames"), "no-frames", "problem frames"),
        (put("detections", "target_id", ALL, ""), "none-names-a-target", "warning detections target_id"),
        (without_covariance, "covariance-unknown", f"warning {NAV} cov_00"),
        (nothing, "camera-clock", "note flight.toml clocks.camera_offset_s"),
        (state({"mount": {"poses": "x"}}), "mount-on-nothing", "problem flight.toml mount.poses"),
        (
            state({"vertical": {"reference": "geoid"}}),
            *("height-reference", "warning flight.toml vertical.reference"),
        ),
        (state({"time": {"kind": "sequence"}}), "no-times", "note flight.toml time.kind"),
    ],
    # Photos of known points.
    "survey": [
        (state({"mount": {"looks": "down"}}), EXPLAINED, WRONG, "the camera looks forward"),
        (shift("frames", 3.0), EXPLAINED, WRONG, "clock of the camera"),
        (shift("frames", -18.0), EXPLAINED, WRONG, "leap seconds (18 s)"),
        (everywhere(lambda a, b, h: (b, a, h)), EXPLAINED, WRONG, "truth: latitude and longitude exchanged"),
        (everywhere(lambda a, b, h: (a, -b, h)), EXPLAINED, WRONG, "truth: longitude negated"),
        (other_names, "points-missed", f"warning {LOGGED}"),
        (put("detections", "u_px", slice(20, 24), 100.0), "one-photo-off", "warning frames frame_id"),
        (mark_off, "one-mark-off", "warning truth target_id"),
        (
            put("detections", "plane_down_m", ALL, -45.0),
            *("ground-off-truth", "warning detections plane_down_m"),
        ),
        (both(without("truth"), put(LOGGED, "down_m", ALL, 50.0)), "rays-from-below", WRONG),
        (both(without("truth"), state({"mount": {"tilt_deg": 80.0}})), "rays-past-ground", WRONG),
        (nothing, "covariance-assumed", f"note {LOGGED} cov_00"),
    ],
    "nameless": [
        (euler(LOGGED, lambda e: e * [1, 1, -1]), "few-meet-a-target", f"warning {LOGGED}", "sign of yaw"),
        (
            state({"targets": {"many": {"others": True}}}),
            *("nearest-among-others", "warning flight.toml scoring.rule"),
        ),
    ],
    # Other sensors.
    "boats": [
        (state({"camera": None}), "sensor-clocks", "note flight.toml sensors"),
        (state({"sensors": {"radra": {}}}), "sensor-absent", "warning flight.toml sensors.radra"),
        (put("frames", "sensor", 0, "lidar"), "source-contradicts-sensor", "problem detections source"),
        (put("detections", "source", 0, "Radar"), "source-is-no-sensor", "note detections source"),
        (drop(LOOKS, 30.1, 89.9), "pose-gap", f"warning {LOOKS} time_s"),
        (shift("truth", -12.0), "scans-explained", "problem truth", "clock of the truth"),
        (
            scale(("azimuth_rad",), -1, "detections"),
            *("source-explained", "problem detections azimuth_rad", "wrong sign"),
        ),
        (
            scale(("range_m",), 0.3048, "detections"),
            *("source-explained", "problem detections azimuth_rad", "in m, and was read as ft"),
        ),
        (
            change_columns("detections", ["azimuth_rad"], lambda a: a + 0.1),
            *("sensors-turned", "warning detections azimuth_rad", "heading off"),
        ),
    ],
    "places": [
        (read_twice, "read-twice", "problem detections source"),
        (beside, "target-beside", "warning truth target_id", "one mark off"),
    ],
    "two sensors": [
        (of_lidar(lambda p: p[:, ::-1]), *SEEN, "lidar: north and east are exchanged"),
        (of_lidar(lambda p: p * [-1, 1]), *SEEN, "lidar: north has the wrong sign"),
        (of_lidar(lambda p: 0.3048 * p), *SEEN, "lidar: it is in m, and was read as ft"),
    ],
    # Inertial and satellite measurements, attitude and magnetic field.
    "aeroplane": [
        (nothing, "navigation-only", f"note {CAMERA}"),
        (drop("imu", 31.01, 32.99), "imu-gap", "warning imu time_s"),
        (drop("gnss", 100.1, 159.9), "gnss-gap", "warning gnss time_s"),
        (drop("gnss", 180, 999), "gnss-gap", "warning gnss time_s"),
        (shift("gnss", 1e6), "imu-gnss-apart", "problem gnss time_s"),
        (shift("gnss", 180), "imu-gnss-little-common", "warning gnss time_s"),
        (shift("gnss", 3.0), "imu-gnss-offset", "warning gnss time_s"),
        (shift("imu", 0.6), "imu-gnss-offset", "warning gnss time_s"),
        (other_flight, "imu-gnss-unlike", "warning gnss time_s"),
        (scale(FORCE, 1 / 9.80665), "force-in-g", "problem imu f_z_m_s2"),
        (gravity_off, "force-short", "problem imu f_z_m_s2"),
        (scale(FORCE, 9.80665), "force-long", "problem imu f_z_m_s2"),
        (scale(RATE, DEGREES), "rate-against-course", "problem imu w_z_rad_s"),
        (scale(RATE, 1 / DEGREES), FELT, "problem imu", "rate: rad/s, and the recipe says deg/s"),
        (turn(EXCHANGED, FORCE, RATE), "gravity-along-other-axis", "problem imu f_x_m_s2"),
        (turn(FLU, FORCE, RATE), "gravity-upside-down", "problem imu f_z_m_s2"),
        (scale(FORCE, -1), "gravity-upside-down", "problem imu f_z_m_s2"),
        (turn(OBLIQUE, FORCE, RATE), "gravity-oblique", "problem imu f_z_m_s2"),
        (turn(-NO_Z, FORCE, RATE), FELT, "problem imu", "[imu.force]: x is minus x, y is minus y"),
        (turn(NO_Y, RATE), FELT, "warning imu", "axes of [imu.rate]: y is minus y"),
        (turn(NO_Z, RATE), FELT, "problem imu", "axes of [imu.rate]: z is minus z"),
        (turn(-FLU, FORCE), FELT, "warning imu", "axes of [imu.force]: x is minus x"),
        (euler(NAV, lambda e: e * [-1, 1, 1]), FELT, f"warning {NAV}", "attitude: sign of roll"),
        (euler(NAV, lambda e: e * [1, -1, 1]), FELT, f"warning {NAV}", "attitude: sign of pitch"),
        (euler(NAV, lambda e: e * [1, 1, -1]), FELT, f"problem {NAV}", "attitude: sign of yaw"),
        (euler(NAV, lambda e: e - [0, 0, 90]), FELT, f"warning {NAV}", "yaw off by 90 deg"),
        (euler(NAV, lambda e: e[:, [1, 0, 2]]), FELT, f"warning {NAV}", "roll and pitch exchanged"),
        (euler(NAV, np.radians), FELT, f"problem {NAV}", "roll, pitch and yaw in radians"),
        (scale(TURNS, -1, NAV), FELT, f"problem {NAV}", "attitude the other way round"),
        (
            change_columns(NAV, ("q_w", *TURNS), lambda q: q[::-1]),
            *("felt-unexplained", f"warning {NAV}"),
        ),
        (euler(NAV, lambda e: e + np.array([0, 0, 12])), "heading-off", f"warning {NAV}", "heading off"),
        (
            both(
                euler(NAV, lambda e: e - np.array([0, 0, 12])),
                state({"magnetometer": {"declination_deg": 12.0}}),
            ),
            *("heading-off", f"warning {NAV}", "declination missing"),
        ),
        (scale(MAGNETOMETER, 0.01, "magnetometer"), "field-unit", FIELD),
        (scale(MAGNETOMETER, 0.001, "magnetometer"), "field-in-ut", FIELD),
        (scale(MAGNETOMETER, 4e-6, "magnetometer"), "field-size", FIELD),
        (
            scale(MAGNETOMETER, [1, -1, 1], "magnetometer"),
            *("field-explained", FIELD, "axes of the magnetometer: y is minus y"),
        ),
        (scale(VELOCITY, [1, 1, -1], "gnss"), *SPEEDS, "sign of down"),
    ],
    "wing": [(turn(NO_Y, FORCE), "force-against", "warning imu f_y_m_s2", "sign of force y")],
    "without attitude": [
        (scale(RATE, DEGREES), "rate-against-course", "problem imu w_z_rad_s"),
        (scale(RATE, 1 / DEGREES), "rate-against-course", "warning imu w_z_rad_s"),
        (both(without("gnss"), scale(RATE, DEGREES)), "rate-too-fast", "problem imu w_z_rad_s"),
        (turn(NO_Z, RATE), "z-against-course", "warning imu w_z_rad_s"),
        (turn(-NO_Z, FORCE, RATE), "nose-drops-in-turns", "warning imu w_y_rad_s"),
        (turn(FLU, FORCE, RATE), "gravity-upside-down", "problem imu f_z_m_s2"),
    ],
    "poses alone": [
        (euler(NAV, lambda e: e * [1, 1, -1]), "heading-not-course", f"warning {NAV}", "sign of yaw"),
        (
            euler(NAV, lambda e: e[:, [1, 0, 2]]),
            *("lean-not-course", f"warning {NAV}", "attitude: roll and pitch exchanged"),
        ),
        (euler(NAV, lambda e: e * [-1, 1, 1]), "lean-not-course", f"warning {NAV}", "attitude: sign of roll"),
        (
            euler(NAV, lambda e: e * [1, 1, DEGREES] + [0, 0, 5]),
            *("turns-too-fast", f"problem {NAV} q_w", "attitude in degrees"),
        ),
        (
            both(rows(NAV, lambda nav: nav.iloc[::20].reset_index(drop=True)), euler(NAV, np.degrees)),
            *("down-everywhere", f"problem {NAV} q_w", "attitude in degrees"),
        ),
        (
            euler(NAV, lambda e: np.radians(np.unwrap(e, axis=0, period=360))),
            *("heading-not-course", f"warning {NAV}", "yaw in radians, read as degrees"),
        ),
    ],
    # Motion and place.
    "track": [
        # Across the way, where no clock would be blamed.
        (both(leap("gnss", 40.0, 0.0), leap(NAV, 40.0, 0.0)), "leap", f"problem {NAV} north_m"),
        (scale(VELOCITY, [-1, 1, 1], "gnss"), *SPEEDS, "sign of north"),
        (scale(VELOCITY, 1 / 0.514444, "gnss"), *SPEEDS, "velocity in kn"),
        (put(NAV, NED[0], ALL, 0.0), "motion-unexplained", f"warning {NAV} v_north_m_s"),
        (shift("gnss", -3.5), *PLACES, "clock of the receiver"),
        (moved([300e3, 0, 0], NAV), "tables-apart", f"problem {NAV} north_m"),
        (
            geodetic("gnss", lambda a, b, h: (b, a, h)),
            *("tables-apart-explained", "problem gnss north_m", "latitude and longitude exchanged"),
        ),
        (moved([30e3, 0, 0], NAV, "gnss"), "origin-far", "warning flight.toml origin"),
        (
            both(*(geodetic(one, lambda a, b, h: (b, a, h)) for one in (NAV, "gnss"))),
            *("origin-explained", "problem flight.toml origin", "exchanged"),
        ),
    ],
    # Straight on, where a leap looks like a clock.
    "straight": [
        (leap("gnss", 60.0, 0.0), *LEAPT),
        (leap("gnss", 60.0, 1.0), *LEAPT),
        (leap(NAV, 60.0, 1.0), "leap", f"problem {NAV} north_m", "leap of the position"),
    ],
    "straight, without velocities": [
        (leap("gnss", 60.0, 0.5), *LEAPT),
        (leap("gnss", 60.0, 1.0), *LEAPT),
    ],
    "without velocities": [
        (moved([0, 0, -40.0], "gnss"), *PLACES, "constant height"),
        (scale(NED, [-1, 1, 1], "gnss"), *PLACES, "gnss: north negated"),
        (
            change_columns("gnss", NED, lambda p: p[:, [1, 0, 2]]),
            *(*PLACES, "gnss: north and east exchanged"),
        ),
        (
            geodetic("gnss", lambda a, b, h: (a, b, h / 0.3048)),
            *(*PLACES, "gnss: height in ft, read as m"),
        ),
        (
            change_columns("gnss", ["north_m"], lambda p: p + 1500 * np.sin(np.arange(len(p)) / 60)[:, None]),
            *("positions-unexplained", f"warning {NAV} north_m"),
        ),
    ],
}  # fmt: skip


@cache
def right(name: str) -> Flight:
    """The flight that a mistake is made in."""
    made = {
        "aeroplane": aeroplane,
        "without attitude": lambda: replace(right("aeroplane"), nav={}),
        "poses alone": lambda: replace(right("aeroplane"), tables={}),
        "wing": lambda: on_board(simulate_sound_flight("fixed wing", 2)),
        "track": lambda: track(turning=0.8),
        "straight": track,
        "straight, without velocities": lambda: track(velocity=False),
        "without velocities": lambda: track(turning=0.8, velocity=False),
        "survey": lambda: simulate(Survey(images=20, every_s=4.0)),
        "nameless": lambda: simulate(Survey(images=20, every_s=4.0, rule="nearest")),
        "boats": lambda: boats(small_flight),
        "two sensors": lambda: with_lidar(boats(small_flight)),
        "places": lambda: boats(small_flight, kind="position"),
        "small": small_flight,
    }
    return made[name]()


def on_board(flight: Flight) -> Flight:
    """What the airframe has alone."""
    seen = ("frames", "detections", "truth")
    return replace(flight, tables={name: one for name, one in flight.tables.items() if name not in seen})


@pytest.mark.parametrize(
    ("flight", "spoil", "code", "place", "cause"),
    [
        pytest.param(flight, *case, *[""] * (4 - len(case)), id=f"{flight}-{case[1]}-{number}")
        for flight, cases in CASES.items()
        for number, case in enumerate(cases)
    ],
)
def test_a_mistake_is_named(flight, spoil, code, place, cause):
    made = copy.deepcopy(right(flight))
    found = find(spoil(made) or made)
    named = [
        one for one in found if (one.code, f"{one.level} {one.table} {one.field}".strip()) == (code, place)
    ]
    assert named and any(cause in one for one in named[0].causes or [""]), found
    assert all(one.sentence and one.fix for one in found)
    ranks = [("problem", "warning", "note").index(one.level) for one in found]
    assert ranks == sorted(ranks)
