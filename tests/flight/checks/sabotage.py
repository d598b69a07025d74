"""Wrong meanings: what a wrong line of a recipe would have made of a flight.

Each is a function from flight to flight, written from the recipe's side and without the functions that the
checks undo mistakes with. `wrong_meanings` gives those that a flight has something for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pymap3d
from scipy.spatial.transform import Rotation

from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight

NED = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
FIELD = ["field_x_ut", "field_y_ut", "field_z_ut"]
EXCHANGE = [[0, 1, 0], [1, 0, 0], [0, 0, 1]]
FOOT = 0.3048
Change = Callable[[Flight], Flight]


class WrongMeaning(NamedTuple):
    name: str
    apply: Change


def wrong_meanings(flight: Flight) -> list[WrongMeaning]:
    """Every wrong meaning that changes something in this flight."""
    from tests.flight.checks import sabotage_camera as cameras
    from tests.flight.checks import sabotage_sensors as sensors

    found: list[WrongMeaning] = []
    if flight.manifest.camera is not None and flight.detections is not None:
        found += cameras.camera_meanings(flight)
    for source in [name for name in flight.nav if name in ("logged", "autopilot", "onboard", "ownship")][:1]:
        found += _poses(flight, source)
    found += places("truth", "truth") if flight.truth is not None else []
    if flight.gnss is not None:
        found += sensors.gnss_meanings(flight)
    if flight.imu is not None:
        found += sensors.imu_meanings()
    if "magnetometer" in flight.tables:
        found += sensors.magnetometer_meanings()
    if flight.detections is not None and flight.manifest.camera is None:
        found += sensors.sensor_meanings(flight)
    if flight.manifest.time.kind == "utc":
        found += sensors.clock_meanings(flight)
    return found


# -- how tables are changed


def with_table(flight: Flight, table: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Flight:
    nav, tables = dict(flight.nav), dict(flight.tables)
    if table.startswith("nav/"):
        nav[table[4:]] = change(nav[table[4:]].copy())
    else:
        tables[table] = change(tables[table].copy())
    return Flight(flight.manifest, nav, tables, None)


def manifest_of(flight: Flight, **parts: dict[str, Any]) -> Flight:
    return Flight(replace_in_manifest(flight.manifest, parts), flight.nav, flight.tables, None)


def of_columns(table: str, names: list[str], change: Callable[[np.ndarray], Any]) -> Change:
    """Columns (N, K) of one table as the recipe would have read them."""

    def apply(flight: Flight) -> Flight:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            data[names] = change(data[names].to_numpy(float))
            return data

        return with_table(flight, table, rows)

    return apply


def columns(table: str, names: list[str], matrix: Any) -> Change:
    return of_columns(table, names, lambda values: values @ np.asarray(matrix, float).T)


def _llh(table: str, change: Callable[[Any, Any, Any], tuple[Any, Any, Any]]) -> Change:
    """Latitude, longitude (degrees) and height as the recipe would have read them."""

    def apply(flight: Flight) -> Flight:
        o = flight.manifest.origin
        place = (o.latitude_deg, o.longitude_deg, o.height_m)

        def moved(p: np.ndarray) -> np.ndarray:
            lat, lon, h = change(*(np.asarray(one) for one in pymap3d.ned2geodetic(*p.T, *place)))
            return np.column_stack(pymap3d.geodetic2ned(np.clip(lat, -90, 90), lon, h, *place))

        return of_columns(table, NED, moved)(flight)

    return apply


def euler(table: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Roll, pitch, yaw (degrees, (N, 3)) as the recipe would have read them."""

    def turned(q: np.ndarray) -> np.ndarray:
        angles = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)[:, ::-1]
        read = Rotation.from_euler("ZYX", change(angles)[:, ::-1], degrees=True)
        return np.asarray(read.as_quat(scalar_first=True, canonical=True))

    return of_columns(table, QUATERNION, turned)


def shift(table: str, seconds: float) -> Change:
    return of_columns(table, ["time_s"], lambda t: t + seconds)


# -- what is done to them


