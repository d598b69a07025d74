"""Wrong meanings of inertial and satellite measurements, of other sensors, and of clocks: see `sabotage`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from tests.flight.checks import sabotage as s
from wildlab.flight.store import Flight


def gnss_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of satellite positions and velocities; a nav source without its own takes its positions from them."""
    follow = [f"nav/{n}" for n, nav in flight.nav.items() if n == "onboard" and s.VELOCITY[0] not in nav]
    along = [s.places(table, "") for table in follow]
    for one in s.places("gnss", "gnss"):
        apply, others = one.apply, [next(meanings).apply for meanings in along]

        def both(f: Flight, apply: s.Change = apply, others: list[s.Change] = others) -> Flight:
            f = apply(f)
            for other in others:
                f = other(f)
            return f

        yield s.WrongMeaning(one.name, both, one.named)
    yield from s.velocities("gnss", "gnss")
    yield s.WrongMeaning(
        "gnss: lever arm in mm",
        lambda f: s.manifest_of(f, gnss={"lever_arm_m": (400.0, 0.0, -100.0)}),
        "lever arm",
    )


def imu_meanings() -> Iterator[s.WrongMeaning]:
    """Of specific force and angular rate."""

    def one(name: str, named: str, *changes: s.Change) -> s.WrongMeaning:
        def apply(flight: Flight) -> Flight:
            for change in changes:
                flight = change(flight)
            return flight

        return s.WrongMeaning(f"imu: {name}", apply, named)

    def both(matrix: object) -> tuple[s.Change, s.Change]:
        return s.columns("imu", s.FORCE, matrix), s.columns("imu", s.RATE, matrix)

    yield one("rate in deg/s", "deg/s", s.columns("imu", s.RATE, np.eye(3) * np.degrees(1)))
    yield one("rate in rad/s read as deg/s", "rad/s", s.columns("imu", s.RATE, np.eye(3) * np.radians(1)))
    yield one("rate in mrad/s", "mrad/s|deg/s", s.columns("imu", s.RATE, np.eye(3) * 1000))
    yield one("force in g", '"g"', s.columns("imu", s.FORCE, np.eye(3) / 9.80665))
    yield one("force in mg", "unit", s.columns("imu", s.FORCE, np.eye(3) * 1000 / 9.80665))
    yield one("force in ft/s2", "unit", s.columns("imu", s.FORCE, np.eye(3) / 0.3048))
    yield one("gravity counted instead of felt", "negate", s.columns("imu", s.FORCE, -np.eye(3)))
    for axis, key in enumerate("xyz"):
        flip = np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))
        yield one(f"rate {key} negated", "negate", s.columns("imu", s.RATE, flip))
        yield one(f"force {key} negated", "negate", s.columns("imu", s.FORCE, flip))
        yield one(f"{key} negated in both", "negate", *both(flip))
    for name, matrix in (
        ("x and y exchanged", [[0, 1, 0], [1, 0, 0], [0, 0, 1]]),
        ("x and z exchanged", [[0, 0, 1], [0, 1, 0], [1, 0, 0]]),
        ("y and z exchanged", [[1, 0, 0], [0, 0, 1], [0, 1, 0]]),
        ("forward-left-up", np.diag([1, -1, -1])),
        ("backwards", np.diag([-1, -1, 1])),
        ("turned to the right", [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        ("turned to the left", [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        ("right-forward-up", [[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    ):
        yield one(name, r"negate|columns|exchange", *both(matrix))


def magnetometer_meanings() -> Iterator[s.WrongMeaning]:
    """Of the magnetic field."""

    def one(name: str, matrix: object, named: str) -> s.WrongMeaning:
        return s.WrongMeaning(f"magnetometer: {name}", s.columns("magnetometer", s.FIELD, matrix), named)

    for axis, key in enumerate("xyz"):
        yield one(
            f"{key} negated", np.diag(np.where(np.arange(3) == axis, -1.0, 1.0)), r"magnetometer\.field"
        )
    yield one("x and y exchanged", [[0, 1, 0], [1, 0, 0], [0, 0, 1]], r"magnetometer\.field")
    yield one("y and z as in the log", np.diag([1, -1, -1]), r"magnetometer\.field")
    yield one("in mG, read as uT", np.eye(3) * 10, "unit")
    yield one("in nT, read as uT", np.eye(3) * 1000, "unit")
    yield one("in G, read as uT", np.eye(3) / 100, "unit")


def clock_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of stamps: zones, leap seconds, delays."""

    def one(name: str, change: s.Change, named: str) -> s.WrongMeaning:
        return s.WrongMeaning(f"clock: {name}", change, named)

    if flight.frames is not None:
        yield one("frames an hour late", s.shift("frames", 3600.0), "1 h")
        yield one("frames two hours early", s.shift("frames", -7200.0), "2 h")
        if flight.manifest.camera is not None:
            yield one("camera 18 s late", s.shift("frames", 18.0), "camera_offset_s|18 s")
            yield one("camera 1 s late", s.shift("frames", 1.0), "camera_offset_s")
            yield one("camera 0.4 s early", s.shift("frames", -0.4), "camera_offset_s")
    if flight.truth is not None and flight.truth["time_s"].notna().any():
        yield one("truth an hour late", s.shift("truth", 3600.0), "1 h")
        yield one("truth 18 s late", s.shift("truth", 18.0), "truth_offset_s|18 s|1[78]")
        yield one("truth 60 s late", s.shift("truth", 60.0), "truth_offset_s|60 s|5[89]|6[01]")
    if flight.gnss is not None:
        yield one("gnss an hour late", s.shift("gnss", 3600.0), "1 h")
        yield one("gnss 18 s late", s.shift("gnss", 18.0), "gnss_offset_s")
        yield one("gnss 2 s early", s.shift("gnss", -2.0), "gnss_offset_s")
    for source in [name for name in flight.nav if name in ("autopilot", "onboard", "ownship")][:1]:
        if "frame_id" not in flight.nav[source]:
            yield one("poses an hour late", s.shift(f"nav/{source}", 3600.0), "1 h")
            yield one("poses 18 s late", s.shift(f"nav/{source}", 18.0), "18 s|1[78]")
            yield one(
                "poses 2 s late", s.shift(f"nav/{source}", 2.0), "offset_s|seconds|s late|s early|2.0 s"
            )


def sensor_meanings(flight: Flight) -> Iterator[s.WrongMeaning]:
    """Of what other sensors saw: positions and bearings."""
    detections = flight.table("detections")
    for source, rows in detections.groupby("source", sort=False):
        kind = rows["kind"].iloc[0]

        def only(change, source=source):  # type: ignore[no-untyped-def]
            def apply(f: Flight) -> Flight:
                def edit(data: pd.DataFrame) -> pd.DataFrame:
                    return change(data, (data["source"] == source).to_numpy())

                return s.with_table(f, "detections", edit)

            return apply

        if kind == "position":
            for name, matrix, named in (
                ("north and east exchanged", [[0, 1], [1, 0]], "north and east are exchanged"),
                ("north negated", np.diag([-1, 1]), "north has the wrong sign"),
                ("east negated", np.diag([1, -1]), "east has the wrong sign"),
                ("both negated", np.diag([-1, -1]), "north and east have the wrong sign"),
                ("in ft", np.eye(2) / 0.3048, "in ft"),
                ("in m, read as ft", np.eye(2) * 0.3048, "read as ft"),
                ("in cm", np.eye(2) * 100, "in cm"),
            ):

                def turn(data, which, m=matrix):  # type: ignore[no-untyped-def]
                    data.loc[which, s.NED[:2]] = data.loc[which, s.NED[:2]].to_numpy(float) @ np.transpose(m)
                    return data

                yield s.WrongMeaning(f"{source}: {name}", only(turn), named)
        elif kind == "bearing":
            for name, change, named in (
                ("to the left", lambda a: -a, "to the left|wrong sign"),
                ("from east", lambda a: a - np.pi / 2, "90 deg|quarter"),
                ("from south", lambda a: a + np.pi, "180 deg|half a turn"),
                ("from west", lambda a: a + np.pi / 2, "90 deg|quarter"),
                ("from east to the left", lambda a: np.pi / 2 - a, "to the left from east"),
                ("in degrees read as radians", np.degrees, "degrees"),
                ("in radians read as degrees", np.radians, "radians"),
            ):

                def bear(data, which, c=change):  # type: ignore[no-untyped-def]
                    data.loc[which, "azimuth_rad"] = c(data.loc[which, "azimuth_rad"].to_numpy(float))
                    return data

                yield s.WrongMeaning(f"{source}: {name}", only(bear), named)


def own_ship(table: str) -> Iterator[s.WrongMeaning]:
    """Of one target's truth alone."""
    yield s.WrongMeaning(
        "truth: one target 25 m off",
        lambda f: s.with_table(f, "truth", _one_target_off),
        "one mark off|target",
    )


def _one_target_off(data: pd.DataFrame) -> pd.DataFrame:
    first = data["target_id"].iloc[0]
    data.loc[data["target_id"] == first, "north_m"] += 25.0
    return data
