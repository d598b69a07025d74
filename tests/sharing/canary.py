"""A flight that gives itself away in every place that a flight has: names, places, dates, numbers."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, local_earth
from wildlab.geometry.georeference import Terrain
from wildlab.navigation.aiding import earth_field

HERE = (-24.873165, 31.486297, 317.43)
EPOCH = datetime(2023, 9, 17, 0, 0, 0, tzinfo=UTC)
#: Of the first sample: it was the time of day.
START = 51_831.25
#: How long, s, and inertial samples a second.
SECONDS, RATE = 60.0, 100.0
HASH = "c0ffee" * 10 + "cafe"


def attitude(t: Array) -> Rotation:
    """From b to n: turning, and banking a little."""
    angles = np.column_stack([0.8 + 0.05 * t, np.zeros_like(t), 0.2 * np.sin(0.4 * t)])
    return Rotation.from_euler("ZYX", angles)


def place(t: Array, corner: Array) -> Array:
    """(N, 3) m in n: an eight, from a corner that may be far from the origin."""
    return corner + np.column_stack(
        [400 * np.sin(0.05 * t), 250 * np.sin(0.1 * t), -80.0 - 4.0 * np.cos(0.2 * t)]
    )


def velocity(t: Array) -> Array:
    """(N, 3) m/s."""
    return np.column_stack([20 * np.cos(0.05 * t), 25 * np.cos(0.1 * t), 0.8 * np.sin(0.2 * t)])


def acceleration(t: Array) -> Array:
    """(N, 3) m/s^2."""
    return np.column_stack([-np.sin(0.05 * t), -2.5 * np.sin(0.1 * t), 0.16 * np.cos(0.2 * t)])


def felt(t: Array, p: Array, where: tuple[float, float, float]) -> tuple[Array, Array]:
    """Specific force and angular rate (N, 3) in b, as an ideal sensor has them at a place on Earth."""
    earth = local_earth(math.radians(where[0]), where[2])
    g = earth.gravity + earth.gradient * p[:, 2]
    pull = np.column_stack([-g * earth.curvature * p[:, 0], -g * earth.curvature * p[:, 1], g])
    turning = np.array(earth.rate)
    to_body = attitude(t).inv()
    f = to_body.apply(acceleration(t) - pull + 2 * np.cross(turning, velocity(t)))
    roll, roll_rate, yaw_rate = 0.2 * np.sin(0.4 * t), 0.08 * np.cos(0.4 * t), 0.05
    w = np.column_stack([roll_rate, yaw_rate * np.sin(roll), yaw_rate * np.cos(roll)])
    return f, w + to_body.apply(turning)


def canary(
    where: tuple[float, float, float] = HERE,
    *,
    corner: tuple[float, float, float] = (812.0, -455.0, -13.0),
    locations: dict[str, Any] | None = None,
    imu: bool = True,
    epoch: datetime = EPOCH,
    field: tuple[float, float, float] = (31.2, -17.4, -58.3),
    **more: Any,
) -> Flight:
    """The flight; ``where`` is its origin, ``corner`` where it flew in n, ``field`` the magnetic one: uT,
    and degrees of declination and inclination."""
    at = np.array(corner)
    t = np.arange(0, SECONDS + 1e-9, 0.2)
    nav = pd.DataFrame({"time_s": t + START})
    nav[["north_m", "east_m", "down_m"]] = place(t, at)
    nav[["q_w", "q_x", "q_y", "q_z"]] = attitude(t).as_quat(scalar_first=True)
    nav[["v_north_m_s", "v_east_m_s", "v_down_m_s"]] = velocity(t)
    nav["lat_raw"] = where[0]
    frames = pd.DataFrame(
        {
            "frame_id": [f"KIFARU_{i:04d}.JPG" for i in range(50)],
            # The camera's clock shows the time of the zone, and is late by 1.5 s.
            "time_s": 5.0 + np.arange(50) + START + 7200.0 - 1.5,
            "group": np.where(np.arange(50) < 25, "Olifants camp", "Letaba drift"),
        }
    )
    rhinos = ["Sarah", "Thandi", "7"]
    detections = pd.DataFrame(
        {
            "detection_id": [f"rhino{i}" for i in range(50)],
            "frame_id": frames["frame_id"],
            "source": "Ranger Jonas",
            "kind": "pixel",
            "u_px": 300.0 + np.arange(50),
            "v_px": 240.0,
            "target_id": [rhinos[i % 3] for i in range(50)],
            "plane_down_m": corner[2],
        }
    )
    truth = pd.DataFrame({"target_id": rhinos, "time_s": np.nan, "north_m": at[0] + [0.0, 50.0, -80.0]})
    truth = truth.assign(east_m=at[1] + 10.0, down_m=corner[2] + 0.0)
    tables = {"frames": frames, "detections": detections, "truth": truth}
    if imu:
        s = np.arange(0, SECONDS + 1e-9, 1 / RATE)
        f, w = felt(s, place(s, at), where)
        columns = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
        tables["imu"] = pd.DataFrame({"time_s": s + START}).assign(
            **dict(zip(columns, np.column_stack([f, w]).T, strict=True))
        )
        iron = [2.0, -1.0, 4.0]
        m = field[0] * attitude(t).inv().apply(earth_field(*np.radians(field[1:]))) + iron
        tables["magnetometer"] = pd.DataFrame({"time_s": t + START}).assign(
            **dict(zip(("field_x_ut", "field_y_ut", "field_z_ut"), m.T, strict=True))
        )
    origin = dict(zip(("latitude_deg", "longitude_deg", "height_m"), where, strict=True))
    lens = {"fx_px": 765.0, "fy_px": 765.0, "cx_px": 319.5, "cy_px": 255.5}
    data = {
        "name": "kifaru-ridge",
        "kind": "logged",
        "description": "Rhinos near Kifaru ridge, by Jonas Exempel",
        "locations": locations or {},
        "origin": origin,
        "platform": {"name": "Kestrel of Olifants camp"},
        "camera": {"name": "Boson of Letaba", "width_px": 640, "height_px": 512, **lens},
        "time": {"kind": "utc", "epoch": epoch},
        "clocks": {"camera_offset_s": 1.5 - 7200.0},
        "vertical": {"reference": "EGM96 at Skukuza", "correction_m": 13.57, "note": "Skukuza base"},
        "magnetometer": {
            "declination_deg": field[1], "inclination_deg": field[2], "hard_iron_ut": (2.0, -1.0, 4.0),
        },
        "terrain": {
            "source": "letaba_srtm.tif", "sha256": HASH, "crs": "EPSG:32736", "heights": "geoid",
            "added_m": 13.57, "unit": "m", "cell_m": (30.87, 28.02), "step_m": 40.0,
            "rows": 30, "columns": 30, "holes": 0, "error_rms_m": 0.1, "error_max_m": 0.4,
        },
        "sources": [{"file": "kifaru_ridge_2023-09-17.bin", "sha256": HASH}],
        "sensors": {"Ranger Jonas": {"rate_hz": 1.0}},
    }  # fmt: skip
    ground = Terrain(np.full((30, 30), -corner[2], np.float32), at[0] - 600.0, at[1] - 600.0, 40.0)
    return Flight(make_manifest(data | more), {"Kestrel-log": nav}, tables, None, ground)
