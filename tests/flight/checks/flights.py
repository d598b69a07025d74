"""Flights that are right, small enough to be checked in a fraction of a second, for tests that spoil one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from tests.flight.checks.watching import level_poses, watch
from tests.flight.conftest import MANIFEST
from tests.sound_logs import NED, QUATERNION, VELOCITY
from wildlab.flight.manifest import make_manifest
from wildlab.flight.schema import FORCE, RATE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, matrix_to_quaternion
from wildlab.simulation.courses import loiter_path
from wildlab.simulation.trajectory import (
    angular_rates,
    attitude_along,
    fixed_wing_trajectory,
    specific_forces,
)

WITHOUT_CAMERA = {key: value for key, value in MANIFEST.items() if key != "camera"}
Path = Callable[[Array], tuple[Array, Array, Array]]

# -- an aeroplane with an inertial sensor, a receiver and a magnetometer

DURATION = 240.0
#: The Earth's field in n, microtesla.
FIELD = np.array([15.0, 1.0, 48.0])


def eight(times: Array) -> tuple[Array, Array, Array]:
    """A figure of eight over 200 m by 120 m in 40 s, briskly up and down, never twice alike."""
    size = np.array([100.0, 60.0, 6.0, 5.0])
    pace = 2 * np.pi / np.array([40.0, 20.0, 10.7, 8.1])
    angle = np.multiply.outer(np.asarray(times, float), pace) + np.array([0.3, 0.9, 0.0, 0.5])

    def in_n(parts: Array) -> Array:
        return np.column_stack([parts[:, :2], parts[:, 2] + parts[:, 3]])

    position = in_n(size * np.sin(angle)) - np.array([0.0, 0.0, 100.0])
    return position, in_n(size * pace * np.cos(angle)), in_n(-size * pace**2 * np.sin(angle))


def circle() -> Path:
    return loiter_path([0.0, 0.0], 150.0, 100.0, 20.0, wind=(6.0, 2.0))


def straight(times: Array) -> tuple[Array, Array, Array]:
    t = np.asarray(times, float)
    v = np.tile([20.0, 3.0, 0.0], (len(t), 1))
    return t[:, None] * v - np.array([0, 0, 100.0]), v, np.zeros_like(v)


def aeroplane(path: Path = eight, noisy: float = 1.0) -> Flight:
    """IMU at 50 Hz, GNSS at 2 Hz, field and poses at 10 Hz of one motion, as noisy as small sensors."""
    rng = np.random.default_rng(4)
    trajectory = fixed_wing_trajectory(path, trim_pitch=0.05)
    attitude = attitude_along(trajectory)

    def noise(sd: float, n: int) -> Array:
        return noisy * sd * rng.standard_normal((n, 3))

    t = np.arange(0.0, DURATION, 0.02)
    motion = trajectory(t)
    imu = pd.DataFrame({"time_s": t})
    imu[list(FORCE)] = specific_forces(motion) + noise(0.5, len(t)) + noisy * np.array([0.2, -0.1, 0.15])
    imu[list(RATE)] = angular_rates(attitude, t) + noise(0.02, len(t)) + noisy * np.array([0.01, -0.01, 0.02])
    t = np.arange(0.0, DURATION - 0.02, 0.5)
    position, velocity, _ = path(t)
    gnss = pd.DataFrame({"time_s": t})
    gnss[NED], gnss[VELOCITY] = position + noise(1.0, len(t)), velocity + noise(0.1, len(t))
    t = np.arange(0.0, DURATION - 0.02, 0.1)
    motion = trajectory(t)
    nav = pd.DataFrame({"time_s": t})
    nav[NED], nav[QUATERNION] = motion.position, matrix_to_quaternion(motion.R_nb)
    field = pd.DataFrame({"time_s": t})
    field[[f"field_{axis}_ut" for axis in "xyz"]] = np.einsum("nji,j->ni", motion.R_nb, FIELD)
    tables = {"imu": imu, "gnss": gnss, "magnetometer": field}
    return Flight(make_manifest(WITHOUT_CAMERA), {"autopilot": nav}, tables)


# -- a track by two sources of positions

SPEED = np.array([16.0, 6.0, 0.0])


def track(
    *,
    leap: float = 0.0,
    clock: float = 0.0,
    who: str = "gnss",
    velocity: bool = True,
    turning: float = 0.0,
    seed: int = 0,
) -> Flight:
    """Two minutes at 17 m/s, straight on or swinging; ``who`` leaps along its way, a clock is off."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 120.0, 0.1)
    turn = turning * np.sin(t / 15)
    v = np.column_stack([np.cos(turn) * SPEED[0], SPEED[1] + np.sin(turn) * SPEED[0], 0 * t])
    p = np.cumsum(v, axis=0) * 0.1 + [0.0, 0.0, -80.0]
    fixes = slice(None, None, 2)
    leapt = np.where((t >= 25.0)[:, None], leap * SPEED / np.linalg.norm(SPEED), 0.0)
    own = p + (leapt if who == "nav" else 0.0) + rng.normal(0, 0.05, p.shape)
    said = p + (leapt if who == "gnss" else 0.0) + np.cumsum(rng.normal(0, 0.03, p.shape), axis=0)
    nav = pd.DataFrame(own, columns=NED).assign(time_s=t, q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0)
    nav[VELOCITY] = v + rng.normal(0, 0.1, v.shape)
    gnss = pd.DataFrame(said[fixes], columns=NED).assign(time_s=t[fixes] - clock)
    if velocity:
        gnss[VELOCITY] = (v + rng.normal(0, 0.2, v.shape))[fixes]
    return Flight(make_manifest(WITHOUT_CAMERA), {"autopilot": nav}, {"gnss": gnss})


