"""Wrong meanings of inertial and satellite measurements, of other sensors, and of clocks: see `sabotage`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import reduce

import numpy as np
import pandas as pd

from tests.flight.checks import sabotage as s
from wildlab.flight.store import Flight


def _one_after_another(*changes: s.Change) -> s.Change:
    return lambda flight: reduce(lambda f, change: change(f), changes, flight)


def _negated(axis: int) -> np.ndarray:
    return np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))


def gnss_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of satellite positions and velocities; a nav source without its own takes its positions from them."""
    along = [f"nav/{n}" for n, nav in flight.nav.items() if n == "onboard" and s.VELOCITY[0] not in nav]
    for same in zip(*(s.places(table, "gnss") for table in ["gnss", *along]), strict=True):
        yield s.WrongMeaning(same[0].name, _one_after_another(*(one.apply for one in same)))
    yield from s.velocities("gnss", "gnss")
    arm = {"lever_arm_m": (400.0, 0.0, -100.0)}
    yield s.WrongMeaning("gnss: lever arm in mm", lambda f: s.manifest_of(f, gnss=arm))


def imu_meanings() -> Iterator[s.WrongMeaning]:
    """Of specific force and angular rate."""

    def one(name: str, matrix: object, *parts: list[str]) -> s.WrongMeaning:
        return s.WrongMeaning(
            f"imu: {name}", _one_after_another(*(s.columns("imu", part, matrix) for part in parts))
        )

    yield one("rate in deg/s", np.eye(3) * np.degrees(1), s.RATE)
    yield one("rate in rad/s read as deg/s", np.eye(3) * np.radians(1), s.RATE)
    yield one("rate in mrad/s", np.eye(3) * 1000, s.RATE)
    yield one("force in g", np.eye(3) / 9.80665, s.FORCE)
    yield one("force in mg", np.eye(3) * 1000 / 9.80665, s.FORCE)
    yield one("force in ft/s2", np.eye(3) / s.FOOT, s.FORCE)
    yield one("gravity counted instead of felt", -np.eye(3), s.FORCE)
    for axis, key in enumerate("xyz"):
        yield one(f"rate {key} negated", _negated(axis), s.RATE)
        yield one(f"force {key} negated", _negated(axis), s.FORCE)
        yield one(f"{key} negated in both", _negated(axis), s.FORCE, s.RATE)
    for name, matrix in {
        "x and y exchanged": s.EXCHANGE,
        "x and z exchanged": [[0, 0, 1], [0, 1, 0], [1, 0, 0]],
        "y and z exchanged": [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        "forward-left-up": np.diag([1, -1, -1]),
        "backwards": np.diag([-1, -1, 1]),
        "turned to the right": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        "turned to the left": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        "right-forward-up": [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
    }.items():
        yield one(name, matrix, s.FORCE, s.RATE)


def magnetometer_meanings() -> Iterator[s.WrongMeaning]:
    """Of the magnetic field."""
    for name, matrix in {
        **{f"{key} negated": _negated(axis) for axis, key in enumerate("xyz")},
        "x and y exchanged": s.EXCHANGE,
        "y and z as in the log": np.diag([1, -1, -1]),
        "in mG, read as uT": np.eye(3) * 10,
        "in nT, read as uT": np.eye(3) * 1000,
        "in G, read as uT": np.eye(3) / 100,
    }.items():
        yield s.WrongMeaning(f"magnetometer: {name}", s.columns("magnetometer", s.FIELD, matrix))


def clock_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of stamps: zones, leap seconds, delays."""
    shifts: dict[str, tuple[float, ...]] = {}
    if flight.frames is not None:
        shifts["frames"] = (3600.0, -7200.0)
        if flight.manifest.camera is not None:
            shifts["frames"] += (18.0, 1.0, -0.4)
    if flight.truth is not None and flight.truth["time_s"].notna().any():
        shifts["truth"] = (3600.0, 18.0, 60.0)
    if flight.gnss is not None:
        shifts["gnss"] = (3600.0, 18.0, -2.0)
    for source in [name for name in flight.nav if name in ("autopilot", "onboard", "ownship")][:1]:
        if "frame_id" not in flight.nav[source]:
            shifts[f"nav/{source}"] = (3600.0, 18.0, 2.0)
    for table, seconds in shifts.items():
        for by in seconds:
            yield s.WrongMeaning(f"clock: {table} {by:g} s late", s.shift(table, by))


def sensor_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of what other sensors saw, positions and bearings; and of one target's truth alone."""
    matrices = {
        "north and east exchanged": [[0, 1], [1, 0]],
        "north negated": np.diag([-1, 1]),
        "east negated": np.diag([1, -1]),
        "both negated": np.diag([-1, -1]),
        "in ft": np.eye(2) / s.FOOT,
        "in m, read as ft": np.eye(2) * s.FOOT,
        "in cm": np.eye(2) * 100,
    }
    bearings: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "to the left": lambda a: -a,
        "from east": lambda a: a - np.pi / 2,
        "from south": lambda a: a + np.pi,
        "from west": lambda a: a + np.pi / 2,
        "from east to the left": lambda a: np.pi / 2 - a,
        "in degrees read as radians": np.degrees,
        "in radians read as degrees": np.radians,
    }

    def only(source: str, names: list[str], change: Callable[[np.ndarray], np.ndarray]) -> s.Change:
        def rows(data: pd.DataFrame) -> pd.DataFrame:
            which = (data["source"] == source).to_numpy()
            data.loc[which, names] = change(data.loc[which, names].to_numpy(float))
            return data

        return lambda f: s.with_table(f, "detections", rows)

    for source, rows in flight.table("detections").groupby("source", sort=False):
        kind = rows["kind"].iloc[0]
        for name, matrix in matrices.items() if kind == "position" else ():
            turn = only(str(source), s.NED[:2], lambda p, m=matrix: p @ np.transpose(m))
            yield s.WrongMeaning(f"{source}: {name}", turn)
        for name, bear in bearings.items() if kind == "bearing" else ():
            yield s.WrongMeaning(f"{source}: {name}", only(str(source), ["azimuth_rad"], bear))

    def off(truth: pd.DataFrame) -> pd.DataFrame:
        truth.loc[truth["target_id"] == truth["target_id"].iloc[0], "north_m"] += 25.0
        return truth

    yield s.WrongMeaning("truth: one target 25 m off", lambda f: s.with_table(f, "truth", off))
