"""Wrong meanings: what a wrong line of a recipe would have made of a flight.

Each is a function from flight to flight, written from the recipe's side and without the functions that the
checks undo mistakes with. `wrong_meanings` gives those that a flight has something for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

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
Change = Callable[[Flight], Flight]


@dataclass(frozen=True)
class WrongMeaning:
    """A mistake: its name, what it does, and what a finding has to say to have named it (a pattern)."""

    name: str
    apply: Change
    named: str


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
        found += sensors.own_ship("truth")
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


def _llh(table: str, change: Callable[[Any, Any, Any], tuple[Any, Any, Any]]) -> Change:
    """Latitude, longitude (degrees) and height as the recipe would have read them."""

    def apply(flight: Flight) -> Flight:
        o = flight.manifest.origin
        place = (o.latitude_deg, o.longitude_deg, o.height_m)

        def rows(data: pd.DataFrame) -> pd.DataFrame:
            lat, lon, h = pymap3d.ned2geodetic(*data[NED].to_numpy(float).T, *place)
            lat, lon, h = change(np.asarray(lat), np.asarray(lon), np.asarray(h))
            data[NED] = np.column_stack(pymap3d.geodetic2ned(np.clip(lat, -90, 90), lon, h, *place))
            return data

        return with_table(flight, table, rows)

    return apply


def columns(table: str, names: list[str], matrix: Any) -> Change:
    def apply(flight: Flight) -> Flight:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            data[names] = data[names].to_numpy(float) @ np.asarray(matrix, float).T
            return data

        return with_table(flight, table, rows)

    return apply


def _euler(table: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Roll, pitch, yaw (degrees, (N, 3)) as the recipe would have read them."""

    def apply(flight: Flight) -> Flight:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            q = Rotation.from_quat(data[QUATERNION].to_numpy(float), scalar_first=True)
            angles = q.as_euler("ZYX", degrees=True)[:, ::-1]
            read = change(angles)
            q = Rotation.from_euler("ZYX", read[:, ::-1], degrees=True)
            data[QUATERNION] = q.as_quat(scalar_first=True, canonical=True)
            return data

        return with_table(flight, table, rows)

    return apply


def _quaternion(table: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    def apply(flight: Flight) -> Flight:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            data[QUATERNION] = change(data[QUATERNION].to_numpy(float))
            return data

        return with_table(flight, table, rows)

    return apply


def shift(table: str, seconds: float, rows: Callable[[pd.DataFrame], Any] | None = None) -> Change:
    def apply(flight: Flight) -> Flight:
        def later(data: pd.DataFrame) -> pd.DataFrame:
            which = slice(None) if rows is None else rows(data)
            data.loc[which, "time_s"] = data.loc[which, "time_s"] + seconds
            return data

        return with_table(flight, table, later)

    return apply


# -- what is done to them


def places(table: str, label: str, velocity: bool = False) -> Iterator[WrongMeaning]:
    def one(name: str, change: Change, named: str) -> WrongMeaning:
        return WrongMeaning(f"{label}: {name}", change, named)

    R = np.degrees(1.0)
    yield one(
        "latitude and longitude exchanged",
        _llh(table, lambda a, b, h: (b, a, h)),
        "latitude and longitude are exchanged|north and east are exchanged",
    )
    yield one("latitude negated", _llh(table, lambda a, b, h: (-a, b, h)), "latitude has the wrong sign")
    yield one("longitude negated", _llh(table, lambda a, b, h: (a, -b, h)), "longitude has the wrong sign")
    yield one(
        "radians read as degrees",
        _llh(table, lambda a, b, h: (a / R, b / R, h)),
        "latitude and longitude are in radians",
    )
    yield one(
        "height in feet",
        _llh(table, lambda a, b, h: (a, b, h / 0.3048)),
        "height is in ft|constant height|vertical",
    )
    yield one(
        "height in metres read as feet",
        _llh(table, lambda a, b, h: (a, b, h * 0.3048)),
        "says ft|constant height|vertical",
    )
    yield one("height above the geoid, 40 m", _llh(table, lambda a, b, h: (a, b, h - 40.0)), "vertical")
    yield one(
        "height negated",
        _llh(table, lambda a, b, h: (a, b, -h)),
        "height has the wrong sign|vertical|counts upwards",
    )
    yield one("height above home", _llh(table, lambda a, b, h: (a, b, h - h[0] + 0.0)), "vertical")
    yield one(
        "north and east exchanged",
        columns(table, NED, [[0, 1, 0], [1, 0, 0], [0, 0, 1]]),
        "north and east are exchanged|latitude and longitude are exchanged",
    )
    yield one("north negated", columns(table, NED, np.diag([-1, 1, 1])), "north has the wrong sign")
    yield one("east negated", columns(table, NED, np.diag([1, -1, 1])), "east has the wrong sign")
    yield one("down read from up", columns(table, NED, np.diag([1, 1, -1])), "upwards|wrong sign|vertical")
    yield one("feet read as metres", columns(table, NED, np.diag([1 / 0.3048, 1 / 0.3048, 1])), "in ft")


def velocities(table: str, label: str) -> Iterator[WrongMeaning]:
    def one(name: str, matrix: Any, named: str) -> WrongMeaning:
        return WrongMeaning(f"{label}: {name}", columns(table, VELOCITY, matrix), named)

    yield one("velocity in knots", np.diag([1 / 0.514444] * 3), "in kn|knots")
    yield one("velocity in km/h", np.diag([3.6] * 3), "km/h")
    yield one("velocity in ft/s", np.diag([1 / 0.3048] * 3), "ft/s")
    yield one("velocity in cm/s", np.diag([100.0] * 3), "cm/s")
    yield one("velocity down from up", np.diag([1, 1, -1]), "down|up")
    yield one("velocity north and east exchanged", [[0, 1, 0], [1, 0, 0], [0, 0, 1]], "exchange")
    yield one("velocity north negated", np.diag([-1, 1, 1]), "north")
    yield one("velocity east negated", np.diag([1, -1, 1]), "east")

    def course(change: Callable[[np.ndarray], np.ndarray]) -> Change:
        def apply(flight: Flight) -> Flight:
            def rows(data: pd.DataFrame) -> pd.DataFrame:
                v = data[VELOCITY].to_numpy(float)
                speed, angle = np.hypot(v[:, 0], v[:, 1]), change(np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi))
                data[VELOCITY] = np.column_stack([speed * np.cos(angle), speed * np.sin(angle), v[:, 2]])
                return data

            return with_table(flight, table, rows)

        return apply

    yield WrongMeaning(f"{label}: course in degrees read as radians", course(np.degrees), "course.*deg")
    yield WrongMeaning(f"{label}: course in radians read as degrees", course(np.radians), "course.*rad")
    yield WrongMeaning(
        f"{label}: course from which it comes", course(lambda a: a + np.pi), "north and east|half a turn|180"
    )