# -- a radar among boats

#: Where five boats are at first, and how fast they go, m and m/s, north and east.
BOATS = {
    "a": (150.0, -120.0, 1.0, 3.0),
    "b": (150.0, 140.0, 1.2, -3.0),
    "c": (320.0, -90.0, 1.0, 2.0),
    "d": (330.0, 100.0, 1.0, -2.2),
    "e": (60.0, 80.0, 2.0, 0.0),
}


def boats(
    make: Callable[..., Flight], off_deg: float = 0.0, late_s: float = 0.0, kind: str = "range-bearing"
) -> Flight:
    """Five moving boats and clutter in 60 looks of a radar; bearings are too large by `off_deg`, and the
    truth has the stamps of `late_s` before."""
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 120.0, 2.0)
    # The way bends, or all could as well be mirrored about it.
    aside = 60 * np.sin(t / 25)
    truth, seen = [], []
    for name, (north, east, v_north, v_east) in BOATS.items():
        # Boats turn, so that no shift in time is a turn about the radar.
        p = north + v_north * t, east + v_east * t + 15 * np.sin(t / 9 + ord(name))
        table = pd.DataFrame({"target_id": name, "time_s": t - late_s, "north_m": p[0], "east_m": p[1]})
        truth.append(table.assign(down_m=0.0))
        to = p[0] - 2.0 * t, p[1] - aside
        seen.append((np.arctan2(to[1], to[0]) + rng.normal(0, np.radians(0.4), len(t)), np.hypot(*to)))
    seen.append((rng.uniform(-np.pi, np.pi, len(t)), 300.0 + 0 * t))
    rows: list[dict[str, Any]] = [
        {"azimuth_rad": bearing + np.radians(off_deg), "range_m": r} for bearing, r in seen
    ]
    if kind == "position":
        rows = [
            {"north_m": 2.0 * t + r * np.cos(a), "east_m": aside + r * np.sin(a), "down_m": 0.0}
            for a, r in ((one["azimuth_rad"], one["range_m"]) for one in rows)
        ]
    flight = watch(make, level_poses(t, 2.0 * t, aside), t, *rows, kind=kind)
    flight.tables["truth"] = pd.concat(truth, ignore_index=True)
    return flight