def places(table: str, label: str) -> Iterator[WrongMeaning]:
    R = np.degrees(1.0)
    for name, change in {
        "latitude and longitude exchanged": lambda a, b, h: (b, a, h),
        "latitude negated": lambda a, b, h: (-a, b, h),
        "longitude negated": lambda a, b, h: (a, -b, h),
        "radians read as degrees": lambda a, b, h: (a / R, b / R, h),
        "height in feet": lambda a, b, h: (a, b, h / FOOT),
        "height in metres read as feet": lambda a, b, h: (a, b, h * FOOT),
        "height above the geoid, 40 m": lambda a, b, h: (a, b, h - 40.0),
        "height negated": lambda a, b, h: (a, b, -h),
        "height above home": lambda a, b, h: (a, b, h - h[0]),
    }.items():
        yield WrongMeaning(f"{label}: {name}", _llh(table, change))
    for name, matrix in {
        "north and east exchanged": EXCHANGE,
        "north negated": np.diag([-1, 1, 1]),
        "east negated": np.diag([1, -1, 1]),
        "down read from up": np.diag([1, 1, -1]),
        "feet read as metres": np.diag([1 / FOOT, 1 / FOOT, 1]),
    }.items():
        yield WrongMeaning(f"{label}: {name}", columns(table, NED, matrix))


def velocities(table: str, label: str) -> Iterator[WrongMeaning]:
    for name, matrix in {
        "in knots": np.eye(3) / 0.514444,
        "in km/h": np.eye(3) * 3.6,
        "in ft/s": np.eye(3) / FOOT,
        "in cm/s": np.eye(3) * 100.0,
        "down from up": np.diag([1, 1, -1]),
        "north and east exchanged": EXCHANGE,
        "north negated": np.diag([-1, 1, 1]),
        "east negated": np.diag([1, -1, 1]),
    }.items():
        yield WrongMeaning(f"{label}: velocity {name}", columns(table, VELOCITY, matrix))

    def course(change: Callable[[np.ndarray], np.ndarray]) -> Change:
        def turned(v: np.ndarray) -> np.ndarray:
            speed, angle = np.hypot(v[:, 0], v[:, 1]), change(np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi))
            return np.column_stack([speed * np.cos(angle), speed * np.sin(angle), v[:, 2]])

        return of_columns(table, VELOCITY, turned)

    yield WrongMeaning(f"{label}: course in degrees read as radians", course(np.degrees))
    yield WrongMeaning(f"{label}: course in radians read as degrees", course(np.radians))
    yield WrongMeaning(f"{label}: course from which it comes", course(lambda a: a + np.pi))


def _poses(flight: Flight, source: str) -> Iterator[WrongMeaning]:
    table, has = f"nav/{source}", flight.nav[source]
    own_place = not (flight.gnss is not None and VELOCITY[0] not in has)  # else taken from the receiver
    if own_place:
        yield from places(table, "poses")
    if VELOCITY[0] in has:
        yield from velocities(table, "poses")
    if np.ptp(has[QUATERNION].to_numpy(float), axis=0).max() > 0:  # else only a stand-in
        yield from _attitudes(table)


def _attitudes(table: str) -> Iterator[WrongMeaning]:
    def one(name: str, change: Callable[[np.ndarray], np.ndarray]) -> WrongMeaning:
        return WrongMeaning(f"attitude: {name}", euler(table, change))

    for axis, key in enumerate(("roll", "pitch", "yaw")):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        yield one(f"{key} negated", lambda e, s=sign: e * s)
    yield one("roll and pitch negated", lambda e: e * [-1, -1, 1])
    for turn in (90.0, -90.0, 180.0):
        yield one(f"yaw off by {turn:g} deg", lambda e, t=turn: e + np.array([0, 0, t]))
    yield one("yaw from east, to the left", lambda e: e * [1, 1, -1] + [0, 0, 90])
    for some, key in (((0, 1, 2), "all angles"), ((0,), "roll"), ((1,), "pitch"), ((2,), "yaw")):
        chosen = np.isin(np.arange(3), some)
        yield one(f"{key} in radians read as degrees", lambda e, c=chosen: np.where(c, np.radians(e), e))
        yield one(f"{key} in degrees read as radians", lambda e, c=chosen: np.where(c, np.degrees(e), e))
    yield one("roll and pitch exchanged", lambda e: e[:, [1, 0, 2]])
    yield one("pitch and yaw exchanged", lambda e: e[:, [0, 2, 1]])
    yield one("pitch from the vertical", lambda e: e + np.array([0, 90, 0]))
    flip = Rotation.from_matrix(np.diag([1.0, -1, -1]))
    enu = Rotation.from_matrix(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]))

    def flu(q: np.ndarray) -> np.ndarray:
        turned = enu * Rotation.from_quat(q, scalar_first=True) * flip
        return np.asarray(turned.as_quat(scalar_first=True, canonical=True))

    for name, change in {
        "quaternion inverse": lambda q: q * [1, -1, -1, -1],
        "quaternion order": lambda q: q[:, [1, 2, 3, 0]],
        "axes flu-enu": flu,
    }.items():
        yield WrongMeaning(f"attitude: {name}", of_columns(table, QUATERNION, change))