def _poses(flight: Flight, source: str) -> Iterator[WrongMeaning]:
    table = f"nav/{source}"
    has = flight.nav[source]
    own_place = not (flight.gnss is not None and VELOCITY[0] not in has)  # else taken from the receiver
    if own_place:
        yield from places(table, "poses")
    if VELOCITY[0] in has:
        yield from velocities(table, "poses")
    if np.ptp(has[QUATERNION].to_numpy(float), axis=0).max() == 0:
        return  # no attitude but a stand-in

    def one(name: str, change: Change, named: str) -> WrongMeaning:
        return WrongMeaning(f"attitude: {name}", change, named)

    for axis, key in enumerate(("roll", "pitch", "yaw")):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        yield one(f"{key} negated", _euler(table, lambda e, s=sign: e * s), f"{key} has the wrong sign")
    yield one(
        "roll and pitch negated",
        _euler(table, lambda e: e * [-1, -1, 1]),
        "roll and pitch have the wrong sign|roll has|pitch has",
    )
    for turn in (90.0, -90.0, 180.0):
        yield one(
            f"yaw off by {turn:g} deg",
            _euler(table, lambda e, t=turn: e + np.array([0, 0, t])),
            "yaw",
        )
    yield one(
        "yaw from east, to the left",
        _euler(table, lambda e: e * [1, 1, -1] + [0, 0, 90]),
        "counts to the left from east|yaw",
    )
    for some, key in (((0, 1, 2), "all angles"), ((0,), "roll"), ((1,), "pitch"), ((2,), "yaw")):
        chosen = np.isin(np.arange(3), some)
        yield one(
            f"{key} in radians read as degrees",
            _euler(table, lambda e, c=chosen: np.where(c, np.radians(e), e)),
            "radians",
        )
        yield one(
            f"{key} in degrees read as radians",
            _euler(table, lambda e, c=chosen: np.where(c, np.degrees(e), e)),
            "degrees",
        )
    yield one(
        "roll and pitch exchanged", _euler(table, lambda e: e[:, [1, 0, 2]]), "roll and pitch are exchanged"
    )
    yield one(
        "pitch and yaw exchanged", _euler(table, lambda e: e[:, [0, 2, 1]]), "pitch and yaw are exchanged"
    )
    yield one(
        "pitch from the vertical",
        _euler(table, lambda e: np.column_stack([e[:, 0], 90 + e[:, 1], e[:, 2]])),
        "pitch",
    )
    yield one("quaternion inverse", _quaternion(table, lambda q: q * [1, -1, -1, -1]), "inverse")
    yield one("quaternion order", _quaternion(table, lambda q: q[:, [1, 2, 3, 0]]), "order")
    flip = Rotation.from_matrix(np.diag([1.0, -1, -1]))
    enu = Rotation.from_matrix(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]))

    def flu(q: np.ndarray) -> np.ndarray:
        return np.asarray(
            (enu * Rotation.from_quat(q, scalar_first=True) * flip).as_quat(scalar_first=True, canonical=True)
        )

    yield one("axes flu-enu", _quaternion(table, flu), "flu-enu")
